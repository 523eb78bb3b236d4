r"""Observers on a clock that jitters: recursions with changing coefficients.

y_t = F_t y_{t−1} + x_t with a small state for each joint. The log is cut into blocks that are run
side by side, each from zero; the states at the blocks' ends obey the same kind of recursion, once a
block, and are summed by doubling: x_b ← x_b + Φ_b x_{b−1}, then over two blocks, four, … until the
filter has forgotten. What enters a block is then run through it and added. That is the plain loop's
sum in another order, so it agrees with it to rounding.

The gains of a two-state Kalman filter follow every step.
The covariance recursion and the filter are run over blocks of samples side by side, all blocks of
a piece at once. Where a block starts follows exactly from what it makes of any other start: if the
posterior P it starts from changes by Δ, the one at its end changes by

    Φ Δ (I + O Δ)⁻¹ Φᵀ,  Φ ← (I − LC)A Φ,  O ← O + uuᵀ/S,  u = (CAΦ)ᵀ

with Φ and O from one pass from any start (the closed-loop transition, and the information that the
block's samples have on its start). So one pass over the samples from a guess, some rounds over the
blocks' ends, and one pass from the right starts give what the plain loop gives.

References:
    B. D. O. Anderson, J. B. Moore, "Optimal Filtering", Prentice-Hall, 1979, Sec. 4.5, for the
    difference of two solutions of a Riccati equation.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vftcli.observers.kalman_model import (
    Covariance,
    Densities,
    Discrete,
    Gains,
    KalmanState,
    error_filter,
    update,
)
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, Indices, empty_series
from vftcli.signals.steady_filter import FORGOTTEN, PIECE

#: Samples in a block at most: the Python loops have this length. From 32 to 64 all take as long.
LENGTH = 36
#: Relative change of the blocks' starts below which another round would change nothing.
SETTLED = 1e-15


class Fold(NamedTuple):
    """A piece of a log laid out as position in block × joint × block.

    Every operation then runs along many blocks at once.
    """

    length: int  #: Samples in a block; the last one is filled up with its last sample.
    blocks: int  #: Number of blocks.
    samples: int  #: Samples of the piece.

    @classmethod
    def of(cls, samples: int) -> "Fold":
        """The layout of a piece: of short ones as many blocks as samples in a block."""
        length = min(LENGTH, int(np.ceil(np.sqrt(samples))))
        return cls(length, -(-samples // length), samples)

    def fold(self, x: Array) -> Array:
        """Samples in blocks: (…, N, k) → (…, length, k, blocks)."""
        *entries, _, k = x.shape
        whole = self.samples // self.length
        covered, out = whole * self.length, np.empty((*entries, self.length, k, self.blocks))
        inside = x[..., :covered, :].reshape(*entries, whole, self.length, k)
        out[..., :whole] = np.moveaxis(inside, -3, -1)
        if whole < self.blocks:
            out[..., -1] = x[..., -1:, :]
            out[..., : self.samples - covered, :, -1] = x[..., covered:, :]
        return out

    def unfold(self, y: Array) -> Array:
        """Samples in their order: (…, length, k, blocks) → (…, N, k), columns whole."""
        columns = np.moveaxis(y, -3, -1).reshape(*y.shape[:-3], y.shape[-2], -1)
        return columns[..., : self.samples].swapaxes(-1, -2)

    def last(self, y: Array) -> Array:
        """The last sample of what is in blocks: (…, length, k, blocks) → (…, k)."""
        return y[..., (self.samples - 1) % self.length, :, -1]


def spans(samples: int, *, begins: bool) -> list[slice]:
    """Pieces of a log's block: they end at multiples of their length."""
    edges = [int(begins), *range(PIECE, samples, PIECE), samples]
    return [slice(a, b) for a, b in pairwise(edges) if a < b]


def recursion(F: Array, x: Array, start: Array) -> Array:
    """y_t = F_t y_{t−1} + x_t from y_{−1} = `start`, in pieces with a state.

    Args:
        F: Transitions of an m-state filter for each of n joints. (m, m, T, n)
        x: Input. (m, T, n)
        start: State before the first sample. (m, n)

    Returns:
        The states y. (m, T, n)
    """
    y = np.empty_like(x)
    for span in spans(x.shape[1], begins=False):
        fold = Fold.of(span.stop - span.start)
        states = run_blocks(fold.fold(F[:, :, span]), fold.fold(x[:, span]), start)
        y[:, span], start = fold.unfold(states), fold.last(states)
    return y


