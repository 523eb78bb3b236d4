"""What thresholds would have detected, on steps whose times and sizes are known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_thresholds import compared

from vftcli.contacts.threshold_check import check_contacts, compared_signals
from vftcli.contacts.thresholds import ComparedSignals, SignalThreshold, Thresholds
from vftcli.observers.paper import MomentumObserver
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.wrench import Wrench, WrenchFrame
from vftcli.wrench.solvers import VirtualSensor

T = np.arange(0.0, 20.0, 0.01)
PUSHES = ((5.0, 6.0, 40.0), (9.0, 10.0, 10.0), (14.0, 15.0, 25.0))
"""From and to [s], force along z [N]; J2 takes it with a lever of .5 m."""
LAG = 0.1  # Of the estimate behind the truth. [s]


def limits(torque: float, force: float) -> Thresholds:
    joint, axis = (SignalThreshold(x, (x, x), 1.0, "free", None) for x in (torque, force))
    signals = {"joints": (joint,) * 6, "axes": (axis,) * 6, "force": (axis,)}
    return Thresholds(rate=1.0, **signals, of_vendor=True, logged_wrench=True)


def steps(delay: float) -> Array:
    """The force along z. (T,) [N]"""
    inside = [(f, (t0 + delay <= T) & (t1 + delay >= T)) for t0, t1, f in PUSHES]
    return np.sum([force * there for force, there in inside], axis=0)


def estimated(extra: Array | float = 0.0) -> ComparedSignals:
    torque, wrench = np.zeros((len(T), 6)), np.zeros((len(T), 6))
    torque[:, 1] = 0.5 * steps(LAG)
    torque[:, 0] += extra
    wrench[:, 2] = steps(LAG)
    return compared("pushes", T, torque, wrench)


def truth() -> tuple[ExternalTorque, Wrench]:
    torque, wrench = np.zeros((len(T), 6)), np.zeros((len(T), 6))
    torque[:, 1], wrench[:, 2] = 0.5 * steps(0.0), steps(0.0)
    true = Wrench(name="truth", t=T, values=wrench, frame="base")
    return ExternalTorque(name="file:truth", t=T, tau=torque), true


def test_every_contact_is_detected_or_missed_with_its_delay_and_force():
    """J2 at 10 N·m tells 20 and 12.5 N·m and not 5; each begins a lag of .1 s after the truth."""
    check = check_contacts(estimated(), limits(10.0, 1e3), *truth())
    assert [c.by for c in check.contacts] == ["J2", "", "J2"]
    # Half a sample for the rounding of edges.
    assert [c.delay for c in check.detected] == pytest.approx([LAG, LAG], abs=0.006)
    *delays, weakest, missed = check.figures.values()
    assert (weakest, missed) == (25.0, 10.0)
    assert delays == pytest.approx([LAG, LAG], abs=0.006)
    assert check.false_alarms == 0
    # 18 s after the settling, 3 of them touched, each a sample longer or shorter.
    assert 3600.0 * check.untouched_h == pytest.approx(15.0, abs=0.07)
    assert check.reference == "file:truth"


@pytest.mark.parametrize(
    ("extra", "torque", "force", "by", "false"),
    [
        (0.0, 1e3, 20.0, ["fz", "", "fz"], 0),  # an axis tells what no joint does
        (np.where(np.abs(T - 12.0) < 0.05, 99.0, 0.0), 10.0, 1e3, ["J2", "", "J2"], 1),
        (0.0, 1e3, 1e3, ["", "", ""], 0),
    ],
)
def test_who_tells_a_contact_and_what_is_false(extra, torque, force, by, false):
    check = check_contacts(estimated(extra), limits(torque, force), *truth())
    assert [c.by for c in check.contacts] == by
    assert check.false_alarms == false
    if not any(by):
        assert check.detected == ()
        *delays, _, missed = check.figures.values()
        assert np.isnan(delays).all()
        assert missed == 40.0


def test_without_a_wrench_the_force_is_not_known():
    torque, _ = truth()
    check = check_contacts(estimated(), limits(10.0, 1e3), torque, None)
    assert np.isnan(check.figures["smallest_detected_N"])
    assert len(check.detected) == 2


def test_without_a_truth_the_alarms_are_listed_with_what_is_estimated():
    check = check_contacts(estimated(), limits(10.0, 1e3), None, None)
    assert [round(c.start, 6) for c in check.contacts] == [5.1, 14.1]
    assert [c.peak_force for c in check.contacts] == [40.0, 25.0]
    assert (check.reference, check.false_alarms) == (None, None)
    assert np.isnan(check.figures["median_delay_s"])
    assert check.figures["smallest_detected_N"] == 25.0
    assert [remark.code for remark in check.remarks] == ["check-without-truth"]


def test_an_alarm_that_stays_on_detects_nothing_new():
    """J1 stays at 99 N·m from the first push on, as a joint at rest keeps its stiction."""
    stays = np.where(T >= 5.2, 99.0, 0.0)
    check = check_contacts(estimated(stays), limits(1e2, 1e3), *truth())
    assert check.detected == ()
    check = check_contacts(estimated(stays), limits(98.0, 1e3), *truth())
    found = [(c.by, c.already_above) for c in check.contacts]
    assert found == [("J1", False), ("", True), ("", True)]
    assert np.isnan(check.figures["largest_missed_N"])


FIXTURES = Path(__file__).parent.parent.parent / "fixtures"


@pytest.fixture(scope="module")
def panda() -> Run:
    recording = read(FIXTURES / "panda_bearing.csv")
    return Run(recording=recording, robot=load_robot("panda"))


@pytest.fixture(scope="module")
def ur5() -> Run:
    return Run(recording=read(FIXTURES / "ur5_circle.csv"), robot=load_robot("ur5"))


def test_the_robots_own_estimate_is_what_it_compares(panda):
    found = compared_signals(panda)
    np.testing.assert_array_equal(found.torque, panda.recording.tau_ext)
    assert (found.of_vendor, found.logged_wrench) == (True, False)


def test_without_one_a_momentum_observer_of_ten_stands_for_it(ur5):
    bare = replace(ur5.recording, tau_ext=None, wrench=None, wrench_frame=None)
    run = Run(recording=bare, robot=ur5.robot)
    found = compared_signals(run)
    estimate = MomentumObserver(gain=10.0).estimate(run.terms)
    np.testing.assert_array_equal(found.torque, estimate.tau)
    wrench = VirtualSensor(frame="base").wrench(estimate, bare.q, run.robot.chain)
    np.testing.assert_array_equal(found.wrench, wrench.known)
    np.testing.assert_array_equal(found.force[:, 0], np.linalg.norm(found.wrench[:, :3], axis=1))
    assert (found.of_vendor, found.logged_wrench) == (False, False)


def test_a_log_of_another_arm_is_refused(panda, ur5):
    with pytest.raises(RobotError, match="7 joints but robot 'ur5' has 6"):
        compared_signals(Run(recording=panda.recording, robot=ur5.robot))


def test_an_estimate_that_is_zero_throughout_is_none(panda):
    zeros = replace(panda.recording, tau_ext=np.zeros(panda.recording.q.shape))
    found = compared_signals(Run(recording=zeros, robot=panda.robot))
    assert not found.of_vendor
    assert np.any(found.torque)


@pytest.mark.parametrize(("axes", "own"), [("base", True), ("tool", True), ("sensor", False)])
def test_a_sensors_wrench_is_no_robots(panda, axes, own):
    values = np.random.default_rng(1).normal(size=(panda.recording.samples, 6))
    frame = WrenchFrame(axes, "flange" if axes == "base" else axes)
    recording = replace(panda.recording, wrench=values, wrench_frame=frame)
    found = compared_signals(Run(recording=recording, robot=panda.robot))
    assert found.logged_wrench is own
    assert np.array_equal(found.wrench, values) is own
