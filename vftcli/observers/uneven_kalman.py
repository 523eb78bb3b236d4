r"""The two-state Kalman filters on a clock that jitters: gains that follow every step.

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

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vftcli.observers.kalman_gains import Covariance, Gains, update
from vftcli.observers.kalman_model import Discrete
from vftcli.observers.recursion import PIECE
from vftcli.observers.steady_filter import FORGOTTEN
from vftcli.signals.arrays import Array, Indices

LENGTH = 64
"""Samples in a block at most: the Python loops have this length."""

SETTLED = 1e-15
"""Relative change of the blocks' starts below which another round would change nothing."""


class Fold(NamedTuple):
    """A piece of a log laid out as position in block × joint × block.

    Attributes:
        length: Samples in a block; the last one is filled up with its last sample.
        blocks: Number of blocks.
        samples: Samples of the piece.
    """

    length: int
    blocks: int
    samples: int

    @classmethod
    def of(cls, samples: int) -> "Fold":
        """The layout of a piece: of short ones as many blocks as samples in a block."""
        length = min(LENGTH, int(np.ceil(np.sqrt(samples))))
        return cls(length, -(-samples // length), samples)

    @property
    def last(self) -> int:
        """Position in the last block of the piece's last sample."""
        return (self.samples - 1) % self.length

    def fold(self, x: Array) -> Array:
        """Samples in blocks: (N, k) → (length, k, blocks)."""
        k, whole = x.shape[1], self.samples // self.length
        out, covered = np.empty((self.length, k, self.blocks)), whole * self.length
        out[..., :whole] = x[:covered].T.reshape(k, whole, self.length).transpose(2, 0, 1)
        if whole < self.blocks:
            rest = x[covered:]
            out[..., -1] = rest[-1]
            out[: len(rest), :, -1] = rest
        return out

    def unfold(self, y: Array) -> Array:
        """Samples in their order: (length, n, blocks) → (N, n), columns whole."""
        return y.transpose(1, 2, 0).reshape(y.shape[1], -1)[:, : self.samples].T


def spans(samples: int, *, begins: bool) -> list[slice]:
    """The pieces of a block of a log: they end at multiples of their length, wherever it begins.

    Args:
        samples: Its number of samples.
        begins: Whether its first sample is the log's first, which no step leads to.
    """
    edges = [int(begins), *range(PIECE, samples, PIECE), samples]
    return [slice(a, b) for a, b in pairwise(edges) if a < b]


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
        entering = last_covariance(gains, fold)
        rows.append(np.stack([fold.unfold(x) for x in (gains.l1, gains.l2, *gains.posterior)]))
    l1, l2, *posterior = np.concatenate(rows, axis=1)
    return Gains(l1, l2, Covariance(*posterior))


def last_covariance(gains: Gains, fold: Fold) -> Covariance:
    """Covariance after a piece's last sample. (n,) each"""
    return Covariance(*(p[fold.last, :, -1] for p in gains.posterior))


def settle(model: Discrete, entering: Covariance, guess: Covariance) -> Gains:
    """Gains of one piece, everything in blocks. (length, n, blocks) each

    Args:
        model: The models of its samples. (length, n, blocks) each
        entering: Covariance after the sample before the piece. (n,)
        guess: Where blocks start before they know better. (n,)
    """
    blocks = model.r.shape[2]
    starts = Covariance(*(np.repeat(p[:, None], blocks, axis=1) for p in guess))
    for start, value in zip(starts, entering, strict=True):
        start[:, 0] = value
    if blocks > 1:
        response = respond(model, starts)
        guessed = Covariance(*(p.copy() for p in starts))
        # After k rounds the first k blocks are exact, so this ends, mostly long before.
        for _ in range(blocks):
            ends = response.of(Covariance(*(p - g for p, g in zip(starts, guessed, strict=True))))
            change = 0.0
            for start, end in zip(starts, ends, strict=True):
                new, old = end[:, :-1], start[:, 1:]
                scale = np.maximum(np.abs(new), np.finfo(float).tiny)
                change = max(change, float(np.max(np.abs(new - old) / scale)))
                start[:, 1:] = new
            if change <= SETTLED:
                break
    return run_blocks(model, starts)


class Response(NamedTuple):
    """What blocks make of the covariance that they start from. (n, blocks) each

    Attributes:
        end: Posterior at the end, from the start that was tried.
        phi: Φ, row by row.
        information: O, as O₁₁, O₁₂, O₂₂.
    """

    end: Covariance
    phi: tuple[Array, Array, Array, Array]
    information: tuple[Array, Array, Array]

    def of(self, change: Covariance) -> Covariance:
        """Posterior at the end from a start that is changed by Δ: X = Δ(I + OΔ)⁻¹ written out."""
        a, b, c = change
        f11, f12, f21, f22 = self.phi
        o11, o12, o22 = self.information
        delta = a * c - b * b
        whole = 1.0 + o11 * a + 2.0 * o12 * b + o22 * c + (o11 * o22 - o12 * o12) * delta
        x11, x12, x22 = (
            (a + o22 * delta) / whole,
            (b - o12 * delta) / whole,
            (c + o11 * delta) / whole,
        )
        u1, u2 = f11 * x11 + f12 * x12, f11 * x12 + f12 * x22
        w1, w2 = f21 * x11 + f22 * x12, f21 * x12 + f22 * x22
        return Covariance(
            self.end.p11 + u1 * f11 + u2 * f12,
            self.end.p12 + u1 * f21 + u2 * f22,
            self.end.p22 + w1 * f21 + w2 * f22,
        )


def respond(model: Discrete, starts: Covariance) -> Response:
    """Run the covariance over every block, with Φ and O beside it."""
    (p11, p12, p22), r = starts, model.r
    one, zero = np.ones_like(p11), np.zeros_like(p11)
    f11, f12, f21, f22 = one, zero, zero, one
    o11, o12, o22 = np.zeros((3, *p11.shape))
    for i in range(len(r)):
        prior = predict(p11, p12, p22, model, i)
        S = prior.p11 + r[i]
        l2, share = prior.p12 / S, r[i] / S
        p11, p12, p22 = share * prior.p11, r[i] * l2, prior.p22 - l2 * prior.p12
        u1, u2 = f11 + model.a12[i] * f21, f12 + model.a12[i] * f22
        told = u1 / S
        o11 += told * u1
        o12 += told * u2
        o22 += u2 * u2 / S
        f11, f12 = share * u1, share * u2
        f21, f22 = model.a22[i] * f21 - l2 * u1, model.a22[i] * f22 - l2 * u2
    return Response(Covariance(p11, p12, p22), (f11, f12, f21, f22), (o11, o12, o22))


def predict(p11: Array, p12: Array, p22: Array, model: Discrete, i: int) -> Covariance:
    """Covariance before the measurement at position i, P⁻ = A P Aᵀ + Q."""
    a12, a22 = model.a12[i], model.a22[i]
    moved = p12 + a12 * p22
    return Covariance(
        p11 + a12 * (p12 + moved) + model.q11[i],
        a22 * moved + model.q12[i],
        a22 * a22 * p22 + model.q22[i],
    )


def run_blocks(model: Discrete, starts: Covariance) -> Gains:
    """The covariance recursion of all blocks side by side. (length, n, blocks) each"""
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


class Filter(NamedTuple):
    """The entries of `error_filter` along one piece. (length, n, blocks) each"""

    a12: Array
    a22: Array
    l2: Array
    rest: Array

    def step(self, i: int, e: Array, tau: Array, d: Array | float) -> tuple[Array, Array]:
        """What e and τ̂ of all blocks are after the sample at position i."""
        x = e - self.a12[i] * tau
        x += d
        tau = self.a22[i] * tau
        tau += self.l2[i] * x
        x *= self.rest[i]
        return x, tau


def filter_blocks(
    model: Discrete, gains: Gains, kind: Indices, d: Array, error: Array, fold: Fold
) -> tuple[Array, Array]:
    """Run `error_filter` over one piece, everything in blocks.

    Args:
        model: The models of its samples, of each kind of joint. (length, kinds, blocks) each
        gains: Their gains.
        kind: Which of them each joint is. (n,)
        d: The input. (length, n, blocks)
        error: e and τ̂ after the sample before the piece. (2, n)
        fold: The layout.

    Returns:
        τ̂ (length, n, blocks), and e and τ̂ after the last sample (2, n).
    """
    of_kind = Filter(model.a12, model.a22, gains.l2, 1.0 - gains.l1)
    of_joint = Filter(*(x.take(kind, axis=1) for x in of_kind))
    # From (1, 0) and (0, 1) without input, and from zero: what each block makes of its start.
    shape = of_kind.rest.shape[1:]
    start = np.zeros((2, 2, *shape))
    start[0, 0] = start[1, 1] = 1.0
    (e, tau), (forced_e, forced_tau) = start, np.zeros((2, *d.shape[1:]))
    for i in range(len(d)):
        e, tau = of_kind.step(i, e, tau, 0.0)
        forced_e, forced_tau = of_joint.step(i, forced_e, forced_tau, d[i])
    forced, phi = np.stack([forced_e, forced_tau]), np.stack([e, tau])
    forced[..., 0] += np.einsum("abn,bn->an", phi[:, :, kind, 0], error)
    sum_varying(forced, phi, kind)
    e, tau = np.concatenate([error[..., None], forced[..., :-1]], axis=2)
    answer = np.empty_like(d)
    for i in range(len(d)):
        e, tau = of_joint.step(i, e, tau, d[i])
        answer[i] = tau
        if i == fold.last:
            end = np.stack([e[:, -1], tau[:, -1]])
    return answer, end


def sum_varying(x: Array, phi: Array, kind: Indices) -> None:
    """Run x_b ← x_b + Φ_b x_{b−1} over all blocks in place, by doubling.

    Args:
        x: What each block adds, then the sums. (m, n, blocks)
        phi: Transitions of each kind of joint, overwritten. (m, m, kinds, blocks)
        kind: Which of them each joint has. (n,)
    """
    apart = 1
    while apart < x.shape[2] and np.max(np.abs(phi[..., apart:])) > FORGOTTEN:
        near = phi[..., apart:]
        x[..., apart:] += np.sum(near[:, :, kind] * x[None, ..., :-apart], axis=1)
        near[:] = np.sum(near[:, :, None] * phi[None, ..., :-apart], axis=1)
        apart *= 2
