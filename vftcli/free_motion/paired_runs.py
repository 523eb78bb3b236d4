"""A log and its free runs: partners of its samples, and their differences.

They go by a clock, or by the nearest place on the joint-space path.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vftcli.robots.run import Run, signal_edge
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.filters import low_pass
from vftcli.signals.series import resample_columns

GAP = 5.5  #: A gap of more than this many median steps is not interpolated across.
FARTHEST = 0.1  #: How far phase may lie from the clock's word, as the low-passed shift. [s]
#: Cutoff of the joint-space phase shift: a servo's compliance is slower. [Hz]
PHASE_CUTOFF = 8.0
#: A stop this long leaves all of the dry friction open. [s]
STUCK = 0.3
#: From farther away a filter of 3 Hz, a 15 Hz log's, passes e^(−2π 3 Hz · sin(π/4) · 2 s)
#: = 3e-12. [s]
HEARD = 2.0
#: Share of the stiction that cancels between two equal stops at one place.
REPEATED = 0.5


class Pairing(NamedTuple):
    """A free run, and where in it each sample of the log belongs."""

    free: Run  #: The free run; the log itself where cycles of one log are compared.
    times: Array  #: Instant on the free run's clock, NaN where there is none. (T,) [s]

    @property
    def known(self) -> Mask:
        """Whether a sample has a partner. (T,)"""
        return np.isfinite(self.times)

    def there(self, x: Array) -> Array:
        """Columns of a free run's signal at paired instants, NaN without."""
        return resample_columns(self.times, self.free.t, x)


def pair_with_run(t: Array, free: Run, shift: float, rate: float = 1.0) -> Pairing:
    """Samples at t (T,) paired with a free run at rate·t + shift of its clock."""
    times = rate * t + shift
    inside = (times >= free.t[0]) & (times <= free.t[-1]) & ~in_gap(free.t, times)
    return Pairing(free, np.where(inside, times, np.nan))


def in_gap(clock: Array, times: Array) -> Mask:
    """Whether an instant lies in a gap of a clock. (T,)"""
    steps = np.diff(clock)
    at = np.clip(clock.searchsorted(times) - 1, 0, len(steps) - 1)
    return steps[at] > GAP * np.median(steps)


def by_phase(motion: Run, pairing: Pairing) -> Pairing:
    """Move each sample's partner to the nearest place on the free run's path.

    Gauss–Newton minimises the distance of the joints; at rest the clock decides. The shift is
    smoothed along time.
    """
    known, free = pairing.known, pairing.free
    if np.count_nonzero(known) < 8:
        return pairing
    times, q, speed = pairing.times[known], motion.q[known], free.smooth_dq
    shift, ends = np.zeros(len(times)), (times.min(), times.max())
    damping = 0.01 * np.sum(speed**2, axis=1).mean() + 1e-6
    for _ in range(4):
        at = np.clip(times + shift, *ends)
        path = resample_columns(at, free.t, speed)
        distance = resample_columns(at, free.t, free.q) - q
        shift -= np.sum(distance * path, axis=1) / (np.sum(path**2, axis=1) + damping)
        shift = shift.clip(-FARTHEST, FARTHEST)
    cutoff = min(PHASE_CUTOFF, 0.2 / motion.step)
    smooth = low_pass(motion.t[known], shift[:, None], cutoff)[:, 0]
    moved = pairing.times.copy()
    moved[known] = np.clip(times + smooth, *ends)
    return Pairing(free, moved)


def mean_of(pairings: Sequence[Pairing], signals: Sequence[Array]) -> Array:
    """Mean of a signal over free runs at paired instants, known ones. (T, n)"""
    if len(pairings) == 1:
        return pairings[0].there(signals[0])
    count, total = np.zeros(1), np.zeros(1)
    for p, x in zip(pairings, signals, strict=True):
        there = p.there(x)
        known = np.isfinite(there)
        count = count + known
        total = total + np.where(known, there, 0.0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


@dataclass(frozen=True, kw_only=True, eq=False)
class PairedRuns:
    """A log and its free runs, each sample of the log with its partners."""

    motion: Run  #: The log.
    pairings: Sequence[Pairing]  #: Its free runs.
    _found: dict[tuple[str, float], Array] = field(init=False, repr=False, default_factory=dict)

    def cached(self, what: str, cutoff: float, find: Callable[[], Array]) -> Array:
        """An earlier result for a cutoff [Hz], else a new one."""
        if (what, cutoff) not in self._found:
            self._found[what, cutoff] = find()
        return self._found[what, cutoff]

    def of_free(self, name: str) -> Array:
        """A series of `Run` as the free runs have it at the paired instants. (T, n)"""
        return mean_of(self.pairings, [getattr(p.free, name) for p in self.pairings])

    @cached_property
    def torque(self) -> Array:
        """Raw torque difference, not corrected; NaN without partner. (T, n) [N·m]"""
        return self.of_free("drive_torque") - self.motion.drive_torque

    @cached_property
    def model_difference(self) -> Array:
        """The model's torque of the motion difference. (T, n) [N·m]"""
        return self.motion.model_torque - self.of_free("model_torque")

    @cached_property
    def known(self) -> Mask:
        """Samples that have a partner. (T,)"""
        return np.asarray(np.isfinite(self.torque).all(axis=1))

    @cached_property
    def standing(self) -> Mask:
        """Rest of a joint in the log or in any free run. (T, n)"""
        found = self.motion.standing.copy()
        for p in self.pairings:
            found |= p.there(p.free.standing.astype(float)) > 0.0
        return found

    @cached_property
    def stopped(self) -> Array:
        """Share of dry friction that a stop leaves open, log or free run, 0–1. (T, n)"""
        longest = self.motion.standstill.copy()
        shortest = longest.copy()
        for p in self.pairings:
            there = np.nan_to_num(p.there(p.free.standstill))
            np.maximum(longest, there, out=longest)
            np.minimum(shortest, there, out=shortest)
        alike = shortest / np.maximum(longest, 1e-9)
        share = np.minimum(longest / STUCK, 1.0) * (1.0 - REPEATED * alike)
        return np.maximum(share, self.standing)

    @cached_property
    def misfit(self) -> Array:
        """Share of torque variation missed by the model in the free run, ≤ 1. (n,)"""
        missed = total = np.zeros(self.motion.drive_torque.shape[1])
        for p in self.pairings:
            used = p.free.t.searchsorted(p.times[p.known])
            used = np.unique(used.clip(0, len(p.free.t) - 1))
            # Of an hour only the free cycle, and what the filter needs.
            pad = round(HEARD / p.free.step)
            first = max(0, int(used[0]) - pad)
            free, used = p.free.part(slice(first, int(used[-1]) + pad + 1)), used - first
            # Below the band of the noise.
            gap, edge = free.drive_torque - free.model_torque, signal_edge(free.step)
            missed = missed + low_pass(free.t, gap, edge)[used].var(axis=0)
            total = total + low_pass(free.t, free.model_torque, edge)[used].var(axis=0)
        return np.sqrt(np.minimum(missed / np.maximum(total, 1e-12), 1.0))
