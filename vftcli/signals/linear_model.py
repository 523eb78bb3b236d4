"""A linear model: Kalman filter, likelihood, Rauch–Tung–Striebel smoother.

States x of a size N move from block to block each on its own, and n numbers d show them:

    xᵏ = fᵏ xᵏ⁻¹ + noise of variance qᵏ,    dᵏ = Hᵏᵀ xᵏ + noise of variance Rᵏ.

The state before the first block is zero and certain: f⁰ = 0 starts it with variance q⁰. A
state with f = q = 0 has mean and variance exactly zero. A block with H = 0 says nothing.
Axes between blocks and numbers hold models of one length side by side.

References:
    H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic
    systems", AIAA Journal 3(8), 1965.
"""

from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array

SPIKE = 40.0  #: Variance of a spike, in variances of the innovation.
#: A state of no larger predicted variance is certain: nothing is carried back to it.
LEAST_VARIANCE = 1e-14
STRETCH = 512  #: Blocks for which innovations and gains back are computed at once.


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
    predicted: Array  #: Covariance before the block's own d is used. (…, N, N)
    square: Array  #: νᵀS⁻¹ν of the innovation, as if it were no spike. (…)
    spread: Array  #: Its covariance S, likewise. (…, n, n)


def beside_errors(H: Array) -> Array:
    """H of a model with n numbers that have errors of their own: [H; I]. (…, N + n, n)"""
    own = np.broadcast_to(np.eye(H.shape[-1]), (*H.shape[:-2], H.shape[-1], H.shape[-1]))
    return np.concatenate([H, own], axis=-2)


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
            # Rounding leaves the two triangles apart, and lets them drift.
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
    """Mean and covariance of every block given all of them. (K, …, N), (K, …, N, N)

    The gain C = P F (P⁻)⁻¹ is solved on states of variance above `LEAST_VARIANCE`.
    """
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
