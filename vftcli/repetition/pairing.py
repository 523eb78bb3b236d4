"""Instants of a free run for a log's samples: by clock, or by positions."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.repetition.cycles import Cycles
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.filters import low_pass
from vftcli.signals.series import resample_columns

GAP = 5.5  #: A gap of more than this many median steps is not interpolated across.
FARTHEST = 0.1  #: How far phase may lie from the clock's word, as the low-passed shift. [s]
PHASE_CUTOFF = 8.0  #: Cutoff of the joint-space phase shift: a servo's compliance is slower. [Hz]


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


def pair_with_cycle(motion: Run, cycles: Cycles, free: int, period: float) -> Pairing:
    """Pair a log with one of its own cycles; that cycle itself has no partner.

    Args:
        motion: The log.
        cycles: Its cycles.
        free: The free cycle, from 0.
        period: Period to go by, the commanded or the found one. [s]
    """
    t, number = motion.t, cycles.number(motion.t)
    first, last = cycles.span(free)
    middle = 0.5 * (first + last)
    away = np.rint((t - middle) / period)
    times = t - away * period
    usable = (number >= 0) & (number != free) & (times >= first) & (times <= last)
    times = np.where(usable & ~in_gap(motion.t, times), times, np.nan)
    return Pairing(motion, times)


def pair_with_run(t: Array, free: Run, shift: float, rate: float = 1.0) -> Pairing:
    """Samples at t (T,) paired with a free run at rate·t + shift of its clock."""
    times = rate * t + shift
    inside = (times >= free.t[0]) & (times <= free.t[-1]) & ~in_gap(free.t, times)
    return Pairing(free, np.where(inside, times, np.nan))


def in_gap(clock: Array, times: Array) -> Mask:
    """Whether an instant lies in a gap of a clock. (T,)"""
    steps = np.diff(clock)
    at = np.clip(np.searchsorted(clock, times) - 1, 0, len(steps) - 1)
    return np.asarray(steps[at] > GAP * np.median(steps))


def by_phase(motion: Run, pairing: Pairing) -> Pairing:
    """Move each sample's partner to the nearest place on the free run's path.

    The shift along the path minimises the distance of the joint positions, by Gauss–Newton; where
    the path rests it shows nothing and the clock decides. The shift is
    smoothed along time.
    """
    known = pairing.known
    if np.count_nonzero(known) < 8:
        return pairing
    times, q = pairing.times[known], motion.q[known]
    free = pairing.free
    speed = free.smooth_dq
    shift = np.zeros(len(times))
    damping = 0.01 * float(np.mean(np.sum(speed**2, axis=1))) + 1e-6
    for _ in range(4):
        at = np.clip(times + shift, times.min(), times.max())
        path = resample_columns(at, free.t, speed)
        distance = resample_columns(at, free.t, free.q) - q
        shift -= np.sum(distance * path, axis=1) / (np.sum(path**2, axis=1) + damping)
        shift = np.clip(shift, -FARTHEST, FARTHEST)
    cutoff = min(PHASE_CUTOFF, 0.2 / motion.step)
    smooth = low_pass(motion.t[known], shift[:, None], cutoff)[:, 0]
    moved = pairing.times.copy()
    moved[known] = np.clip(times + smooth, times.min(), times.max())
    return Pairing(free, moved)


def mean_of(pairings: Sequence[Pairing], signals: Sequence[Array]) -> Array:
    """Mean of a signal over free runs at paired instants, known ones. (T, n)"""
    if len(pairings) == 1:
        return pairings[0].there(signals[0])
    count = np.zeros(len(pairings[0].times), dtype=np.intp)[:, None]
    total: Array = np.zeros(1)
    for p, x in zip(pairings, signals, strict=True):
        there = p.there(x)
        known = np.isfinite(there)
        count = count + known
        total = total + np.where(known, there, 0.0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
