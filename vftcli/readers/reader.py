"""A reader's request and result: a choice, a raw log, one of several episodes."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from vftcli.signals.errors import LogError, ParameterError
from vftcli.signals.option import LOG, Choice, Option
from vftcli.signals.option import interval as read_interval

if TYPE_CHECKING:
    from vftcli.readers.columns import ColumnSpec
    from vftcli.signals.arrays import Array, Indices
    from vftcli.signals.recording import Recording
    from vftcli.signals.remarks import Remark
    from vftcli.signals.wrench import WrenchFrame


@dataclass(frozen=True, kw_only=True)
class RawLog:
    """A log in SI units, before its clock is cleaned."""

    stamps: "Array"  #: Time stamps in ticks of `tick`; whole numbers stay whole. (T,)
    tick: float = 1.0  #: Length of one tick. [s]
    #: What has to be added to the stamps to be on the log's own clock. [s]
    origin: float = 0.0
    clock: str  #: Which clock the stamps are from, in words.
    #: Which of several recordings is wanted, from 1; None for all.
    segment: int | None = None
    signals: (
        #: Field of Recording → (T, n), `wrench` → (T, 6), in SI units.
        "Mapping[str, Array]"
    )
    wrench_frame: "WrenchFrame | None" = None  #: The log's own.
    joint_names: tuple[str, ...] = ()  #: The joints' names, base to tip, or empty.
    #: Name of the profile that the log itself settles, or None.
    robot_hint: str | None = None
    #: Whether nothing says that the positions are in radians.
    degrees_possible: bool = False
    #: What the reader dropped, turned or derived, and what looks suspicious.
    remarks: "tuple[Remark, ...]" = ()
    payload_mass: float | None = None  #: The controller's. [kg]
    #: Its centre of mass in flange axes. (3,) [m]
    payload_com: tuple[float, ...] | None = None
    #: Which of several recordings, as "episode 3"; "" for the only one.
    part: str = ""
    #: The files of a folder that it was read from; () for all.
    files: tuple[Path, ...] = ()
    #: Which rows of the file these are, counted from 0; None for all. (T,)
    rows: "Indices | None" = None
    #: Rows of the file that were left out because a value is no number.
    unknown: "Indices | None" = None


ARMS = ("left", "right")  #: Values of ``--arm``.
#: ``log.effort`` → field of Recording; None: the model decides.
EFFORT = {
    "auto": None,
    "current": "current",
    "torque": "torque",
    "torque-without-gravity": "torque_without_gravity",
}


ALL = -1  #: The episode of ``--episode all``: each, as a log of its own.


def episode_number(text: str) -> int:
    """The number of ``--episode``, counted as the file counts, or `ALL`."""
    if not re.fullmatch(r"[0-9]{1,9}|all", text):
        raise ParameterError(f"--episode {text!r} is neither a number, as in 0, nor all")
    return ALL if text == "all" else int(text)


class ReadChoice(Choice):
    """How a log is read, and which part of it is used."""

    GROUP = LOG

    #: Name of a format in `vftcli.readers.FORMATS`, None by content.
    format: Annotated[
        str | None,
        Option("log.format", "NAME", "Read the log as this format; default: by its content."),
    ] = None
    columns: Annotated[
        str | None, Option("--columns", "SPEC", "Name a table's columns (help columns).")
    ] = None
    #: The span that is used, from the first sample, None for all of it. [s]
    interval: Annotated[
        tuple[float, float] | None,
        Option("--interval", "A:B", "Use only seconds A to B of the log.", read_interval),
    ] = None
    #: A key of `EFFORT`; "auto" leaves it to who knows the robot; None: as it is called.
    effort: Annotated[
        str | None,
        Option(
            "log.effort",
            "auto|current|torque|torque-without-gravity",
            "What the log's effort is; auto: the kind that the robot's model explains.",
        ),
    ] = None
    #: Episode, `ALL`, or None to leave it to the reader.
    episode: Annotated[
        int | None,
        Option(
            "--episode",
            "K|all",
            "Choose an episode of a file that holds several.",
            episode_number,
        ),
    ] = None
    #: Which arm of a log of two, a member of `ARMS`; None for the only one.
    arm: Annotated[
        str | None, Option("--arm", "left|right", "Choose one arm of a two-armed log.")
    ] = None
    #: "dq" derives velocities in any log, "none" in none; None: where a fast log has none.
    derive: Annotated[
        str | None,
        Option(
            "log.derive",
            "dq|none",
            "Velocities from the positions; by default where the log has none, from 50 Hz on.",
        ),
    ] = None
    #: The signals that are wanted; None for all. Others may be left unread.
    signals: frozenset[str] | None = None
    #: Whether the log is only looked at: a part says more than a refusal.
    examining: bool = False
    #: Whether rows with no number are left out and said, not refused.
    skips_unknown: bool = False

    @property
    def spec(self) -> "ColumnSpec":
        """The parsed ``--columns``, empty without such a text."""
        from vftcli.readers.columns import ColumnSpec, parse_columns

        return parse_columns(self.columns) if self.columns is not None else ColumnSpec()

    @property
    def whole(self) -> "ReadChoice":
        """This choice for a whole file: a free run is a log of its own."""
        return replace(self, interval=None, episode=None)

    def with_stated_effort(self, recording: "Recording") -> "Recording":
        """A recording with its effort as stated, and derived velocities."""
        from vftcli.signals.repairs import RATE, with_velocity

        kind = EFFORT[self.effort] if self.effort is not None else None
        if kind is not None:
            recording = recording.with_effort(kind)
        if self.derive == "dq":
            return with_velocity(replace(recording, dq=None))
        return recording if self.derive else with_velocity(recording, RATE)

    def within(self, recording: "Recording") -> "Recording":
        """The part of a recording in the interval, which may not be empty."""
        return recording if self.interval is None else recording.between(*self.interval)

    def wants(self, signal: str) -> bool:
        """Whether a signal is to be read, as clock and positions always are."""
        return self.signals is None or signal in self.signals or signal in {"t", "q"}


#: The number of each episode of a file, rising, and the function that reads it.
Episodes = Mapping[int, Callable[[ReadChoice], RawLog]]


def episode_of(
    path: Path | str, request: ReadChoice, numbers: Sequence[int]
) -> "tuple[int, str, tuple[Remark, ...]]":
    """The number of the episode to read, its name as a part, and remarks."""
    from vftcli.signals.remarks import caution

    first, count = numbers[0], len(numbers)
    number = first if request.episode is None else request.episode
    if number not in numbers:
        raise LogError(
            f"{path}: no episode {number}; it holds {count}, from {first} to {numbers[-1]} "
            "(--episode K|all)."
        )
    part = f"episode {number}" if count > 1 else ""
    if request.episode is not None or count == 1:
        return number, part, ()
    return number, part, (caution("episode-chosen", episode=number, episodes=count),)


def arm_of(
    path: Path | str, request: ReadChoice, arms: Sequence[str], places: str = "by name"
) -> "tuple[str, tuple[Remark, ...]]":
    """The arm to read of two: the one asked for, or the first if only examining."""
    from vftcli.signals.remarks import caution

    if request.arm is not None and request.arm not in arms:
        raise LogError(f"{path}: holds the {arms[0]} arm alone; leave --arm out.")
    if request.arm is not None or len(arms) == 1:
        return request.arm or arms[0], ()
    if not request.examining:
        raise LogError(
            f"{path}: holds two arms ({places}); say which with --arm {' or --arm '.join(arms)}."
        )
    return arms[0], (caution("arm-side-chosen", arm=arms[0], other=arms[1], places=places),)
