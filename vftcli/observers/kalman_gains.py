"""Gains and covariances of n independent two-state Kalman filters: steady, or step by step."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from vftcli.observers.kalman_model import Discrete
from vftcli.observers.recursion import PIECE
from vftcli.signals.arrays import Array

SETTLED = 4e-16
"""Relative change of a block's first covariance below which another pass would change nothing."""


class Covariance(NamedTuple):
    """Entries of a symmetric 2×2 covariance of [p; τ_ext], one a joint (and sample)."""

    p11: Array
    p12: Array
    p22: Array


class Gains(NamedTuple):
    """Filtered gains L₁ (momentum) and L₂ (torque) and the covariance after the update."""

    l1: Array
    l2: Array
    posterior: Covariance


class Steady(NamedTuple):
    """What a constant sample time settles to: the gains and the prior covariance."""

    gains: Gains
    prior: Covariance


def steady(model: Discrete, decay: Array) -> Steady:
    """The stationary filter, the stabilising solution of the discrete Riccati equation.

    For A_τ = 0 in closed form, λ = Ts√(Q₂₂/R), β = (Q₁₁ − TsQ₁₂)/R, y = ½(λ + √(λ² + 16 + 4β)),
    r = ½(y − √(y² − 4)), L₁ = 1 − r², L₂ = λr/Ts; for A_τ ≠ 0 by SciPy's solver, joint by joint.
    The prior follows from the gains: P₁₁ = R L₁/(1−L₁), P₁₂ = R L₂/(1−L₁).
    """
    if np.any(decay > 0.0):
        prior = solved_prior(model)
    else:
        lam = model.step * np.sqrt(model.q22 / model.r)
        beta = (model.q11 - model.step * model.q12) / model.r
        y = 0.5 * (lam + np.sqrt(lam**2 + 16.0 + 4.0 * beta))
        # 1 − r² and 1/r² − 1 lose digits when r is near 1: both follow from √(y² − 4) instead.
        root = np.sqrt(np.maximum((y - 2.0) * (y + 2.0), 0.0))
        r = 2.0 / (y + root)
        l1, l2 = r * root, lam * r / model.step
        p11, p12 = model.r * l1 / r**2, model.r * l2 / r**2
        p22 = (model.r * l2 * root / r - model.q12) / model.step + model.q22
        prior = Covariance(p11, p12, p22)
    return Steady(update(prior, model.r), prior)


def solved_prior(model: Discrete) -> Covariance:
    """The stationary prior from SciPy's discrete Riccati solver, one joint at a time. (n,)"""
    from scipy.linalg import solve_discrete_are

    entries = []
    for j in range(len(model.step)):
        A = np.array([[1.0, model.a12[j]], [0.0, model.a22[j]]])
        Q = np.array([[model.q11[j], model.q12[j]], [model.q12[j], model.q22[j]]])
        P = solve_discrete_are(A.T, np.array([[1.0], [0.0]]), Q, np.array([[model.r[j]]]))
        entries.append((P[0, 0], P[0, 1], P[1, 1]))
    return Covariance(*np.array(entries).T)


def predict(posterior: Covariance, model: Discrete) -> Covariance:
    """Covariance before the next measurement, P⁻ = A P Aᵀ + Q."""
    p11, p12, p22 = posterior
    moved = p12 + model.a12 * p22
    return Covariance(
        p11 + model.a12 * (p12 + moved) + model.q11,
        model.a22 * moved + model.q12,
        model.a22**2 * p22 + model.q22,
    )


def update(prior: Covariance, r: Array) -> Gains:
    """Gains for a measured momentum, and the covariance after it in Joseph's form."""
    p11, p12, p22 = prior
    innovation = p11 + r
    # 1 − L₁ as a quotient: the difference would lose every digit of a small r.
    l1, l2 = p11 / innovation, p12 / innovation
    rest = r / innovation
    # Joseph's form stays positive whatever the rounding of the gains.
    posterior = Covariance(
        rest**2 * p11 + l1**2 * r,
        rest * (p12 - l2 * p11) + l1 * l2 * r,
        p22 - 2.0 * l2 * p12 + l2**2 * p11 + l2**2 * r,
    )
    return Gains(l1, l2, posterior)


