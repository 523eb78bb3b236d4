"""Contacts are kept apart from free motion while the model's error is fitted."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from known_errors import (
    STEP,
    best_by_hand,
    dense,
    drawn_error,
    fit_rows,
    motion,
    shortened,
    ur10e,
    wrong_run,
)

from vftcli.bias.model_error import smooth_motion
from vftcli.bias.robust_fit import faded, fit_robustly, free_samples, guarded, slow_loads
from vftcli.robots import load_robot
from vftcli.signals.rest import MOVES

STEPS = 3
DRY = np.array([17.0, 16.0, 6.0])


def pushes(t, _q):
    """Three pushes of 20 N·m on joint 2, a second long. (T, n) [N·m]"""
    on = np.any([(t > a) & (t < a + 1.0) for a in (6.0, 13.0, 21.0)], axis=0)
    return 20.0 * on[:, None] * np.array([0.0, 1.0, 0.0])


def rows_of(external, noise=0.3, size=1.0):
    robot = shortened(ur10e(), 3)
    run = wrong_run(robot, drawn_error(robot, size=size), external, noise=noise)
    return fit_rows(run, STEPS, cutoff=6.0)


@pytest.fixture(scope="module")
def pushed():
    return rows_of(pushes)


def test_contacts_are_found_and_the_error_is_fitted_as_if_nobody_had_pushed(pushed):
    """A quarter second is added to either end of a contact, half a second a push in all.

    White noise of .3 N·m is .1 behind 6 Hz; less than a third of the error is left.
    """
    fit = fit_robustly(pushed, STEPS * STEP, DRY)
    t = STEPS * STEP * np.arange(len(pushed.d))
    touched = pushes(t, None)[:, 1] > 0.0
    assert not np.any(fit.free & touched)
    # 3 pushes of 1.5 s in 30 s, and a tenth for what noise and friction's turns add
    assert np.mean(fit.free) > 1.0 - 0.15 - 0.1
    found = pushed.solution(pushed.sums(fit.weight, fit.free)[0])
    left = pushed.d + pushed.modelled(found.model)
    rms = np.sqrt(np.mean(left[fit.free] ** 2, axis=0))
    before = np.sqrt(np.mean(pushed.d[fit.free] ** 2, axis=0))
    # friction turns its sign within a step, and the prior holds large errors back
    assert np.all(rms < 0.3)
    assert np.all(before > 3.0 * rms)


def test_a_scale_is_never_below_a_share_of_the_dry_friction():
    """A log that the model explains to the last digit is not full of contacts."""
    fit = fit_robustly(rows_of(None, noise=0.0, size=0.0), STEPS * STEP, DRY)
    np.testing.assert_allclose(fit.scale, np.maximum(0.08 * DRY, 0.02))
    assert fit.free.all()


def test_a_long_rest_does_not_make_all_motion_a_contact():
    """Two thirds of the time at rest: their residual of 1 mN·m is no scale of a motion's."""
    rows, chain = rows_of(None, size=3.0), shortened(ur10e(), 3).chain
    rest, samples = 2 * len(rows.d), 3 * len(rows.d)

    def after_rest(x):
        return np.concatenate([np.repeat(x[:1], rest, axis=0), x])

    loads = slow_loads(chain, STEPS * STEP * np.arange(samples), np.zeros((samples, 3)))
    rows = replace(
        rows,
        columns=[after_rest(column) for column in rows.columns],
        loads=loads._replace(torque=after_rest(rows.loads.torque)),
        d=np.concatenate([1e-3 * np.ones((rest, 3)), rows.d]),
        moves=np.arange(samples) >= rest,
    )
    assert fit_robustly(rows, STEPS * STEP, DRY).free[rest:].mean() > 0.4
    as_motion = replace(rows, moves=np.ones_like(rows.moves))
    assert fit_robustly(as_motion, STEPS * STEP, DRY).free[rest:].mean() < 0.1


def test_weights_count_what_is_correlated_once(pushed):
    """.3 s of samples count as one: ten at a step of 30 ms."""
    fit = fit_robustly(pushed, STEPS * STEP, DRY)
    assert fit.weight.max() <= 1.0 / (10.0 * 0.02**2)
    halved = fit_robustly(pushed, 2 * STEPS * STEP, DRY)
    ratio = np.median(halved.weight * halved.scale**2) / np.median(fit.weight * fit.scale**2)
    assert ratio == pytest.approx(2.0)


