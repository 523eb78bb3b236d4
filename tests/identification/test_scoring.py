"""What a score says: rms, causes of a residual, repeated trajectories."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from vftcli.identification.fitting import (
    Trace,
    held_out_remarks,
    joint_remark,
    repeated_share,
    score_remarks,
)
from vftcli.identification.training import apparent_load
from vftcli.robots import Payload, load_robot

UR5 = load_robot("ur5")


@pytest.fixture
def motion(prepared, sines):
    """Eight seconds of motion of a UR5, without torque."""
    t, q, dq, ddq = sines()
    return prepared(t, q=q, dq=dq, ddq=ddq)


def trace(motion, residual, role="held-out"):
    return Trace(motion, role, residual, np.zeros_like(residual), np.zeros(motion.q.shape[1]))


def test_rigid_torque_is_pinocchios_without_rotors(motion):
    data = UR5.model.createData()
    plain = UR5.model.copy()
    plain.armature = np.zeros(6)
    for k in (0, 500, -1):
        expected = pin.rnea(plain, data, motion.q[k], motion.dq[k], motion.ddq[k])
        np.testing.assert_allclose(motion.rigid[k], expected, atol=1e-9)


def test_prediction_adds_rotors_and_filtered_friction(motion):
    rotors = UR5.chain.rotor_inertia * motion.ddq
    bare = motion.with_robot(UR5.without_friction()).predicted
    np.testing.assert_allclose(bare, motion.rigid + rotors, atol=1e-12)
    friction = motion.predicted - bare
    joint, dq = UR5.friction[0], motion.dq[:, 0]
    first = joint.torques[0]
    law = first * np.tanh(dq / joint.parameters["smoothing"])
    law += np.sign(dq) * (np.interp(np.abs(dq), joint.speeds, joint.torques) - first)
    expected = motion.filtered(law[:, None])[:, 0]
    np.testing.assert_allclose(friction[:, 0], expected, atol=1e-9)


@pytest.mark.parametrize("mass", [1.5, -0.8])
def test_a_load_on_the_flange_is_named(motion, mass):
    load = Payload(mass=abs(mass), com=np.array([0.0, 0.0, 0.05]), inertia=np.zeros((3, 3)))
    effect = motion.with_robot(UR5.with_payload(load)).rigid - motion.rigid
    residual = np.sign(mass) * effect
    found, share = apparent_load(motion, residual)
    # m, m·c alone are fitted; the point mass's own tensor about the last frame is 2e-3 of it
    assert found == pytest.approx(mass, rel=0.02)
    assert share > 0.99
    (remark,) = held_out_remarks(trace(motion, residual), np.full(6, 0.01))
    assert remark.code == "apparent-load"
    assert dict(remark.values) == {"mass_kg": found, "share_percent": 100.0 * share}


def test_no_remark_where_the_score_is_that_of_the_training(motion):
    residual = np.ones_like(motion.q)
    assert not list(held_out_remarks(trace(motion, residual), np.full(6, 0.67)))
    assert list(held_out_remarks(trace(motion, residual), np.full(6, 0.66)))  # > 1.5 ×


@pytest.mark.parametrize(("sign", "code"), [(1.0, "more-friction"), (-1.0, "less-friction")])
def test_friction_is_named_as_a_cause(motion, sign, code):
    dq = motion.dq[:, 2]
    rubbing = motion.filtered(np.column_stack([np.tanh(dq / 0.01), dq])) @ [1.5, 0.5]
    residual = np.zeros_like(motion.q)
    residual[:, 2] = sign * rubbing
    remark = joint_remark(trace(motion, residual), 2, 0.1)
    assert (remark.code, remark.where.joints) == (code, (3,))
    speed = np.sqrt(np.mean(dq[np.abs(dq) > 0.02] ** 2))
    assert remark.values["speed_rad_s"] == pytest.approx(speed)
    assert remark.values["friction_Nm"] == pytest.approx(1.5 + 0.5 * speed, rel=1e-6)
    assert remark.values["share_percent"] == pytest.approx(100.0)
    assert remark.values["ratio"] == pytest.approx(remark.values["rms_Nm"] / 0.1)


def test_the_share_of_a_cause_is_that_of_the_mean_square(motion):
    """Friction of 2 N·m beside noise of 1 N·m: four fifths, less what is smoothed at reversals."""
    residual = np.random.default_rng(3).standard_normal(motion.q.shape)
    residual[:, 2] += 2.0 * np.sign(motion.dq[:, 2])
    remark = joint_remark(trace(motion, residual), 2, 0.1)
    assert remark.values["share_percent"] == pytest.approx(80.0, abs=4.0)


def test_joints_that_rest_say_nothing(motion, prepared):
    dq = motion.dq.copy()
    dq[:, 4] = 0.0
    noise = np.random.default_rng(1).standard_normal(dq.shape)
    still = prepared(motion.t, q=motion.q, dq=dq, ddq=motion.ddq)
    remarks = list(held_out_remarks(trace(still, noise), np.full(6, 0.1)))
    assert [r.where.joints for r in remarks if r.code == "resting-joints"] == [(5,)]
    assert sum(r.code == "larger-residual" for r in remarks) == 5


def test_the_share_of_a_repeated_path(prepared, sines):
    t, q, dq, _ = sines(seconds=8.0)
    whole = prepared(t, q=q, dq=dq)
    half = prepared(t[:500], q=q[:500], dq=dq[:500])
    assert repeated_share(whole, half) == 1.0
    # the sines of 1/6, 1/3 and 1/2 Hz repeat after 6 s only
    assert repeated_share(half, whole) == pytest.approx((500 + 250) / 1000, abs=0.01)
    # the same places at half the speed are another trajectory, but where it stands nearly still
    assert repeated_share(whole, prepared(t, q=q, dq=0.5 * dq)) < 0.1
    assert repeated_share(whole, prepared(t, q=q + 0.009, dq=dq)) > 0.9
    assert repeated_share(whole, prepared(t, q=q + 0.2, dq=dq)) < 0.1
    assert repeated_share(replace(half, t=t[:0]), whole) == 0.0


@pytest.mark.parametrize(("before", "worse"), [(1.9, True), (2.0, False), (3.0, False)])
def test_a_model_that_leaves_more_than_the_profile_is_reported(motion, before, worse):
    left = trace(motion, np.full(motion.q.shape, 2.0), "train")
    remarks = list(score_remarks([left._replace(before=np.full(6, before))]))
    reported = [r.values["profile_Nm"] for r in remarks if r.code == "worse-than-profile"]
    assert reported == pytest.approx([before] if worse else [])


def test_a_repeated_log_is_no_test_and_the_training_level_is_said(motion):
    train = trace(motion, np.full(motion.q.shape, 2.0), "train")
    remarks = list(score_remarks([train, trace(motion, np.full(motion.q.shape, 2.0))]))
    assert [r.code for r in remarks] == ["repeated-trajectory", "training-residual"]
    assert remarks[0].values["share_percent"] == 100.0
    assert remarks[1].values["mean_Nm"] == 2.0
    assert not list(score_remarks([]))
