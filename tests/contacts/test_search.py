"""Where a contact may be: the two-state filter, the threshold, and where contacts are split."""

import numpy as np
import pytest
from drawn_blocks import B, blocks, drawn, noise

from vftcli.contacts.search import (
    AT_FIRST,
    BETWEEN,
    PUSH,
    SEARCHES,
    filtered_contacts,
    split_at_turns,
    split_run,
    two_state_odds,
)
from vftcli.contacts.windows import WindowWrench
from vftcli.robots.terms import Blocks
from vftcli.signals.arrays import Array
from vftcli.signals.estimation import SPIKE
from vftcli.wrench.model_error import ErrorProcess, error_process


def joints_of(d: Array) -> tuple[Blocks, Array]:
    """Blocks of one moving joint with d, and a Jacobian of which a force of 1 N makes 1 N·m."""
    jacobian = np.zeros((len(d), 6, 1))
    jacobian[:, 0] = 0.5
    return blocks(d, np.full_like(d, 0.5)), jacobian


def both_ways(log: Blocks, joints: int = 1) -> tuple[ErrorProcess, ErrorProcess]:
    back = log.part(slice(None, None, -1))
    back = back._replace(t=-back.t, velocity=-back.velocity)
    return error_process(noise(joints), log), error_process(noise(joints), back)


def pushed(count: int, seed: int) -> Array:
    """Model error with a push of 8 N·m from block 100 to 120."""
    d = drawn(count, np.random.default_rng(seed))
    d[100:120] += 8.0
    return d


@pytest.mark.parametrize("push", [3.4, 3.5])
def test_a_contact_is_what_is_99_percent_sure(push):
    """72 ms of a push in no noise; in the middle both directions know the same.

    3.4 N·m are 98.8 % sure, 3.5 N·m 99.2 %.
    """
    d = np.zeros((300, 1))
    d[140:143] = push
    log, jacobian = joints_of(d)
    courses = both_ways(log)
    size = PUSH[0] * jacobian[:, 0]
    odds = max(float(both[141]) for each in two_state_odds(log, courses, size) for both in each)
    assert 0.98 < 1.0 / (1.0 + np.exp(-odds)) < 0.995
    assert filtered_contacts(log, courses, jacobian).any() == (1.0 / (1.0 + np.exp(-odds)) > 0.99)


def textbook_odds(d, process, size, time, lasts) -> Array:
    """Log odds of contact after each block: Blom and Bar-Shalom's cycle, in matrices. (K,)

    The state of a joint is (b, x); the mode "free" does not see x, which is as it may be there.
    """
    count, n = d.shape
    leave = 1.0 - np.exp(-B / np.array([BETWEEN, lasts]))
    turn = np.array([[1.0 - leave[0], leave[0]], [leave[1], 1.0 - leave[1]]])
    g, mode = np.exp(-B / time), np.array([1.0 - AT_FIRST, AT_FIRST])
    mean, P = np.zeros((2, n, 2)), np.zeros((2, n, 2, 2))
    P[:, :, 1, 1] = size[0] ** 2
    odds = np.empty(count)
    for k in range(count):
        mean[0, :, 1], P[0, :, 0, 1], P[0, :, 1, 0], P[0, :, 1, 1] = 0.0, 0.0, 0.0, size[k] ** 2
        mixed, before, P_before = turn * mode[:, None], mean.copy(), P.copy()
        mode = mixed.sum(axis=0)
        shares = mixed / mode
        for to, j in np.ndindex(2, n):
            share = shares[:, to]
            mean[to, j] = share @ before[:, j]
            apart = before[:, j] - mean[to, j]
            P[to, j] = np.einsum("i,iab->ab", share, P_before[:, j])
            P[to, j] += np.einsum("i,ia,ib->ab", share, apart, apart)
            f, q = process.decay[k, j], process.added[k, j]
            q = q / (1.0 - f * f) if k == 0 else q
            F = np.diag([f, g])
            mean[to, j] = F @ mean[to, j]
            P[to, j] = F @ P[to, j] @ F + np.diag([q, (1.0 - g * g) * size[k, j] ** 2])
            H = np.array([1.0, to])
            S, nu = H @ P[to, j] @ H + process.white[k, j], d[k, j] - H @ mean[to, j]
            spike = process.spikes[k, j]
            wide = SPIKE * S
            usual = (1.0 - spike) * np.exp(-0.5 * nu**2 / S) / np.sqrt(S)
            spiked = spike * np.exp(-0.5 * nu**2 / wide) / np.sqrt(wide)
            mode[to] *= usual + spiked
            K = P[to, j] @ H / (wide if spiked > usual else S)
            mean[to, j] += K * nu
            P[to, j] -= np.outer(K, H @ P[to, j])
        mode /= mode.sum()
        odds[k] = np.log(mode[1] / mode[0])
    return odds


