"""Training: joints fitted one by one, contacts left out, wrong robots doubted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vftcli.identification import friction_fit
from vftcli.identification.clean_fit import CleanFit
from vftcli.identification.friction_fit import (
    PreslidingScore,
    all_residuals,
    data_of_joint,
    fit_frictions,
)
from vftcli.identification.links import stack
from vftcli.identification.methods import (
    by_constant,
    check_friction,
    fit_remarks,
    friction_method,
    identified_friction,
    initial_columns,
    rotor_number,
    whole_arm,
    with_vector,
)
from vftcli.identification.shapes import bent
from vftcli.identification.training import moving_joints, prepare_training
from vftcli.robots import JointFriction, Payload, load_robot
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.signals.errors import IdentificationError
from vftcli.signals.rest import MOVES

RUBBING = JointFriction(
    model="coulomb-viscous-offset", parameters={"coulomb": 4.0, "viscous": 6.0, "offset": 0.5}
)
UR5 = replace(load_robot("ur5"), friction=(RUBBING,) * 6)
"""A UR5 with one friction in all joints; the logs are its own."""


@pytest.fixture
def recording(rubbing_log):
    """12 s of a UR5 that rubs."""
    return rubbing_log


@pytest.fixture
def data(rubbing_data):
    """That log as training data for its own robot."""
    return rubbing_data


T = np.arange(0, 10, 0.01)


def speeds(**seconds):
    """Velocities of three joints that run +0.5 and −0.5 rad/s for so many seconds each."""
    dq = np.zeros((len(T), 3))
    for name, (forwards, backwards) in seconds.items():
        j = int(name[1:]) - 1
        dq[forwards - 1e-9 > T, j] = 0.5
        dq[(T >= 5) & (5 + backwards - 1e-9 > T), j] = -0.5
    return dq


def test_a_joint_moves_from_one_second_on_and_reverses_from_a_tenth_of_it(prepared):
    dq = speeds(J1=(1.2, 0.2), J2=(1.2, 0.05), J3=(0.9, 0.0))
    moves, reverses = moving_joints([prepared(T, dq=dq)])
    assert moves.tolist() == [True, True, False]
    assert reverses.tolist() == [True, False, False]


def test_times_of_several_logs_add_up(prepared):
    log = prepared(T, dq=speeds(J1=(0.6, 0.0)))
    with pytest.raises(IdentificationError, match="no joint moves faster than"):
        moving_joints([log])
    assert moving_joints([log, log])[0].tolist() == [True, False, False]


def test_a_slow_joint_does_not_move(prepared):
    dq = np.column_stack([np.full(len(T), 0.9 * MOVES), np.full(len(T), 1.1 * MOVES)])
    assert moving_joints([prepared(T, dq=dq)])[0].tolist() == [False, True]


def test_the_equation_of_a_joint_is_torque_less_rigid_body(data):
    given = data_of_joint(data, 1, constant=False)
    (log,) = data.logs
    np.testing.assert_allclose(given.y, log.tau[:, 1] - log.rigid[:, 1])
    np.testing.assert_array_equal(given.fixed, log.ddq[:, 1:2])
    asked = data_of_joint(data, 1, constant=True)
    np.testing.assert_array_equal(asked.y, log.tau[:, 1])
    np.testing.assert_array_equal(asked.fixed[:, 1], log.rigid[:, 1])
    behind_gear = data._replace(robot=replace(UR5, torque_source="link_torque"))
    assert data_of_joint(behind_gear, 1, constant=False).fixed.shape[1] == 0


def test_friction_and_rotor_of_every_joint_are_found(data):
    fits = fit_frictions(data)
    for j, found in fits.items():
        values = dict(zip(found.shape.terms, found.fit.values, strict=False))
        # noise .1 through the 8 Hz filter on 570 samples; offset and Coulomb share reversals
        assert values["coulomb"] == pytest.approx(4.0, abs=0.15)
        assert values["offset"] == pytest.approx(0.5, abs=0.1)
        J = found.fit.values[len(found.shape.terms)]
        assert pytest.approx(UR5.chain.rotor_inertia[j], abs=0.05) == J
    left = all_residuals(data, fits)
    assert [x.shape for x in left] == [log.tau.shape for log in data.logs]


def test_residuals_are_cut_apart_log_by_log(recording):
    logs = [recording, recording.between(0.0, 7.0)]
    data = prepare_training(logs, UR5)
    fits = fit_frictions(data)
    first, second = all_residuals(data, fits)
    assert (len(first), len(second)) == tuple(log.samples for log in data.logs)
    whole = fits[3].fit.residual
    np.testing.assert_array_equal(np.concatenate([first[:, 3], second[:, 3]]), whole)


def test_drive_constants_need_currents(recording):
    torque = replace(recording, current=None, torque=recording.q)
    with pytest.raises(
        IdentificationError, match=r"--set identify\.constants=yes needs motor currents"
    ):
        prepare_training([torque], UR5, fit_constants=True)


def test_friction_that_pushes_everywhere_is_refused_and_a_little_is_reported(data):
    fine = JointFriction(model="coulomb-viscous", parameters={"coulomb": 1.0, "viscous": 1.0})
    assert not list(check_friction(0, fine, data))
    pushing = JointFriction(
        model="coulomb-viscous", parameters={"coulomb": -5.0, "viscous": -5.0}
    )
    speed = np.max(np.abs(data.logs[0].dq[:, 0]))
    ends = f"as {-5 - 0.5 * speed:.2g} to {-5 - 5 * speed:.2g} N·m: it would push"
    with pytest.raises(IdentificationError, match=f"of joint 1 comes out {ends}"):
        list(check_friction(0, pushing, data))
    crossing = JointFriction(
        model="coulomb-viscous", parameters={"coulomb": -2.0, "viscous": 5.0}
    )
    (remark,) = check_friction(2, crossing, data)
    speed = np.max(np.abs(data.logs[0].dq[:, 2]))
    assert remark.where.joints == (3,)
    assert remark.values["least_Nm"] == pytest.approx(-2.0 + 0.5 * speed)
    bent = {"coulomb": 1.0, "viscous": 5.0, "quadratic": -1.0}
    falling = JointFriction(model="coulomb-viscous-quadratic", parameters=bent)
    (remark,) = check_friction(2, falling, data)
    assert remark.code == "falling-friction"
    # 5 − 2 v = 0, seen in 500 steps up to the joint's limit
    limit = UR5.limits.qd_max[2]
    assert remark.values["speeds_rad_s"] == pytest.approx([2.5], abs=2 * limit / 500)
    assert remark.values["limits_rad_s"] == [limit]


def test_joints_that_are_held_are_reported(data):
    moves = np.array([True, False, True, True, True, True])
    reverses = np.array([True, False, False, True, True, True])
    held = data._replace(moves=moves, reverses=reverses, rubs=False)
    remarks = friction_method(held, CleanFit(held, fit_frictions(held), [])).remarks
    reported = [(r.code, r.where.joints) for r in remarks if r.code.endswith("-joint")]
    assert reported == [("static-joint", (2,)), ("one-way-joint", (3,))]


@pytest.mark.parametrize(
    ("value", "sd", "known"), [(1.0, 0.29, True), (1.0, 0.34, False), (-1.0, 1.1, False)]
)
def test_a_rotor_inertia_is_known_to_thirty_per_cent(value, sd, known):
    found, _ = rotor_number(3, value, sd, 2.0)
    assert (found.joint, found.unit, found.determined) == (4, "kg·m²", known)
    assert found.value == value


@pytest.mark.parametrize(
    ("value", "sd", "taken"), [(0.2, 0.6, 0.2), (0.2, 0.601, None), (-1.0, 0.9, 0.0)]
)
def test_a_rotor_inertia_three_standard_deviations_off_is_taken(value, sd, taken):
    """The profile's 2 kg·m² is wrong then, whatever the right one; none is below zero."""
    found, remarks = rotor_number(3, value, sd, 2.0)
    assert found.determined is (taken is not None)
    assert found.value == (value if taken is None else taken)
    code = "undetermined-rotor-inertia" if taken is None else "refuted-rotor-inertia"
    assert [(r.code, r.where.joints) for r in remarks] == [(code, (4,))]
    assert list(remarks[0].values.values()) == [found.value, sd, 2.0]


