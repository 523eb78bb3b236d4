"""Files that are no logs of an arm, told by name with the nearest remedy."""

from collections.abc import Callable
from typing import NamedTuple

from vftcli.readers.opening import HEAD_BYTES
from vftcli.readers.reader import LogFile
from vftcli.signals.errors import UnknownFormatError


class Foreign(NamedTuple):
    """A kind of file that is not read.

    Attributes:
        is_it: Whether a file is of it.
        words: What it is, and what to do.
    """

    is_it: Callable[[LogFile], bool]
    words: str


def directory(file: LogFile) -> bytes:
    """The last bytes of a zip file, which name what it holds."""
    return bytes(file.content[-HEAD_BYTES:])


FOREIGN = (
    Foreign(
        lambda file: file.head.startswith(b"PK\x03\x04") and b"xl/workbook" in directory(file),
        "an Excel workbook. Save the sheet as CSV and give that.",
    ),
    Foreign(
        lambda file: file.head.startswith(b"ULog\x01\x12\x35"),
        "a PX4 ULog of a drone, which has no arm to estimate torques of.",
    ),
)
"""Every kind that is told."""


def refuse_foreign(file: LogFile) -> None:
    """Refuse a file of a kind that is known and not read.

    Raises:
        UnknownFormatError: With what it is and what to do.
    """
    for kind in FOREIGN:
        if kind.is_it(file):
            raise UnknownFormatError(f"{file.path}: {kind.words}")
