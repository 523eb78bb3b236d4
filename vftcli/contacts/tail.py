"""How often a signal that nothing touches passes a level: maxima of blocks, exponential tail.

The largest maxima of 1 s blocks lie beyond a level u at λ per hour, by e on average, and a level x
beyond u is passed at the rate λ exp(−(x − u)/e). A tail that bends (generalised Pareto) has one
number more to learn from few maxima, and its rare levels came out too low.
"""

from dataclasses import dataclass

import numpy as np

from vftcli.signals.arrays import Array, seal
from vftcli.signals.errors import ParameterError
from vftcli.signals.series import median_step
from vftcli.virtual_sensor.detection import ContactInterval, contact_intervals

SETTLING = 2.0  #: Left out at the start of every log: observers rise from zero. [s]
BLOCK = 1.0  #: Length of the blocks of which maxima are used. [s]
APART = 0.5  #: Passages closer than this are one event. [s]
KNOWN = 0.5  #: A block counts if at least this share of its samples is known.
ENOUGH = 5  #: Maxima beyond the level that tell a tail; below four its interval has no lower end.
#: Readings in a tail: at least so many where there are, more an hour, of so many blocks one.
LEAST_READINGS, AN_HOUR, SHARE = 30, 60.0, 5
NORMAL = 1.96  #: Half width of a normal's 95 % in standard deviations.


def block_maxima(t: Array, level: Array) -> Array:
    """The largest value of every known 1 s block, the settling left out, NaN ignored. (B,)"""
    used = t >= t[0] + SETTLING
    if np.count_nonzero(used) < 2:
        return np.zeros(0)
    t, level = t[used], level[used]
    number = np.floor((t - t[0]) / BLOCK).astype(np.intp)
    first = np.flatnonzero(np.diff(number, prepend=-1))
    known = np.add.reduceat(np.isfinite(level).astype(np.intp), first)
    maxima = np.maximum.reduceat(np.where(np.isfinite(level), level, -np.inf), first)
    found: Array = maxima[known * median_step(t) >= KNOWN * BLOCK]
    return found


def events(t: Array, level: Array) -> tuple[ContactInterval, ...]:
    """When a level (T,) exceeds 1, the settling left out; NaN, where it is not known, does not."""
    above = (np.nan_to_num(level, nan=0.0) > 1.0) & (t >= t[0] + SETTLING)
    return contact_intervals(t, above, gap=APART)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tail:
    """The exponential tail of one signal of one log."""

    maxima: Array  #: The block maxima, largest first. (B,)
    count: int  #: How many of them, k, lie beyond `start`.

    def __post_init__(self) -> None:
        seal(self, "maxima")

    @property
    def start(self) -> float:
        """u: where the tail begins. [the signal's unit]"""
        return float(self.maxima[self.count])

    @property
    def excess(self) -> float:
        """e: mean distance from `start` of the maxima beyond it. [the signal's unit]"""
        return float(np.mean(self.maxima[: self.count])) - self.start

    @property
    def hours(self) -> float:
        """Length of the known blocks. [h]"""
        return len(self.maxima) * BLOCK / 3600.0

    @property
    def rate(self) -> float:
        """λ: how often the signal passes `start`. [1/h]"""
        return self.count / self.hours

    def threshold(self, rate: float) -> tuple[float, tuple[float, float]]:
        """The level passed at a rate [1/h], u + e ln(λ/rate), and the ends of its 95 %.

        They are those of e, (1 ± 1.96/√k) e, the lower one u at the least. What happens more often
        than λ is no matter of the tail: of m times in all it is the m-th largest maximum, of m its
        95 %, m ± 1.96 √m.
        """
        if rate <= self.rate:
            step = self.excess * float(np.log(self.rate / rate))
            spread = float(NORMAL / np.sqrt(self.count) * step)
            value = self.start + step
            return value, (max(value - spread, self.start), value + spread)
        due = rate * self.hours
        if due > 0.5 * len(self.maxima):
            most = 0.5 * 3600.0 / BLOCK
            raise ParameterError(
                f"a rate of {rate:.4g} false alarms per hour of one signal is no alarm's: at most "
                f"{most:.4g} can be told from maxima of {BLOCK:g} s"
            )
        ranks = due + np.array([0.0, 1.0, -1.0]) * NORMAL * np.sqrt(due)
        places = np.clip(np.rint(ranks).astype(np.intp), 1, len(self.maxima)) - 1
        value, low, high = (float(x) for x in self.maxima[places])
        return value, (low, high)


def tail_of(maxima: Array) -> Tail | None:
    """The tail of block maxima (B,), None where there are fewer than five of them.

    k = min(max(30, 60 an hour), B/5) of them are taken for the tail.
    """
    hours = len(maxima) * BLOCK / 3600.0
    count = min(max(LEAST_READINGS, round(AN_HOUR * hours)), len(maxima) // SHARE)
    if count < 1:
        return None
    return Tail(maxima=np.sort(maxima)[::-1], count=count)
