"""The cycles of a repeated motion in one log, without the way in and the way out."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.repetition.periodicity import Period, moving_part
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.recording import Recording
from vftcli.signals.series import resample_columns

#: A sample is on the repeated path if it is there again one period away, within this. [rad]
ON_PATH = 0.1
COMPLETE = 0.97  #: Share of a cycle that must be in the log for it to count as whole.


class Cycles(NamedTuple):
    """The repeated part of a log."""

    period: float  #: Length of a cycle. [s]
    begin: float  #: First instant on the repeated path. [s]
    end: float  #: Last instant on it. [s]

    @property
    def whole(self) -> int:
        """Whole cycles; the last may lack a few samples."""
        return max(int((self.end - self.begin) / self.period + 1.0 - COMPLETE), 0)

    def number(self, t: Array) -> NDArray[np.int64]:
        """Cycle of each instant, from 0; −1 before the first and after the last. (T,)"""
        cycle = np.floor((t - self.begin) / self.period).astype(np.int64)
        return np.where((t < self.begin) | (t > self.end), -1, cycle)

    def span(self, cycle: int) -> tuple[float, float]:
        """First and last instant of a cycle, counted from 0. [s]"""
        first = self.begin + cycle * self.period
        return first, min(first + self.period, self.end)


def segment(recording: Recording, period: Period) -> Cycles:
    """Find where the repeated path begins and ends; the log may start amid a cycle.

    A sample is on the path if one period later or earlier the arm is at this place, or if the
    log is so short that neither is in it. Contacts push it off for a moment only, so the path
    begins with the first sample after which at least three quarters of a cycle are on it, and ends
    likewise.
    """
    t, q = moving_part(recording)
    seconds = period.seconds
    alone = (t + seconds > t[-1]) & (t - seconds < t[0])
    on_path = alone | comes_back(t, q, seconds) | comes_back(t, q, -seconds)
    begin = settled(t, on_path, seconds)
    end = -settled(-t[::-1], on_path[::-1], seconds)
    cycles = Cycles(seconds, begin, end)
    if not end - begin > seconds:
        raise ReferenceTorqueError(
            f"{recording.name}: only {max(end - begin, 0.0):.4g} s of the motion repeat, less than "
            f"the period of {seconds:.4g} s; give a free run of the same motion with --free"
        )
    return cycles


def comes_back(t: Array, q: Array, shift: float) -> Mask:
    """Whether the arm is at this place `shift` seconds away. (T,)"""
    distance = np.abs(resample_columns(t + shift, t, q, np.nan) - q).max(axis=1)
    return np.asarray(distance <= ON_PATH)


def settled(t: Array, on_path: Mask, seconds: float) -> float:
    """First instant with three quarters of the next cycle on the path. [s]"""
    count = np.concatenate([[0], np.cumsum(on_path)])
    stop = np.searchsorted(t, t + seconds)
    here = np.arange(len(t))
    share = (count[stop] - count[here]) / np.maximum(stop - here, 1)
    good = np.flatnonzero(on_path & (share >= 0.75))
    return float(t[good[0]]) if len(good) else float(t[-1])
