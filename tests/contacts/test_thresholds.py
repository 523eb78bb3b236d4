"""Thresholds of noise whose tail is known: rates, the worst day, what is too short, counts."""

import numpy as np
import pytest

from vftcli.contacts.thresholds import (
    BLOCK,
    SETTLING,
    ComparedSignals,
    Thresholds,
    block_maxima,
    events,
    find_thresholds,
    tail_of,
    worst_of,
)
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.recording import Recording, Source

STEADY = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])  # The moments alone.

RATE = 10.0  # Samples a second. [Hz]


def free_log(name, seconds, scale=1.0, *, seed=0, joints=6, axes=6) -> ComparedSignals:
    """Joints and axes of exponential noise whose mean is `scale`. [N·m, N]"""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    torque = rng.exponential(scale, (len(t), joints)) * rng.choice([-1.0, 1.0], (len(t), joints))
    return compared(name, t, torque, rng.exponential(scale, (len(t), axes)))


def compared(name: str, t: Array, torque: Array, wrench: Array) -> ComparedSignals:
    """Signals as a robot of its own estimate has them."""
    log = Recording(t=t, q=np.zeros(torque.shape), source=Source(label=name))
    told = {"of_vendor": True, "logged_wrench": True}
    told["frame"] = "base axes" if wrench.shape[1] else ""
    return ComparedSignals(recording=log, torque=torque, wrench=wrench, **told)


def codes(thresholds: Thresholds) -> list[str]:
    return [remark.code for remark in thresholds.remarks]


def test_every_signal_of_a_set_has_its_share_of_the_rate():
    """An hour of exponential noise of 2 N·m: of rate 6, one an hour a joint, 2 ln 36 000 = 21.0.

    k = 60 of them know the distance from λ = 60 an hour, 2 ln 60, to 13 %; 3 sd are allowed.
    """
    found = find_thresholds([free_log("a", 3602.0, 2.0)], 6.0)
    exact, allowed = 2.0 * np.log(3600.0 * RATE), 3.0 / np.sqrt(60.0) * 2.0 * np.log(60.0)
    for one in (*found.joints, *found.axes):
        assert one.rate == 1.0
        assert abs(one.value - exact) < allowed
        assert one.interval[0] < one.value < one.interval[1]
    (force,) = found.force
    assert force.rate == 6.0


@pytest.mark.statistical
def test_an_unseen_half_passes_the_thresholds_at_the_stated_rate():
    """30 pairs of hours at 12 per hour: 360 are due; events nearer than .5 s hardly take any.

    Each count scatters by √12, each threshold by e-folds of ln(30)/√60 beside it: 360 ± 30 %.
    """
    counted = 0
    for seed in range(30):
        limits = find_thresholds([free_log("a", 3602.0, seed=seed)], 12.0)
        unseen = free_log("b", 3602.0, seed=1000 + seed)
        counted += len(events(unseen.t, worst_of(limits.level("joints", unseen))))
    assert 250 <= counted <= 470


def test_the_worst_day_counts_and_not_the_mean():
    calm, rough = free_log("calm", 600.0, 1.0), free_log("rough", 600.0, 3.0, seed=1)
    alone = find_thresholds([rough], 1.0)
    both = find_thresholds([calm, rough], 1.0)
    assert [one.value for one in both.joints] == [one.value for one in alone.joints]
    assert {one.log for one in both.joints} == {"rough"}


def test_a_short_log_beside_a_long_one_counts_by_its_largest_reading():
    long, short = free_log("long", 600.0), free_log("short", 12.0, 40.0, seed=1)
    found = find_thresholds([long, short], 1.0)
    settled = short.t >= 2.0
    largest = np.abs(short.torque[settled]).max(axis=0)
    assert [one.value for one in found.joints] == pytest.approx(largest.tolist(), rel=1e-12)
    assert found.joints[0].tail is None
    assert "free-log-too-short" in codes(found)


