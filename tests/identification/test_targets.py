"""What a controller believes, read off targets that were made here."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vftcli.identification.shapes import LOGARITHMIC_VELOCITIES
from vftcli.identification.targets import (
    UNKNOWN,
    WRITTEN,
    ControllerModel,
    ControllerTargets,
    Estimate,
    constant_at_rest,
    controller_friction,
    controller_models,
    refuse_guided,
    rotor_inertia,
    target_remarks,
    targets_method,
)
from vftcli.robots import JointFriction, load_robot
from vftcli.robots.friction import friction_torque
from vftcli.signals.errors import IdentificationError

UR5 = load_robot("ur5")
K, J, GRAVITY = 10.0, 3.0, 1.001
KNOWN = Estimate(2.0, 0.01, True)


@pytest.fixture
def targets(prepared, sines) -> ControllerTargets:
    """One joint's targets of a controller of known K, J, gravity and friction, 20 s at 100 Hz."""
    t, q, dq, ddq = sines(seconds=20.0, rate=100.0, joints=1, seed=3)
    gravity = 20.0 * np.sin(q)
    rigid = 2.0 * ddq + gravity
    moment = rigid + J * ddq + (GRAVITY - 1.0) * gravity
    friction = 4.0 * np.tanh(dq / 0.01) + 6.0 * dq - 2.0 * dq * np.abs(dq)
    log = prepared(t, q=q, dq=dq, ddq=ddq, load=np.abs(gravity))
    current = (moment + log.filtered(friction)) / K
    lead = np.gradient(moment, t, axis=0)
    return ControllerTargets((log,), dq, ddq, current, moment, lead, rigid, gravity)


def test_rotor_and_gravity_come_from_moments_beyond_the_rigid_body(targets):
    rotor = rotor_inertia(0, targets)
    assert rotor.value == pytest.approx(J, rel=1e-6)
    assert rotor.known
    assert not rotor_inertia(0, targets._replace(ddq=0.0 * targets.ddq)).known
    # a shift in time is no inertia
    late = targets._replace(moment=targets.moment + 0.002 * targets.lead)
    # the derivative's column takes it up to second order, numerical differences to 1e-3
    assert rotor_inertia(0, late).value == pytest.approx(J, rel=2e-3)


def test_friction_is_read_as_the_points_of_the_controllers_line(targets):
    dq = targets.dq
    parameters = {"smoothing": 0.01, "load_coulomb": 0.05}
    line = {"speeds": (0.01, 0.5, 1.5), "torques": (4.0, 7.0, 10.0)}
    truth = JointFriction(model="points", parameters=parameters, **line)
    law = friction_torque((truth,), dq, targets.gravity)
    bent = targets._replace(current=(targets.moment + targets.logs[0].filtered(law)) / K)
    shape, values, sd = controller_friction(0, bent, K)
    assert (shape.model, shape.speeds) == ("points", truth.speeds)
    np.testing.assert_allclose(values, [4.0, 7.0, 10.0, 0.05], rtol=1e-6)
    assert np.all(sd < 1e-3)
    # too slow for a second point, a logarithm stands for the line; slower still, nothing does
    slow = bent._replace(dq=slowed(targets, 0.12))
    assert controller_friction(0, slow, K)[0].logarithmic_velocity in LOGARITHMIC_VELOCITIES
    assert controller_friction(0, bent._replace(dq=slowed(targets, 0.04)), K) is None


def guided_log(targets, share=1.0, asked=None):
    """The log of a controller that feeds a share of a UR5's first joint's friction forward."""
    arm = SimpleNamespace(friction=UR5.friction[:1], torque_constant=np.array([K]))
    law = friction_torque(arm.friction, targets.dq)
    log = targets._replace(current=(targets.moment + share * law) / K)
    recording = log.logs[0].recording
    return replace(recording, target_dq=asked), log, arm


@pytest.mark.parametrize("share", [0.7, 1.0, 1.3])
def test_a_program_feeds_its_friction_forward(targets, share):
    refuse_guided(*guided_log(targets, share))
    # target velocities say more than a share of friction
    dq = targets.dq
    refuse_guided(*guided_log(targets, 0.1, asked=dq))


def test_a_hand_that_leads_the_arm_is_refused(targets):
    with pytest.raises(IdentificationError, match="a hand led the arm"):
        refuse_guided(*guided_log(targets, 0.3))
    # a program asked for this share of the motion
    count = len(targets.dq)
    below, above = (np.arange(count) < share * count for share in (0.49, 0.51))
    refuse_guided(*guided_log(targets, 1.0, asked=targets.dq * above[:, None]))
    with pytest.raises(IdentificationError, match="a hand led"):
        refuse_guided(*guided_log(targets, 1.0, asked=targets.dq * below[:, None]))


