"""Thresholds from motion that nobody touched, at a stated rate of false alarms.

The largest maxima of 1 s blocks of a signal lie beyond a level u at λ per hour, by e on
average, and a level x beyond u is passed at the rate λ exp(−(x − u)/e). Rare levels of a
tail that bends (generalised Pareto) came out too low.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vftcli.signals.arrays import Z_95, Array, median_step
from vftcli.signals.errors import ParameterError
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.signals.shown import Shown, joined, record
from vftcli.signals.wrench import AXES, unit_of
from vftcli.wrench.detection import ContactInterval, contact_intervals

if TYPE_CHECKING:
    import polars as pl


SETTLING = 2.0  #: Left out at every log's start: observers rise. [s]
BLOCK = 1.0  #: Length of the blocks of which maxima are used. [s]
APART = 0.5  #: Passages closer than this are one event. [s]
KNOWN = 0.5  #: Least share of known samples of a block.
#: Maxima that tell a tail; below four its interval has no lower end.
ENOUGH = 5
#: Readings in a tail: at least, in each hour, and per block.
LEAST_READINGS, AN_HOUR, SHARE = 30, 60.0, 5


def block_maxima(t: Array, level: Array) -> Array:
    """Largest value of every known 1 s block behind the settling. (B,)"""
    used = t >= t[0] + SETTLING
    if np.count_nonzero(used) < 2:
        return np.zeros(0)
    t, level = t[used], level[used]
    number = np.floor((t - t[0]) / BLOCK).astype(int)
    first = np.flatnonzero(np.diff(number, prepend=-1))
    known = np.add.reduceat(np.isfinite(level).astype(int), first)
    maxima = np.maximum.reduceat(np.where(np.isfinite(level), level, -np.inf), first)
    return maxima[known * median_step(t) >= KNOWN * BLOCK]


def events(t: Array, level: Array) -> tuple[ContactInterval, ...]:
    """Times of a level (T,) above 1, without the settling."""
    above = (np.nan_to_num(level, nan=0.0) > 1.0) & (t >= t[0] + SETTLING)
    return contact_intervals(t, above, gap=APART)


class Tail(NamedTuple):
    """The exponential tail of one signal of one log."""

    maxima: Array  #: The block maxima, largest first. (B,)
    size: int  #: Number k of them beyond `start`.
    start: float  #: u: where the tail begins. [the signal's unit]
    excess: float  #: e: mean distance of those beyond. [the signal's unit]
    hours: float  #: Length of the known blocks. [h]
    rate: float  #: λ: how often the signal passes `start`. [1/h]

    def threshold(self, rate: float) -> tuple[float, tuple[float, float]]:
        """The level passed at a rate [1/h], u + e ln(λ/rate), and the ends of its 95 %.

        By (1 ± 1.96/√k) e, the lower one u at the least. Above λ: of m events the level is the
        m-th largest maximum, 95 % m ± 1.96 √m.
        """
        if rate <= self.rate:
            step = self.excess * np.log(self.rate / rate)
            value, spread = self.start + step, Z_95 / np.sqrt(self.size) * step
            return value, (max(value - spread, self.start), value + spread)
        due = rate * self.hours
        if due > 0.5 * len(self.maxima):
            most = 0.5 * 3600.0 / BLOCK
            raise ParameterError(
                f"{rate:.4g} false alarms per hour of one signal are too many: at most {most:.4g} "
                f"can be found from maxima of {BLOCK:g} s"
            )
        ranks = due + np.array([0.0, 1.0, -1.0]) * Z_95 * np.sqrt(due)
        places = np.rint(ranks).astype(int).clip(1, len(self.maxima)) - 1
        value, low, high = self.maxima[places].tolist()
        return value, (low, high)


def tail_of(maxima: Array) -> Tail | None:
    """The tail of block maxima (B,), None of fewer than five."""
    hours = len(maxima) * BLOCK / 3600.0
    count = min(max(LEAST_READINGS, round(AN_HOUR * hours)), len(maxima) // SHARE)
    if not count:
        return None
    ordered = np.sort(maxima)[::-1]
    start = float(ordered[count])
    excess = float(ordered[:count].mean()) - start
    return Tail(ordered, count, start, excess, hours, count / hours)


#: So many false alarms show a rate; fewer extrapolate it.
DUE = 3.0
LEAST = 1e-9  #: In place of a threshold of zero. [N·m, N]
#: Shortest log that tells its own tail. [s]
LONG_ENOUGH = SETTLING + 5 * ENOUGH * BLOCK
SELDOM = 0.5  #: Least share of samples with a wrench.


class ComparedSignals(NamedTuple):
    """Joint torques and wrench of one log."""

    recording: Recording  #: The log.
    torque: Array  #: Estimated external torque. (T, n) [N·m]
    #: Force, then moment, NaN where unknown; no column for an arm of
    #: fewer than six joints. (T, 6) [N, N·m]
    wrench: Array
    of_vendor: bool  #: Whether the torque is the robot's own estimate.
    logged_wrench: bool  #: Whether the wrench is the robot's own.
    #: Axes of the wrench and point of its moment, or "".
    frame: str

    @property
    def t(self) -> Array:
        """The log's time. (T,) [s]"""
        return self.recording.t

    @property
    def force(self) -> Array:
        """Size of the force, no column without a wrench. (T, 1) [N]"""
        size: Array = np.linalg.norm(self.wrench[:, :3], axis=1, keepdims=True)
        return size[:, : self.wrench.shape[1]]


