"""Contacts are kept apart from free motion while the model's error is fitted."""

import numpy as np
import pytest
from known_errors import STEP, drawn_error, fit_rows, shortened, ur10e, wrong_run

from vftcli.bias.robust_fit import fit_robustly, free_samples, largest_around

STRIDE = 3
DRY = np.array([17.0, 16.0, 6.0])


def pushes(t, _q):
    """Three pushes of 20 N·m on joint 2, a second long. (T, n) [N·m]"""
    on = np.any([(t > a) & (t < a + 1.0) for a in (6.0, 13.0, 21.0)], axis=0)
    return 20.0 * on[:, None] * np.array([0.0, 1.0, 0.0])


def rows_of(external, noise=0.3, size=1.0):
    robot = shortened(ur10e(), 3)
    run = wrong_run(robot, drawn_error(robot, size=size), external, noise=noise)
    return fit_rows(run, STRIDE, cutoff=6.0)


@pytest.fixture(scope="module")
def pushed():
    return rows_of(pushes)


def test_contacts_are_found_and_the_error_is_fitted_as_if_nobody_had_pushed(pushed):
    """A quarter second is added to either end of a contact, half a second a push in all.

    White noise of .3 N·m is .1 behind 6 Hz; less than a third of the error is left.
    """
    fit = fit_robustly(pushed, STRIDE * STEP, DRY)
    t = STRIDE * STEP * np.arange(len(pushed.d))
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
    fit = fit_robustly(rows_of(None, noise=0.0, size=0.0), STRIDE * STEP, DRY)
    np.testing.assert_allclose(fit.scale, np.maximum(0.08 * DRY, 0.02))
    assert fit.free.all()


def test_weights_count_what_is_correlated_once(pushed):
    """.3 s of samples count as one: ten at a step of 30 ms."""
    fit = fit_robustly(pushed, STRIDE * STEP, DRY)
    assert fit.weight.max() <= 1.0 / (10.0 * 0.02**2)
    halved = fit_robustly(pushed, 2 * STRIDE * STEP, DRY)
    ratio = np.median(halved.weight * halved.scale**2) / np.median(fit.weight * fit.scale**2)
    assert ratio == pytest.approx(2.0)


def test_short_peaks_are_no_contact_and_contacts_grow():
    """At 20 ms: .08 s are four samples, .25 s twelve (rounded) to either side."""
    worst = np.ones(300)
    worst[50:53] = 9.0
    worst[150:154] = 9.0
    free = free_samples(worst, 0.02)
    assert np.flatnonzero(~free).tolist() == list(range(150 - 12, 154 + 12))


def test_a_log_in_contact_throughout_has_none():
    assert free_samples(np.full(100, 9.0), 0.02).all()
    worst = np.full(100, 9.0)
    worst[:45] = 1.0
    # 45 − 12 are left free, more than thirty
    assert np.count_nonzero(free_samples(worst, 0.02)) == 33


def test_the_largest_around_is_a_loop_s():
    values = np.random.default_rng(2).normal(size=50)
    expected = [values[max(k - 4, 0) : k + 5].max() for k in range(50)]
    np.testing.assert_array_equal(largest_around(values, 4), expected)
    np.testing.assert_array_equal(largest_around(values, 0), values)
