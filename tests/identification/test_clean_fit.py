"""Friction from free motion alone: contacts left out, wrong robots doubted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vftcli.identification.clean_fit import (
    OTHER_LINKS,
    TOUCH_MARGIN,
    TOUCH_TIME,
    ContactSpan,
    find_contacts,
    fit_without_contacts,
    fitted_dry_friction,
    heavy_joints,
    links_explain,
    model_doubts,
    warm_up_remarks,
)
from vftcli.identification.friction_fit import fit_frictions
from vftcli.identification.training import Training, prepare_training
from vftcli.robots import Payload, load_robot
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.signals.errors import IdentificationError
from vftcli.signals.rest import SLIDES


@pytest.mark.slow
def test_a_push_is_left_out_of_the_fit(recording, arm, data):
    push = np.where((recording.t > 5) & (recording.t < 6), 40.0, 0.0)[:, None] * np.eye(6)[1]
    pushed = replace(recording, current=recording.current + push / arm.torque_constant)
    touched = prepare_training([pushed], arm)
    found, fits, (remark,) = fit_without_contacts(touched, strict=False)
    assert remark.code == "suspected-contacts"
    t, weights = touched.logs[0].t, found.logs[0].weights
    np.testing.assert_array_equal(weights[(t > 5) & (t < 6)], 0.0)
    assert weights[(t < 4.5) | (t > 6.5)].all()
    # the samples closer than the margin, steps of 24 ms
    ends = np.array([remark.values["starts_s"][0], remark.values["stops_s"][0]])
    lost = t[weights[:, 0] == 0.0][[0, -1]] - ends
    np.testing.assert_allclose(lost, [-TOUCH_MARGIN, TOUCH_MARGIN], atol=0.025)
    # the 8 Hz filter spreads the edges by less than a period of 0.125 s
    np.testing.assert_allclose(ends, [5.0, 6.0], atol=0.125)
    assert (remark.values["count"], remark.values["worst_joints"]) == (1, [2])
    assert remark.values["total_s"] == ends[1] - ends[0]
    clean = fit_without_contacts(data, strict=False)
    assert clean.remarks == []
    np.testing.assert_allclose(fits[1].fit.values[:2], clean.fits[1].fit.values[:2], rtol=0.03)


def test_the_dry_friction_of_a_fit_is_what_a_joint_may_stick_with(data):
    fits = fit_frictions(data)
    # noise of .1 N·m; Coulomb torque and the smoothing of the sign share the reversals
    np.testing.assert_allclose(fitted_dry_friction(data.logs[0], fits), 4.0, atol=0.3)


T = np.arange(0, 10, 0.01)


def touched(seconds, size, joint=1, base=1.0):
    """Residual ±base in turn, whose robust sd is 1.48·base, and a push from 4 s on."""
    residual = base * np.where(np.arange(len(T)) % 2, 1.0, -1.0)[:, None] * np.ones(3)
    residual[(T >= 4.0) & (4.0 + seconds > T), joint] = size
    return residual


@pytest.mark.parametrize(
    ("seconds", "size", "found"),
    [
        (0.5, 11.0, True),  # 7 · 1.4826 = 10.4
        (0.5, 10.0, False),
        (0.5, -11.0, True),
        (TOUCH_TIME - 0.03, 11.0, False),
    ],
)
def test_a_contact_is_seven_deviations_large_and_lasts(prepared, seconds, size, found):
    motion = prepared(T, dq=np.full((len(T), 3), 0.5))
    spans = find_contacts(motion, touched(seconds, size), np.zeros((len(T), 3)))
    assert len(spans) == found
    for span in spans:
        assert (span.joint, span.size) == (2, size)
        # first and last sample at or above it
        assert (span.start, span.stop) == pytest.approx((4.0, 4.0 + seconds - 0.01), abs=1e-9)


def test_what_dry_friction_can_hold_near_standstill_is_no_contact(prepared):
    dry = np.full((len(T), 3), 30.0)
    standing = prepared(T, dq=np.zeros((len(T), 3)))
    running = prepared(T, dq=np.full((len(T), 3), 0.5))
    assert not find_contacts(standing, touched(0.5, 35.0), dry)
    assert find_contacts(standing, touched(0.5, 45.0), dry)  # 45 − 30 = 15 > 10.4
    assert find_contacts(running, touched(0.5, 35.0), dry)
    told = np.repeat(np.abs(T - 4.25)[:, None] > 0.3, 3, axis=1) * 1.0
    assert not find_contacts(replace(running, weights=told), touched(0.5, 50.0), 0.0 * dry)


def test_standstill_is_spread_by_a_period_of_the_filter(prepared):
    dq = np.full((len(T), 3), 0.5)
    dq[500] = 0.9 * SLIDES
    motion, dry = prepared(1.2 * T, dq=dq), np.full((len(T), 3), 30.0)
    # 1 / 8 Hz is 10.4 samples of 12 ms: what friction of 30 may hold in 10 to either side
    for first, last, starts in ((490, 510, []), (511, 530, [511]), (500, 530, [511])):
        residual = touched(0.0, 0.0)
        residual[first : last + 1, 1] = 20.0
        spans = find_contacts(motion, residual, dry)
        assert [span.start for span in spans] == [motion.t[k] for k in starts]


def test_neighbours_are_joined_and_the_larger_one_names_them(prepared):
    motion, residual = prepared(T, dq=np.full((len(T), 3), 0.5)), touched(0.0, 0.0)
    gap = round(100 * 2 * TOUCH_MARGIN)
    residual[100:201, 0] = -24.0
    residual[150, 0] = -25.0  # its largest, in joint 1
    residual[200 + gap - 1 : 301, 1] = 20.0  # .59 s later
    residual[300 + gap + 1 : 501, 2] = 15.0  # .61 s later
    residual[500 + gap - 1 : 601, 2] = 14.0  # .59 s later
    spans = find_contacts(motion, residual, np.zeros((len(T), 3)))
    second = ContactSpan(pytest.approx(3.61), 6.0, 3, 15.0)
    assert spans == [ContactSpan(1.0, 3.0, 1, -25.0), second]


def test_the_worst_explained_heavy_joint_is_named(data):
    """Shares of the torque's mean square that the fit leaves; its variance is what counts."""
    (log,) = data.logs
    tau = log.tau
    most = 0.8 * np.var(tau[:, 1]) / np.mean(tau[:, 1] ** 2)
    residuals = [0.9, most, 0.01, 0.9, 0.9, 0.9]
    fits = {
        j: SimpleNamespace(fit=SimpleNamespace(residual=np.sqrt(share) * tau[:, j]))
        for j, share in enumerate(residuals)
    }
    (remark,) = model_doubts(data, fits)
    assert (remark.code, remark.where.joints) == ("unexplained-torque", (2,))
    assert remark.values["share_percent"] == pytest.approx(20.0, rel=1e-9)
    assert not list(model_doubts(data._replace(moves=np.zeros(6, dtype=bool)), fits))


