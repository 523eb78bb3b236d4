"""Training: joints fitted one by one, contacts left out, wrong robots doubted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vftcli.identification import friction_fit, methods
from vftcli.identification.clean_fit import CleanFit
from vftcli.identification.friction_fit import PreslidingScore, all_residuals, fit_frictions
from vftcli.identification.links import stack
from vftcli.identification.shapes import Shape, bent
from vftcli.identification.training import (
    moving_joints,
    prepare,
    prepare_training,
    settings_record,
    stride,
    usable_samples,
)
from vftcli.robots import JointFriction, Payload, load_robot
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.signals.errors import IdentificationError
from vftcli.signals.recording import Recording
from vftcli.signals.rest import MOVES

T = np.arange(0, 10, 0.01)


def test_a_joint_moves_for_a_second_and_reverses_for_a_tenth_of_it(prepared):
    """Joints at ±.5 rad/s for so many seconds each way, the last two slower than a motion."""
    forwards, backwards = [1.2, 1.2, 0.9, 0.6, 9.9, 9.9], [0.2, 0.05, 0.0, 0.0, 0.0, 0.0]
    dq = np.where(T[:, None] < np.array(forwards) - 1e-9, 0.5, 0.0)
    dq -= np.where((T[:, None] >= 5) & (T[:, None] < 5 + np.array(backwards) - 1e-9), 0.5, 0.0)
    dq[:, 4:] = MOVES * np.array([0.9, 1.1])
    log = prepared(T, dq=dq)
    moves, reverses = moving_joints([log])
    assert moves.tolist() == [True, True, False, False, False, True]
    assert reverses.tolist() == [True, False, False, False, False, False]
    # the times of several logs add up
    assert moving_joints([log, log])[0].tolist() == [True, True, True, True, False, True]
    with pytest.raises(IdentificationError, match="no joint moves faster than"):
        moving_joints([prepared(T, dq=dq[:, 2:5])])


def test_residuals_are_cut_apart_log_by_log(recording, arm):
    logs = [recording, recording.between(0.0, 7.0)]
    data = prepare_training(logs, arm)
    fits = fit_frictions(data)
    first, second = all_residuals(data, fits)
    assert (len(first), len(second)) == tuple(log.samples for log in data.logs)
    whole = fits[3].fit.residual
    np.testing.assert_array_equal(np.concatenate([first[:, 3], second[:, 3]]), whole)


def test_drive_constants_need_currents(recording, arm):
    torque = replace(recording, current=None, torque=recording.q)
    with pytest.raises(IdentificationError, match=r"constants=yes needs motor currents"):
        prepare_training([torque], arm, fit_constants=True)


def test_friction_that_pushes_everywhere_is_refused_and_a_little_is_reported(data):
    def friction(coulomb, viscous, quadratic=0.0):
        parameters = {"coulomb": coulomb, "viscous": viscous, "quadratic": quadratic}
        return JointFriction(model="coulomb-viscous-quadratic", parameters=parameters)

    assert not list(methods.check_friction(0, friction(1.0, 1.0), data))
    speed = np.max(np.abs(data.logs[0].dq[:, 0]))
    ends = f"as {-5 - 0.5 * speed:.2g} to {-5 - 5 * speed:.2g} N·m: it would push"
    with pytest.raises(IdentificationError, match=f"of joint 1 comes out {ends}"):
        list(methods.check_friction(0, friction(-5.0, -5.0), data))
    (remark,) = methods.check_friction(2, friction(-2.0, 5.0), data)
    speed = np.max(np.abs(data.logs[0].dq[:, 2]))
    assert remark.where.joints == (3,)
    assert remark.values["least_Nm"] == pytest.approx(-2.0 + 0.5 * speed)
    (remark,) = methods.check_friction(2, friction(1.0, 5.0, -1.0), data)
    assert remark.code == "falling-friction"
    # 5 − 2 v = 0, seen in 500 steps up to the joint's limit
    limit = data.robot.limits.qd_max[2]
    assert remark.values["speeds_rad_s"] == pytest.approx([2.5], abs=2 * limit / 500)
    assert remark.values["limits_rad_s"] == [limit]


def test_joints_that_are_held_are_reported(data):
    moves = np.array([True, False, True, True, True, True])
    reverses = np.array([True, False, False, True, True, True])
    held = data._replace(moves=moves, reverses=reverses, rubs=False)
    remarks = methods.friction_method(held, CleanFit(held, fit_frictions(held), [])).remarks
    reported = [(r.code, r.where.joints) for r in remarks if r.code.endswith("-joint")]
    assert reported == [("static-joint", (2,)), ("one-way-joint", (3,))]


@pytest.mark.parametrize(
    ("value", "sd", "taken", "code"),
    [
        (1.0, 0.29, 1.0, None),  # known to thirty per cent
        (1.0, 0.34, None, "undetermined-rotor-inertia"),
        (-1.0, 1.1, None, "undetermined-rotor-inertia"),
        # three standard deviations off the profile's: that is wrong, whatever the right one
        (0.2, 0.6, 0.2, "refuted-rotor-inertia"),
        (0.2, 0.601, None, "undetermined-rotor-inertia"),
        (-1.0, 0.9, 0.0, "refuted-rotor-inertia"),  # none is below zero
    ],
)
def test_a_rotor_inertia_is_known_or_the_profile_s_is_refuted(value, sd, taken, code):
    """The profile's is 2 kg·m²."""
    found, remarks = methods.rotor_number(3, value, sd, 2.0)
    assert (found.joint, found.unit, found.determined) == (4, "kg·m²", taken is not None)
    assert found.value == (value if taken is None else taken)
    assert [(r.code, r.where.joints) for r in remarks] == ([(code, (4,))] if code else [])
    for remark in remarks:
        assert list(remark.values.values()) == [found.value, sd, 2.0]


