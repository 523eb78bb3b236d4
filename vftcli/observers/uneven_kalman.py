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

from typing import NamedTuple

import numpy as np

from vftcli.observers.kalman_gains import Covariance, Gains, update
from vftcli.observers.kalman_model import Discrete
from vftcli.observers.recursion import Fold, spans
from vftcli.signals.arrays import Array

SETTLED = 1e-15
"""Relative change of the blocks' starts below which another round would change nothing."""


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