def test_an_unknown_load_is_doubted_from_half_a_kilogram_on(recording, arm, sines):
    _, q, dq, ddq = sines(seconds=12.0, seed=2)
    for mass, doubted in ((0.4, False), (1.5, True)):
        load = Payload(mass=mass, com=np.array([0.0, 0.0, 0.05]), inertia=np.zeros((3, 3)))
        heavier = chain_parameters(arm.with_payload(load).loaded_chain)
        extra = torque_regressor(arm.chain, q, dq, ddq) @ (heavier - chain_parameters(arm.chain))
        log = replace(recording, current=recording.current + extra / arm.torque_constant)
        data = prepare_training([log], arm)
        remarks = list(model_doubts(data, {}))
        assert [r.code for r in remarks] == ["unknown-load"] * doubted
        if doubted:
            assert remarks[0].values["mass_kg"] == pytest.approx(mass, rel=0.02)
            # noise of .1 beside some 10 N·m
            assert 99.5 < remarks[0].values["share_percent"] < 100.0


def test_strict_methods_refuse_what_others_remark_on(recording, arm):
    turned = replace(recording, current=-recording.current)
    data = prepare_training([turned], arm)
    with pytest.raises(IdentificationError, match="Choose another --robot"):
        fit_without_contacts(data, strict=True)
    codes = [r.code for r in fit_without_contacts(data, strict=False).remarks]
    assert codes[-2:] == ["unexplained-torque", "absorbed-doubt"]


@pytest.mark.slow
def test_links_of_another_arm_are_told_from_an_effort_no_links_explain(recording, arm, data):
    """The same effort through a UR10e's links, and its own links under noise of 30 N·m."""

    def ratio(training):
        return np.max(links_explain(training, fit_frictions(training)))

    # 10 cosines of freedom a link against 2300 equations a joint: a few per cent
    assert ratio(data) == pytest.approx(1.0, abs=0.1)
    ur10 = replace(load_robot("ur10e"), torque_constant=arm.torque_constant)
    other = prepare_training([recording], ur10)
    assert ratio(other) > OTHER_LINKS
    rng = np.random.default_rng(4)
    noise = 30.0 * rng.standard_normal(recording.q.shape) / arm.torque_constant
    noisy = replace(recording, current=recording.current + noise)
    trained = prepare_training([noisy], arm)
    remarks = fit_without_contacts(trained, strict=True).remarks
    (said,) = [r for r in remarks if r.code == "noisy-effort"]
    assert said.values["ratio"] < 1.2
    np.testing.assert_array_equal(heavy_joints(data), [False, True, True, False, False, False])


@pytest.mark.parametrize(
    ("thirds", "found"),
    [
        ((0.9, 0.4, 0.3), True),
        ((0.9, 0.2, 0.3), False),  # rises again
        ((0.32, 0.2, 0.1), True),  # .22 N·m: more than 5 % of 4 N·m
        ((0.28, 0.2, 0.1), False),
    ],
)
def test_a_joint_that_rubs_less_and_less_is_reported(prepared, arm, thirds, found):
    """So much more torque along the velocity in each third, of joint 2 alone."""
    dq = np.where(T % 1.0 < 0.5, 0.5, -0.5)[:900, None] * np.ones(6)
    along = np.repeat(thirds, 300)[:, None] * np.sign(dq) * np.eye(6)[1]
    log = prepared(T[:900], dq=dq)
    fits = {
        j: SimpleNamespace(friction=arm.friction[j], fit=SimpleNamespace(residual=along[:, j]))
        for j in range(6)
    }
    moves = np.ones(6, bool)
    remarks = list(warm_up_remarks(Training(arm, (), (log,), moves, moves), fits))
    assert [(r.code, r.where.joints) for r in remarks] == [("warm-up", (2,))] * found
    for remark in remarks:
        # tanh of .5 rad/s over the smoothing is 1
        np.testing.assert_allclose(remark.values["first_Nm"], [thirds[0]], rtol=1e-6)
        np.testing.assert_allclose(remark.values["last_Nm"], [thirds[2]], rtol=1e-6)