def test_what_was_fitted_is_remarked_on_in_its_units(data, prepared):
    warm = prepared(T, dq=np.zeros((len(T), 3)), warmth=np.array([[0.9], [1.2]]))
    score = PreslidingScore(1e-3, {0.0: 1.0, 1e-3: 0.5})
    fits = {2: SimpleNamespace(shape=Shape(("offset",)), scores={}, presliding=score)}
    remarks = list(methods.fit_remarks(data._replace(logs=(warm,)), fits))
    assert [(r.code, list(r.values.values())) for r in remarks] == [
        ("friction-at-bound", ["coulomb and viscous"]),
        ("presliding-length", [1.0, [0.0, 1.0], [1.0, 0.5]]),
        ("friction-by-temperature", [[0.9, 1.2]]),
    ]


def test_points_of_a_line_are_listed_beside_the_profile_s(data):
    arm, sd = load_robot("ur5"), np.array([0.29, 0.31, 0.1])
    old, x = data._replace(robot=arm), np.array([1.0, -1.0, 0.3])
    friction, numbers = methods.identified_friction(old, 1, bent(2.0), x, sd, "base")
    assert friction.confidence == (
        "identified (base) from recording (sha256 unknown); standard deviations 0.29, 0.31, 0.1"
    )
    found = [(n.joint, n.value, n.sd, n.profile, n.determined) for n in numbers]
    rows = zip([2] * 3, x, sd, arm.friction[1].torques[:3], [True, False, False], strict=True)
    assert found == list(rows)


def test_a_current_that_falls_with_the_torque_is_refused(data):
    before = data.robot.torque_constant[1]
    values, sd, K = methods.by_constant(data, 1, np.array([8.0, 0.8]), np.array([0.4, 0.02]))
    np.testing.assert_allclose([*values, *sd], [10.0, 1.0, 0.5, 0.025])
    assert K[:2] == (2, "torque_constant")
    assert K[2:4] == pytest.approx((before / 0.8, before * 0.02 / 0.8**2))
    with pytest.raises(IdentificationError, match=r"of joint 1 does not .* \(slope 0\.05\)"):
        methods.by_constant(data, 0, np.array([0.05]), np.array([0.01]))