def test_short_peaks_are_no_contact_and_contacts_grow():
    """At 20 ms: .08 s are four samples, .25 s twelve (rounded) to either side."""
    worst = np.ones(300)
    worst[50:53] = worst[150:154] = worst[296:] = 9.0
    touched = np.flatnonzero(~free_samples(worst, 0.02)).tolist()
    assert touched == [*range(150 - 12, 154 + 12), *range(296 - 12, 300)]


def test_a_log_in_contact_throughout_has_none():
    assert free_samples(np.full(100, 9.0), 0.02).all()
    worst = np.full(100, 9.0)
    worst[:45] = 1.0
    # 45 − 12 are left free, more than thirty
    assert np.count_nonzero(free_samples(worst, 0.02)) == 33


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
        place = pin.Frame(f"point {joint}", joint, point, pin.FrameType.OP_FRAME)
        frames.append(model.addFrame(place))
    data, sd = model.createData(), np.repeat([50.0, 10.0, 50.0, 50.0], 3)
    for row, found in zip(q, loads.torque, strict=True):
        axes = pin.LOCAL_WORLD_ALIGNED
        J = [pin.computeFrameJacobian(model, data, row, frame, axes) for frame in frames]
        felt = np.vstack([J[0], J[1][:3], J[2][:3]]).T
        np.testing.assert_allclose(found, -sd * felt, atol=1e-12 * 50.0)


@pytest.mark.parametrize(("seconds", "knots"), [(14.0, 1), (16.0, 3), (55.0, 7), (3600.0, 61)])
def test_knots_lie_ten_seconds_apart(seconds, knots):
    t = np.linspace(0.0, seconds, 40)
    assert slow_loads(load_robot("ur5").chain, t, np.zeros((40, 6))).knots == knots


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


JOINTS, STRIDE = 4, 10


def push(t, _q):
    """A torque that rises along the log. (T, n) [N·m]"""
    return 0.4 * t[:, None] * np.ones(JOINTS)


@pytest.fixture(scope="module")
def rows():
    robot = shortened(ur10e(), JOINTS)
    return fit_rows(wrong_run(robot, drawn_error(robot), push, seconds=26.0, noise=0.5), STRIDE)


@pytest.fixture(scope="module")
def weight(rows):
    """Of every row, differing. Seed 4."""
    return np.random.default_rng(4).uniform(0.01, 2.0, rows.d.shape)


@pytest.mark.parametrize("scale", [0.1, 1.0])
def test_the_solution_is_that_of_the_dense_matrix(rows, weight, scale):
    """The group of loads is the one with the least objective and twice its columns."""
    assert rows.loads.torque.shape[2] == 6 + 3  # elbow and wrist of four joints are one point
    found, P = rows.solution(rows.sums(weight)[0], scale), rows.unknowns
    expected = best_by_hand(dense(rows), rows.d, weight, scale, rows)
    assert P + len(found.loads) == len(expected)
    # condition numbers of up to 1e8 leave seven digits
    np.testing.assert_allclose(found.model, expected[:P], atol=1e-6)
    np.testing.assert_allclose(found.loads, expected[P:], atol=1e-6)


def test_the_spread_is_that_of_the_inverse(rows, weight):
    """diag(A N⁻¹ Aᵀ) with the loads' columns in N."""
    P, found = rows.unknowns, rows.solution(rows.sums(weight)[0], 0.3)
    used = len(found.loads)
    assert used > 0
    A = dense(rows)[:, :, : P + used]
    flat = A.reshape(-1, A.shape[-1])
    prior = np.concatenate([np.full(P, 0.3), np.ones(used)]) ** -2.0
    N = flat.T @ (flat * weight.ravel()[:, None]) + np.diag(prior)
    covariance = np.linalg.inv(N)[:P, :P]
    expected = np.sqrt(np.einsum("tnp,pq,tnq->tn", A[:, :, :P], covariance, A[:, :, :P]))
    np.testing.assert_allclose(rows.spread(found.covariance), expected, rtol=1e-6)


def test_no_load_is_believed_where_there_is_none(rows):
    """Noise of a tenth of the scale gains less than two a column."""
    quiet = replace(rows, d=np.random.default_rng(8).normal(0.0, 0.1, rows.d.shape))
    assert len(quiet.solution(quiet.sums(np.ones(rows.d.shape))[0]).loads) == 0


def fit_of(size, noise=0.3):
    """The fit of a model that is wrong by so much, and the velocities at its samples."""
    robot = shortened(ur10e(), 3)
    run = wrong_run(robot, drawn_error(robot, size=size), noise=noise)
    fit = fit_robustly(fit_rows(run, STEPS), STEPS * STEP, DRY)
    return fit, smooth_motion(run).dq[::STEPS]


