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
from vftcli.observers.recursion import Fold, moved, spans
from vftcli.signals.arrays import Array

#: Relative change of the blocks' starts below which another round would change nothing.
SETTLED = 1e-15


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
    """What blocks make of the covariance that they start from."""

    #: Posterior at the end, from the start that was tried, as P₁₁, P₁₂, P₂₂. (3, n, blocks)
    end: Array
    phi: Array  #: Φ. (2, 2, n, blocks)
    information: Array  #: O. (2, 2, n, blocks)

    def of(self, change: Array) -> Array:
        """Posterior at the end from a start that is changed by Δ: X = Δ(I + OΔ)⁻¹ written out."""
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
    """The gains of all blocks side by side, from where each starts. (length, n, blocks) each"""
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