def test_short_logs_alone_tell_a_guess_and_say_so():
    found = find_thresholds([free_log("a", 12.0), free_log("b", 12.0, seed=1)], 60.0)
    assert "tail-of-few" in codes(found)
    assert all(one.tail is not None and one.tail.size == 2 for one in found.joints)


@pytest.mark.parametrize(("seconds", "said"), [(3602.0, True), (3 * 3600.0 + 2.1, False)])
def test_a_log_shorter_than_three_false_alarms_extrapolates(seconds, said):
    found = find_thresholds([free_log("a", seconds, joints=2, axes=0)], 1.0)
    assert ("thresholds-extrapolated" in codes(found)) is said
    for remark in (r for r in found.remarks if r.code == "thresholds-extrapolated"):
        rates = {name: remark.values[name] for name in ("rate_per_h", "own_rate_per_h", "need_h")}
        assert rates == {"rate_per_h": 1.0, "own_rate_per_h": 0.5, "need_h": 3.0}


def test_a_wrench_that_is_hardly_known_gives_no_axes_and_is_said():
    log = free_log("a", 600.0)
    wrench = np.where(log.t[:, None] < 5.0, log.wrench, np.nan)
    found = find_thresholds([compared("a", log.t, log.torque, wrench)], 1.0)
    assert (found.axes, found.force) == ((), ())
    assert {"axes-unknown", "wrench-seldom-known"} <= set(codes(found))
    found = find_thresholds([free_log("a", 600.0, joints=4, axes=0)], 1.0)  # of few joints none
    assert (len(found.joints), found.axes, found.force) == (4, (), ())


def test_an_axis_wider_than_its_value_is_no_threshold_and_says_how_much_more():
    """A minute: k = 11 readings know e to 59 %; moments of 1 N·m ride on an offset, forces do not.

    From 1 an hour, 1/6 an axis, e ln(λ·6) = 8.2 e beyond u = 1.6 e + ln 10 e: 95 % is 9.7 e wide
    about 12 e. With the offset the same 9.7 stand beside 40.
    """
    few = free_log("few", 27.0)
    found = find_thresholds([compared("few", few.t, few.torque, few.wrench + 40.0 * STEADY)], 1.0)
    assert [one.is_wide for one in found.axes] == [True] * 3 + [False] * 3
    (remark,) = [r for r in found.remarks if r.code == "axes-too-wide"]
    assert remark.values["axes"].split(", ")[:3] == ["fx", "fy", "fz"]
    # what does not exist raises no alarm, and is null
    level = found.level("axes", few)
    assert not level[:, :3].any()
    assert found.to_polars()["threshold"].null_count() == len(remark.values["axes"].split(", "))
    # so much more, and they are there
    seconds = 25.0 + 1.3 * 60.0 * remark.values["more_min"]
    more = find_thresholds([free_log("more", 2.0 + seconds)], 1.0)
    assert not any(one.is_wide for one in more.axes)


LOG = free_log("a", 600.0)


@pytest.mark.parametrize(
    ("logs", "rate", "said"),
    [
        *(([LOG], rate, "--rate") for rate in (0.0, -1.0, float("nan"), float("inf"))),
        ([free_log("a", 6.0)], 1.0, "at least 27 s"),
        ([LOG, free_log("b", 600.0, joints=7)], 1.0, "logs of one arm"),
        ([LOG, LOG._replace(of_vendor=False)], 1.0, "recorded in one way"),
    ],
)
def test_what_tells_no_threshold_is_refused(logs, rate, said):
    with pytest.raises(ParameterError, match=said):
        find_thresholds(logs, rate)


def test_a_joint_that_never_moved_alarms_at_whatever_it_reads():
    log = free_log("a", 600.0)
    still = compared("a", log.t, np.zeros(log.torque.shape), log.wrench)
    found = find_thresholds([still], 1.0)
    assert found.joints[0].value == 0.0
    assert np.all(found.level("joints", still) == 0.0)
    assert np.all(found.level("joints", log) > 1.0)


