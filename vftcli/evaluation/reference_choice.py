"""ReferenceChoice: which reference a comparison is made against, and the table of all there are."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from vftcli.evaluation.reference import (
    ReferenceLoad,
    sensor_reference,
    vendor_reference,
    zero_reference,
)
from vftcli.evaluation.reference_file import file_reference
from vftcli.repetition.free_motion import FreeMotion
from vftcli.repetition.two_cycle import two_cycle_reference
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.virtual_sensor.frames import NOTHING, Mounting

FILE = "file:"  #: The one reference whose name holds a path.


@dataclass(frozen=True, kw_only=True)
class ReferenceChoice:
    """Which reference a user asks for; checked when it is made, before any log is read.

    Raises:
        ReferenceTorqueError: If there is no such reference.
    """

    name: str  #: A key of `REFERENCES`, or ``file:PATH``.
    #: The column description of a reference file, None to recognise its columns.
    columns: str | None = None
    contacts: bool = False  #: Whether each observer's contacts are judged by the reference's too.

    def __post_init__(self) -> None:
        if self.path is None and self.name not in REFERENCES:
            there = ", ".join((*REFERENCES, f"{FILE}PATH"))
            raise ReferenceTorqueError(f"no reference {self.name!r}; there is {there}")

    @classmethod
    def parsed(
        cls, *, reference: str, reference_columns: str | None = None, contacts: bool = False
    ) -> "ReferenceChoice":
        """The choice that ``--reference``, ``--reference-columns`` and ``--contacts`` state."""
        return cls(name=reference, columns=reference_columns, contacts=contacts)

    @property
    def path(self) -> Path | None:
        """The file of ``file:PATH``, None for a reference that is made from the log."""
        return Path(self.name.removeprefix(FILE)) if self.name.startswith(FILE) else None


@dataclass(frozen=True, kw_only=True)
class ReferenceSource:
    """All that a reference can be made from."""

    motion: FreeMotion  #: The log that is compared, its robot, and its free motion.
    mounting: Mounting = NOTHING  #: Where tool and sensor sit on the flange.


#: Name at the command line → what makes it; ``file:PATH`` is the one name with a path in it.
REFERENCES: dict[str, Callable[[ReferenceSource], ReferenceLoad]] = {
    "zero": lambda source: zero_reference(source.motion.log),
    "vendor": lambda source: vendor_reference(source.motion.log.recording),
    "two-cycle": lambda source: ReferenceLoad(torque=two_cycle_reference(source.motion)),
    "sensor": lambda source: sensor_reference(
        source.motion.log.recording, source.motion.log.robot, source.mounting
    ),
}


def make_reference(source: ReferenceSource, choice: ReferenceChoice) -> ReferenceLoad:
    """The reference that is asked for, on the log's clock."""
    if choice.path is not None:
        log, mounting = source.motion.log, source.mounting
        return file_reference(choice.path, log.recording, log.robot, mounting, choice.columns)
    return REFERENCES[choice.name](source)