def run_blocks(F: Array, y: Array, start: Array, kind: Indices | slice = slice(None)) -> Array:
    """One piece of `recursion`, everything in blocks.

    Args:
        F: Transitions of each kind of joint. (m, m, length, kinds, blocks)
        y: The input x, over which the states are written. (m, length, n, blocks)
        start: State before the first sample. (m, n)
        kind: Which of the kinds each joint is. (n,)
    """
    steps, samples = np.moveaxis(F, 2, 0), np.moveaxis(y, 1, 0)
    columns = steps[0].swapaxes(0, 1).copy()  # of the whole block's transition, Φ
    for step, before, sample in zip(steps[1:], samples, samples[1:], strict=False):
        np.add(sample, moved(step[:, :, kind], before), out=sample)
        columns = moved(step, columns)
    ends, reach, apart = samples[-1].copy(), columns.swapaxes(0, 1), 1
    ends[..., :1] += moved(reach[:, :, kind, :1], start[..., None])
    while apart < ends.shape[-1] and np.max(np.abs(reach[..., apart:])) > FORGOTTEN:
        ends[..., apart:] += moved(reach[:, :, kind, apart:], ends[..., :-apart])
        columns[..., apart:] = moved(reach[..., apart:], columns[..., :-apart])
        apart *= 2
    entering = np.concatenate([start[..., None], ends[..., :-1]], axis=-1)
    for step, sample in zip(steps, samples, strict=True):
        entering = moved(step[:, :, kind], entering)
        np.add(sample, entering, out=sample)
    return y


def moved(F: Array, state: Array) -> Array:
    """F·state for every joint and block: (m, m, n, B), (…, m, n, B) → (…, m, n, B)."""
    total: Array = F[:, 0] * state[..., :1, :, :]
    for k in range(1, len(F)):
        total += F[:, k] * state[..., k : k + 1, :, :]
    return total


def gain_sequence(model: Discrete, prior: Covariance, guess: Covariance) -> Gains:
    """The gains and posterior covariances of a whole log. (T, n) each

    Args:
        model: The models of all samples; that of sample 0 only has its noise used. (T, n) each
        prior: Covariance before the first sample's update. (n,)
        guess: Where blocks start before they know better, the stationary posterior. (n,)
    """
    first = update(prior, model.r[0])
    entering = first.posterior
    rows = [np.stack([first.l1, first.l2, *entering])[:, None]]
    for span in spans(len(model.r), begins=True):
        fold = Fold.of(span.stop - span.start)
        gains = settle(Discrete(*(fold.fold(entry[span]) for entry in model)), entering, guess)
        entering = Covariance(*map(fold.last, gains.posterior))
        rows.append(np.stack([fold.unfold(x) for x in (gains.l1, gains.l2, *gains.posterior)]))
    l1, l2, *posterior = np.concatenate(rows, axis=1)
    return Gains(l1, l2, Covariance(*posterior))


def settle(model: Discrete, entering: Covariance, guess: Covariance) -> Gains:
    """Gains of one piece, everything in blocks. (length, n, blocks) each

    Args:
        model: The models of its samples. (length, n, blocks) each
        entering: Covariance after the sample before the piece. (n,)
        guess: Where blocks start before they know better. (n,)
    """
    blocks = model.r.shape[2]
    starts = np.repeat(np.stack(guess)[..., None], blocks, axis=2)
    starts[..., 0] = entering
    if blocks > 1:
        response, guessed = respond(model, Covariance(*starts)), starts.copy()
        # After k rounds the first k blocks are exact, so this ends, mostly long before.
        for _ in range(blocks):
            new, old = response.of(starts - guessed)[..., :-1], starts[..., 1:]
            change = np.abs(new - old) / np.maximum(np.abs(new), np.finfo(float).tiny)
            starts[..., 1:] = new
            if np.max(change) <= SETTLED:
                break
    return gains_from(model, Covariance(*starts))


class Response(NamedTuple):
    """Blocks' maps of their start covariance."""

    #: Posterior at the end, from the start that was tried, as P₁₁, P₁₂, P₂₂. (3, n, blocks)
    end: Array
    phi: Array  #: Φ. (2, 2, n, blocks)
    information: Array  #: O. (2, 2, n, blocks)

    def of(self, change: Array) -> Array:
        """Posterior after a start changed by Δ: X = Δ(I + OΔ)⁻¹ in full."""
        a, b, c = change
        (o11, o12), (_, o22) = self.information
        delta = a * c - b * b
        whole = 1.0 + o11 * a + 2.0 * o12 * b + o22 * c + (o11 * o22 - o12 * o12) * delta
        cross = b - o12 * delta
        X = np.array([[a + o22 * delta, cross], [cross, c + o11 * delta]]) / whole
        gained = moved(self.phi, moved(self.phi, X).swapaxes(0, 1))
        return self.end + gained[(0, 0, 1), (0, 1, 1)]


