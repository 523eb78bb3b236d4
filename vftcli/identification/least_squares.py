"""Weighted, robust least squares of one column, with honest standard deviations."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError

#: Residuals beyond this many robust standard deviations weigh less (Huber). On normal noise that
#: is 1.2 % of the samples.
HUBER = 2.5
PASSES = 6  #: Reweighting passes.
#: Eigenvalues of scaled normal equations below this share of the largest tell nothing.
NULL = 1e-12
FOLDS = 5  #: Contiguous stretches of the log for cross-validation.


class ColumnFit(NamedTuple):
    """A fitted column."""

    values: Array  #: Coefficients. (k,)
    sd: Array  #: Their standard deviations, the residual's correlation along time counted. (k,)
    residual: Array  #: What is not explained. (M,)
    weights: Array  #: Final weights, 0 … 1. (M,)


def fit_column(A: Array, y: Array, weights: Array) -> ColumnFit:
    """Fit y ≈ A x, down-weighting outliers.

    Args:
        A: Columns. (M, k)
        y: What they shall explain. (M,)
        weights: Weights to start from, 0 for samples that tell nothing. (M,)
    """
    if np.count_nonzero(weights) <= 2 * A.shape[1]:
        raise IdentificationError(
            f"{np.count_nonzero(weights)} samples in motion for {A.shape[1]} unknowns; "
            "record a longer log in which every joint moves"
        )
    if not A.shape[1]:
        return ColumnFit(np.zeros(0), np.zeros(0), y, weights)
    # Iteratively reweighted least squares: what the last fit leaves decides who is an outlier.
    outliers = np.ones_like(y)
    for _ in range(PASSES):
        x = normal(A, y, weights * outliers).solution()
        residual = y - A @ x
        outliers = huber(residual / max(robust_sd(residual[weights > 0]), 1e-12))
    final = weights * outliers
    return ColumnFit(x, deviations(A, residual, final), residual, final)


class Normal(NamedTuple):
    """Normal equations: all that least squares needs of any number of rows."""

    gram: Array  #: AᵀA. (k, k)
    right: Array  #: Aᵀy. (k,)
    square: float  #: yᵀy.

    def minus(self, other: "Normal") -> "Normal":
        """The normal equations without some of the rows: least squares of all stretches but one."""
        return Normal(self.gram - other.gram, self.right - other.right, self.square - other.square)

    def solution(self) -> Array:
        """Least squares with scaled columns; what the data leaves free stays zero. (k,)"""
        scale = np.sqrt(np.maximum(np.diag(self.gram), 0.0))
        scale[scale == 0.0] = 1.0
        values, vectors = np.linalg.eigh(self.gram / np.outer(scale, scale))
        keep = values > NULL * max(float(values[-1]), 0.0)
        V = vectors[:, keep]
        x: Array = V @ ((V.T @ (self.right / scale)) / values[keep]) / scale
        return x

    def misfit(self, x: Array) -> float:
        """Sum of squares ‖A x − y‖² that a solution x (k,) leaves."""
        return max(self.square - 2.0 * float(x @ self.right) + float(x @ self.gram @ x), 0.0)


def normal(A: Array, y: Array, weights: Array) -> Normal:
    """Normal equations of rows A (M, k), y (M,) with weights (M,)."""
    weighted = A * weights[:, None]
    return Normal(weighted.T @ A, weighted.T @ y, float(weights @ (y * y)))


def solve(A: Array, y: Array) -> Array:
    """Least squares with scaled columns; what the data leaves free stays zero. (k,)"""
    return normal(A, y, np.ones_like(y)).solution()


def huber(z: Array, limit: float = HUBER) -> Array:
    """Weights of residuals in standard deviations: 1 within the limit, limit/|z| beyond."""
    weights: Array = limit / np.maximum(np.abs(z), limit)
    return weights


def robust_sd(residual: Array) -> float:
    """Standard deviation from the median of the absolute values, for normal noise."""
    return 1.4826 * float(np.median(np.abs(residual))) if residual.size else 0.0


def correlation_time(residual: Array) -> float:
    """Samples that count as one: 1 + 2 Σ ρ_k up to the first ρ_k ≤ 0. At least 1."""
    x = residual - residual.mean()
    size = len(x)
    if size < 4 or not np.any(x):
        return 1.0
    spectrum = np.fft.rfft(x, 2 * size)
    rho = np.fft.irfft(np.abs(spectrum) ** 2)[: size // 2]
    rho /= rho[0]
    end = int(np.argmax(rho <= 0.0)) or len(rho)
    return max(1.0, 1.0 + 2.0 * float(np.sum(rho[1:end])))


def deviations(A: Array, residual: Array, weights: Array) -> Array:
    """Standard deviations of weighted least squares, for residuals correlated along time. (k,)"""
    used = weights > 0
    freedom = max(1, np.count_nonzero(used) - A.shape[1])
    variance = float(np.sum(weights * residual**2)) / freedom
    gram = (A * weights[:, None]).T @ A
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    inverse = np.linalg.pinv(gram / np.outer(scale, scale), rcond=1e-10, hermitian=True)
    inflation = correlation_time(residual[used])
    sd: Array = np.sqrt(np.maximum(np.diag(inverse), 0.0) * variance * inflation) / scale
    return sd


def folds(samples: int, count: int = FOLDS) -> list[slice]:
    """Contiguous stretches of equal length that cover all samples."""
    edges = np.linspace(0, samples, count + 1).astype(int)
    return [slice(a, b) for a, b in itertools.pairwise(edges)]


def left_out(lengths: Sequence[int], told: Sequence[bool]) -> list[Array]:
    """The rows that cross-validation leaves out in turn, of logs that stand one after the other.

    Of several logs that tell something each is left out whole: another log is what a model is for.
    A single one is cut into fifths. Rows of logs that tell nothing are never left out.
    """
    edges = np.cumsum([0, *lengths])
    rows = [
        np.arange(a, b) for (a, b), use in zip(itertools.pairwise(edges), told, strict=True) if use
    ]
    if len(rows) > 1:
        return rows
    return [one[fold] for one in rows for fold in folds(len(one))]


def cross_validated(A: Array, y: Array, weights: Array, parts: Sequence[Array]) -> float:
    """RMS of what fits on all rows but one part's miss on that part, weighted.

    Args:
        A: Columns. (M, k)
        y: What they shall explain. (M,)
        weights: Of the rows. (M,)
        parts: Rows of each part.
    """
    whole = normal(A, y, weights)
    total, count = 0.0, 0.0
    for rows in parts:
        part = normal(A[rows], y[rows], weights[rows])
        total += part.misfit(whole.minus(part).solution())
        count += float(np.sum(weights[rows]))
    return float(np.sqrt(total / count)) if count > 0 else float("nan")