def test_what_was_fitted_is_remarked_on_in_its_units(data, prepared):
    warm = prepared(T, dq=speeds(J1=(3.0, 3.0)), warmth=np.array([[0.9], [1.2]]))
    score = PreslidingScore(1e-3, {0.0: 1.0, 1e-3: 0.5})
    fits = {2: SimpleNamespace(at_bound=("coulomb", "viscous"), presliding=score)}
    remarks = list(fit_remarks(data._replace(logs=(warm,)), fits))
    assert [(r.code, list(r.values.values())) for r in remarks] == [
        ("friction-at-bound", ["coulomb and viscous"]),
        ("presliding-length", [1.0, [0.0, 1.0], [1.0, 0.5]]),
        ("friction-by-temperature", [[0.9, 1.2]]),
    ]


def test_points_of_a_line_are_listed_beside_the_profile_s(data):
    arm, sd = load_robot("ur5"), np.array([0.29, 0.31, 0.1])
    old, x = data._replace(robot=arm), np.array([1.0, -1.0, 0.3])
    friction, numbers = identified_friction(old, 1, bent(2.0), x, sd, "base")
    assert friction.confidence == (
        "identified (base) from recording (sha256 unknown); standard deviations 0.29, 0.31, 0.1"
    )
    found = [(n.joint, n.value, n.sd, n.profile, n.determined) for n in numbers]
    rows = zip([2] * 3, x, sd, arm.friction[1].torques[:3], [True, False, False], strict=True)
    assert found == list(rows)


def test_a_current_that_falls_with_the_torque_is_refused(data):
    before = UR5.torque_constant[1]
    values, sd, K = by_constant(data, 1, np.array([8.0, 0.8]), np.array([0.4, 0.02]))
    np.testing.assert_allclose([*values, *sd], [10.0, 1.0, 0.5, 0.025])
    assert K[:2] == (2, "torque_constant")
    assert K[2:4] == pytest.approx((before / 0.8, before * 0.02 / 0.8**2))
    with pytest.raises(IdentificationError, match=r"of joint 1 does not .* \(slope 0\.05\)"):
        by_constant(data, 0, np.array([0.05]), np.array([0.01]))


