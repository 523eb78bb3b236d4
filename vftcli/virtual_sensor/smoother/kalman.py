"""Kalman filter and Rauch–Tung–Striebel smoother of wrench and model error, block by block.

The state is x = [w; b]: the wrench w (6) and one model error b a joint (n). Each component decays
on its own, so that the transition is a diagonal,

    xᵏ = fᵏ ∘ xᵏ⁻¹ + noise of variance qᵏ,    dᵏ = Jᵏᵀ wᵏ + bᵏ + noise of variance R.

The state before the first block is zero and certain: f⁰ = 0 starts it with variance q⁰. A component
with f = q = 0 is pinned: its mean and variance are exactly zero. A block whose disturbance is
unknown is passed through without one.

References:
    H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems",
    AIAA Journal 3(8), 1965.
"""

from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Mask

LEAST_VARIANCE = 1e-14
"""A state whose predicted variance is no larger is certain: nothing is carried back to it."""

STRETCH = 512
"""Blocks whose likelihood is summed at once."""


class Evolution(NamedTuple):
    """How every state component goes from block to block; one a setting where there are G.

    Attributes:
        decay: f, the share that is kept. (K, N) or (K, G, N)
        variance: q, the variance that is added. Like `decay`.
    """

    decay: Array
    variance: Array


class Measurement(NamedTuple):
    """What the blocks say of the state.

    Attributes:
        d: Mean disturbance. (K, n) [N·m]
        jacobian: J of the wrench's point. (K, 6, n)
        noise: R, variance of the white noise of each joint. (n,) [(N·m)²]
        known: Blocks whose disturbance is known. (K,)
    """

    d: Array
    jacobian: Array
    noise: Array
    known: Mask


class Filtered(NamedTuple):
    """The forward pass: state and covariance of every block given all up to it.

    Attributes:
        mean: (K, N)
        covariance: (K, N, N)
        predicted: Covariance before the block's own disturbance is used. (K, N, N)
    """

    mean: Array
    covariance: Array
    predicted: Array


class Smoothed(NamedTuple):
    """State and covariance of every block given the whole log.

    Attributes:
        mean: (K, N)
        covariance: (K, N, N)
    """

    mean: Array
    covariance: Array


class Innovation(NamedTuple):
    """What a block's disturbance adds: its departure from the prediction, and that's covariance.

    Attributes:
        value: (…, n) [N·m]
        covariance: (…, n, n) [(N·m)²]
    """

    value: Array
    covariance: Array


def update(x: Array, P: Array, d: Array, Ht: Array, R: Array) -> tuple[Array, Array, Innovation]:
    """State and covariance with a block's disturbance in them, and what it added.

    Args:
        x: Predicted state. (…, N)
        P: Its covariance. (…, N, N)
        d: Mean disturbance. (n,) [N·m]
        Ht: [J; I], what turns a state into joint torques, turned round. (N, n)
        R: Covariance of the white noise. (n, n) [(N·m)²]
    """
    PHt = P @ Ht
    S = Ht.T @ PHt
    S += R
    nu = d - x @ Ht
    gain = PHt @ np.linalg.inv(S)
    x = x + (gain @ nu[..., None])[..., 0]
    P = P - gain @ PHt.swapaxes(-1, -2)
    # Rounding leaves the two triangles apart, and lets them drift.
    P = 0.5 * (P + P.swapaxes(-1, -2))
    return x, P, Innovation(nu, S)


def observation(measured: Measurement) -> Array:
    """[J; I] of every block. (K, N, n)"""
    blocks, _, n = measured.jacobian.shape
    return np.concatenate([measured.jacobian, np.broadcast_to(np.eye(n), (blocks, n, n))], axis=1)


