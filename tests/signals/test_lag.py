"""Lags: found again where they are known, and equal to the plainest search for them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vftcli.signals.lag import LEAD, LONGEST, LagFit, lag_fit, lags_of_each, peak, time_offset

SEEDS = st.integers(0, 2**32 - 1)


def waves(t: np.ndarray) -> np.ndarray:
    return np.column_stack([np.sin(2.0 * t), np.sin(3.3 * t + 1.0)])


@pytest.mark.parametrize("lag", [-0.123, 0.0, 0.05, 0.3])
def test_lags_and_offsets_have_one_sign_and_are_found_below_the_sample_time(lag: float) -> None:
    """The late series first: column by column and together."""
    t = np.arange(0, 12, 0.01)
    late, early = waves(t - lag), waves(t)
    # a parabola through a band-limited peak; the ends, which do not overlap, pull a sine's by up
    # to a fifth of the 10 ms step
    np.testing.assert_allclose(lags_of_each([late], early, 0.01)[0], lag, atol=2e-3)
    found, correlation = time_offset(t, late, early)
    assert found == pytest.approx(lag, abs=2e-3)
    assert correlation > 0.99
    samples = lag_fit(late, early, 0.3).closest
    assert 0.01 * samples == pytest.approx(lag, abs=0.005)  # half a step


def test_an_uneven_clock_and_unknown_samples_do_not_move_an_offset() -> None:
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.004, 0.012, 1500))
    late = np.where(rng.random((1500, 2)) < 0.2, np.nan, waves(t - 0.05))
    # bridges of a few samples of 8 ms over waves of 2 s
    assert time_offset(t, late, waves(t))[0] == pytest.approx(0.05, abs=2e-3)


@given(SEEDS)
def test_the_closest_lag_is_that_of_a_plain_search(seed: int) -> None:
    rng = np.random.default_rng(seed)
    early = np.cumsum(rng.standard_normal((int(rng.integers(10, 40)), 2)), axis=0)
    late = np.cumsum(rng.standard_normal((int(rng.integers(10, 40)), 2)), axis=0)
    least = max(2, int(0.3 * min(len(late), len(early))))
    squares = {}
    for lag in range(-(len(early) - 1), len(late)):
        pairs = [(i + lag, i) for i in range(len(early)) if 0 <= i + lag < len(late)]
        if len(pairs) >= least:
            squares[lag] = np.mean([np.sum((late[a] - early[b]) ** 2) for a, b in pairs])
    best = min(squares.values())
    # The FFT's rounding may choose among lags that are equally good.
    assert squares[int(lag_fit(late, early, 0.3).closest)] == pytest.approx(best, rel=1e-9)


@given(SEEDS)
def test_the_offset_is_that_of_the_best_normalised_correlation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    step, count = 0.125, 40
    t = step * np.arange(count)
    late, early = np.cumsum(rng.standard_normal((2, count, 3)), axis=1)
    x, y = late - late.mean(axis=0), early - early.mean(axis=0)
    value = {}
    for lag in range(-4, 5):
        a, b = x[max(lag, 0) : count + min(lag, 0)], y[max(-lag, 0) : count - max(lag, 0)]
        value[lag] = np.sum(a * b) / np.sqrt(np.sum(a**2) * np.sum(b**2))
    found, correlation = time_offset(t, late, early)
    assert correlation == pytest.approx(max(value.values()), rel=1e-9)
    assert abs(found / step - max(value, key=lambda lag: value[lag])) <= 0.5


def test_rivals_of_the_closest_lag_are_valleys_that_overlap_longer() -> None:
    """Valleys at −3, −1, 1 and 3, the last the deepest; the longest overlap comes first."""
    difference = np.array([9.0, 1.0, 9.0, 3.0, 9.0, 2.0, 9.0, 0.5, 9.0])
    overlap = np.array([5, 7, 8, 9, 10, 9, 8, 6, 5])
    fit = LagFit(np.arange(-4, 5), difference, overlap)
    assert fit.closest == 3.0
    assert fit.rivals(2.5) == [1.0, -3.0]
    assert fit.rivals(3.0) == [-1.0, 1.0, -3.0]
    assert fit._replace(overlap=overlap[::-1]).rivals(2.5) == [1.0]  # −3 overlaps less, 6 < 7


@pytest.mark.parametrize(
    ("lag", "found"), [(0.9, 0.9), (1.1, np.nan), (-0.1, -0.1), (-0.3, np.nan)]
)
def test_a_delay_is_looked_for_up_to_a_second_and_a_lead_up_to_a_fifth(lag, found):
    """White noise is like itself at its own delay alone."""
    early = np.random.default_rng(4).standard_normal((1000, 1))
    assert np.isnan(lags_of_each([early], 0.0 * early, 0.01)[0, 0])  # nothing fits noise
    late = np.roll(early, round(lag / 0.01), axis=0)
    # Beside the peak of 1 two correlations of about 1/√1000 pull it by a hundredth of a sample.
    assert lags_of_each([late], early, 0.01)[0, 0] == pytest.approx(found, abs=5e-4, nan_ok=True)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("samples", "lag", "found"), [(43, 10, 1), (43, 11, 0), (7, 1, 1), (7, 2, 0)]
)
def test_a_lag_is_looked_for_within_a_quarter_of_a_short_log(samples, lag, found, sign) -> None:
    early = np.random.default_rng(4).standard_normal((samples, 1))
    (value,) = lags_of_each([np.roll(early, sign * lag, axis=0)], early, 0.01)[0]
    assert (abs(value / 0.01 - sign * lag) < 0.5) == found


def whole_lags(late: np.ndarray, early: np.ndarray, step: float) -> np.ndarray:
    """As `lags_of_each`, by plain sums over all samples at every lag."""
    count, found = len(late), []
    first = -min(round(LEAD / step), count // 4)
    last = max(1, min(round(LONGEST / step), count // 4))
    for column, other in zip(late.T, early.T, strict=True):
        known = np.isfinite(column) & np.isfinite(other)
        x, y = (np.where(known, z - z[known].mean(), 0.0) for z in (column, other))
        fit = []
        for lag in range(first - 1, last + 2):
            later = slice(max(lag, 0), count + min(lag, 0))
            earlier = slice(max(-lag, 0), count - max(lag, 0))
            a, b, both = x[later], y[earlier], known[later] & known[earlier]
            power = np.sum(a[both] ** 2) * np.sum(b[both] ** 2)
            fit.append(np.sum(a * b) / np.sqrt(power) if power > 0 else 0.0)
        found.append(step * (first - 1 + peak(np.array(fit))))
    return np.array(found)


@pytest.mark.parametrize("unknown", [0.0, 0.1])
@pytest.mark.parametrize(
    ("count", "step"),
    [(40, 0.1), (9000, 0.008), pytest.param(20_000, 0.001, marks=pytest.mark.slow)],
)
def test_lags_by_blocks_are_those_of_plain_sums(count: int, step: float, unknown: float) -> None:
    rng = np.random.default_rng(5)
    early = np.cumsum(rng.standard_normal((count, 2)), axis=0)
    late = np.roll(early, 3, axis=0) + rng.standard_normal((count, 2))
    late[rng.random((count, 2)) < unknown] = np.nan
    other = np.where(rng.random((count, 2)) < unknown, np.nan, early)
    found = lags_of_each([late, other], early, step)
    for lag, series in zip(found, (late, other), strict=True):
        # rounding of sums of 20 000 products, through the bend of the parabola
        np.testing.assert_allclose(lag, whole_lags(series, early, step), atol=1e-9)