def test_a_wrong_drive_constant_scales_friction_and_rotor(recording):
    """Currents of an arm whose K is 1.05 × the profile's: all torques are 1.05 × what is read."""
    log = replace(recording, current=recording.current / 1.05)
    data = prepare_training([log], UR5, fit_constants=True)
    found = friction_method(data)
    K = {n.joint: n for n in found.numbers if n.parameter == "torque_constant"}
    # joints that carry weight; the wrists' load is no larger than the noise
    for j in (2, 3):
        assert K[j].value == pytest.approx(1.05 * UR5.torque_constant[j - 1], rel=0.01)
        assert K[j].profile == UR5.torque_constant[j - 1]
    coulomb = {n.joint: n for n in found.numbers if n.parameter == "coulomb"}
    assert coulomb[2].value == pytest.approx(4.0, rel=0.05)
    assert found.robot.torque_constant[1] == pytest.approx(K[2].value, rel=1e-6)


def test_the_whole_arm_starts_from_the_profile_and_the_fits(data):
    fits = fit_frictions(data)
    layout, start = initial_columns(data, fits)
    np.testing.assert_array_equal(start[:60], chain_parameters(UR5.loaded_chain))
    assert start[60 + 1] == fits[1].fit.values[len(fits[1].shape.terms)]
    np.testing.assert_array_equal(start[layout.frictions[2]], fits[2].fit.values[:-1])
    held = {j: fit for j, fit in fits.items() if j}
    layout, start = initial_columns(data, held)
    assert layout.shapes[0].terms == ("coulomb", "viscous", "offset")
    np.testing.assert_array_equal(start[layout.frictions[0]], [4.0, 6.0, 0.5])
    np.testing.assert_allclose(start[60], UR5.chain.rotor_inertia[0])


def test_a_vector_becomes_a_robot_without_its_payload(data):
    load = Payload(mass=1.0, com=np.zeros(3), inertia=np.zeros((3, 3)))
    layout, start = initial_columns(data, fit_frictions(data))
    x = start.copy()
    x[10], x[60:66] = 9.5, 2.5
    robot = with_vector(UR5.with_payload(load), layout, x, UR5.friction)
    assert robot.payload is None
    assert robot.chain.mass[1] == 9.5
    np.testing.assert_array_equal(robot.chain.rotor_inertia, 2.5)
    log = data.logs[0]
    Y = torque_regressor(UR5.chain, log.q, log.dq, log.ddq)
    np.testing.assert_allclose(log.with_robot(robot).rigid, Y @ x[:60], atol=1e-9)


@pytest.mark.slow
def test_the_whole_arm_says_how_it_was_made(data):
    base = whole_arm(data)
    assert "nearest-physical-model" in {r.code for r in base.remarks}
    (opened,) = [r for r in base.remarks if r.code == "undetermined-base-parameters"]
    assert opened.values["count"] == 40
    assert opened.values["undetermined"] == 40 - base.base["determined"][:40].sum()
    # one robot made this log: the model predicts its torque to the noise
    motion = data.logs[0]
    Y = torque_regressor(UR5.chain, motion.q, motion.dq, motion.ddq)
    change = Y @ (chain_parameters(base.robot.chain) - chain_parameters(UR5.chain))
    assert np.sqrt(np.mean(change[:, 1:3] ** 2)) < 0.2


def test_too_short_logs_are_refused(data):
    layout, start = initial_columns(data, fit_frictions(data))
    few = np.zeros_like(data.logs[0].weights)
    few.ravel()[: 4 * layout.size - 1] = 1.0
    with pytest.raises(IdentificationError, match="record a longer log"):
        stack(layout, [replace(data.logs[0], weights=few)], start)
    few.ravel()[: 4 * layout.size] = 1.0
    assert stack(layout, [replace(data.logs[0], weights=few)], start).layout is layout


def test_a_joint_that_the_profile_predicts_better_keeps_its_numbers(data, monkeypatch):
    """The log's own arm is its profile: what is fitted predicts as well as the truth, not worse."""
    fits = fit_frictions(data)
    assert all(fit.errors[1] == pytest.approx(fit.errors[0], rel=0.1) for fit in fits.values())
    assert not any(fit.is_kept for fit in fits.values())
    assert fits[0]._replace(errors=(1.0, 0.84)).is_kept
    assert not fits[0]._replace(errors=(1.0, np.nan)).is_kept
    monkeypatch.setattr(friction_fit, "KEPT", 2.0)
    found = friction_method(data)
    reported = [r.where.joints for r in found.remarks if r.code == "profile-kept"]
    assert reported == [(j,) for j in range(1, 7)]
    assert found.robot.friction == UR5.friction
    np.testing.assert_array_equal(found.robot.chain.rotor_inertia, UR5.chain.rotor_inertia)
