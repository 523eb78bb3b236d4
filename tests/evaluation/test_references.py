"""Reference files: the clock that their times are on."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.evaluation.references import since_start
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
    own = np.arange(zero - 0.01, zero + 4.0, 0.003)
    expected = own - zero
    assert since_start(own, replace(log)) == pytest.approx(expected)
