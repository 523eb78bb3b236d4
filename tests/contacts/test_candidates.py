"""Where a contact may be: the two-state filter and the threshold."""

import numpy as np
import pytest
from test_error_process import B, blocks, drawn, noise

from vftcli.contacts.search import (
    STRETCH,
    WARM_UP,
    filtered_contacts,
    stretches_of,
    turned_round,
    two_state_odds,
)
from vftcli.robots.terms import Blocks
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.series import runs_of
from vftcli.virtual_sensor.model_error import error_process


def joints_of(d: Array) -> tuple[Blocks, Array]:
    """Blocks of one moving joint with d, and a Jacobian of which a force of 1 N makes 1 N·m."""
    jacobian = np.zeros((len(d), 6, 1))
    jacobian[:, 0] = 0.5
    return blocks(d, np.full_like(d, 0.5)), jacobian


def taken(log: Blocks, jacobian: Array) -> Mask:
    """Blocks that the two-state filter takes for contact."""
    courses = error_process(noise(), log), error_process(noise(), turned_round(log))
    return filtered_contacts(log, courses, jacobian)


def pushed(count: int, seed: int) -> Array:
    """Model error with a push of 8 N·m from block 100 to 120."""
    d = drawn(count, np.random.default_rng(seed))
    d[100:120] += 8.0
    return d


def test_a_push_is_found_to_a_block_or_two() -> None:
    runs = runs_of(taken(*joints_of(pushed(300, 1))))
    assert len(runs) == 1
    assert abs(runs[0][0] - 100) <= 2
    assert abs(runs[0][1] - 120) <= 2


def test_nothing_is_found_in_what_was_drawn_free() -> None:
    assert not taken(*joints_of(drawn(1000, np.random.default_rng(2)))).any()


def test_the_list_of_a_log_turned_round_is_the_list_turned_round() -> None:
    log, jacobian = joints_of(pushed(300, 3))
    np.testing.assert_array_equal(taken(turned_round(log), jacobian), taken(log, jacobian)[::-1])


def test_one_bad_block_is_no_contact() -> None:
    d = drawn(300, np.random.default_rng(4))
    # Six standard deviations of the innovation.
    d[150] += 1.0
    assert not taken(*joints_of(d)).any()


@pytest.mark.slow
def test_a_long_log_is_searched_in_stretches_as_if_in_one(monkeypatch: pytest.MonkeyPatch) -> None:
    d = pushed(2000, 5)
    d[1200:1300] += 5.0
    log, _ = joints_of(d)
    courses = error_process(noise(), log), error_process(noise(), turned_round(log))
    size = np.full((2000, 1), 15.0)
    apart = two_state_odds(log, courses, size)
    monkeypatch.setattr("vftcli.contacts.search.STRETCH", 1000.0)
    whole = two_state_odds(log, courses, size)
    for one, other in zip(apart, whole, strict=True):
        for a, b in zip(one, other, strict=True):
            # After 5 s, a dozen correlation times, nothing is left of how a stretch began.
            assert np.mean(np.sign(a) != np.sign(b)) < 0.002


def test_stretches_cover_the_log() -> None:
    begins, warm, length = stretches_of(5000, B)
    own = length - warm
    assert warm == round(WARM_UP / B)
    assert own == round(STRETCH / B)
    assert begins[0] == 0
    assert begins[-1] + length >= 5000
    assert stretches_of(100, B) == ([0], 0, 100)