SCALES = (0.0, 0.1, 0.3, 1.0)
"""What the guard chooses among: no error of the model, a share of its spread, all of it."""


@pytest.fixture(scope="module")
def wrong():
    return fit_of(1.0)


def test_noise_is_left_alone():
    """White noise of .3 N·m and no error: nothing is predicted."""
    found = guarded(*fit_of(0.0))
    assert found.solution is None
    assert not found.weight.any()
    assert np.all(found.share > 0.9)


def test_the_unseen_share_is_that_of_dense_fits(wrong):
    """Every fold, scale and choice of loads by dense matrices; the guard's own words by hand."""
    wrong, dq = wrong
    rows, P = wrong.rows, wrong.rows.unknowns
    moves = np.abs(dq) > MOVES  # every joint does in nine tenths of the samples and more
    place, A = np.arange(len(rows.d)), dense(rows)
    squares = np.zeros((len(SCALES), 3))
    for fold in np.array_split(np.flatnonzero(wrong.free), 5):
        rest = wrong.free & ((place < fold[0] - 17) | (place > fold[-1] + 17))
        for k, scale in enumerate(SCALES):
            u = np.zeros(P)
            if scale:
                u = best_by_hand(A[rest], rows.d[rest], wrong.weight[rest], scale, rows)[:P]
            left = np.abs(rows.d[fold] + A[fold][:, :, :P] @ u) / wrong.scale
            squares[k] += np.sum(np.minimum(left, 6.0) ** 2 * moves[fold], axis=0)
    best = int(np.argmin(squares.mean(axis=1)))
    expected = np.sqrt(squares[best] / squares[0])
    found = guarded(wrong, dq)
    # condition numbers of up to 1e8 leave seven digits
    np.testing.assert_allclose(found.share, expected, rtol=1e-5)
    assert found.solution.scale == SCALES[best]
    np.testing.assert_array_equal(found.weight, 1.0)  # an error that is there is applied


def test_a_joint_that_gains_too_little_is_left_alone(wrong):
    """The third joint's signal replaced by noise: the others are corrected."""
    fit, dq = wrong
    d = fit.rows.d.copy()
    d[:, 2] = np.random.default_rng(3).normal(0.0, 0.3, len(d))
    found = guarded(replace(fit, rows=replace(fit.rows, d=d)), dq)
    assert found.weight[2] == 0.0
    assert found.weight[:2].any()


def in_turn(fit, dq, joint, shares, level=2.0):
    """One joint rests for a share of every 2 s, and stiction holds ± `level` there, seed 4. [N·m]

    The other joints are as they were, at a level of 0 the torque too.
    """
    t = fit.step * np.arange(len(dq))
    rests = t % 2.0 < 2.0 * shares
    d, still = fit.rows.d.copy(), dq.copy()
    still[:, joint] = np.where(rests, 0.0, 1.0)
    sign = np.random.default_rng(4).choice([-1.0, 1.0], int(t[-1] / 2.0) + 1)
    d[:, joint] += level * sign[(t / 2.0).astype(int)] * rests
    return replace(fit, rows=replace(fit.rows, d=d)), still


def test_a_joint_is_judged_while_it_moves(wrong):
    """Stiction at rest, which no model predicts, hides nothing of what is gained in motion."""
    fit, dq = in_turn(*wrong, joint=0, shares=0.5, level=9.0)
    found = guarded(fit, dq)
    everywhere = guarded(fit, np.ones_like(dq))
    np.testing.assert_array_equal(found.weight, 1.0)
    assert found.share[0] < 0.5 * everywhere.share[0]


def test_a_joint_that_seldom_moves_is_judged_by_all_samples(wrong):
    fit, dq = in_turn(*wrong, joint=0, shares=0.85, level=0.0)
    rests = np.abs(dq) < MOVES
    moving = guarded(fit, np.where(rests, 1.0, dq))
    np.testing.assert_array_equal(guarded(fit, dq).share[0], moving.share[0])


def test_between_worth_it_and_not_a_part_is_used():
    """.9 of the unseen error left: all of the correction; .95: none; between in proportion."""
    share = np.array([0.3, 0.9, 0.91, 0.94, 0.95, 1.2])
    expected = [1.0, 1.0, 0.8, 0.2, 0.0, 0.0]
    np.testing.assert_allclose(faded(share, 0.9, 0.95), expected, atol=1e-12)