# Block maxima, events and the exponential tail, against loops and exponential noise
#
# The largest of ten exponential readings a second, of mean 1, passes x at 3600 (1 − (1 − e^−x)^10)
# per hour, for a large x at 36 000 e^−x: the level of a rate r is ln(36 000/r).


def test_the_interval_holds_the_analytic_level_as_often_as_it_says():
    """300 quarters of an hour (k = 30): .95 ± .025 by count, less what u's own error takes."""
    rng, held = np.random.default_rng(2), 0
    for _ in range(300):
        # The largest of ten readings in every block: the inverse of (1 − e^−x)^10.
        tail = tail_of(-np.log1p(-(rng.uniform(size=900) ** 0.1)))
        _, (low, high) = tail.threshold(1.0)
        held += low <= np.log(36_000.0) <= high
    assert 0.88 <= held / 300 <= 0.99


def test_few_maxima_tell_a_fifth_of_them_and_four_tell_nothing():
    assert tail_of(np.arange(4.0)) is None
    tail = tail_of(np.arange(60.0))
    # The twelve largest of 0 … 59 lie 1 … 12 beyond the next, 47.
    assert (tail.size, tail.start, tail.excess) == (12, 47.0, 6.5)


def test_the_lower_end_of_one_maximum_is_the_level_it_lies_beyond():
    tail = tail_of(np.array([1.0, 1.0, 2.0, 3.0, 5.0]))
    assert tail.size == 1
    value, (low, high) = tail.threshold(tail.rate / np.e)
    # One e-fold beyond u = 3 with e = 2, and 1.96 times that as half the interval.
    assert (value, low) == (5.0, 3.0)
    assert high == pytest.approx(5.0 + 1.96 * 2.0, rel=1e-12)


def test_what_happens_more_often_than_the_tail_is_read_off_the_maxima():
    """Of 3600 maxima 0 … 3599 the level 100 an hour is the hundredth largest, 3500."""
    tail = tail_of(np.arange(3600.0))
    with pytest.raises(ParameterError, match="at most 1800"):
        tail.threshold(2000.0)
    value, (low, high) = tail.threshold(100.0)
    assert value == 3500.0
    # 100 ± 1.96 √100 = 119.6 and 80.4 of them lie above the ends.
    assert (low, high) == (3480.0, 3520.0)
    few = tail_of(np.array([1.0, 1.0, 2.0, 3.0, 5.0]))
    # Of 2 the ends are 2 + 1.96 √2 = 4.8, hence 5, and the largest at the most.
    assert few.threshold(2.0 / few.hours) == (3.0, (1.0, 5.0))


def test_block_maxima_are_those_of_a_loop():
    """A jittering clock of 50 Hz with a gap of 3 s and a stretch that is not known."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.015, 0.025, 1000))
    t[600:] += 3.0
    level = rng.exponential(size=1000)
    level[300:420] = np.nan
    start = t[t >= t[0] + SETTLING][0]
    expected = []
    for block in range(int((t[-1] - start) / BLOCK) + 1):
        inside = (t >= start + block * BLOCK) & (t < start + (block + 1) * BLOCK)
        known = level[inside][np.isfinite(level[inside])]
        if len(known) * np.median(np.diff(t[t >= start])) >= 0.5 * BLOCK:
            expected.append(known.max())
    np.testing.assert_array_equal(block_maxima(t, level), expected)
    assert len(block_maxima(t[:60], level[:60])) == 0  # it ends while it settles


def test_passages_less_than_half_a_second_apart_are_one_event():
    t = np.arange(0.0, 10.0, 0.1)
    level = np.zeros(100)
    # At 1 s it still settles; 4.0 and 4.4 s are one, 5.0 s is another; what is not known is none.
    level[[10, 40, 44, 50]] = [9.0, 2.0, 3.0, 1.5]
    level[80] = np.nan
    found = events(t, level)
    assert [(round(e.start, 6), round(e.stop, 6)) for e in found] == [(4.0, 4.4), (5.0, 5.0)]