def check_alike(signals: Sequence[ComparedSignals]) -> None:
    """Raise unless all logs hold the same estimates of the same arm."""
    first, *others = signals
    for other in others:
        kinds = {(one.of_vendor, one.logged_wrench, one.frame) for one in (first, other)}
        if len(kinds) > 1:
            raise ParameterError(
                f"{other.recording.name} and {first.recording.name} hold "
                "different estimates of the robot's own, and thresholds serve only one of them; "
                "give logs recorded in one way"
            )
        if other.torque.shape[1] != first.torque.shape[1]:
            raise ParameterError(
                f"{other.recording.name} has {other.torque.shape[1]} joints and "
                f"{first.recording.name} {first.torque.shape[1]}; give logs of one arm"
            )


#: Set of signals that share a rate → its field of `ComparedSignals`.
SETS = {"joints": "torque", "axes": "wrench", "force": "force"}


class SignalThreshold(NamedTuple):
    """The threshold of one joint, axis or of the force's size."""

    value: float  #: The threshold. [N·m, N]
    interval: tuple[float, float]  #: 95 % of it.
    rate: float  #: The false alarms that are this signal's share. [1/h]
    log: str  #: The free log that needs the highest.
    #: That log's tail, None of one that is too short for it.
    tail: Tail | None

    @property
    def is_wide(self) -> bool:
        """Whether its interval is wider than its value."""
        return self.interval[1] - self.interval[0] > self.value

    @property
    def level(self) -> float:
        """Threshold of an axis or the force's size, NaN if wide. [N, N·m]"""
        return float("nan") if self.is_wide else self.value


@record
class Thresholds(Shown):
    """Thresholds of an arm."""

    rate: float  #: False alarms of a whole set, as of any joint. [1/h]
    joints: tuple[SignalThreshold, ...]  #: One a joint. [N·m]
    #: One an axis, none below six joints or where wide. [N, N·m]
    axes: tuple[SignalThreshold, ...]
    #: Of the force's size, or none; as of an axis. [N]
    force: tuple[SignalThreshold, ...]
    of_vendor: bool  #: Whether the joints' are of the robot's own estimate.
    logged_wrench: bool  #: Whether the others are of the robot's own wrench.
    remarks: tuple[Remark, ...] = ()  #: Limits of the numbers.

    def _headline(self) -> str:
        values = joined(one.value for one in self.joints)
        return f"passed {self.rate:g} × an hour: {values} N·m on J1…"

    @property
    def named(self) -> tuple[tuple[str, str, float, SignalThreshold], ...]:
        """Name, unit, level (NaN without one), threshold of joints, axes and |F|."""
        return (
            *((f"J{j}", "N·m", one.value, one) for j, one in enumerate(self.joints, start=1)),
            *((n, unit_of(n), x.level, x) for n, x in zip(AXES, self.axes, strict=False)),
            *(("|F|", "N", one.level, one) for one in self.force),
        )

    def _rows(self) -> Iterator[Sequence[object]]:
        yield "signal", "threshold", "unit", "95 %", "needed by"
        for name, unit, level, one in self.named:
            yield name, level, unit, joined(one.interval), one.log

    def to_polars(self) -> "pl.DataFrame":
        """One row a signal: threshold or null, interval, unit, rate, log."""
        import polars as pl

        names = ("signal", "threshold", "low", "high", "unit", "rate_per_h", "log")
        rows = [(n, level, *x.interval, unit, x.rate, x.log) for n, unit, level, x in self.named]
        return pl.DataFrame(rows, names, orient="row").with_columns(
            pl.col("threshold").fill_nan(None)
        )

    def level(self, name: str, signals: ComparedSignals) -> Array:
        """A set's signals in multiples of their thresholds. (T, k)"""
        values = [one.value if name == "joints" else one.level for one in getattr(self, name)]
        # An axis without a threshold raises no alarm.
        limits = np.nan_to_num(values, nan=np.inf)
        # A signal that never moved has the threshold zero.
        sizes = abs(getattr(signals, SETS[name])[:, : len(values)])
        return np.asarray(sizes / np.maximum(limits, LEAST))


