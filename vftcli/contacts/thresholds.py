"""Thresholds from motion that nobody touched, at a stated rate of false alarms.

A robot compares its own estimate with the thresholds it is given, so that one is taken where the
log has it. Where it has none, a momentum observer of 10 1/s runs: causal, as a robot needs it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vftcli.contacts.tail import (
    AN_HOUR,
    BLOCK,
    ENOUGH,
    LEAST_READINGS,
    SETTLING,
    SHARE,
    Tail,
    block_maxima,
    events,
    tail_of,
)
from vftcli.observers.paper import MomentumObserver
from vftcli.robots.run import Run
from vftcli.robots.terms import check_joints
from vftcli.signals.arrays import Array, seal
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.signals.shown import Shown, joined
from vftcli.signals.wrench import AXES, POINTS, unit_of
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor

if TYPE_CHECKING:
    import polars as pl

GAIN = 10.0  #: Of the momentum observer. [1/s]
#: A log that holds this many false alarms, at their rate, shows it; a shorter one extrapolates.
DUE = 3.0
LEAST = 1e-9  #: What stands for a threshold of zero, so that a level can be told. [N·m, N]
#: A log of this length has enough readings to tell its own tail. [s]
LONG_ENOUGH = SETTLING + 5 * ENOUGH * BLOCK
SELDOM = 0.5  #: A wrench that is known in less than this share of the samples is said to be.


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedSignals:
    """Joint torques and wrench of one log, as they are compared with thresholds."""

    recording: Recording  #: The log.
    torque: Array  #: Estimated external torque. (T, n) [N·m]
    #: Force, then moment, NaN where the pose cannot tell them; no column for an arm of fewer than
    #: six joints. (T, 6) [N, N·m]
    wrench: Array
    of_vendor: bool  #: Whether the torque is the robot's own estimate, not the observer's.
    logged_wrench: bool  #: Whether the wrench is the robot's own, not that of the torque.
    frame: str  #: Axes of the wrench and the point of its moment, in words; "" without a wrench.

    def __post_init__(self) -> None:
        seal(self, "torque", "wrench")

    @property
    def t(self) -> Array:
        """The log's time. (T,) [s]"""
        return self.recording.t

    @property
    def force(self) -> Array:
        """Size of the force, no column without a wrench. (T, 1) [N]"""
        size: Array = np.linalg.norm(self.wrench[:, :3], axis=1, keepdims=True)
        return size[:, : self.wrench.shape[1]]


def compared_signals(run: Run) -> ComparedSignals:
    """What a robot would compare along a log.

    The wrench is the log's own where the robot made it; one in sensor axes is an instrument's,
    which no threshold of the robot sees. Else it is that of the torque, by least squares in base
    axes about the flange point.
    """
    # The robot's own estimate asks for no model, which else would check.
    check_joints(run.recording, run.robot)
    recording, vendor = run.recording, run.recording.tau_ext
    of_vendor = vendor is not None and bool(np.any(vendor))
    if vendor is not None and of_vendor:
        torque = ExternalTorque(name="tau_ext", t=recording.t, tau=vendor)
    else:
        torque = MomentumObserver(gain=GAIN).estimate(run.terms)
    stated, own = recording.wrench_frame, recording.wrench
    logged = own is not None and bool(np.any(own)) and stated is not None
    if own is not None and stated is not None and logged and stated.axes != "sensor":
        wrench, frame = own, f"{stated.axes} axes at {POINTS.get(stated.point, stated.point)}"
    elif recording.joints >= 6:
        solved = VirtualSensor(frame="base").wrench(torque, recording.q, run.robot.chain)
        wrench, frame, logged = solved.known, "base axes at the flange point", False
    else:
        wrench, frame, logged = np.zeros((recording.samples, 0)), "", False
    return ComparedSignals(
        recording=recording,
        torque=torque.tau,
        wrench=wrench,
        of_vendor=of_vendor,
        logged_wrench=logged,
        frame=frame,
    )


