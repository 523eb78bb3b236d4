"""A log with its free runs below it, and their difference."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from vftcli.repetition.pairing import Pairing, mean_of
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array, Mask

#: A stop of this length leaves the whole of the dry friction open, a shorter one its share. [s]
STUCK = 0.3
#: Of what lies farther away a filter of 3 Hz, that of a log at 15 Hz, lets
#: e^(−2π 3 Hz · sin(π/4) · 2 s) = 3e-12 through. [s]
HEARD = 2.0
#: Share of the stiction that cancels between two equal stops at one place.
REPEATED = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class LaidOver:
    """A log and its free runs, each sample of the log with its partners.

    Every rung of the alignment ladder and every low-pass starts from these; each is made once.
    """

    motion: Run  #: The log.
    pairings: Sequence[Pairing]  #: Its free runs.
    #: What else was found of them, by what it is and the cutoff that it was found for.
    found: dict[tuple[str, float], Array] = field(default_factory=dict, repr=False)

    def once(self, what: str, cutoff: float, find: Callable[[], Array]) -> Array:
        """An earlier result for a cutoff [Hz], else a new one."""
        if (what, cutoff) not in self.found:
            self.found[what, cutoff] = find()
        return self.found[what, cutoff]

    @cached_property
    def torque(self) -> Array:
        """Raw torque difference, not corrected; NaN without partner. (T, n) [N·m]"""
        return (
            mean_of(self.pairings, [p.free.drive_torque for p in self.pairings])
            - self.motion.drive_torque
        )

    @cached_property
    def change(self) -> Array:
        """The model's torque of the motion difference. (T, n) [N·m]"""
        return self.motion.model_torque - mean_of(
            self.pairings, [p.free.model_torque for p in self.pairings]
        )

    @property
    def momentum(self) -> Array:
        """Difference of the momenta. (T, n) [kg·m²/s]"""
        there = mean_of(self.pairings, [p.free.momentum for p in self.pairings])
        return self.motion.momentum - there

    @cached_property
    def known(self) -> Mask:
        """Samples that have a partner. (T,)"""
        return np.asarray(np.isfinite(self.torque).all(axis=1))

    @cached_property
    def standing(self) -> Mask:
        """Rest of a joint in the log or in any free run. (T, n)"""
        found = self.motion.standing.copy()
        for p in self.pairings:
            found |= p.there(p.free.standing.astype(np.float64)) > 0.0
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
        return np.asarray(np.maximum(share, self.standing))

    @cached_property
    def misfit(self) -> Array:
        """Share of torque variation missed by the model in the free run, ≤ 1. (n,)"""
        missed = total = np.zeros(self.motion.drive_torque.shape[1])
        for p in self.pairings:
            used = np.searchsorted(p.free.t, p.times[p.known])
            used = np.unique(used.clip(0, len(p.free.t) - 1))
            # Of an hour with one free cycle that cycle, and what the filter hears of the rest.
            pad = round(HEARD / p.free.step)
            first = max(0, int(used[0]) - pad)
            free, used = p.free.part(slice(first, int(used[-1]) + pad + 1)), used - first
            missed = missed + np.var(free.smooth_gap[used], axis=0)
            total = total + np.var(free.smooth_model[used], axis=0)
        return np.asarray(np.sqrt(np.minimum(missed / np.maximum(total, 1e-12), 1.0)))