def test_a_wrong_drive_constant_scales_friction_and_rotor(recording, arm):
    """Currents of an arm whose K is 1.05 × the profile's: all torques are 1.05 × what is read."""
    log = replace(recording, current=recording.current / 1.05)
    data = prepare_training([log], arm, fit_constants=True)
    found = methods.friction_method(data)
    K = {n.joint: n for n in found.numbers if n.parameter == "torque_constant"}
    # joints that carry weight; the wrists' load is no larger than the noise
    for j in (2, 3):
        assert K[j].value == pytest.approx(1.05 * arm.torque_constant[j - 1], rel=0.01)
        assert K[j].profile == arm.torque_constant[j - 1]
    coulomb = {n.joint: n for n in found.numbers if n.parameter == "coulomb"}
    assert coulomb[2].value == pytest.approx(4.0, rel=0.05)
    assert found.robot.torque_constant[1] == pytest.approx(K[2].value, rel=1e-6)


def test_the_whole_arm_starts_from_the_profile_and_the_fits(data, arm):
    fits = fit_frictions(data)
    layout, start = methods.initial_columns(data, fits)
    np.testing.assert_array_equal(start[:60], chain_parameters(arm.loaded_chain))
    assert start[60 + 1] == fits[1].fit.values[len(fits[1].shape.terms)]
    np.testing.assert_array_equal(start[layout.frictions[2]], fits[2].fit.values[:-1])
    held = {j: fit for j, fit in fits.items() if j}
    layout, start = methods.initial_columns(data, held)
    assert layout.shapes[0].terms == ("coulomb", "viscous", "offset")
    np.testing.assert_array_equal(start[layout.frictions[0]], [4.0, 6.0, 0.5])
    np.testing.assert_allclose(start[60], arm.chain.rotor_inertia[0])
    # a vector becomes a robot without its payload
    load = Payload(mass=1.0, com=np.zeros(3), inertia=np.zeros((3, 3)))
    start[10], start[60:66] = 9.5, 2.5
    robot = methods.with_vector(arm.with_payload(load), layout, start, arm.friction)
    assert robot.payload is None
    np.testing.assert_array_equal(robot.chain.rotor_inertia, 2.5)
    np.testing.assert_allclose(chain_parameters(robot.chain), start[:60], atol=1e-9)


@pytest.mark.slow
def test_the_whole_arm_says_how_it_was_made(data, arm):
    base = methods.whole_arm(data)
    assert "nearest-physical-model" in {r.code for r in base.remarks}
    (opened,) = [r for r in base.remarks if r.code == "undetermined-base-parameters"]
    assert opened.values["count"] == 40
    assert opened.values["undetermined"] == 40 - base.base["determined"][:40].sum()
    # one robot made this log: the model predicts its torque to the noise
    motion = data.logs[0]
    Y = torque_regressor(arm.chain, motion.q, motion.dq, motion.ddq)
    change = Y @ (chain_parameters(base.robot.chain) - chain_parameters(arm.chain))
    assert np.sqrt(np.mean(change[:, 1:3] ** 2)) < 0.2


def test_too_short_logs_are_refused(data):
    layout, start = methods.initial_columns(data, fit_frictions(data))
    few = np.zeros_like(data.logs[0].weights)
    few.ravel()[: 4 * layout.size - 1] = 1.0
    with pytest.raises(IdentificationError, match="record a longer log"):
        stack(layout, [replace(data.logs[0], weights=few)], start)
    few.ravel()[: 4 * layout.size] = 1.0
    assert stack(layout, [replace(data.logs[0], weights=few)], start).layout is layout


def test_a_joint_that_the_profile_predicts_better_keeps_its_numbers(data, arm, monkeypatch):
    """The log's own arm is its profile: what is fitted predicts as well as the truth, not worse."""
    fits = fit_frictions(data)
    assert all(fit.errors[1] == pytest.approx(fit.errors[0], rel=0.1) for fit in fits.values())
    assert not any(fit.is_kept for fit in fits.values())
    assert fits[0]._replace(errors=(1.0, 0.84)).is_kept
    assert not fits[0]._replace(errors=(1.0, np.nan)).is_kept
    monkeypatch.setattr(friction_fit, "KEPT", 2.0)
    found = methods.friction_method(data)
    reported = [r.where.joints for r in found.remarks if r.code == "profile-kept"]
    assert reported == [(j,) for j in range(1, 7)]
    assert found.robot.friction == arm.friction
    np.testing.assert_array_equal(found.robot.chain.rotor_inertia, arm.chain.rotor_inertia)


