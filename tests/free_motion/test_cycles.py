"""The period, the cycles, and one clear line for each log that has none."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from sound_logs import UR10E

from vftcli.free_motion.cycles import (
    Cycles,
    FreeCycles,
    Period,
    find_free_cycles,
    find_period,
    moving_part,
    pair_with_cycle,
    segment,
)
from vftcli.readers.reading import read
from vftcli.robots.run import Run
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.recording import Recording

WITHIN = 2e-4  # Required: the period to 0.02 %.


@pytest.mark.parametrize(
    "made",
    [
        *({"period": p, "rate": r} for p in (1.234, 3.7, 4.012) for r in (30.0, 125.0, 1000.0)),
        # Pushes as a soft servo gives way, three times those of the paper's arm. [rad]
        *({"push": push, "cycles": 5.0, "rate": 125.0} for push in (0.02, 0.05)),
    ],
)
def test_period_below_the_sample_time(repeated, made):
    found = find_period(repeated(**made))
    assert found.seconds == pytest.approx(made.get("period", 3.7), rel=WITHIN)


def test_a_last_cycle_that_lacks_a_few_samples_is_whole():
    for cycles, whole in ((2.971, 3), (2.969, 2), (-0.25, 0)):
        assert Cycles(period=4.0, begin=1.0, end=1.0 + 4.0 * cycles).whole == whole


def test_less_than_a_cycle_and_a_part_of_the_next(repeated):
    log = repeated(cycles=0.8)
    said = "only 2.96 s of the motion repeat, less than the period of 3.7 s; give a free run"
    with pytest.raises(ReferenceTorqueError, match=said):
        segment(replace(log, t=log.t + 10.0), Period(3.7, 0.0))


def test_all_cycles_together_refine_the_period(repeated):
    """Ten cycles of 370 samples, 2 mrad of noise: twice the Cramér–Rao bound, 7 µs.

    σ_P² = 12 σ²/(M (M² − 1) Σ dq²) of M cycles; one cycle beside the next tells 26 µs.
    """
    bound, missed = np.sqrt(12.0 / (10.0 * 99.0 * 370.0 * 2.59)) * 2e-3, []
    for seed in range(4):
        log = repeated(cycles=10.3)
        noise = 2e-3 * np.random.default_rng(seed).standard_normal(log.q.shape)
        missed.append(find_period(replace(log, q=log.q + noise), 3.71).seconds - 3.7)
    assert np.sqrt(np.mean(np.square(missed))) < 2.0 * bound


@pytest.mark.parametrize("turned", [1, -1])
def test_a_place_crossed_by_accident_begins_no_cycle(repeated, turned):
    """A way in 1 rad beside the path until 3 s, on it for .3 s at 1 s: .3 of .75 cycles."""
    log = repeated(cycles=4.0)
    beside = (log.t < 3.0) & ~((log.t > 1.0) & (log.t < 1.3))
    off = log.q + beside[:, None]
    cycles = segment(replace(log, q=off[::turned], dq=None), Period(3.7, 0.0))
    edge = cycles.begin if turned == 1 else log.t[-1] - cycles.end
    assert edge == pytest.approx(3.0, abs=0.02)


def test_way_in_rests_and_start_amid_a_cycle(repeated):
    log = repeated(approach=2.0, hold=1.0, start=1.3, cycles=3.4)
    period = find_period(log)
    cycles = segment(log, period)
    assert period.seconds == pytest.approx(3.7, rel=WITHIN)
    assert cycles.whole == 3
    # From the end of the way in, 3 s, less the last moments of it, which are within 0.1 rad.
    assert 2.5 <= cycles.begin <= 3.0
    assert cycles.end == pytest.approx(3.0 + 3.4 * 3.7, abs=0.1)


def test_one_and_a_third_cycles_are_enough(repeated):
    log = repeated(cycles=1.33)
    cycles = segment(log, find_period(log))
    assert cycles.whole == 1
    assert cycles.period == pytest.approx(3.7, rel=1e-3)  # one overlap of 1.2 s, 50 µrad noise


@pytest.mark.parametrize(
    ("stated", "seconds"),
    # 3.7 s is just beyond the 3 % around 3.58 s: the deepest place of these is its slope.
    [(7.4, 7.4), (3.75, 3.7), (3.58, 3.7)],
)
def test_the_stated_period_decides_between_multiples(repeated, stated, seconds):
    assert find_period(repeated(), stated).seconds == pytest.approx(seconds, abs=1e-4)


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        (100.0, "does not fit into the 14.79 s"),
        (14.0, "more than one cycle"),
        (0.039, r"shorter than four samples \(0\.01 s each\); .* in seconds"),
        (3.0, "no repetition found near 3 s"),
        (0.05, "no repetition found near 0.05 s"),
    ],
)
def test_impossible_periods(repeated, stated, message):
    with pytest.raises(ReferenceTorqueError, match=message):
        find_period(repeated(), stated)


def resized(log, size):
    """Positions of which the joint that moves most moves by so much. [rad]"""
    return {"q": size / np.ptp(log.q, axis=0).max() * log.q}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        # Six joints wander off by 20 mrad/s: √6 · 20 mrad/s · 3.7 s = .18 rad a period.
        (
            lambda log: {"q": log.q + 0.02 * log.t[:, None]},
            r"after 3\.[67]\d* s, .* 0\.18 rad.*--free",
        ),
        # A jump of the clock by 10⁶ s: an even series over it would hold 10⁸ samples.
        (lambda log: {"t": log.t + 1e6 * (log.t > 7.4)}, r"is a gap, .* leave the gap out"),
        (lambda log: {"q": 0.0 * log.q, "dq": 0.0 * log.q}, "does not move"),
        (lambda log: resized(log, 0.0099), "does not move"),  # 1 cm at an arm's length of a metre
        (lambda log: {k: getattr(log, k)[:7] for k in ("t", "q", "dq")}, "7 samples are too few"),
    ],
)
def test_a_log_without_a_period_is_refused(repeated, changes, said):
    log = repeated()
    with pytest.raises(ReferenceTorqueError, match=said):
        find_period(replace(log, **changes(log)))
    moving_part(replace(log, **resized(log, 0.0101)))


def test_sweeps_of_a_real_arm_are_no_repetition(logs):
    """Single-joint sweeps come back nearly, at another speed each time."""
    log = read(logs / "ur10e" / "jointwise_2.csv", columns=UR10E)
    with pytest.raises(ReferenceTorqueError, match="no repetition"):
        find_period(log)


@pytest.mark.parametrize("stated", [12.4, 12.5, 12.55])
def test_a_stated_period_near_the_end_of_the_log(repeated, stated):
    """The longest that is allowed, .85 of what moves: one lag is left to look at, and it is."""
    log = repeated(period=12.5, cycles=14.78 / 12.5)
    assert find_period(log, stated).seconds == pytest.approx(12.5, rel=1e-3)  # 2.3 s overlap


def test_a_clock_of_bursts_leaves_no_lag_to_look_at():
    """Eleven samples, half of them at once: six steps of the median, too few for a period."""
    t = np.concatenate([1e-4 * np.arange(5), 0.1 + 0.1 * np.arange(6)])
    q = np.outer(np.sin(20.0 * t), np.ones(6))
    log = Recording(t=t, q=q, dq=np.ones_like(q))
    with pytest.raises(ReferenceTorqueError, match="no repetition found"):
        find_period(log)


def test_positions_alone_tell_where_the_arm_rests(repeated):
    """Rests of 1 s before and after 4 cycles of 3.7 s; velocities are differences along time."""
    log = repeated(hold=1.0)
    t, q = moving_part(replace(log, dq=None))
    # A joint counts as standing from 0.1 s before its rest to 0.1 s after it.
    assert (t[0], t[-1]) == (pytest.approx(1.1, abs=0.03), pytest.approx(15.7, abs=0.03))
    np.testing.assert_array_equal(q, moving_part(log)[1])


T = 0.01 * np.arange(1200)

CYCLES = Cycles(period=4.0, begin=0.0, end=12.0)  # Three whole ones.

MakesRun = Callable[..., Run]


@pytest.fixture
def pushed(drive_of: MakesRun) -> Callable[..., Run]:
    """Two joints that swing every 4 s with 0.1 N·m of noise, pushed by 5 N·m at some instants."""

    def make(*instants: float, t: np.ndarray = T, offset: float = 0.0) -> Run:
        phase = 0.5 * np.pi * T[:, None] + np.array([0.0, 1.0])
        torque = 0.1 * np.random.default_rng(2).standard_normal((len(T), 2))
        for instant in instants:
            torque -= 5.0 * np.exp(-(((T - instant) / 0.3) ** 2))[:, None]
        torque[(T >= 4.0) & (T < 8.0)] -= offset
        return drive_of(t, np.sin(phase), 0.5 * np.pi * np.cos(phase), drive_torque=torque)

    return make


@pytest.mark.parametrize(
    ("instants", "free"),
    [
        ((2.0,), (1, 2)),
        ((6.0,), (0, 2)),
        ((10.0,), (0, 1)),
        ((2.0, 6.0), (2,)),
        ((6.0, 10.0), (0,)),
    ],
)
def test_all_cycles_without_a_push_are_free(pushed, instants, free):
    found = find_free_cycles(pushed(*instants), CYCLES)
    assert found.numbers == free
    # 5 N·m for half a second against noise of 0.1 N·m that is low-passed at 5 Hz: 40 times.
    assert np.all((found.residuals > 10.0) == ~np.isin(np.arange(3), free))


def test_of_cycles_that_are_all_alike_the_last_is_left_to_be_compared(pushed):
    assert find_free_cycles(pushed(), CYCLES._replace(end=8.0)).numbers == (0,)
    assert find_free_cycles(pushed(), CYCLES._replace(end=6.5)).numbers == (0,)  # the only one
    # The low-pass leaves .066 of the two cycles' √2 · .1 N·m: √(.06² + .066²) is within 1.5 of it.
    for offset, free in ((0.0, (0, 1)), (0.06, (0, 1)), (0.09, (0, 2))):
        assert find_free_cycles(pushed(offset=offset), CYCLES).numbers == free
    residuals = find_free_cycles(pushed(), CYCLES).residuals
    np.testing.assert_allclose(residuals, 1.0, atol=0.5)  # noise alone


def test_a_log_shorter_than_a_cycle_has_no_free_one(pushed):
    with pytest.raises(ReferenceTorqueError, match=r"no whole cycle of 13 s.*--free"):
        find_free_cycles(pushed(), Cycles(period=13.0, begin=0.0, end=12.0))


def test_a_cycle_in_a_gap_is_not_free_and_the_others_are_judged(pushed):
    with_gap = pushed(t=T + 40.0 * (T >= 6.0))
    found = find_free_cycles(with_gap, Cycles(period=4.0, begin=0.0, end=52.0))
    assert set(np.flatnonzero(np.isfinite(found.residuals))) == {0, 1, 11, 12}
    assert set(found.numbers) <= {0, 1, 11, 12}


def test_of_many_free_cycles_eight_are_laid_under_the_others_from_the_first_to_the_last():
    many = FreeCycles(tuple(range(3, 62)), None)
    assert many.drawn == (3, 11, 20, 28, 36, 44, 53, 61)  # 58/7 cycles apart, rounded
    given, remark = many.remarks(64)
    assert (given.code, given.values["whole"]) == ("free-cycles-given", 64)
    assert list(given.values["cycles"]) == list(range(4, 63))
    assert list(remark.values["cycles"]) == [4, 12, 21, 29, 37, 45, 54, 62]
    assert (remark.code, remark.values["free"]) == ("free-cycles-drawn", 59)
    assert remark.values["wider"] == pytest.approx(
        0.0518, abs=1e-4
    )  # √((1 + 1/8)/(1 + 1/59)) − 1
    (one,) = FreeCycles((2,), np.array([1.5, np.inf, 1.0])).remarks(3)
    assert (one.code, list(one.values["residuals"])) == ("free-cycles-found", [1.5, 1.0])
    for count in (3, 8):
        few = FreeCycles(tuple(range(count)), None)
        assert (few.drawn, len(few.remarks(9))) == (few.numbers, 1)


@pytest.mark.parametrize("free", [0, 1, 2])
def test_a_cycle_is_laid_under_all_others_and_not_under_itself(pushed, free):
    # By 4.1 s an instant 2 to 2.05 s from the middle of a cycle has no partner in it.
    for period in (4.0, 4.1):
        pairing = pair_with_cycle(pushed(), CYCLES, free, period)
        own = CYCLES.number(T) == free
        assert not pairing.known[own].any()
        assert pairing.known[~own].mean() > 0.96
        away = (T[pairing.known] - pairing.times[pairing.known]) / period
        np.testing.assert_allclose(away, np.rint(away), atol=1e-9)
        first, last = CYCLES.span(free)
        partners = pairing.times[pairing.known]
        assert np.all((partners >= first) & (partners <= last))


def test_an_instant_behind_the_last_cycle_or_before_the_first_is_in_none():
    cycles = CYCLES._replace(begin=1.0, end=11.0)
    number = cycles.number(np.array([0.99, 1.0, 4.99, 5.0, 10.99, 11.01]))
    assert number.tolist() == [-1, 0, 0, 1, 2, -1]