def find_thresholds(free: Sequence[ComparedSignals], rate: float) -> Thresholds:
    """Thresholds that motion like that of some logs passes at a rate.

    Each of n signals gets rate/n [1/h]; the log that needs the highest threshold sets it.
    """
    if not (np.isfinite(rate) and rate > 0.0):
        raise ParameterError(f"--rate {rate:g} is not a positive number of false alarms per hour")
    check_alike(free)
    joints, axes, force = (thresholds_of_set(free, field, rate) for field in SETS.values())
    if not joints:
        raise ParameterError(
            f"the longest free log has {max(signals.recording.duration for signals in free):.3g} "
            "s: too short to count how often a level is "
            f"passed; record at least {LONG_ENOUGH:g} s, better an hour"
        )
    remarks = remarks_on(free, len(joints), rate)
    if free[0].wrench.shape[1] and not axes:
        remarks.append(caution("axes-unknown"))
    named = (*zip(AXES, axes, strict=False), *(("|F|", one) for one in force))
    if wide := {name: one for name, one in named if one.is_wide}:
        lengths = {signals.recording.name: signals.recording.duration for signals in free}
        more = 0.0
        for one in wide.values():
            if one.tail is not None:
                # So many readings narrow its interval to the value.
                count = one.tail.size * (np.ptp(one.interval) / max(one.value, LEAST)) ** 2
                rare = count <= LEAST_READINGS
                blocks = SHARE * count if rare else count / AN_HOUR * 3600.0 / BLOCK
                share = blocks / len(one.tail.maxima) - 1.0
                more = max(more, share * lengths[one.log] / 60.0)
        remarks.append(caution("axes-too-wide", axes=", ".join(wide), more_min=more))
    return Thresholds(
        rate=rate,
        joints=joints,
        axes=axes,
        force=force,
        of_vendor=free[0].of_vendor,
        logged_wrench=free[0].logged_wrench,
        remarks=tuple(remarks),
    )


def thresholds_of_set(
    free: Sequence[ComparedSignals], field: str, rate: float
) -> tuple[SignalThreshold, ...]:
    """Thresholds of a set's signals, none if no log shows one."""
    signals = {log.recording.name: (log.t, abs(getattr(log, field)).T) for log in free}
    count = getattr(free[0], field).shape[1]
    share, found = rate / max(count, 1), []
    for k in range(count):
        maxima = {name: block_maxima(t, x[k]) for name, (t, x) in signals.items()}
        tails = {name: tail for name, own in maxima.items() if (tail := tail_of(own)) is not None}
        if not tails:
            return ()
        # A tail of few readings is a guess: others come first.
        sure = {name: tail for name, tail in tails.items() if tail.size >= ENOUGH} or tails
        levels = [
            SignalThreshold(*tail.threshold(share), share, name, tail)
            for name, tail in sure.items()
        ]
        levels += [
            SignalThreshold(own.max(), (own.max(), np.nan), share, name, None)
            for name, own in maxima.items()
            if len(own) and name not in sure
        ]
        found.append(max(levels, key=lambda one: one.value))
    return tuple(found)


def remarks_on(free: Sequence[ComparedSignals], joints: int, rate: float) -> list[Remark]:
    """Remarks on the logs: source, extrapolation, missing signals."""
    first = free[0]
    remarks = [
        fact("thresholds-of-vendor") if first.of_vendor else caution("thresholds-of-observer")
    ]
    if first.frame:
        code = "thresholds-of-logged-wrench" if first.logged_wrench else "thresholds-of-torques"
        remarks.append(fact(code, frame=first.frame))
    # Every joint has equally many readings.
    tails = (tail_of(block_maxima(signals.t, signals.torque[:, 0])) for signals in free)
    longest = max(filter(None, tails), key=lambda tail: tail.hours)
    if longest.hours < (need := DUE / rate):
        remarks.append(
            caution(
                "thresholds-extrapolated",
                rate_per_h=rate,
                need_h=need,
                hours=longest.hours,
                maxima=longest.size,
                tail_rate_per_h=longest.rate,
                own_rate_per_h=rate / joints,
            )
        )
    if longest.size < ENOUGH:
        remarks.append(caution("tail-of-few", maxima=longest.size, need_s=LONG_ENOUGH))
    for signals in free:
        where, duration = Where(signals.recording.name), signals.recording.duration
        if duration < LONG_ENOUGH and longest.size >= ENOUGH:
            remarks.append(caution("free-log-too-short", where, duration_s=duration))
        if not signals.frame:
            continue
        if (share := np.isfinite(signals.wrench[:, 0]).mean()) < SELDOM:
            remarks.append(caution("wrench-seldom-known", where, share=share))
    return remarks


def worst_of(level: Array) -> Array:
    """The largest of each sample's levels, or NaN. (T,)"""
    return np.asarray(np.fmax.reduce(level, axis=1, initial=np.nan))
