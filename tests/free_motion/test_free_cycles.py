"""Which cycles are taken to be free: the one with the least residual, and those like it."""

from collections.abc import Callable

import numpy as np
import pytest

from vftcli.free_motion.cycles import Cycles, FreeCycles, find_free_cycles, pair_with_cycle
from vftcli.robots.run import Run
from vftcli.signals.errors import ReferenceTorqueError

T = 0.01 * np.arange(1200)

CYCLES = Cycles(period=4.0, begin=0.0, end=12.0)
"""Three whole ones."""

Make = Callable[..., Run]


@pytest.fixture
def pushed(drive_of: Make) -> Callable[..., Run]:
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
def test_all_cycles_without_a_push_are_free(
    pushed: Callable[..., Run], instants: tuple[float, ...], free: tuple[int, ...]
) -> None:
    found = find_free_cycles(pushed(*instants), CYCLES)
    assert found.numbers == free
    assert found.residuals is not None
    # 5 N·m for half a second against noise of 0.1 N·m that is low-passed at 5 Hz: 40 times.
    assert np.all((found.residuals > 10.0) == ~np.isin(np.arange(3), free))


def test_of_cycles_that_are_all_alike_the_last_is_left_to_be_compared(
    pushed: Callable[..., Run],
) -> None:
    assert find_free_cycles(pushed(), CYCLES._replace(end=8.0)).numbers == (0,)
    assert find_free_cycles(pushed(), CYCLES._replace(end=6.5)).numbers == (0,)  # the only one
    # The low-pass leaves .066 of the two cycles' √2 · .1 N·m: √(.06² + .066²) is within 1.5 of it.
    for offset, free in ((0.0, (0, 1)), (0.06, (0, 1)), (0.09, (0, 2))):
        assert find_free_cycles(pushed(offset=offset), CYCLES).numbers == free
    residuals = find_free_cycles(pushed(), CYCLES).residuals
    np.testing.assert_allclose(residuals, 1.0, atol=0.5)  # noise alone


def test_a_log_shorter_than_a_cycle_has_no_free_one(pushed: Callable[..., Run]) -> None:
    with pytest.raises(ReferenceTorqueError, match=r"no whole cycle of 13 s.*--free"):
        find_free_cycles(pushed(), Cycles(period=13.0, begin=0.0, end=12.0))


def test_a_cycle_in_a_gap_is_not_free_and_the_others_are_judged(
    pushed: Callable[..., Run],
) -> None:
    with_gap = pushed(t=T + 40.0 * (T >= 6.0))
    found = find_free_cycles(with_gap, Cycles(period=4.0, begin=0.0, end=52.0))
    assert found.residuals is not None
    assert set(np.flatnonzero(np.isfinite(found.residuals))) == {0, 1, 11, 12}
    assert set(found.numbers) <= {0, 1, 11, 12}


def test_of_many_free_cycles_eight_are_laid_under_the_others_from_the_first_to_the_last() -> None:
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
def test_a_cycle_is_laid_under_all_others_and_not_under_itself(
    pushed: Callable[..., Run], free: int
) -> None:
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


def test_an_instant_behind_the_last_cycle_or_before_the_first_is_in_none() -> None:
    cycles = CYCLES._replace(begin=1.0, end=11.0)
    number = cycles.number(np.array([0.99, 1.0, 4.99, 5.0, 10.99, 11.01]))
    assert number.tolist() == [-1, 0, 0, 1, 2, -1]
