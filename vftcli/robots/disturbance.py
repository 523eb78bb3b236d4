"""The raw disturbance: the external torque as p and μ show it unfiltered, with all their noise."""

from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Mask, is_uniform
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.rest import REST, slower
from vftcli.signals.series import gaps_of, median_step, resample_columns, runs_of

#: What rounding changes at most, of a speed as a share or of a number of blocks, up to 1e6 s.
TIE = 1e-6
GAP = 5.5  #: A step of more than this many median steps is a gap; no stretch reaches across.


def raw_disturbance(terms: DynamicsTerms) -> Array:
    """The unfiltered external torque d of every sample but the first. (T−1, n) [N·m]

    d = (pᵗ − pᵗ⁻¹)/Ts − ½(μᵗ + μᵗ⁻¹) by the log's own sample times: the mean over a sample of the
    external torque and of everything else that the model leaves unexplained.
    """
    d = np.diff(terms.p, axis=0)
    d /= np.diff(terms.t)[:, None]
    d -= 0.5 * (terms.mu[1:] + terms.mu[:-1])
    return d


def disturbance_impulse(terms: DynamicsTerms) -> Array:
    """The raw disturbance's integral, pᵗ − p⁰ − ∫μ. (T, n) [N·m·s]

    A difference of two of its values over the time between them is the mean of d there.
    """
    gained = raw_disturbance(terms) * np.diff(terms.t)[:, None]
    return np.concatenate([np.zeros((1, terms.joints)), np.cumsum(gained, axis=0)])


class Blocks(NamedTuple):
    """The raw disturbance averaged over blocks of time that follow one another."""

    t: Array  #: Middle of each block. (K,) [s]
    length: Array  #: How long it lasts. (K,) [s]
    d: Array  #: Mean disturbance over it. (K, n) [N·m]
    q: Array  #: Joint positions at its middle. (K, n) [rad]
    velocity: Array  #: Mean joint velocity over it, from the positions. (K, n) [rad/s]
    known: Mask  #: Whether its disturbance is known: not across a gap of the clock. (K,)

    @property
    def rests(self) -> Mask:
        """Blocks in which each joint rests. (K, n)"""
        # Steps of an encoder make speeds of just `REST`: they move, whatever rounding makes of it.
        return slower(self.velocity, (1.0 - TIE) * REST)

    def part(self, chosen: slice) -> "Blocks":
        """Some of the blocks."""
        return self._replace(**{name: x[chosen] for name, x in self._asdict().items()})


def disturbance_blocks(
    terms: DynamicsTerms, q: Array, seconds: float, inside: Mask | None = None
) -> Blocks:
    """Block averages d = (s(e′) − s(e))/(e′ − e) with s = p − ∫μ.

    A block of some seconds holds whole samples; what is left at the end of a stretch joins the
    last block where it is less than half of one. A gap of the clock is a block of its own, its
    disturbance unknown, and so is what lies between samples `inside` (T,).
    """
    t, joints = terms.t, terms.joints
    if len(t) < 2:
        nothing, never = np.zeros((1, joints)), np.zeros(1, dtype=bool)
        return Blocks(t, np.zeros(1), nothing, q, nothing, never)
    size = max(round(seconds / median_step(t)), 1)
    whole = np.ones(len(t) - 1, dtype=bool)
    whole[gaps_of(t, GAP)] = False
    if inside is not None:
        whole &= inside[1:] & inside[:-1]
    # The unbroken runs of intervals give the edges; between two runs one block reaches across.
    edges: list[int] = [0]
    known: list[bool] = []
    for start, stop in runs_of(whole):
        if start > edges[-1]:
            edges.append(start)
            known.append(False)
        count = max(round((stop - start) / size), 1)
        edges += [*range(start + size, start + size * count, size), stop]
        known += [True] * count
    if edges[-1] < len(t) - 1:
        edges.append(len(t) - 1)
        known.append(False)
    at = t[edges]
    middle, length = 0.5 * (at[1:] + at[:-1]), np.diff(at)
    return Blocks(
        t=middle,
        length=length,
        d=np.diff(disturbance_impulse(terms)[edges], axis=0) / length[:, None],
        q=resample_columns(middle, t, q),
        velocity=np.diff(q[edges], axis=0) / length[:, None],
        known=np.array(known),
    )


def disturbance_stretches(terms: DynamicsTerms, inside: Mask, step: float) -> list[Array]:
    """The raw disturbance in unbroken stretches of an even clock. (N, n) each

    On an uneven clock the integral of d is interpolated, which averages d over each new step [s].
    """
    t, d = terms.t, raw_disturbance(terms)
    whole = inside[1:] & inside[:-1]
    if len(t) > 1 and is_uniform(t):
        return [d[start:stop] for start, stop in runs_of(whole)]
    # Across a gap the mean of two μ says nothing of what was between them.
    whole[gaps_of(t, GAP)] = False
    stretches = []
    for start, stop in runs_of(whole):
        clock = t[start : stop + 1]
        total = np.concatenate([np.zeros((1, d.shape[1])), d[start:stop] * np.diff(clock)[:, None]])
        np.cumsum(total, axis=0, out=total)
        even = np.arange(clock[0], clock[-1], step)
        stretches.append(np.diff(resample_columns(even, clock, total), axis=0) / step)
    return stretches
