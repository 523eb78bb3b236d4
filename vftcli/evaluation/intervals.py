"""Confidence intervals of an RMSE of correlated errors: block bootstrap.

Paired draws show whether one observer is better than another or was lucky.
"""

from collections.abc import Sequence
from functools import cache
from itertools import combinations
from math import lgamma
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.signals.arrays import Array, Indices, root_mean_squares
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.lag import sliding

REPETITIONS = 1000  #: Bootstrap repetitions; 25 of them lie beyond each end.
SEED = 20250811  #: Seed of every bootstrap: a log has one interval.
#: Most blocks in a repetition: more only cost time.
MOST_BLOCKS = 300
#: Fewest blocks in a repetition, whatever the correlation.
LEAST_BLOCKS = 10
MEMORY = 5.0  #: Length of a block in correlation times of the squared error.
#: Largest share subtracted: the upper end of an interval is at most five times the RMSE.
WIDEST = 0.96
#: Of Student's quantile: 1e-12 of it from 1 to 1000 degrees.
QUADRATURE, NEWTON_STEPS = 48, 12
FIRST_LAGS = 1024  #: First lags of an autocorrelation. [samples]
#: Columns of the significance table: RMSE less that of `other`, 95 % interval, p.
SIGNIFICANCE: dict[str, type[pl.DataType]] = {
    "recording": pl.String,
    "joint": pl.Int64,
    "observer": pl.String,
    "other": pl.String,
    "difference_Nm": pl.Float64,
    "low_Nm": pl.Float64,
    "high_Nm": pl.Float64,
    "p": pl.Float64,
}
SAME = 1e-9  #: RMSEs closer than this share are one number.


class Resampled(NamedTuple):
    """Mean squares of resampled errors."""

    draws: Array  #: One mean square a repetition and column. (B, m)
    blocks: int  #: Blocks in a repetition, the number of independent pieces.


def resample(squares: Array, length: int) -> Resampled:
    """Moving-block bootstrap draws of the means of squared errors. (T, m) [(N·m)²]

    Blocks of `MEMORY` correlation times (`block_lengths`), all columns' `length` [samples],
    are drawn with replacement from the series closed to a ring, so that every sample counts
    alike (Politis and Romano's circular variant of Künsch's moving blocks).
    """
    samples = len(squares)
    blocks = max(1, round(samples / length))
    starts = np.random.default_rng(SEED).integers(0, samples, (REPETITIONS, blocks))
    picked = np.zeros((REPETITIONS, squares.shape[1]))
    for column, x in enumerate(squares.T):
        total = np.concatenate([[0.0], x, x[: length - 1]]).cumsum()
        sums = total[length:] - total[:-length]
        picked[:, column] = sums[starts].sum(axis=1) / (blocks * length)
    return Resampled(picked, blocks)


def block_lengths(squares: Array) -> Indices:
    """Block length per column: `MEMORY` correlation times. (m,) [samples]"""
    samples = len(squares)
    longest = max(1, samples // LEAST_BLOCKS)
    shortest = min(longest, max(1, -(-samples // MOST_BLOCKS)))
    wanted = np.ceil(MEMORY * correlation_time(squares)).astype(int)
    return wanted.clip(shortest, longest)


def correlation_time(x: Array) -> Array:
    """Autocorrelation's integral up to its first value below 0.05. (m,) [samples]

    1 for white noise. Lags: `FIRST_LAGS`, then fourfold until every column has fallen, to at
    most half of the log.
    """
    most = max(len(x) // 2, 1)
    columns = np.ascontiguousarray((x - x.mean(axis=0)).T)
    count = 0
    while count < most:
        count = min(4 * count or FIRST_LAGS, most)
        product = sliding(columns, columns, np.arange(count)).T
        rho = product / np.where(product[0] > 0, product[0], 1.0)
        fallen = rho < 0.05
        if fallen.any(axis=0).all():
            break
    end = np.where(fallen.any(axis=0), fallen.argmax(axis=0), count)
    inside = np.arange(count)[:, None] < end
    time: Array = 2.0 * np.where(inside, rho, 0.0).sum(axis=0) - 1.0
    return np.maximum(time, 1.0)


def interval(mean_square: float, draws: Array, blocks: int) -> tuple[float, float]:
    """95 % interval of an RMSE from bootstrap draws of its mean square. [N·m]

    The scatter of a mean square is a share of the true value. With h, that share times
    Student's quantile for the number of blocks, the true value is at most observed/(1 − h),
    at least observed·e^{−h}: in the logarithm, as the mean square is skewed.
    """
    if not mean_square > 0 or blocks < 2:
        return float("nan"), float("nan")
    quantile = student_quantile(0.975, blocks - 1) * np.sqrt(blocks / (blocks - 1.0))
    half = min(quantile * draws.std() / mean_square, WIDEST)
    return float(np.sqrt(mean_square * np.exp(-half))), float(np.sqrt(mean_square / (1.0 - half)))


@cache
def student_quantile(p: float, freedom: int) -> float:
    """Quantile of Student's t for a share p > 0.5.

    With t = √ν tan θ the share between 0 and t is c ∫ cos^(ν−1) over [0, θ], concave in θ:
    Newton's steps from θ = (p − ½)/c reach the root from below. SciPy's import would cost as
    much time as an analysis.
    """
    c = np.exp(lgamma(0.5 * (freedom + 1)) - lgamma(0.5 * freedom)) / np.sqrt(np.pi)
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE)
    theta = (p - 0.5) / c
    for _ in range(NEWTON_STEPS):
        share = 0.5 * theta * weights @ np.cos(0.5 * theta * (nodes + 1.0)) ** (freedom - 1)
        theta += ((p - 0.5) / c - share) / np.cos(theta) ** (freedom - 1)
    return float(np.sqrt(freedom) * np.tan(theta))


def paired_significance(
    recording: str, estimates: Sequence[ExternalTorque], reference: ExternalTorque
) -> pl.DataFrame:
    """Difference of RMSE, interval and p of every pair of observers and joint.

    Both observers' errors are drawn in the same blocks, so that common errors cancel. No
    answer counts as the answer 0.
    """
    rows = []
    for j in range(reference.joints):
        known = np.isfinite(reference.tau[:, j])
        answers = np.column_stack([e.tau[known, j] for e in estimates])
        answers[~np.isfinite(answers)] = 0.0
        errors = answers - reference.tau[known, j, None]
        if len(errors) < 2:
            continue
        squares = errors**2
        draws = np.sqrt(resample(squares, int(block_lengths(squares).max())).draws)
        observed = root_mean_squares(errors)
        for a, b in combinations(range(len(estimates)), 2):
            difference = draws[:, a] - draws[:, b]
            low, high = np.quantile(difference, [0.025, 0.975])
            pair = estimates[a].name, estimates[b].name
            sizes = float(observed[a] - observed[b]), float(low), float(high)
            rows.append((recording, j + 1, *pair, *sizes, p_value(draws[:, a], draws[:, b])))
    return pl.DataFrame(rows, schema=SIGNIFICANCE, orient="row")


def p_value(first: Array, second: Array) -> float:
    """Two-sided p that two mean squares differ by chance, from paired draws.

    At least one over the number of draws; 1 where both numbers are equal.
    """
    size = max(abs(first).mean(), abs(second).mean(), 1e-300)
    if abs(first - second).max() <= SAME * size:
        return 1.0
    above = np.mean(first > second)
    return float(np.clip(2.0 * min(above, 1.0 - above), 1.0 / len(first), 1.0))
