import numpy as np
import pytest

from vftcli.robots.running_friction import play


def looped(q, length, centre=None):
    """The operator as it is written: one sample after another."""
    centre = q[0] if centre is None else centre
    states = []
    for row in q:
        centre = np.clip(centre, row - length, row + length)
        states.append((row - centre) / length)
    return np.array(states), centre


@pytest.mark.parametrize("samples", [1, 2, 31, 32, 33, 1024, 1025, 5000])
def test_blocks_are_the_loop(samples):
    rng = np.random.default_rng(7)
    q = np.cumsum(rng.normal(scale=2e-4, size=(samples, 6)), axis=0)
    length = np.array([1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-4])
    state, centre = looped(q, length)
    found = play(q, length)
    # Only comparisons and one division are made, in both: no rounding can differ.
    np.testing.assert_array_equal(found.state, np.clip(state, -1.0, 1.0))
    np.testing.assert_array_equal(found.centre, centre)


@pytest.mark.parametrize("cut", [1, 17, 32, 900])
def test_stretches_carry_their_centre(cut):
    rng = np.random.default_rng(8)
    q = np.cumsum(rng.normal(scale=2e-4, size=(1000, 3)), axis=0)
    whole, first = play(q, 3e-4), play(q[:cut], 3e-4)
    second = play(q[cut:], 3e-4, first.centre)
    np.testing.assert_array_equal(np.concatenate([first.state, second.state]), whole.state)
    np.testing.assert_array_equal(second.centre, whole.centre)


def test_it_is_the_sign_of_a_long_motion_and_holds_at_rest():
    # Forward by 10 s₀, rest, back by s₀ (half of the way through the play), back by 9 s₀.
    s0 = 3e-4
    q = s0 * np.array([0.0, 5.0, 10.0, 10.0, 10.0, 9.0, 0.0])[:, None]
    state = play(q, s0).state[:, 0]
    # The angles are multiples of s₀ with rounding errors of some 1e-19 rad: 1e-15 of s₀.
    np.testing.assert_allclose(state, [0.0, 1.0, 1.0, 1.0, 1.0, 0.0, -1.0], atol=1e-12)


def test_an_empty_log_has_no_state():
    found = play(np.zeros((0, 2)), 3e-4)
    assert found.state.shape == (0, 2)