def slowed(targets, fastest):
    """The motion at other velocities, `fastest` at most."""
    return targets.dq * fastest / np.max(np.abs(targets.dq))


def resting(prepared, moments, step=1e-3, wobble=0.0):
    """Rests of a second each at these moments, 0.2 s of motion between; current in steps."""
    t = np.arange(0, 1.2 * len(moments), 0.01)
    dq = np.where(t % 1.2 < 1.0, 0.0, 0.5)[:, None]
    moment = np.array(moments)[(t / 1.2).astype(int)]
    swing = np.where(dq[:, 0] > 0, 0.02 * np.sin(40 * t), 0.0)  # shows the current's digits
    current = np.round((moment / K + wobble * np.sin(5 * t) + swing) / step) * step
    log = prepared(t, dq=dq, target_current=current[:, None], target_torque=moment[:, None])
    nothing = 0 * dq
    return ControllerTargets((log,), dq, *[nothing] * 6)


def test_at_rest_the_constant_is_moment_over_current(prepared):
    found = constant_at_rest(0, resting(prepared, [20.0, -30.0, 10.0]))
    # 1, 2 and 3 A are whole milliamperes: what is left is how each is rounded
    assert found.value == pytest.approx(K, rel=1e-9)
    size = np.sqrt(2.0**2 + 3.0**2 + 1.0**2)
    assert found.sd == pytest.approx(K * 1e-3 / np.sqrt(12) / size, rel=1e-6)
    assert found.known


def test_rests_whose_current_wanders_or_is_small_tell_nothing(prepared):
    assert not constant_at_rest(0, resting(prepared, [20.0], wobble=0.1)).known
    # below 20 steps of 1 mA
    assert not constant_at_rest(0, resting(prepared, [0.19])).known
    assert constant_at_rest(0, resting(prepared, [0.25])).value == pytest.approx(K, rel=0.03)


def test_a_robot_without_constants_has_no_targets():
    with pytest.raises(IdentificationError, match="no torque constants"):
        list(controller_models([], load_robot("panda")))


def model(constant=KNOWN, rotor=KNOWN, friction=True):
    """What a controller believes of a joint."""
    found = (WRITTEN[0], np.array([1.0, 2.0]), np.full(2, 0.1)) if friction else None
    return ControllerModel(constant, rotor, found)


@pytest.mark.parametrize(
    ("believed", "said"),
    [
        (model(), {}),
        (
            model(constant=Estimate(9.0, 0.5, False)),
            {"undetermined-drive-constant": [UR5.torque_constant[2], 9.0, 0.5]},
        ),
        (model(constant=UNKNOWN), {"unexcited-drive-constant": [UR5.torque_constant[2]]}),
        (model(rotor=UNKNOWN), {"unaccelerated-joint": [UR5.chain.rotor_inertia[2]]}),
        (model(friction=False), {"unexcited-friction": []}),
    ],
)
def test_what_the_targets_leave_open_is_reported(believed, said):
    remarks = list(target_remarks(2, believed, UR5))
    assert {r.code: list(r.values.values()) for r in remarks} == said
    assert all(r.where.joints == (3,) for r in remarks)
    for remark in remarks:
        assert str(remark)  # every code has its words, every template its values


def test_numbers_stand_beside_the_profiles(data, monkeypatch):
    believed = [model(), model(), model(friction=False), *[model()] * 3]
    door = "vftcli.identification.targets.controller_models"
    monkeypatch.setattr(door, lambda *_: believed)
    found, arm = targets_method(data), data.robot
    own = ["torque_constant", "rotor_inertia"]
    numbers = [n for n in found.numbers if n.joint == 2]
    assert [n.parameter for n in numbers] == [*own, "coulomb", "logarithmic"]
    before = [arm.torque_constant[1], arm.chain.rotor_inertia[1], 4.0]
    assert [n.profile for n in numbers[:3]] == before
    assert [n.parameter for n in found.numbers if n.joint == 3] == own
    np.testing.assert_array_equal(found.robot.torque_constant, KNOWN.value)
    np.testing.assert_array_equal(found.robot.chain.rotor_inertia, KNOWN.value)
    assert found.robot.friction[2] == arm.friction[2]
    assert found.robot.friction[1].model == "coulomb-logarithmic"
