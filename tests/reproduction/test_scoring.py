"""What is scored of one log: the clock of a file, the worst span, a carried weight."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.evaluation.references import since_start
from vftcli.reproduction.scoring import weighed, worst_of
from vftcli.signals.external_torque import ExternalTorque
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


def test_the_worst_span_is_where_the_error_is() -> None:
    t = np.arange(0.0, 40.0, 0.01)
    tau = np.zeros((len(t), 3))
    tau[(t > 21.0) & (t < 23.0), 1] = 4.0
    tau[t > 35.0, 0] = 90.0  # not scored
    torque = ExternalTorque(name="best", t=t, tau=tau)
    found = worst_of(torque, np.zeros_like(tau), t < 30.0)
    assert found["worst_joint"] == 2
    assert found["worst_t"][0] <= 21.0
    assert found["worst_t"][-1] > 22.98
    assert found["worst_t"][-1] - found["worst_t"][0] == pytest.approx(10.0, abs=0.02)
    assert max(found["worst_estimate"]) == 4.0


def test_a_weight_is_of_what_is_answered() -> None:
    up = np.array([20.0, 30.0, np.nan, 40.0])
    found = weighed(up, 27.0, np.array([1.0, 1.0, 1.0, 2.0]))
    assert found["mean_N"] == pytest.approx((20 + 30 + 80) / 4)
    assert found["rms_error_N"] == pytest.approx(np.sqrt((49 + 9 + 2 * 169) / 4))
    assert found["answered"] == pytest.approx(4 / 5)