def check_alike(signals: Sequence[ComparedSignals]) -> None:
    """Raise unless all logs hold the same estimates of the same arm."""
    first = signals[0]
    for other in signals[1:]:
        kinds = ((one.of_vendor, one.logged_wrench, one.frame) for one in (first, other))
        if len(set(kinds)) > 1:
            raise ParameterError(
                f"{other.recording.name} and {first.recording.name} do not hold the same "
                "estimates of the robot's own, and one set of thresholds serves one of them; "
                "give logs recorded alike"
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
    log: str  #: The free log that it comes from: the one that needs the highest.
    #: That log's tail; None where the log is too short for one, and its largest reading stands
    #: higher than what the others' tails say.
    tail: Tail | None

    @property
    def is_wide(self) -> bool:
        """Whether its interval is wider than its value, which then says nothing."""
        return self.interval[1] - self.interval[0] > self.value

    @property
    def level(self) -> float:
        """The threshold of an axis or of the force's size, NaN of one that is wide. [N, N·m]"""
        return float("nan") if self.is_wide else self.value

    @property
    def more_share(self) -> float:
        """How much more of its log's motion would narrow the interval to the value, of its length.

        The width falls with the root of the tail's readings, see `vftcli.contacts.tail.tail_of`.
        """
        if self.tail is None or not self.is_wide:
            return 0.0
        width = (self.interval[1] - self.interval[0]) / max(self.value, LEAST)
        count = self.tail.count * width**2
        blocks = SHARE * count if count <= LEAST_READINGS else count / AN_HOUR * 3600.0 / BLOCK
        return max(blocks / len(self.tail.maxima) - 1.0, 0.0)


@dataclass(frozen=True, kw_only=True, repr=False)
class Thresholds(Shown):
    """Thresholds of an arm."""

    rate: float  #: False alarms of a whole set, as of any joint. [1/h]
    joints: tuple[SignalThreshold, ...]  #: One a joint. [N·m]
    #: One an axis of the wrench, none for an arm of fewer than six joints; one that is wide is
    #: none. [N, N·m]
    axes: tuple[SignalThreshold, ...]
    #: That of the force's size, or none; its rate is `rate` itself; as of an axis. [N]
    force: tuple[SignalThreshold, ...]
    of_vendor: bool  #: Whether the joints' are of the robot's own estimate.
    logged_wrench: bool  #: Whether those of axes and force are of the robot's own wrench.
    remarks: tuple[Remark, ...] = ()  #: What a reader of the numbers should know.

    def _headline(self) -> str:
        values = joined(one.value for one in self.joints)
        return f"passed {self.rate:g} × an hour: {values} N·m on J1…"

    @property
    def named(self) -> tuple[tuple[str, str, float, SignalThreshold], ...]:
        """Name, unit, level and threshold of every joint and axis, and of the force's size.

        The level is NaN of an axis that has none.
        """
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
        """One row a signal: its threshold, null where there is none, interval, unit, rate, log."""
        import polars as pl

        names = ("signal", "threshold", "low", "high", "unit", "rate_per_h", "log")
        rows = [(n, level, *x.interval, unit, x.rate, x.log) for n, unit, level, x in self.named]
        return pl.DataFrame(rows, names, orient="row").with_columns(
            pl.col("threshold").fill_nan(None)
        )

    def level(self, name: str, signals: ComparedSignals) -> Array:
        """A set's signals in multiples of their thresholds, no column without thresholds. (T, k)"""
        values = [one.value if name == "joints" else one.level for one in getattr(self, name)]
        if not values:
            return np.zeros((len(signals.t), 0))
        # An axis without a threshold raises no alarm.
        limits = np.nan_to_num(values, nan=np.inf)
        # A signal that never moved has the threshold zero: whatever it reads then is an alarm.
        share: Array = np.abs(getattr(signals, SETS[name])) / np.maximum(limits, LEAST)
        return share


def find_thresholds(free: Sequence[ComparedSignals], rate: float) -> Thresholds:
    """Thresholds that motion like that of some logs passes at a rate.

    Every signal of a set of n gets rate/n. Several logs are not mixed: every threshold is that of
    the log which needs the highest, so that the worst day has the rate and the others fewer. A log
    too short for a tail counts by its largest reading alone, where another is long enough.

    Args:
        free: Logs of one arm that nobody touched.
        rate: False alarms of all joints together; and as many of all axes. [1/h]
    """
    if not (np.isfinite(rate) and rate > 0.0):
        raise ParameterError(f"--rate {rate:g} is not a positive number of false alarms per hour")
    check_alike(free)
    joints, axes, force = (thresholds_of_set(free, field, rate) for field in SETS.values())
    if not joints:
        longest = max(signals.recording.duration for signals in free)
        raise ParameterError(
            f"the longest free log has {longest:.3g} s: too few to tell how often a level is "
            f"passed; record at least {LONG_ENOUGH:g} s, better an hour"
        )
    made = Thresholds(
        rate=rate,
        joints=joints,
        axes=axes,
        force=force,
        of_vendor=free[0].of_vendor,
        logged_wrench=free[0].logged_wrench,
    )
    remarks = remarks_on(free, len(made.joints), rate)
    if free[0].wrench.shape[1] and not made.axes:
        remarks.append(caution("axes-untold"))
    wide = {name: one for name, *_, one in made.named[len(made.joints) :] if one.is_wide}
    if wide:
        lengths = {signals.recording.name: signals.recording.duration for signals in free}
        more = max(one.more_share * lengths[one.log] / 60.0 for one in wide.values())
        remarks.append(caution("axes-too-wide", axes=", ".join(wide), more_min=more))
    return replace(made, remarks=tuple(remarks))


def thresholds_of_set(
    free: Sequence[ComparedSignals], field: str, rate: float
) -> tuple[SignalThreshold, ...]:
    """The threshold of every signal of a set, none if no log tells one; see `find_thresholds`."""
    maxima = {
        log.recording.name: [block_maxima(log.t, x) for x in np.abs(getattr(log, field)).T]
        for log in free
    }
    count = getattr(free[0], field).shape[1]
    found = []
    for k in range(count):
        each = {name: own[k] for name, own in maxima.items() if len(own[k])}
        tails = {name: tail for name, own in each.items() if (tail := tail_of(own)) is not None}
        if not tails:
            return ()
        # Of few readings a tail is a guess, and a guess may not outdo what others know.
        sure = {name: tail for name, tail in tails.items() if tail.count >= ENOUGH} or tails
        levels = [
            SignalThreshold(*tail.threshold(rate / count), rate / count, name, tail)
            for name, tail in sure.items()
        ]
        for name in each.keys() - sure.keys():
            largest = float(each[name].max())
            levels.append(
                SignalThreshold(largest, (largest, float("nan")), rate / count, name, None)
            )
        found.append(max(levels, key=lambda one: one.value))
    return tuple(found)


def remarks_on(free: Sequence[ComparedSignals], joints: int, rate: float) -> list[Remark]:
    """What the logs can bear: whose estimate it is, how far it is extrapolated, what is missing."""
    first = free[0]
    remarks = [
        fact("thresholds-of-vendor") if first.of_vendor else caution("thresholds-of-observer")
    ]
    if first.frame:
        code = "thresholds-of-logged-wrench" if first.logged_wrench else "thresholds-of-torques"
        remarks.append(fact(code, frame=first.frame))
    # How many readings there are is the same for every joint.
    tails = [tail_of(block_maxima(signals.t, signals.torque[:, 0])) for signals in free]
    longest = max((tail for tail in tails if tail is not None), key=lambda tail: tail.hours)
    if longest.hours < (need := DUE / rate):
        remarks.append(
            caution(
                "thresholds-extrapolated",
                rate_per_h=rate,
                need_h=need,
                hours=longest.hours,
                maxima=longest.count,
                tail_rate_per_h=longest.rate,
                own_rate_per_h=rate / joints,
            )
        )
    if longest.count < ENOUGH:
        remarks.append(caution("tail-of-few", maxima=longest.count, need_s=LONG_ENOUGH))
    for signals in free:
        where, duration = Where(signals.recording.name), signals.recording.duration
        if duration < LONG_ENOUGH and longest.count >= ENOUGH:
            remarks.append(caution("free-log-too-short", where, duration_s=duration))
        if not signals.frame:
            continue
        if (share := float(np.mean(np.isfinite(signals.wrench[:, 0])))) < SELDOM:
            remarks.append(caution("wrench-seldom-known", where, share=share))
    return remarks


class CountedAlarms(NamedTuple):
    """False alarms of one free log, at thresholds learned without it."""

    log: str  #: The log.
    hours: float  #: Its length without the settling. [h]
    due: float  #: The false alarms of any joint that the rate allows in that time.
    joints: tuple[int, ...]  #: Those of every joint alone.
    any_joint: int  #: Those of all joints together.
    any_axis: int  #: Those of all axes together.


def counted_alarms(signals: ComparedSignals, thresholds: Thresholds) -> CountedAlarms:
    """How often a log passes thresholds."""
    t, joints = signals.t, thresholds.level("joints", signals)
    hours = max(signals.recording.duration - SETTLING, 0.0) / 3600.0
    return CountedAlarms(
        log=signals.recording.name,
        hours=hours,
        due=hours * thresholds.rate,
        joints=tuple(len(events(t, column)) for column in joints.T),
        any_joint=len(events(t, worst_of(joints))),
        any_axis=len(events(t, worst_of(thresholds.level("axes", signals)))),
    )


def left_out(free: Sequence[ComparedSignals], rate: float) -> tuple[CountedAlarms, ...]:
    """Every free log at the thresholds of the others: what a new day would have brought.

    None where there is one log alone, or the others are all too short.
    """
    found = []
    for k, signals in enumerate(free):
        others = [*free[:k], *free[k + 1 :]]
        if any(one.recording.duration >= LONG_ENOUGH for one in others):
            found.append(counted_alarms(signals, find_thresholds(others, rate)))
    return tuple(found)


def worst_of(level: Array) -> Array:
    """The largest of each sample's levels, NaN where none is known. (T,)"""
    worst: Array = np.fmax.reduce(level, axis=1, initial=np.nan)
    return worst
