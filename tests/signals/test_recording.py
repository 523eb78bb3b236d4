"""A recording's effort taken for what it is."""

import numpy as np
import pytest

from vftcli.signals.errors import MissingSignalError, ParameterError
from vftcli.signals.recording import Recording, Source, refuse_repeated_logs, same_run

T = np.arange(4.0)
Q = np.zeros((4, 6))
EFFORT = np.linspace(-1.0, 2.0, 24).reshape(4, 6)


def test_the_only_effort_is_taken_for_what_is_said() -> None:
    log = Recording(t=T, q=Q, current=EFFORT).with_effort("torque_without_gravity", factor=-1.0)
    assert log.current is None
    assert log.torque_without_gravity is not None
    assert np.array_equal(log.torque_without_gravity, -EFFORT)
    (remark,) = log.source.remarks
    assert (remark.code, remark.level) == ("effort-used", "fact")
    assert remark.values["factor"] == -1.0
    assert "motor currents of the log are read as joint torques without gravity's" in str(remark)


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


def recording(sha256="", label="", t0=0.0):
    source = Source(sha256=sha256, label=label, t0=t0)
    return Recording(t=np.arange(3.0), q=np.zeros((3, 6)), source=source)


def test_recordings_are_one_run_by_digest_and_time_whatever_the_label():
    """Those made in memory only if they are the same object."""
    one = recording()
    assert same_run(recording("f00", "a.csv"), recording("f00", "b.csv"))
    assert not same_run(recording("f00", "a.csv"), recording("f01", "a.csv"))
    assert same_run(one, one)
    assert not same_run(one, recording())
    assert not same_run(recording("f00", t0=0.0), recording("f00", t0=90.0))


def test_a_log_given_twice_is_refused_by_both_names():
    logs = [recording("f00", "a.csv"), recording("f01", "b.csv"), recording("f00", "c.csv")]
    with pytest.raises(ParameterError, match=r"a\.csv and c\.csv, each given as LOG"):
        refuse_repeated_logs(logs)
    refuse_repeated_logs(logs[:2])
    with pytest.raises(
        ParameterError, match=r"given as --free, are one run .* adds nothing; do that"
    ):
        refuse_repeated_logs(logs[::2], "--free", "do that")