def test_the_odds_are_those_of_the_textbook_filter():
    """Two joints with a push on one, a slow start on the other: for taps and for leans."""
    rng = np.random.default_rng(6)
    d = np.hstack([drawn(150, rng), drawn(150, rng)])
    d[60:75, 0] += 4.0
    d[60:75, 1] -= np.linspace(0.0, 3.0, 15)
    log = blocks(d, np.full_like(d, 0.5))
    size = np.column_stack([np.linspace(10.0, 20.0, 150), np.linspace(8.0, 4.0, 150)])
    ahead, back = both_ways(log, 2)
    found = two_state_odds(log, (ahead, back), size)
    for (forward, backward), (time, lasts) in zip(found, SEARCHES, strict=True):
        there = textbook_odds(d, ahead, size, time, lasts)
        again = textbook_odds(d[::-1], back, size[::-1], time, lasts)
        # The odds reach hundreds of nats, of sums of 300 terms.
        np.testing.assert_allclose(forward, there, atol=1e-8)
        np.testing.assert_allclose(backward, again[::-1], atol=1e-8)


@pytest.mark.slow
def test_a_long_log_is_searched_in_stretches_as_if_in_one(monkeypatch):
    d = pushed(2000, 5)
    d[1200:1300] += 5.0
    log, _ = joints_of(d)
    courses = both_ways(log)
    size = np.full((2000, 1), 15.0)
    apart = two_state_odds(log, courses, size)
    monkeypatch.setattr("vftcli.contacts.search.STRETCH", 1000.0)
    whole = two_state_odds(log, courses, size)
    for one, other in zip(apart, whole, strict=True):
        for a, b in zip(one, other, strict=True):
            # After 5 s, a dozen correlation times, nothing is left of how a stretch began.
            assert np.mean(np.sign(a) != np.sign(b)) < 0.002


def test_behind_a_gap_of_an_hour_the_odds_are_those_of_a_log_that_begins():
    """Contacts come every 30 s: by then one is there as often as not, and that is no 0/0."""
    log, _ = joints_of(drawn(300, np.random.default_rng(8)))
    log = log._replace(t=log.t + np.where(np.arange(300) < 150, 0.0, 3600.0))
    courses = both_ways(log)
    for each in two_state_odds(log, courses, np.full((300, 1), 15.0)):
        assert all(np.isfinite(odds).all() and odds[[145, 299]].max() < 0.0 for odds in each)


@pytest.mark.parametrize(
    ("pause", "force", "sd", "felt", "pieces"),
    [
        (6, 0.5, 2.0, 0.0, [(0, 10), (16, 26)]),
        (2, 0.5, 2.0, 0.0, [(0, 22)]),  # a hand that slips for a moment has not let go
        (6, 0.5, 2.0, 20.0, [(0, 26)]),  # the force turns while the joints feel it
        (6, 10.0, 20.0, 0.0, [(0, 26)]),  # noise hides the force
    ],
)
def test_two_pushes_are_split_where_force_and_torque_pause(pause, force, sd, felt, pieces):
    """Ten blocks of 30 N and ten of 40 N along x; joint 1 feels the force, joint 4 so much more."""
    size = [30.0] * 10 + [force] * pause + [40.0] * 10
    count = len(size)
    values = np.tile([0.0, 0.0, 0.0, felt, 0.0, 0.0], (count, 1))
    values[:, 0] = size
    wrench = WindowWrench(0, values, np.tile(np.eye(6) * sd**2 / 3.0, (count, 1, 1)))
    found = split_run(B * np.arange(count), wrench, (0, count), np.tile(np.eye(6), (count, 1, 1)))
    assert found == pieces


def test_pushes_from_different_sides_are_two_contacts():
    t = B * np.arange(200)
    force = np.zeros((200, 3))
    force[:100, 0] = 40.0 * np.sin(np.pi * np.arange(100) / 100)
    force[100:, 1] = 40.0 * np.sin(np.pi * np.arange(100) / 100)
    load = 0.5 * np.linalg.norm(force, axis=1)
    (first, second) = split_at_turns(t, force, load, (0, 200))
    assert first[1] == second[0] == pytest.approx(100, abs=1)
    # From one side, or where the joints are loaded all the while, it is one.
    same = np.roll(force[:, ::-1], 0, axis=1).copy()
    same[:, 0] = np.linalg.norm(force, axis=1)
    same[:, 1:] = 0.0
    assert split_at_turns(t, same, load, (0, 200)) == [(0, 200)]
    assert split_at_turns(t, force, np.full(200, 20.0), (0, 200)) == [(0, 200)]
    # A hand that has just begun is none of its own.
    brief = force[94:]
    assert split_at_turns(t[94:], brief, load[94:], (0, 106)) == [(0, 106)]