def filter_forward(evolution: Evolution, measured: Measurement) -> Filtered:
    """The forward pass of one setting."""
    decay, variance = evolution
    blocks, size = decay.shape
    R, Ht = np.diag(measured.noise), observation(measured)
    mean, covariance = np.empty((blocks, size)), np.empty((blocks, size, size))
    predicted = np.empty((blocks, size, size))
    # One row a block, every size+1-th entry of which lies on the diagonal.
    flat = predicted.reshape(blocks, -1)
    x, P = np.zeros(size), np.zeros((size, size))
    for k in range(blocks):
        f = decay[k]
        x = f * x
        P = np.multiply(f[:, None] * f, P, out=predicted[k])
        flat[k, :: size + 1] += variance[k]
        if measured.known[k]:
            x, P, _ = update(x, P, measured.d[k], Ht[k], R)
        mean[k], covariance[k] = x, P
    return Filtered(mean, covariance, predicted)


def smooth_backward(evolution: Evolution, forward: Filtered) -> Smoothed:
    """The backward pass over a forward one.

    The gain C = P F (P⁻)⁻¹ is solved on the states whose predicted variance is above
    `LEAST_VARIANCE`: a pinned one has none, and nothing to be told.
    """
    decay = evolution.decay
    mean, covariance = forward.mean.copy(), forward.covariance.copy()
    gains = backward_gains(decay[1:], forward)
    for k in range(len(mean) - 2, -1, -1):
        C = gains[k]
        mean[k] += C @ (mean[k + 1] - decay[k + 1] * forward.mean[k])
        P = C @ (covariance[k + 1] - forward.predicted[k + 1]) @ C.T
        P += covariance[k]
        covariance[k] = 0.5 * (P + P.T)
    return Smoothed(mean, covariance)


def backward_gains(decay: Array, forward: Filtered) -> Array:
    """C of every block but the last, solved stretch by stretch. (K−1, N, N)"""
    size = decay.shape[1]
    gains = np.empty((len(decay), size, size))
    for start in range(0, len(decay), STRETCH):
        span = slice(start, min(start + STRETCH, len(decay)))
        ahead = forward.predicted[1:][span]
        uncertain = ahead[:, np.arange(size), np.arange(size)] > LEAST_VARIANCE
        both = uncertain[:, :, None] & uncertain[:, None, :]
        certain = np.where(uncertain, 0.0, 1.0)[:, :, None] * np.eye(size)
        # F P, without what leads to a certain state: (P⁻)⁻¹ F P is C turned round.
        led = (decay[span] * uncertain)[:, :, None] * forward.covariance[:-1][span]
        gains[span] = np.linalg.solve(np.where(both, ahead, 0.0) + certain, led).swapaxes(1, 2)
    return gains


def likelihoods(evolution: Evolution, measured: Measurement) -> Array:
    """Log-likelihood of each of G settings, less −½ ln 2π a number. (G,) [nats]

    The settings go through the log side by side.

    Args:
        evolution: Of each setting. (K, G, N) each
        measured: The blocks.
    """
    decay, variance = evolution
    blocks, settings, size = decay.shape
    R, Ht = np.diag(measured.noise), observation(measured)
    x, P = np.zeros((settings, size)), np.zeros((settings, size, size))
    total = np.zeros(settings)
    for start in range(0, blocks, STRETCH):
        values: list[Array] = []
        spreads: list[Array] = []
        for k in range(start, min(start + STRETCH, blocks)):
            f = decay[k]
            x = f * x
            P = f[:, :, None] * P * f[:, None, :]
            P.reshape(settings, -1)[:, :: size + 1] += variance[k]
            if measured.known[k]:
                x, P, innovation = update(x, P, measured.d[k], Ht[k], R)
                values.append(innovation.value)
                spreads.append(innovation.covariance)
        if values:
            nu = np.array(values)[..., None]
            S = np.array(spreads)
            squares = np.sum(nu * np.linalg.solve(S, nu), axis=(0, 2, 3))
            total -= 0.5 * (squares + np.linalg.slogdet(S).logabsdet.sum(axis=0))
    return total
