"""Slow external loads: their columns against Pinocchio, their knots against a dense sum."""

import numpy as np
import pinocchio as pin
import pytest
from known_errors import motion, shortened, ur10e

from vftcli.bias.robust_fit import slow_loads
from vftcli.robots import load_robot


@pytest.mark.parametrize(("name", "joints"), [("ur5", (2, 3)), ("panda", (3, 4))])
def test_a_force_along_the_arm_is_felt_by_the_joints_before_it(name, joints):
    """J of flange, elbow and wrist on the links before, by Pinocchio: frames there, in world axes.

    The torque's sign is turned, of one standard deviation.

    Joints from 0; of seven the axis of 5 passes where 6 is.
    """
    robot = load_robot(name)
    q = np.random.default_rng(1).uniform(-2.0, 2.0, (5, robot.joints))
    loads, model = slow_loads(robot.chain, np.arange(5.0), q), robot.model.copy()
    frames = [model.getFrameId("flange")]
    for joint in joints:
        point = pin.SE3(np.eye(3), robot.chain.translation[joint])
        frames += [
            model.addFrame(pin.Frame(f"point {joint}", joint, point, pin.FrameType.OP_FRAME))
        ]
    data, sd = model.createData(), np.repeat([50.0, 10.0, 50.0, 50.0], 3)
    for row, found in zip(q, loads.torque, strict=True):
        J = [
            pin.computeFrameJacobian(model, data, row, frame, pin.LOCAL_WORLD_ALIGNED)
            for frame in frames
        ]
        felt = np.vstack([J[0], J[1][:3], J[2][:3]]).T
        np.testing.assert_allclose(found, -sd * felt, atol=1e-12 * 50.0)


@pytest.mark.parametrize("joints", [3, 4, 5])
def test_on_a_short_arm_elbow_and_wrist_are_one_point(joints):
    """A wrench of six components at the flange and one force of three along the arm."""
    loads = slow_loads(shortened(ur10e(), joints).chain, np.arange(4.0), np.zeros((4, joints)))
    assert loads.torque.shape[2] == 6 + 3


@pytest.mark.parametrize(("seconds", "knots"), [(14.0, 1), (16.0, 3), (55.0, 7), (3600.0, 61)])
def test_knots_lie_ten_seconds_apart(seconds, knots):
    t = np.linspace(0.0, seconds, 40)
    loads = slow_loads(load_robot("ur5").chain, t, np.zeros((40, 6)))
    assert loads.knots == knots
    assert loads.sizes == (0, 6 * knots, 12 * knots)
    np.testing.assert_allclose(loads.knot + loads.share, t / seconds * (knots - 1), atol=1e-9)
    assert loads.knot.max() <= max(knots - 2, 0)


def test_a_load_runs_straight_from_knot_to_knot():
    """Against the sum over all knots of hat functions, component by component."""
    robot = load_robot("ur5")
    t = np.linspace(0.0, 25.0, 60)
    q = motion(t, 6)[0]
    loads = slow_loads(robot.chain, t, q)
    values = np.random.default_rng(3).normal(size=loads.sizes[-1])
    at = np.linspace(0.0, 25.0, loads.knots)
    expected = np.zeros((60, 6))
    for k in range(loads.knots):
        hat = np.interp(t, at, np.eye(loads.knots)[k])
        for c in range(loads.torque.shape[2]):
            value = values[loads.numbers[k, c]]
            expected += value * hat[:, None] * loads.torque[:, :, c]
    np.testing.assert_allclose(loads.torque_of(values), expected, atol=1e-10)
    flange = loads.torque_of(values[: loads.sizes[1]])
    np.testing.assert_allclose(
        flange, loads.torque_of(np.append(values[: loads.sizes[1]], np.zeros(6 * loads.knots)))
    )
