"""Moving-block bootstrap: block lengths, coverage, and paired differences."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import stdtrit

from vftcli.evaluation.errors import evaluate
from vftcli.evaluation.intervals import (
    Resampled,
    block_lengths,
    correlation_time,
    interval,
    p_value,
    paired_significance,
    resample,
    student_quantile,
)
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import ExternalTorque

STEP = 0.008


def drawn_from(squares: Array) -> Resampled:
    """Draws in the longest blocks that a column asks for."""
    return resample(squares, int(block_lengths(squares).max()))


def autoregressive(rng: np.random.Generator, samples: int, decay: float) -> Array:
    """x_t = decay·x_{t−1} + noise, of unit variance, settled."""
    noise = np.sqrt(1.0 - decay**2) * rng.standard_normal(samples + 2000)
    return np.asarray(lfilter([1.0], [1.0, -decay], noise)[2000:])


def estimation_error(rng: np.random.Generator, samples: int) -> Array:
    """What a first-order observer (K = 10 1/s) misses of random pushes, noise included. [N·m]

    Pushes of 0.14 to 1.2 s come at random, 0.9 a second, of 6 to 20 N·m either way.
    """
    count = samples + 600
    t = STEP * np.arange(count)
    tau = np.zeros(count)
    for _ in range(rng.poisson(0.9 * t[-1])):
        start, length = rng.uniform(0.0, t[-1]), rng.uniform(0.14, 1.2)
        size = 20.0 * rng.uniform(0.3, 1.0) * rng.choice([-1, 1])
        pushed = (t >= start) & (t < start + length)
        tau[pushed] += size * np.sin(np.pi * (t[pushed] - start) / length) ** 2
    a = 10.0 * STEP / 2.0
    seen = lfilter([a / (1 + a)] * 2, [1.0, -(1 - a) / (1 + a)], tau + rng.standard_normal(count))
    return np.asarray((seen - tau)[600:])


def test_blocks_follow_the_memory() -> None:
    """Five correlation times, of 10 to 300 blocks: docs/compare.md."""
    rng = np.random.default_rng(1)
    white = rng.standard_normal((30_000, 1)) ** 2
    assert block_lengths(white) == 100
    assert block_lengths(white[:29_999]) == 100
    slow = np.repeat(rng.standard_normal((30, 1)) ** 2, 100, axis=0)
    assert block_lengths(slow) == 300
    middle = np.repeat(rng.standard_normal((600, 1)) ** 2, 10, axis=0)
    assert block_lengths(middle) == np.ceil(5.0 * correlation_time(middle))
    assert block_lengths(np.ones((5, 1))) == 1


def ring(squares: Array, length: int) -> Array:
    """Means of blocks that are drawn from the series closed to a ring, sample by sample. (B, m)"""
    blocks = round(len(squares) / length)
    starts = np.random.default_rng(20250811).integers(0, len(squares), (1000, blocks))
    inside = (starts[..., None] + np.arange(length)) % len(squares)
    return np.asarray(squares[inside].mean(axis=(1, 2)))


@pytest.mark.parametrize(("length", "blocks"), [(1, 30), (7, 4), (8, 4), (30, 1)])
def test_draws_are_means_of_blocks_of_the_ring(length: int, blocks: int) -> None:
    squares = np.random.default_rng(9).standard_normal((30, 2)) ** 2
    found = resample(squares, length)
    assert found.blocks == blocks
    np.testing.assert_allclose(found.draws, ring(squares, length), rtol=1e-9)


def test_a_pair_s_interval_is_of_the_differences_drawn() -> None:
    """White errors of 900 samples: blocks of a 300th; the 2.5 % and 97.5 % of 1000 draws."""
    first, second = np.random.default_rng(4).standard_normal((2, 900))
    row = paired_significance("log", *pair(first, 1.1 * second)).row(0, named=True)
    squares = np.column_stack([first, 1.1 * second]) ** 2
    gap = -np.diff(np.sqrt(ring(squares, int(block_lengths(squares).max()))))[:, 0]
    assert (row["low_Nm"], row["high_Nm"]) == pytest.approx(np.percentile(gap, [2.5, 97.5]))
    assert row["difference_Nm"] == pytest.approx(-np.diff(np.sqrt(squares.mean(axis=0)))[0])
    assert row["p"] == pytest.approx(2.0 * min(np.mean(gap > 0), np.mean(gap <= 0)))


def test_an_interval_does_not_depend_on_who_else_is_asked() -> None:
    rng = np.random.default_rng(7)
    t = STEP * np.arange(4000)
    quick, slow = (autoregressive(rng, 4000, decay)[:, None] for decay in (0.5, 0.99))
    zero = ExternalTorque(name="zero", t=t, tau=np.zeros((4000, 1)))
    both = [ExternalTorque(name=name, t=t, tau=x) for name, x in (("q", quick), ("s", slow))]
    ends = ["rmse_low_Nm", "rmse_high_Nm"]
    alone = evaluate("log", both[:1], zero).select(ends).row(0)
    assert evaluate("log", both, zero).select(ends).row(0) == alone


def pair(first: Array, second: Array) -> tuple[list[ExternalTorque], ExternalTorque]:
    t, named = STEP * np.arange(len(first)), {"fdo": first, "gmo": second, "zero": 0.0 * first}
    *made, zero = (ExternalTorque(name=n, t=t, tau=tau[:, None]) for n, tau in named.items())
    return made, zero


def test_a_difference_is_sure_where_the_draws_are_paired() -> None:
    """Errors that differ by 2 % of themselves, independent ones of one process, and equal ones."""
    error = estimation_error(np.random.default_rng(4), 3000)
    row = paired_significance("log", *pair(error, 1.02 * error)).row(0, named=True)
    assert row["difference_Nm"] < 0
    assert row["high_Nm"] < 0
    assert row["p"] <= 0.002
    rng = np.random.default_rng(5)
    lucky = (autoregressive(rng, 3000, 0.95) for _ in range(2))
    row = paired_significance("log", *pair(*lucky)).row(0, named=True)
    assert row["p"] > 0.05
    assert row["low_Nm"] < 0 < row["high_Nm"]
    twice = paired_significance("log", *pair(error, error * (1.0 + 1e-13)))
    assert twice["p"].item() == 1.0


@pytest.mark.statistical
@pytest.mark.parametrize("samples", [1000, 2000, 8000])
def test_intervals_cover_the_true_rmse(samples: int) -> None:
    """Required: 90 to 98 % of 200 repetitions; 400 are drawn so that chance is ±2.2 %."""
    rng = np.random.default_rng(7)
    true = np.sqrt(np.mean([np.mean(estimation_error(rng, samples) ** 2) for _ in range(2000)]))
    covered = 0
    for _ in range(400):
        squares = estimation_error(rng, samples)[:, None] ** 2
        drawn = drawn_from(squares)
        low, high = interval(float(squares.mean()), drawn.draws[:, 0], drawn.blocks)
        covered += low <= true <= high
    assert 0.90 <= covered / 400 <= 0.98


def test_an_interval_is_students_of_its_blocks() -> None:
    """Five blocks: t of four degrees of freedom, 2.7764 (tables), times √(5/4), times the scatter.

    Draws of mean square 4 with a standard deviation of .2: h = 2.7764·1.1180·.2/4 = .15520.
    """
    draws = np.tile([3.8, 4.2], 500)
    low, high = interval(4.0, draws, 5)
    half = 2.7764 * np.sqrt(5.0 / 4.0) * 0.2 / 4.0
    assert low == pytest.approx(2.0 * np.exp(-half / 2.0), rel=1e-4)
    assert high == pytest.approx(2.0 / np.sqrt(1.0 - half), rel=1e-4)
    assert np.isnan(interval(4.0, draws, 1)).all()
    assert np.isfinite(interval(4.0, draws, 2)).all()
    assert np.isnan(interval(0.0, 0.0 * draws, 5)).all()  # a perfect estimate
    # An upper end is at most five times the RMSE.
    wide = interval(4.0, np.tile([0.0, 40.0], 500), 3)
    assert wide[1] == pytest.approx(2.0 / np.sqrt(0.04))


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.99, 0.9995])
@pytest.mark.parametrize("count", [30, 3000, 20_000])
def test_a_correlation_time_by_blocks_is_that_of_the_whole(memory: float, count: int) -> None:
    """Of one transform of the whole series, whichever of the growing numbers of lags is enough."""
    noise = np.random.default_rng(8).standard_normal((count, 2))
    x = lfilter([1.0], [1.0, -memory], noise, axis=0)
    centred = x - x.mean(axis=0)
    spectrum = np.abs(np.fft.rfft(centred, 2 * count, axis=0)) ** 2
    product = np.fft.irfft(spectrum, axis=0)[: count // 2]
    expected = []
    for rho in (product / product[0]).T:
        fallen = np.flatnonzero(rho < 0.05)
        end = int(fallen[0]) if len(fallen) else len(rho)
        expected.append(max(1.0, 2.0 * float(np.sum(rho[:end])) - 1.0))
    # rounding of two ways of summing up to 10 000 correlations
    np.testing.assert_allclose(correlation_time(x), expected, rtol=1e-9)


@pytest.mark.parametrize("freedom", [1, 2, 3, 9, 30, 299])
@pytest.mark.parametrize("p", [0.6, 0.9, 0.975, 0.995])
def test_students_quantile_is_scipys(p: float, freedom: int) -> None:
    # 1e-10: Newton's steps end at the rounding of the quadrature, 1e-12 here.
    assert student_quantile(p, freedom) == pytest.approx(stdtrit(freedom, p), rel=1e-10)


# Pairs of observers: every pair once, its sign, and p between its bounds


TIMES = 0.01 * np.arange(500)


def estimate(name: str, *errors: np.ndarray) -> ExternalTorque:
    return ExternalTorque(name=name, t=TIMES, tau=np.column_stack(errors))


def test_every_pair_of_observers_on_every_joint() -> None:
    rng = np.random.default_rng(0)
    three = [estimate(n, *rng.standard_normal((2, 500))) for n in ("a", "b", "c")]
    table = paired_significance("log", three, estimate("zero", *np.zeros((2, 500))))
    pairs = list(zip(table["joint"], table["observer"], table["other"], strict=True))
    assert pairs == [(j, *pair) for j in (1, 2) for pair in (("a", "b"), ("a", "c"), ("b", "c"))]
    for row in table.iter_rows(named=True):
        assert row["low_Nm"] < row["high_Nm"]
        assert 1e-3 <= row["p"] <= 1.0


def test_a_joint_without_two_known_samples_has_no_row() -> None:
    unknown = np.full(500, np.nan)
    unknown[3] = 1.0
    two = [estimate(n, *np.ones((2, 500))) for n in ("a", "b")]
    table = paired_significance("log", two, estimate("z", unknown, np.zeros(500)))
    assert table["joint"].to_list() == [2]


def test_p_is_two_sided_and_draws_within_a_billionth_are_one_number() -> None:
    """Above in 3 of 100 paired draws: p = .06 either way round."""
    first, second = np.ones(100), np.full(100, 2.0)
    first[:3] = 3.0
    assert [p_value(first, second), p_value(second, first)] == pytest.approx([0.06, 0.06])
    first = np.linspace(1.0, 3.0, 500)  # of mean 2
    for apart, p in ((0.0, 1.0), (0.9e-9, 1.0), (1.1e-9, 1.0 / 500)):
        assert p_value(first, first + 2.0 * apart) == p
        assert p_value(first + 2.0 * apart, first) == p
