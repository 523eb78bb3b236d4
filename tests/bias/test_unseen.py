"""The guard: what does not predict is not used."""

from dataclasses import replace

import numpy as np
import pytest
from known_errors import (
    STEP,
    best_by_hand,
    dense,
    drawn_error,
    fit_rows,
    shortened,
    ur10e,
    wrong_run,
)

from vftcli.bias.model_error import smooth_motion
from vftcli.bias.robust_fit import faded, fit_robustly, guarded
from vftcli.signals.rest import MOVES

STRIDE = 3


def fit_of(size, noise=0.3):
    """The fit of a model that is wrong by so much, and the velocities at its samples."""
    robot = shortened(ur10e(), 3)
    run = wrong_run(robot, drawn_error(robot, size=size), noise=noise)
    fit = fit_robustly(fit_rows(run, STRIDE), STRIDE * STEP, np.array([17.0, 16.0, 6.0]))
    return fit, smooth_motion(run).dq[::STRIDE]


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
    np.testing.assert_array_equal(
        guarded(fit, dq).share[0], guarded(fit, np.where(rests, 1.0, dq)).share[0]
    )


def test_between_worth_it_and_not_a_part_is_used():
    """.9 of the unseen error left: all of the correction; .95: none; between in proportion."""
    share = np.array([0.3, 0.9, 0.91, 0.94, 0.95, 1.2])
    np.testing.assert_allclose(
        faded(share, 0.9, 0.95), [1.0, 1.0, 0.8, 0.2, 0.0, 0.0], atol=1e-12
    )