PANDA = load_robot("panda")


def log(rate=500.0, seconds=8.0, joints=7):
    """Half a second of rest, sines of 0.4 Hz, half a second of rest."""
    t = np.arange(0, seconds, 1 / rate)
    w = 2 * np.pi * 0.4
    run = (t > 0.5) & (t < seconds - 0.5)
    phase = np.arange(joints)
    angle = w * (np.clip(t, 0.5, seconds - 0.5) - 0.5)[:, None] + phase
    q = 0.5 * np.sin(angle) - 0.7
    dq = np.where(run[:, None], 0.5 * w * np.cos(angle), 0.0)
    return Recording(t=t, q=q, dq=dq, torque=2.0 * q), w


def test_a_log_is_cut_to_its_motion_and_decimated_to_six_samples_a_period():
    recording, _ = log()
    motion = prepare(recording, PANDA)
    # 500 Hz over 6 · 8 Hz is 10.4: every tenth sample
    assert np.all(np.diff(motion.kept) == 10)
    assert motion.t[0] == pytest.approx(0.502)
    assert motion.t[-1] == pytest.approx(7.498, abs=0.021)
    np.testing.assert_array_equal(motion.t, recording.t[motion.kept])
    assert [stride(8.0, 1 / rate) for rate in (1000.0, 48.0, 20.0)] == [20, 1, 1]
    words = settings_record(4.0, 0.002)
    # 500 Hz over 24 Hz
    assert (words["cutoff_hz"], words["decimation"], words["kept_rate_hz"]) == (4.0, 20.0, 25.0)


def test_signals_of_the_band_pass_and_velocity_becomes_acceleration():
    recording, w = log()
    motion = prepare(recording, PANDA)
    inner = (motion.t > 1.5) & (motion.t < 6.5)
    angle = w * (motion.t[inner] - 0.5)[:, None] + np.arange(7)
    # two passes of a Butterworth filter of order 4 take (0.4 / 8)⁸ of the amplitude
    np.testing.assert_allclose(motion.q[inner], 0.5 * np.sin(angle) - 0.7, atol=1e-5)
    np.testing.assert_allclose(motion.tau[inner], 2 * motion.q[inner], atol=1e-9)
    # central differences over 4 ms: (w h)²/6 of it, 2e-5
    expected = -0.5 * w**2 * np.sin(angle)
    np.testing.assert_allclose(motion.ddq[inner], expected, atol=2e-4)
    filtered = motion.filtered(recording.dq)
    np.testing.assert_allclose(filtered, motion.dq, atol=1e-12)


def test_long_stops_and_gaps_tell_nothing():
    t = np.arange(0, 10, 0.01)
    t[500:] += 0.5  # a gap of half a second, 50 steps
    dq = np.full((len(t), 2), 0.5)
    dq[100:129, 0] = 0.0  # 0.28 s: short
    dq[200:232, 0] = 0.0  # 0.31 s: long
    usable = usable_samples(t, dq, 8.0)
    lost = np.flatnonzero(~usable[:, 0])
    # 1/16 s to either side of the gap: 4.9275 to 4.99 and 5.50 to 5.5625
    gap = list(range(493, 507))
    assert lost.tolist() == [*range(200, 232), *gap]
    assert np.flatnonzero(~usable[:, 1]).tolist() == gap


def test_chunks_cover_every_sample_once_and_of_a_log_at_rest_none():
    recording, _ = log(seconds=60.0)
    motion = prepare(recording, PANDA)
    rows = np.concatenate([np.arange(motion.samples)[span] for span in motion.chunks()])
    assert motion.samples > 2 * 1024
    np.testing.assert_array_equal(rows, np.arange(motion.samples))
    still = prepare(Recording(t=recording.t, q=0 * recording.q, dq=0 * recording.q,
                              torque=0 * recording.q), PANDA)  # fmt: skip
    assert (still.samples, list(still.chunks())) == (0, [])
