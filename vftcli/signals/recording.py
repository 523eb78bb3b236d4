"""Recording: one log in SI units on one strictly increasing clock; its Source."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import field, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.signals.arrays import (
    Array,
    Indices,
    Mask,
    check_clock,
    check_shape,
    median_step,
    release,
    seal,
)
from vftcli.signals.errors import ClockError, MissingSignalError, ParameterError, ShapeError
from vftcli.signals.option import interval_text
from vftcli.signals.remarks import Remark, fact
from vftcli.signals.shown import ALL, Shown, TimeSeries, per_joint, record
from vftcli.signals.wrench import WrenchFrame, per_axis

if TYPE_CHECKING:
    import polars as pl


class Cut(NamedTuple):
    """Samples that were cut out because no arm can have made them."""

    code: str  #: The finding that says why.
    start: float  #: Time of the first. [s]
    stop: float  #: Time of the last. [s]
    rows: int  #: How many there are.
    joints: tuple[int, ...]  #: The joints with signals that say so, from 1.
    #: Largest of its kind, in the unit of the words; else seconds.
    size: float


@record
class Source(Shown):
    """Where a recording came from and what was done to it on the way in."""

    #: The file or bag directory, or None for a recording made in memory.
    path: Path | None = None
    #: Its name in tables, unique within a command.
    label: str = ""
    format: str = "memory"  #: The reader's name.
    columns: str = ""  #: What ``--columns`` said of it, "" for nothing.
    sha256: str = ""  #: Hex digest of the file, of a folder's in name order.
    clock: str = "as given"  #: Which clock the stamps are from, in words.
    t0: float = 0.0  #: The log's own stamp of the first sample. [s]
    #: The same stamp in whole nanoseconds where the log counts them. [ns]
    t0_ns: int | None = None
    rows: int = 0  #: Samples the file held before any were dropped.
    duplicates: int = 0  #: Rows dropped as they repeat a stamp.
    #: Signals that were made of others here and stand in no log.
    derived: tuple[str, ...] = ()
    #: What was dropped, turned or derived, and what looks wrong.
    remarks: tuple[Remark, ...] = ()
    #: Which of several recordings, as "episode 3"; "" for the only one.
    part: str = ""
    cuts: tuple[Cut, ...] = ()  #: Samples that no arm can have made.
    #: The sample that each row is or repeats, −1 for none; None if each is its own. (rows,)
    row_samples: Indices | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        if not self.label and self.path is not None:
            object.__setattr__(self, "label", self.path.name)

    def _headline(self) -> str:
        return f"{self.path or 'in memory'}, {self.format}"

    @property
    def repairs(self) -> tuple[str, ...]:
        """Parts that were dropped, turned or derived, in words."""
        return tuple(str(remark) for remark in self.remarks if remark.level == "fact")

    @property
    def warnings(self) -> tuple[str, ...]:
        """Suspicious findings, in words."""
        return tuple(str(remark) for remark in self.remarks if remark.level != "fact")


IN_MEMORY = Source()  #: Of a recording that was made in memory.


#: Fields of a Recording that hold a signal → its unit, with its sign, and what it is.
SIGNALS = {
    "q": ("rad", "joint positions"),
    "dq": ("rad/s", "joint velocities"),
    "current": ("A", "motor currents"),
    "torque": ("N·m", "joint torques"),
    "torque_without_gravity": ("N·m", "joint torques without gravity's"),
    "target_q": ("rad", "target positions"),
    "target_dq": ("rad/s", "target velocities"),
    "target_current": ("A", "target currents"),
    "target_torque": ("N·m", "target torques"),
    "tau_ext": ("N·m, on the robot", "vendor estimates of the external torque"),
    "temperature": ("°C", "joint temperatures"),
    "wrench": ("N and N·m", "wrenches"),
}
MEANINGS = {name: meaning for name, (_, meaning) in SIGNALS.items()}
#: Those of them that hold one column a joint.
JOINT_SIGNALS = tuple(name for name in MEANINGS if name != "wrench")
#: Signals with columns in tables that differ in name from the field of a Recording.
COLUMN_NAMES = {"torque": "tau"}
#: Those that say what the drives do; a log has one of them or several.
EFFORTS = ("current", "torque", "torque_without_gravity")


def units_of(signals: Iterable[str]) -> dict[str, str]:
    """Units of a table's columns: of the time, and of these signals."""
    return {"t": "s", **{COLUMN_NAMES.get(name, name): SIGNALS[name][0] for name in signals}}


