"""What a robot compares: its own estimate where the log has one, else a momentum observer's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.contacts.threshold_check import compared_signals
from vftcli.observers.paper import MomentumObserver
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.errors import RobotError
from vftcli.signals.wrench import WrenchFrame
from vftcli.wrench.solvers import VirtualSensor

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
