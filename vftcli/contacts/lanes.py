"""Kalman passes over many short stretches of a log side by side: windows, hypotheses, settings.

Each lane is a stretch of blocks with the model of the wrench smoother: a state [w; b] of six
components of a wrench and one model error a joint, whose parts decay each on its own, and

    dᵏ = Jᵏᵀ wᵏ + bᵏ + noise of variance Rᵏ,

with the Jacobian of the point that the lane's hypothesis names. A block that says nothing has a
variance so large that it tells nothing, the same in every lane. Lanes of one call are equally long.
"""

from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Mask

LEAST_VARIANCE = 1e-14
"""A state whose predicted variance is no larger is certain: nothing is carried back to it."""


class Lanes(NamedTuple):
    """Stretches of blocks, L side by side.

    Attributes:
        d: Mean disturbance. (K, L, n) [N·m]
        jacobian: J. (K, L, 6, n)
        white: R. (K, L, n) [(N·m)²]
        decay: Share of the state that is kept from the block before. (K, L, 6 + n)
        added: Variance that is added. (K, L, 6 + n)
    """

    d: Array
    jacobian: Array
    white: Array
    decay: Array
    added: Array


class Passed(NamedTuple):
    """A forward pass: the state of every block given all up to it.

    Attributes:
        mean: (K, L, N)
        covariance: (K, L, N, N)
        predicted: Covariance before the block's own disturbance is used. (K, L, N, N)
    """

    mean: Array
    covariance: Array
    predicted: Array


def correct(
    x: Array, P: Array, d: Array, J: Array, R: Array
) -> tuple[Array, Array, tuple[Array, Array]]:
    """State and covariance with a block's disturbance in them; νᵀS⁻¹ν and S of its innovation."""
    PH = P[..., :6] @ J
    PH += P[..., 6:]
    S = J.swapaxes(-1, -2) @ PH[..., :6, :]
    S += PH[..., 6:, :]
    n = S.shape[-1]
    S[..., np.arange(n), np.arange(n)] += R
    nu = d - (x[..., None, :6] @ J)[..., 0, :] - x[..., 6:]
    inverse = np.linalg.inv(S)
    weighted = (inverse @ nu[..., None])[..., 0]
    gain = PH @ inverse
    x = x + (PH @ weighted[..., None])[..., 0]
    P = P - gain @ PH.swapaxes(-1, -2)
    P += P.swapaxes(-1, -2).copy()
    P *= 0.5
    return x, P, (np.sum(nu * weighted, axis=-1), S)


def step_ahead(x: Array, P: Array, f: Array, added: Array) -> tuple[Array, Array]:
    """State and covariance a block later."""
    size = f.shape[-1]
    P = P * (f[..., :, None] * f[..., None, :])
    P[..., np.arange(size), np.arange(size)] += added
    return f * x, P


def nats(lanes: Lanes) -> Array:
    """Log likelihood ln p(d) of each lane, less the constant −½ ln 2π a number. (L,) [nats]"""
    blocks, count, size = lanes.decay.shape
    x, P = np.zeros((count, size)), np.zeros((count, size, size))
    squares, spreads = np.zeros(count), []
    for k in range(blocks):
        x, P = step_ahead(x, P, lanes.decay[k], lanes.added[k])
        x, P, (square, S) = correct(x, P, lanes.d[k], lanes.jacobian[k], lanes.white[k])
        squares += square
        spreads.append(S)
    found: Array = -0.5 * (squares + np.linalg.slogdet(np.array(spreads))[1].sum(axis=0))
    return found


def smoothed(lanes: Lanes) -> tuple[Array, Array]:
    """State and covariance of every block given its whole lane. (K, L, N), (K, L, N, N)"""
    passed = forward(lanes)
    mean, covariance = passed.mean.copy(), passed.covariance.copy()
    gains = backward_gains(lanes.decay[1:], passed)
    for k in range(len(mean) - 2, -1, -1):
        C = gains[k]
        ahead = mean[k + 1] - lanes.decay[k + 1] * passed.mean[k]
        mean[k] += (C @ ahead[..., None])[..., 0]
        P = C @ (covariance[k + 1] - passed.predicted[k + 1]) @ C.swapaxes(-1, -2)
        P += covariance[k]
        covariance[k] = 0.5 * (P + P.swapaxes(-1, -2))
    return mean, covariance


def forward(lanes: Lanes) -> Passed:
    """The forward pass."""
    blocks, count, size = lanes.decay.shape
    mean, covariance = np.empty((blocks, count, size)), np.empty((blocks, count, size, size))
    predicted = np.empty((blocks, count, size, size))
    x, P = np.zeros((count, size)), np.zeros((count, size, size))
    for k in range(blocks):
        x, P = step_ahead(x, P, lanes.decay[k], lanes.added[k])
        predicted[k] = P
        x, P, _ = correct(x, P, lanes.d[k], lanes.jacobian[k], lanes.white[k])
        mean[k], covariance[k] = x, P
    return Passed(mean, covariance, predicted)


def backward_gains(decay: Array, passed: Passed) -> Array:
    """C = P F (P⁻)⁻¹ of every block but the last, on the states that are uncertain."""
    size = decay.shape[-1]
    ahead = passed.predicted[1:]
    uncertain: Mask = np.diagonal(ahead, axis1=-2, axis2=-1) > LEAST_VARIANCE
    both = uncertain[..., :, None] & uncertain[..., None, :]
    certain = np.where(uncertain, 0.0, 1.0)[..., None] * np.eye(size)
    # F P, without what leads to a certain state: (P⁻)⁻¹ F P is C turned round.
    led = (decay * uncertain)[..., None] * passed.covariance[:-1]
    solved = np.linalg.solve(np.where(both, ahead, 0.0) + certain, led)
    return np.asarray(solved.swapaxes(-1, -2))