#: Signals that an examination looks at beside time and positions.
EXAMINED = frozenset(
    ("dq", *EFFORTS, "target_dq", "target_current", "target_torque", "tau_ext", "temperature")
)


@record
class Recording(TimeSeries):
    """Measurements of n joints at T instants; a missing signal is None."""

    t: Array  #: Time since the first sample, strictly increasing. (T,) [s]
    q: Array  #: Joint positions. (T, n) [rad]
    dq: Array | None = None  #: Joint velocities. (T, n) [rad/s]
    current: Array | None = None  #: Motor currents. (T, n) [A]
    torque: Array | None = None  #: Measured drive torques, gravity included. (T, n) [N·m]
    #: Drive torques less the gravity of arm and payload, from newer UR drivers. (T, n) [N·m]
    torque_without_gravity: Array | None = None
    target_q: Array | None = None  #: Commanded positions. (T, n) [rad]
    target_dq: Array | None = None  #: Commanded velocities. (T, n) [rad/s]
    target_current: Array | None = None  #: The controller's expected currents. (T, n) [A]
    #: The controller's inverse-dynamics torques. (T, n) [N·m]
    target_torque: Array | None = None
    #: The vendor's estimate of the external torque ON the robot. (T, n) [N·m]
    tau_ext: Array | None = None
    temperature: Array | None = None  #: Joint temperatures. (T, n) [°C]
    #: Force then moment, in the sign and axes that `wrench_frame` names. (T, 6) [N, N·m]
    wrench: Array | None = None
    #: What the log states of `wrench`; None where it states nothing.
    wrench_frame: WrenchFrame | None = None
    joint_names: tuple[str, ...] = ()  #: The joints' names, or empty.
    robot_hint: str | None = None  #: The profile that it settles, or None.
    #: Mass of the payload that the controller knows, None if not logged. [kg]
    payload_mass: float | None = None
    #: Its centre of mass in flange axes. (3,) [m]
    payload_com: tuple[float, ...] | None = None
    source: Source = IN_MEMORY  #: Where it came from and what was repaired.
    #: True torques and wrenches, columns as in PATH.truth.parquet.
    truth: "pl.DataFrame | None" = None

    def __post_init__(self) -> None:
        seal(self, "t", "q")
        check_shape(self.q, ("T", "n"), "q", "the recording")
        if np.size(self.t) == 0:
            raise ClockError(f"{self.name}: no samples")
        check_clock(self.t, self.name)
        shape = self.samples, self.joints
        seal(self, *JOINT_SIGNALS, shape=shape, called=self.name)
        seal(self, "wrench", shape=(self.samples, 6), called=self.name)
        if self.joint_names and len(self.joint_names) != self.joints:
            held = f"{len(self.joint_names)} joint names for {self.joints} joints"
            raise ShapeError(f"{self.name}: {held}; expected one per joint, or none")
        if self.payload_com is not None:
            check_shape(self.payload_com, (3,), "payload_com", self.name)

    def _headline(self) -> str:
        there = f"{self.samples} samples of {self.joints} joints over {self.duration:.4g} s"
        return f"{self.name}: {there}; {', '.join(self.signals)}"

    def _rows(self) -> Iterator[Sequence[object]]:
        yield "signal", "what it is", "columns", "least", "most"
        for name in self.signals:
            values = getattr(self, name)
            yield name, MEANINGS[name], values.shape[1], values.min(), values.max()

    def columns(self, rows: slice = ALL) -> Iterator[tuple[str, Array]]:
        """Every signal's columns, as ``q/1``, as `vftcli convert` writes them."""
        for name in self.signals:
            split = per_axis if name == "wrench" else per_joint
            yield from split(COLUMN_NAMES.get(name, name), getattr(self, name)[rows])

    @cached_property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.q.shape[1])

    @cached_property
    def samples(self) -> int:
        """Number of samples T."""
        return len(self.t)

    @cached_property
    def duration(self) -> float:
        """Time from the first to the last sample. [s]"""
        return float(self.t[-1] - self.t[0])

    @cached_property
    def median_step(self) -> float:
        """Median time between samples, the nominal sample time. [s]"""
        if self.samples < 2:
            raise ClockError(f"{self.name}: one sample has no sample time")
        return median_step(self.t)

    @cached_property
    def name(self) -> str:
        """Its name in tables and messages, unique within a command."""
        return self.source.label or "recording"

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals this log has, in a fixed order."""
        return tuple(name for name in MEANINGS if getattr(self, name) is not None)

    def require(self, name: str) -> Array:
        """A signal, or a MissingSignalError that says what would supply it."""
        value: Array | None = getattr(self, name)
        if value is None:
            derive = ", or derive them from the positions: --set log.derive=dq"
            raise MissingSignalError(
                f"{self.name}: the log has no {MEANINGS[name]} ({name}); it has "
                f"{', '.join(self.signals)}. Record them, or name their columns with --columns"
                f"{derive if name == 'dq' else ''}."
            )
        return value

    def changed(self, *remarks: Remark, **fields: Any) -> "Recording":  # noqa: ANN401 - fields
        """The recording with other fields, and remarks that say so."""
        source = replace(self.source, remarks=(*self.source.remarks, *remarks))
        return replace(self, source=source, **fields)

    def rows(self, rows: slice | Indices | Mask) -> "Recording":
        """Some of its samples; their times stay those of the whole log."""
        return replace(self, **{name: getattr(self, name)[rows] for name in ("t", *self.signals)})

    def blocks(self, size: int) -> Iterator["Recording"]:
        """Blocks of so many samples, one at a time in memory."""
        for start in range(0, self.samples, size):
            yield self.rows(slice(start, start + size))
            self.release()

    def release(self) -> None:
        """Give the memory of long signals back; files can be read again."""
        for name in self.signals:
            release(getattr(self, name))

    def with_effort(
        self, kind: str, *, source: str | None = None, factor: float = 1.0
    ) -> "Recording":
        """The recording with its effort as a `kind` of `EFFORTS`, and no other.

        `source` is the log's effort to use, None for that kind or the only one.
        """
        there = [name for name in EFFORTS if getattr(self, name) is not None]
        source = source or (kind if kind in there else None)
        if not there or (len(there) > 1 and source is None):
            raise MissingSignalError(
                f"{self.name}: the log has {' and '.join(there) or 'no effort'}, so none of it can "
                f"be read as {kind}; name the column with --columns"
            )
        source = source or there[0]
        value = getattr(self, source)
        remark = fact("effort-used", effort=MEANINGS[source], kind=MEANINGS[kind], factor=factor)
        # 0 + x: no zero of the other sign.
        return self.changed(remark, **{**dict.fromkeys(there), kind: 0.0 + factor * value})

    def without(self, rows: Mask, cuts: Iterable[Cut] = ()) -> "Recording":
        """The recording without some rows (T,); gaps stay in their place."""
        source, number = self.source, np.where(rows, -1, np.cumsum(~rows) - 1)
        samples = source.row_samples
        now = number if samples is None else np.where(samples < 0, -1, number[samples])
        source = replace(source, cuts=(*source.cuts, *cuts), row_samples=now)
        return replace(self.rows(~rows), source=source)

    def between(self, start: float, stop: float) -> "Recording":
        """The samples, at least two, with start ≤ t ≤ stop. [s]"""
        keep = (self.t >= start) & (self.t <= stop)
        if np.count_nonzero(keep) < 2:
            raise ClockError(
                f"{self.name}: fewer than two samples in {interval_text(start, stop)}; "
                f"the log runs from {self.t[0]:g} to {self.t[-1]:g} s"
            )
        return self.without(~keep)


def trim() -> None:
    """Give free memory back to the system, if the C library can."""
    import ctypes

    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


def pieces(values: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """The rows of an array, 65 536 at a time in memory."""
    for start in range(0, max(len(values), 1), size := 1 << 16):
        yield values[start : start + size]
        release(values)


def same_run(one: Recording, other: Recording) -> bool:
    """Whether two recordings were read from equal bytes.

    A span is the same run as the whole; of one file clock and part tell two runs apart.
    """
    if one is other:
        return True
    mine, theirs = one.source, other.source
    if (mine.rows, mine.t0, mine.part) != (theirs.rows, theirs.t0, theirs.part):
        return False
    return bool(mine.sha256) and mine.sha256 == theirs.sha256


def refuse_repeated_logs(
    logs: Sequence[Recording], option: str = "LOG", remedy: str = "give each run once"
) -> None:
    """Refuse logs that are the same run: their agreement would be evidence."""
    for a, b in combinations(logs, 2):
        if same_run(a, b):
            raise ParameterError(
                f"{a.name} and {b.name}, each given as {option}, are one run (equal sha256), so "
                f"the second adds nothing; {remedy}"
            )
