"""Estimation: least squares; Kalman filter and smoother of a linear model.

In a linear model, states x of a size N move from block to block each on its own, and n
numbers d show them:

    xᵏ = fᵏ xᵏ⁻¹ + noise of variance qᵏ,    dᵏ = Hᵏᵀ xᵏ + noise of variance Rᵏ.

The state before the first block is zero and certain: f⁰ = 0 starts it with variance q⁰. A
state with f = q = 0 has mean and variance exactly zero. A block with H = 0 says nothing.
Axes between blocks and numbers hold models of one length side by side.

References:
    H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic
    systems", AIAA Journal 3(8), 1965.
"""

import itertools
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError

#: Residuals beyond so many robust deviations weigh less (Huber): 1.2 % of normal noise.
HUBER = 2.5
PASSES = 6  #: Reweighting passes.
#: Eigenvalues below this share of the largest tell nothing.
NULL = 1e-12
#: `NULL` of an inverse, in which a single such value outweighs all others.
NULL_OF_INVERSE = 1e-10
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
    """All that least squares needs of any number of rows."""

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

    Columns get a unit diagonal, and V the scale: V diag(1/values) Vᵀ is the inverse of AᵀWA.
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
    """Contiguous stretches of equal length over all samples."""
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


SPIKE = 40.0  #: Variance of a spike, in variances of the innovation.
#: A state of no larger predicted variance is certain: nothing is carried back to it.
LEAST_VARIANCE = 1e-14
STRETCH = 512  #: Blocks that are computed at once.


class LinearModel(NamedTuple):
    """Models side by side along K blocks; axes may have length 1, but of `decay`."""

    d: Array  #: What is measured. (K, …, n)
    observation: Array  #: H. (K, …, N, n)
    white: Array  #: R. (K, …, n)
    decay: Array  #: f. (K, …, N)
    added: Array  #: q. (K, …, N)


class FilteredBlock(NamedTuple):
    """The filter at one block."""

    mean: Array  #: State given the blocks up to this one. (…, N)
    covariance: Array  #: (…, N, N)
    predicted: Array  #: Covariance before its own d. (…, N, N)
    square: Array  #: νᵀS⁻¹ν of the innovation, as if it were no spike. (…)
    spread: Array  #: Its covariance S, as if it were no spike. (…, n, n)


def filtered(model: LinearModel, limit: Array | None = None) -> Iterator[FilteredBlock]:
    """The filter, block by block; νᵀS⁻¹ν beyond `limit` (K, …) is a spike."""
    shape, (size, n) = model.decay.shape[1:], model.observation.shape[-2:]
    # Of single numbers the product of matrices is that of numbers, at a third of the CPU.
    alone = size == n == 1
    times, inverse = (np.multiply, np.reciprocal) if alone else (np.matmul, np.linalg.inv)
    x, P = np.zeros((*shape, 1)), np.zeros((*shape, size))
    turned = model.observation.swapaxes(-1, -2)
    for k, (d, H, white, f, added) in enumerate(zip(*model, strict=True)):
        Ht, column = turned[k], f[..., None]
        x, P = column * x, column * P * f[..., None, :]
        P.reshape(*shape[:-1], -1)[..., :: size + 1] += added
        predicted, PH = P, times(P, H)
        S = times(Ht, PH)
        S.reshape(*S.shape[:-2], -1)[..., :: n + 1] += white
        nu, Si = d[..., None] - times(Ht, x), inverse(S)
        gain = times(PH, Si)
        square = times(nu.swapaxes(-1, -2), times(Si, nu))[..., 0, 0]
        if limit is not None:
            gain /= np.where(square > limit[k], SPIKE, 1.0)[..., None, None]
        x, P = x + times(gain, nu), P - times(gain, PH.swapaxes(-1, -2))
        if not alone:
            # Rounding lets the two triangles drift apart.
            P = 0.5 * (P + P.swapaxes(-1, -2))
        yield FilteredBlock(x[..., 0], P, predicted, square, S)


def log_likelihood(model: LinearModel) -> Array:
    """Log likelihood ln p(d) of each model, less −½ ln 2π a number. (…) [nats]"""
    blocks, total = filtered(model), np.zeros(model.decay.shape[1:-1])
    while some := list(islice(blocks, STRETCH)):
        volume = np.linalg.slogdet(np.array([block.spread for block in some])).logabsdet
        total -= 0.5 * (np.array([block.square for block in some]) + volume).sum(axis=0)
    return total


def smoothed(model: LinearModel) -> tuple[Array, Array]:
    """Mean and covariance of every block given all of them. (K, …, N), (K, …, N, N)"""
    decay, size = model.decay, model.decay.shape[-1]
    mean, covariance = np.empty(decay.shape), np.empty((*decay.shape, size))
    predicted = np.empty_like(covariance)
    for k, block in enumerate(filtered(model)):
        mean[k], covariance[k], predicted[k] = block[:3]
    for stop in range(len(decay) - 1, 0, -STRETCH):
        start = max(stop - STRETCH, 0)
        ahead, f = predicted[start + 1 : stop + 1], decay[start + 1 : stop + 1]
        uncertain = np.diagonal(ahead, axis1=-2, axis2=-1) > LEAST_VARIANCE
        both = uncertain[..., :, None] & uncertain[..., None, :]
        certain = np.where(uncertain, 0.0, 1.0)[..., None] * np.eye(size)
        # F P, without what leads to a certain state: (P⁻)⁻¹ F P is C turned round.
        led = (f * uncertain)[..., None] * covariance[start:stop]
        back = np.linalg.solve(np.where(both, ahead, 0.0) + certain, led)
        for k in range(stop - 1, start - 1, -1):
            Ct = back[k - start]
            C = Ct.swapaxes(-1, -2)
            mean[k] += (C @ (mean[k + 1] - decay[k + 1] * mean[k])[..., None])[..., 0]
            P = C @ (covariance[k + 1] - predicted[k + 1]) @ Ct
            P += covariance[k]
            covariance[k] = 0.5 * (P + P.swapaxes(-1, -2))
    return mean, covariance
