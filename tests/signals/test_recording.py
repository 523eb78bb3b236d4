"""A recording's effort taken for what it is."""

import numpy as np
import pytest

from vftcli.signals.errors import MissingSignalError
from vftcli.signals.recording import Recording

T = np.arange(4.0)
Q = np.zeros((4, 6))
EFFORT = np.linspace(-1.0, 2.0, 24).reshape(4, 6)


def test_the_only_effort_is_taken_for_what_is_said() -> None:
    log = Recording(t=T, q=Q, current=EFFORT).with_effort("torque_without_gravity", factor=-1.0)
    assert log.current is None
    assert log.torque_without_gravity is not None
    assert np.array_equal(log.torque_without_gravity, -EFFORT)
    (remark,) = log.source.remarks
    assert (remark.code, remark.level) == ("effort-taken", "fact")
    assert str(remark) == (
        "the motor currents of the log are read as joint torques without gravity's, times -1"
    )


def test_of_several_the_one_that_is_called_so_stays_alone() -> None:
    both = Recording(t=T, q=Q, current=EFFORT, torque=2 * EFFORT)
    log = both.with_effort("torque")
    assert log.current is None
    assert np.array_equal(log.require("torque"), 2 * EFFORT)
    other = both.with_effort("torque", source="current")
    assert np.array_equal(other.require("torque"), EFFORT)
    with pytest.raises(MissingSignalError, match="the log has current and torque, so none"):
        both.with_effort("torque_without_gravity")
    with pytest.raises(MissingSignalError, match="no effort"):
        Recording(t=T, q=Q).with_effort("torque")
