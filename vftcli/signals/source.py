"""Where a recording came from."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from vftcli.signals.arrays import Indices
from vftcli.signals.remarks import Remark
from vftcli.signals.shown import Shown


class Cut(NamedTuple):
    """Samples that were cut out because no arm can have made them."""

    code: str  #: The finding that says why.
    start: float  #: Time of the first. [s]
    stop: float  #: Time of the last. [s]
    rows: int  #: How many there are.
    joints: tuple[int, ...]  #: The joints whose signals say so, from 1.
    #: The largest of what says so, in the unit of the finding's words; else its length in s.
    size: float


class Awaited:
    """A field that may be given as a function; it is called when the field is first read.

    A digest is computed beside everything else, and nobody waits for it before it is written down.
    """

    def __set_name__(self, _owner: type, name: str) -> None:
        self._key = f"_{name}"

    def __get__(self, instance: object, _owner: type) -> str:
        if instance is None:
            return ""  # the field's default
        value: str | Callable[[], str] = instance.__dict__[self._key]
        if not isinstance(value, str):
            value = value()
            instance.__dict__[self._key] = value
        return value

    def __set__(self, instance: object, value: str | Callable[[], str]) -> None:
        instance.__dict__[self._key] = value


@dataclass(frozen=True, kw_only=True, repr=False)
class Source(Shown):
    """Where a recording came from and what was done to it on the way in."""

    path: Path | None = None  #: The file or bag directory, or None for a recording made in memory.
    #: What the log is called in tables, unique within a command; the file's name where that is
    #: unique.
    label: str = ""
    format: str = "memory"  #: The reader's name.
    #: Hex digest of the file's bytes (of all files of a directory, in name order), by which a run
    #: is known again; reading it waits until it is computed.
    sha256: Awaited = Awaited()
    clock: str = "as given"  #: Which clock the stamps are from, in words.
    t0: float = 0.0  #: The log's own stamp of the first sample. [s]
    t0_ns: int | None = None  #: The same stamp in whole nanoseconds where the log counts them. [ns]
    rows: int = 0  #: Samples the file held before any were dropped.
    duplicates: int = 0  #: Rows dropped because their stamp repeated the one before.
    derived: tuple[str, ...] = ()  #: Signals that were made of others here and stand in no log.
    #: Facts on what was dropped, turned or derived; cautions and warnings on what looks suspicious
    #: but was left as it is.
    remarks: tuple[Remark, ...] = ()
    #: Which of several recordings in the file this is, as "episode 3"; "" for the only one.
    part: str = ""
    cuts: tuple[Cut, ...] = ()  #: Samples that were cut out because no arm can have made them.
    #: The sample that each of the rows is, or repeats; −1 for one that was dropped otherwise. None
    #: where each row is the sample of its number. (rows,)
    row_samples: Indices | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        if not self.label and self.path is not None:
            object.__setattr__(self, "label", self.path.name)

    def _headline(self) -> str:
        return f"{self.path or 'in memory'}, {self.format}"

    def cuts_between(self, start: float, stop: float) -> tuple[Cut, ...]:
        """What was cut out between two times. [s]"""
        return tuple(cut for cut in self.cuts if cut.start <= stop and cut.stop >= start)

    @property
    def repairs(self) -> tuple[str, ...]:
        """What was dropped, turned or derived, in words."""
        return tuple(str(remark) for remark in self.remarks if remark.level == "fact")

    @property
    def warnings(self) -> tuple[str, ...]:
        """What looks suspicious, in words."""
        return tuple(str(remark) for remark in self.remarks if remark.level != "fact")


IN_MEMORY = Source()  #: Of a recording that was made in memory.
