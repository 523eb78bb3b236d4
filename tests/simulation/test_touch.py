"""Contacts on the arm: their joint torque by virtual work, and the truth they leave."""

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import load_robot
from vftcli.signals.errors import ParameterError
from vftcli.simulation.contacts import Touching
from vftcli.simulation.scenario import HandSpec, ProfileSpec

ROBOT = load_robot("ur5")
FORCE, MOMENT, POINT = (3.0, -4.0, 12.0), (0.5, 0.2, -0.3), (0.02, 0.05, 0.1)
Q = np.linspace(-1.0, 0.8, 6)


def torque_of(link: int, axes: str = "base") -> tuple[np.ndarray, Touching]:
    """Joint torque of one steady push in the middle of its span."""
    spec = ProfileSpec(
        name="p",
        spans=((0.0, 10.0),),
        force=FORCE,
        torque=MOMENT,
        link=link,
        point=POINT,
        axes=axes,
    )
    touching = Touching((spec,), ROBOT.chain, 10.0, np.random.SeedSequence(1))
    data = ROBOT.model.createData()
    pin.computeJointJacobians(ROBOT.model, data, Q)
    return touching.torque(5.0, ROBOT.model, data, np.zeros(6)), touching


def point_of(q: np.ndarray, link: int) -> tuple[np.ndarray, np.ndarray]:
    """Where the point is and how its body is turned, by Pinocchio."""
    data = ROBOT.model.createData()
    pin.framesForwardKinematics(ROBOT.model, data, q)
    frame = data.oMf[ROBOT.model.getFrameId("flange")] if link == 0 else data.oMi[link]
    return frame.act(np.array(POINT)), frame.rotation


@pytest.mark.parametrize("link", [0, 3, 5])
def test_joint_torque_is_virtual_work(link):
    tau, touching = torque_of(link)
    h = 1e-6
    for j in range(6):
        ends = [point_of(Q + sign * h * np.eye(6)[j], link) for sign in (1, -1)]
        speed = (ends[0][0] - ends[1][0]) / (2 * h)
        spin = pin.log3(ends[0][1] @ ends[1][1].T) / (2 * h)
        # differences of order h²: 1e-9 of forces of 13 N
        assert tau[j] == pytest.approx(np.dot(FORCE, speed) + np.dot(MOMENT, spin), abs=1e-7)
    np.testing.assert_allclose(touching.wrenches, [[*FORCE, *MOMENT]])


@pytest.mark.parametrize("link", [0, 4])
def test_a_hand_brakes_how_its_point_moves_and_its_link_turns(link):
    """Dampers alone, against the motion of the point by differences."""
    hand = HandSpec(
        name="h",
        spans=((0.0, 10.0),),
        stiffness=0.0,
        damping=2.0,
        twist_damping=3.0,
        link=link,
        point=POINT,
    )
    touching = Touching((hand,), ROBOT.chain, 10.0, np.random.SeedSequence(1))
    data, v, h = ROBOT.model.createData(), np.linspace(0.5, -0.4, 6), 1e-6
    pin.computeJointJacobians(ROBOT.model, data, Q)
    touching.torque(5.0, ROBOT.model, data, v)
    (ahead, turned), (behind, before) = (point_of(Q + sign * h * v, link) for sign in (1, -1))
    spin = pin.log3(turned @ before.T) / (2 * h)
    # differences of order h²: 1e-9 of a metre a second
    expected = [*(-2.0 * (ahead - behind) / (2 * h)), *(-3.0 * spin)]
    np.testing.assert_allclose(touching.wrenches[0], expected, atol=1e-7)
    assert np.linalg.norm(expected[:3]) > 0.1


def test_link_axes_turn_with_the_link():
    _, touching = torque_of(0, "link")
    rotation = point_of(Q, 0)[1]
    np.testing.assert_allclose(touching.wrenches[0, :3], rotation @ FORCE, atol=1e-12)
    np.testing.assert_allclose(touching.wrenches[0, 3:], rotation @ MOMENT, atol=1e-12)


def test_nothing_pushes_outside_its_span():
    spec = ProfileSpec(name="p", spans=((1.0, 2.0),), force=FORCE)
    touching = Touching((spec,), ROBOT.chain, 10.0, np.random.SeedSequence(1))
    assert not touching.anything(0.5)
    assert touching.anything(1.5)
    assert not touching.anything(2.5)


@pytest.mark.parametrize("link", [-1, 7])
def test_links_that_are_not_there_are_refused(link):
    spec = ProfileSpec(name="p", spans=((0.0, 1.0),), link=link)
    with pytest.raises(ParameterError, match=f"link is {link}; it is 0 .flange. to 6"):
        Touching((spec,), ROBOT.chain, 0.1, np.random.SeedSequence(1))
