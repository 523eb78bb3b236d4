"""Least squares: normal equations, Huber weights, spreads, cross-validation."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError

#: Residuals beyond so many robust deviations weigh less (Huber): 1.2 % of normal noise.
HUBER = 2.5
PASSES = 6  #: Reweighting passes.
#: Eigenvalues below this share of the largest tell nothing.
NULL = 1e-12
NULL_OF_INVERSE = (
    1e-10  #: `NULL` of an inverse, in which a single such value outweighs all others.
)
SD_PER_MEDIAN = 1.4826  #: SD of normal noise over the median of its size.
FOLDS = 5  #: Contiguous stretches of the log for cross-validation.


class ColumnFit(NamedTuple):
    """A fitted column."""

    values: Array  #: Coefficients. (k,)
    #: Their SDs, the residual's correlation along time counted. (k,)
    sd: Array
    residual: Array  #: What is not explained. (M,)
    weights: Array  #: Final weights, 0 … 1. (M,)


def fit_column(A: Array, y: Array, weights: Array) -> ColumnFit:
    """Fit y (M,) ≈ A x, down-weighting outliers."""
    if np.count_nonzero(weights) <= 2 * A.shape[1]:
        raise IdentificationError(
            f"{np.count_nonzero(weights)} samples in motion for {A.shape[1]} unknowns; "
            "record a longer log in which every joint moves"
        )
    if not A.shape[1]:
        return ColumnFit(np.zeros(0), np.zeros(0), y, weights)
    # Reweighted: what the last fit leaves shows the outliers.
    outliers = np.ones_like(y)
    for _ in range(PASSES):
        x = normal_equations(A, y, weights * outliers).solution()
        residual = y - A @ x
        outliers = huber(residual / np.maximum(robust_sd(residual[weights > 0]), 1e-12))
    final = weights * outliers
    return ColumnFit(x, deviations(A, residual, final), residual, final)


class NormalEquations(NamedTuple):
    """Normal equations: all that least squares needs of any number of rows."""

    gram: Array  #: AᵀWA. (k, k)
    right: Array  #: AᵀWy. (k,)
    square: float  #: yᵀWy.

    def minus(self, other: "NormalEquations") -> "NormalEquations":
        """The normal equations without some of the rows."""
        square = self.square - other.square
        return NormalEquations(self.gram - other.gram, self.right - other.right, square)

    def solution(self) -> Array:
        """Least squares with scaled columns; what the data leaves free stays zero. (k,)"""
        values, V = shown_directions(self.gram, NULL)
        return V @ ((V.T @ self.right) / values)

    def misfit(self, x: Array) -> float:
        """Sum of squares ‖A x − y‖² that a solution x (k,) leaves."""
        return max(self.square - 2.0 * float(x @ self.right) + float(x @ self.gram @ x), 0.0)


def normal_equations(A: Array, y: Array, weights: Array) -> NormalEquations:
    """Normal equations of rows A (M, k), y (M,) with weights (M,)."""
    weighted = A * weights[:, None]
    return NormalEquations(weighted.T @ A, weighted.T @ y, float(weights @ (y * y)))


def shown_directions(gram: Array, null: float) -> tuple[Array, Array]:
    """Eigenvalues and vectors of a scaled AᵀWA that the data shows. (s,), (k, s)

    Columns are scaled to a unit diagonal, as their units differ. The scale is in the
    vectors V: V diag(1/values) Vᵀ is the inverse of AᵀWA itself.
    """
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    scale[scale == 0.0] = 1.0
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    keep = values > null * values.max(initial=0.0)
    return values[keep], vectors[:, keep] / scale[:, None]


def inverse_of(gram: Array) -> Array:
    """(AᵀWA)⁻¹, zero in directions that the data does not show. (k, k)"""
    values, V = shown_directions(gram, NULL_OF_INVERSE)
    return (V / values) @ V.T


def solve(A: Array, y: Array) -> Array:
    """Least squares with scaled columns; what the data leaves free stays zero. (k,)"""
    return normal_equations(A, y, np.ones_like(y)).solution()


def huber(z: Array) -> Array:
    """Weights of residuals in SDs: 1 up to `HUBER`."""
    return HUBER / np.maximum(abs(z), HUBER)


def robust_sd(residual: Array) -> Array:
    """SD of each column by the median of its size. (n,)"""
    if not len(residual):
        return np.zeros(residual.shape[1:])
    return SD_PER_MEDIAN * np.median(abs(residual), axis=0)


def correlation_time(residual: Array) -> float:
    """Samples that count as one: 1 + 2 Σ ρ_k up to the first ρ_k ≤ 0. At least 1."""
    x = residual - residual.mean()
    size = len(x)
    if size < 4 or not x.any():
        return 1.0
    spectrum = np.fft.rfft(x, 2 * size)
    rho = np.fft.irfft(abs(spectrum) ** 2)[: size // 2]
    rho /= rho[0]
    end = int(np.argmax(rho <= 0.0)) or len(rho)
    return max(1.0, 1.0 + 2.0 * float(rho[1:end].sum()))


def deviations(A: Array, residual: Array, weights: Array) -> Array:
    """SDs of a fit, the residual correlated along time. (k,)"""
    used = weights > 0
    freedom = max(1, np.count_nonzero(used) - A.shape[1])
    variance = np.sum(weights * residual**2) / freedom
    inverse = inverse_of((A * weights[:, None]).T @ A)
    sd: Array = np.sqrt(np.diag(inverse) * variance * correlation_time(residual[used]))
    return sd


def folds(samples: int, count: int = FOLDS) -> list[slice]:
    """Contiguous stretches of equal length that cover all samples."""
    edges = np.linspace(0, samples, count + 1).astype(int)
    return list(itertools.starmap(slice, itertools.pairwise(edges)))


def left_out(lengths: Sequence[int], use: Sequence[bool]) -> list[Array]:
    """The rows that cross-validation leaves out in turn.

    Each of several logs in `use` goes whole, a single one in fifths; rows of others stay.
    """
    edges = np.cumsum([0, *lengths])
    rows = [
        np.arange(a, b)
        for (a, b), counts in zip(itertools.pairwise(edges), use, strict=True)
        if counts
    ]
    if len(rows) > 1:
        return rows
    return [one[fold] for one in rows for fold in folds(len(one))]


def cross_validated(A: Array, y: Array, weights: Array, parts: Sequence[Array]) -> float:
    """RMS of what fits on all rows but one part's miss on that part, weighted."""
    whole = normal_equations(A, y, weights)
    total, count = 0.0, 0.0
    for rows in parts:
        part = normal_equations(A[rows], y[rows], weights[rows])
        total += part.misfit(whole.minus(part).solution())
        count += weights[rows].sum()
    return float(np.sqrt(total / count)) if count > 0 else float("nan")