def respond(model: Discrete, starts: Covariance) -> Response:
    """Run the covariance over every block, with Φ and O beside it."""
    (p11, p12, p22), r = starts, model.r
    information, phi = np.zeros((2, 2, 2, *p11.shape))
    phi[0, 0] = phi[1, 1] = 1.0
    for i in range(len(r)):
        prior = predict(p11, p12, p22, model, i)
        S = prior.p11 + r[i]
        l2, share = prior.p12 / S, r[i] / S
        p11, p12, p22 = share * prior.p11, r[i] * l2, prior.p22 - l2 * prior.p12
        u = phi[0] + model.a12[i] * phi[1]
        information += u[:, None] * u / S
        phi[0] = share * u
        phi[1] = model.a22[i] * phi[1] - l2 * u
    return Response(np.stack([p11, p12, p22]), phi, information)


def predict(p11: Array, p12: Array, p22: Array, model: Discrete, i: int) -> Covariance:
    """Covariance before the measurement at position i, P⁻ = A P Aᵀ + Q."""
    a12, a22 = model.a12[i], model.a22[i]
    carried = p12 + a12 * p22
    return Covariance(
        p11 + a12 * (p12 + carried) + model.q11[i],
        a22 * carried + model.q12[i],
        a22 * a22 * p22 + model.q22[i],
    )


def gains_from(model: Discrete, starts: Covariance) -> Gains:
    """Gains of all blocks side by side, from their starts. (length, n, blocks) each"""
    (p11, p12, p22), r = starts, model.r
    l1, l2, torque = np.empty((3, *r.shape))
    for i in range(len(r)):
        prior = predict(p11, p12, p22, model, i)
        S = prior.p11 + r[i]
        np.divide(prior.p11, S, out=l1[i])
        np.divide(prior.p12, S, out=l2[i])
        p11, p12 = r[i] * l1[i], r[i] * l2[i]
        # Joseph's form: an error of L₂ counts squared.
        np.subtract(prior.p22, l2[i] * (2.0 * prior.p12 - l2[i] * S), out=torque[i])
        p22 = torque[i]
    return Gains(l1, l2, Covariance(r * l1, r * l2, torque))


def kalman_steps(
    terms: DynamicsTerms,
    d: Array,
    model_of: Callable[[Densities, Array], Discrete],
    densities: Densities,
    guess: Covariance,
    state: KalmanState,
    *,
    begins: bool,
) -> tuple[Array, Array, KalmanState]:
    """τ̂ and √P₂₂ of a block, gains by each step's sample time. (T, n) each

    Args:
        terms: The block.
        d: The filter's input. (T, n) [N·m·s]
        model_of: The discrete model of some joints at some sample times [s].
        densities: The parameters, one a joint.
        guess: The stationary posterior. (n,)
        state: What the filter is before the block; at a log's begin after its first sample.
        begins: Whether the log begins here.
    """
    samples, n = d.shape
    tau, sd = empty_series(samples, n), empty_series(samples, n)
    dt, (error, posterior, _) = np.broadcast_to(terms.dt, (samples, 1)), state
    if begins:
        tau[0], sd[0] = 0.0, np.sqrt(posterior.p22)
    # Joints with equal numbers have equal gains: compute one of each kind.
    numbers = np.stack([*densities, *posterior])
    _, kept, kind = np.unique(numbers, axis=1, return_index=True, return_inverse=True)
    kind = kind.ravel()
    own = Densities(*(x[kept, None] for x in densities))
    guess, entering = (Covariance(*(p[kept] for p in each)) for each in (guess, posterior))
    for span in spans(samples, begins=begins):
        fold = Fold.of(span.stop - span.start)
        # What is one for all joints is written out: rows of one size need no iterator.
        model = model_of(own, fold.fold(dt[span]))
        model = Discrete(model.step, *map(np.ascontiguousarray, model[1:]))
        gains = settle(model, entering, guess)
        entering = Covariance(*map(fold.last, gains.posterior))
        F, g = error_filter(gains, model.a12, model.a22)
        states = run_blocks(F, g[:, :, kind] * fold.fold(d[span]), error, kind)
        error = fold.last(states)
        tau[span] = fold.unfold(states[1])
        sd.T[:, span] = fold.unfold(np.sqrt(gains.posterior.p22)).T[kind]
    return tau, sd, KalmanState(error, Covariance(*(p[kind] for p in entering)))
