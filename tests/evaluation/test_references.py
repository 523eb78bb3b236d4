"""Reference files: the clock that their times are on."""

from pathlib import Path

import numpy as np
import pytest

from vftcli.evaluation.references import on_the_logs_clock, since_start
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.recording import Recording, Source


@pytest.mark.parametrize("zero", [0.0, 0.02, 798.467])
@pytest.mark.parametrize("every", [1, 3])
def test_a_file_may_count_from_the_first_sample_or_be_on_the_logs_clock(
    zero: float, every: int
) -> None:
    t = np.arange(0.0, 5.0, 0.0137)
    source = Source(format="x", clock="x", rows=len(t), duplicates=0, t0=zero)
    log = Recording(t=t, q=np.zeros((len(t), 6)), source=source)
    for stamps in (t[::every], t[::every] + zero):
        assert since_start(stamps, log) == pytest.approx(t[::every])
    # A sensor's clock of its own has none of the log's stamps: where it overlaps, it is the log's.
    for first, last in ((-0.01005, 4.0), (1.00005, 9.0)):  # it may go on after the log's end
        own = np.arange(zero + first, zero + last, 0.003)
        assert since_start(own, log) == pytest.approx(own - zero)


def test_a_file_of_another_time_is_refused_with_both_spans() -> None:
    t = np.arange(0.0, 5.0, 0.5)
    log = Recording(t=t, q=np.zeros((len(t), 6)))
    message = r"a\.csv: its clock \(50 to 54\.5 s\) does not overlap the log's \(0 to 4\.5 s\)"
    with pytest.raises(ReferenceTorqueError, match=message):
        on_the_logs_clock(t + 50.0, np.zeros((len(t), 6)), log, Path("a.csv"))
    # Half a sample beyond either end is the same clock, rounded; more is no answer.
    there = on_the_logs_clock(t[:-2] + 0.2, t[:-2, None], log, Path("a.csv"))[:, 0]
    assert np.isfinite(there).tolist() == [True] * 8 + [False] * 2
