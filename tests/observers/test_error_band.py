"""The one model of an estimate's error, against sums by hand."""

import numpy as np

from vftcli.observers.spectra import ENOUGH, UNSEEN, FreeError, error_band, free_error
from vftcli.robots.friction import HELD

FRICTION = np.array([4.0, 0.0])


def test_rest_and_motion_are_learned_apart() -> None:
    """Columns of 1 N·m at rest and 3 N·m in motion; the dry friction of J1 is the larger."""
    resting = np.zeros((200, 2), dtype=bool)
    resting[:100] = True
    read = np.where(resting, 1.0, -3.0)
    found = free_error(read, resting, FRICTION)
    np.testing.assert_allclose(found.moving, [9.0, 9.0])
    np.testing.assert_allclose(found.resting, [(HELD * 4.0) ** 2, 1.0])
    assert not found.unseen.any()


def test_few_samples_are_spoken_for_by_all() -> None:
    """With 49 moving samples of 200 the mean square is over all of them, friction beside it."""
    resting = np.ones((200, 2), dtype=bool)
    resting[: ENOUGH - 1, 0] = False
    read = np.where(resting, 1.0, 3.0)
    found = free_error(read, resting, FRICTION)
    whole = np.mean(read**2, axis=0)
    np.testing.assert_allclose(found.moving, whole + (UNSEEN * FRICTION) ** 2)
    np.testing.assert_array_equal(found.unseen, [True, True])


def test_what_is_not_known_does_not_count() -> None:
    read = np.full((200, 2), 2.0)
    read[:100, 1] = np.nan
    found = free_error(read, np.zeros((200, 2), dtype=bool), FRICTION)
    np.testing.assert_allclose(found.moving, [4.0, 4.0])


def test_variances_add_sample_by_sample() -> None:
    free = FreeError(np.array([4.0, 1.0]), np.array([9.0, 2.0]), np.zeros(2, dtype=bool))
    resting = np.array([[True, False], [False, True], [False, False]])
    correction = np.array([[1.0, 0.0], [0.0, 2.0], [3.0, 3.0]])
    sd = error_band(free, np.array([0.5, 0.25]), resting, correction)
    expected = [[9 + 0.5 + 1, 1 + 0.25], [4 + 0.5, 2 + 0.25 + 4], [4 + 0.5 + 9, 1 + 0.25 + 9]]
    np.testing.assert_allclose(sd**2, expected)