def gain_pieces(
    model_of: Callable[[slice], Discrete],
    samples: int,
    entering: Covariance,
    guess: Covariance,
    *,
    begins: bool = True,
) -> Iterator[tuple[slice, Discrete, Gains]]:
    """Run the covariance recursion over a log's own sample times, a piece of the log at a time.

    The recursion is nonlinear but forgets where it started, so blocks of a piece are run side by
    side from a guess, and again from where the block before ended, until no block's start changes:
    the result is then that of the plain loop. A filter that forgets slowly only takes more passes.

    Args:
        model_of: The models of a span of samples, entries (N, n); that of a log's first sample only
            has its measurement noise used.
        samples: Number of samples T.
        entering: Covariance before the first sample's update where the log begins, else after the
            update of the sample before. (n,)
        guess: Where the blocks start before they know better, the stationary posterior. (n,)
        begins: Whether the first sample is the log's first.

    Yields:
        A span of samples, its models, and its gains and posterior covariances. (N, n) each
    """
    begin = 0
    if begins:
        first, begin = slice(0, 1), 1
        model = model_of(first)
        gains = update(Covariance(*(p[None] for p in entering)), model.r)
        entering = Covariance(*(p[-1] for p in gains.posterior))
        yield first, model, gains
    while begin < samples:
        # Pieces end at multiples of their length, whatever block they belong to.
        span = slice(begin, min((begin // PIECE + 1) * PIECE, samples))
        model = model_of(span)
        gains = settle(model, entering, guess)
        entering, begin = Covariance(*(p[-1] for p in gains.posterior)), span.stop
        yield span, model, gains


def gain_sequence(model: Discrete, prior: Covariance, guess: Covariance) -> Gains:
    """The gains of `gain_pieces` for a whole log at once. (T, n) each

    Args:
        model: The models of all samples. (T, n) each
        prior: Covariance before the first sample's update. (n,)
        guess: Where blocks of a piece start before they know better. (n,)
    """
    shape = np.broadcast_shapes(model.r.shape, prior.p11.shape)
    whole = empty_gains(shape)
    pieces = gain_pieces(
        lambda span: Discrete(*(entry[span] for entry in model)), shape[0], prior, guess
    )
    for span, _, gains in pieces:
        write(whole, span, gains)
    return whole


def empty_gains(shape: tuple[int, ...]) -> Gains:
    """Uninitialised gains and covariances, as `write` fills them."""
    return Gains(np.empty(shape), np.empty(shape), Covariance(*(np.empty(shape) for _ in range(3))))


def write(out: Gains, span: slice, part: Gains) -> None:
    """Copy gains and covariances into their place."""
    out.l1[span], out.l2[span] = part.l1, part.l2
    for whole, piece in zip(out.posterior, part.posterior, strict=True):
        whole[span] = piece


def settle(model: Discrete, entering: Covariance, guess: Covariance) -> Gains:
    """Gains of one piece of a log, its blocks repeated until their starts agree. (N, n) each"""
    samples, n = model.a12.shape
    length = max(1, int(np.ceil(np.sqrt(samples))))
    blocks = -(-samples // length)
    padded = Discrete(*(in_blocks(entry, blocks, length) for entry in model))
    starts = Covariance(*(np.tile(g, (blocks, 1)) for g in guess))
    for start, value in zip(starts, entering, strict=True):
        start[0] = value
    # After k passes the first k blocks are exact, so this ends, mostly long before.
    for _ in range(blocks):
        gains = run_blocks(padded, starts, length)
        change = 0.0
        for start, end in zip(starts, gains.posterior, strict=True):
            new = end[-1, :-1]
            scale = np.maximum(np.abs(new), np.finfo(float).tiny)
            change = max(change, float(np.max(np.abs(new - start[1:]) / scale, initial=0.0)))
            start[1:] = new
        if change <= SETTLED:
            break
    flat = [
        a.transpose(1, 0, 2).reshape(blocks * length, n)[:samples]
        for a in (gains.l1, gains.l2, *gains.posterior)
    ]
    return Gains(flat[0], flat[1], Covariance(*flat[2:]))


def in_blocks(entry: Array, blocks: int, length: int) -> Array:
    """Arrange samples as position in block × block × joint, repeating the last to fill up."""
    short = blocks * length - len(entry)
    padded = np.concatenate([entry, np.repeat(entry[-1:], short, axis=0)]) if short else entry
    return np.ascontiguousarray(padded.reshape(blocks, length, -1).transpose(1, 0, 2))


def run_blocks(model: Discrete, starts: Covariance, length: int) -> Gains:
    """One pass: the covariance recursion of all blocks side by side. (length, blocks, n) each"""
    gains, state = empty_gains(model.a12.shape), starts
    for i in range(length):
        step = update(predict(state, Discrete(*(entry[i] for entry in model))), model.r[i])
        write(gains, slice(i, i + 1), step)
        state = step.posterior
    return gains
