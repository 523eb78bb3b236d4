"""Evaluation: errors of estimates with intervals, lags and significance.

Here is the user's choice of a reference to compare with.
"""

from pathlib import Path
from typing import Annotated

from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.option import COMPARE, FILE, Choice, Option

#: The references that are made from the log.
NAMES = ("zero", "vendor", "two-cycle", "sensor")


class ReferenceChoice(Choice):
    """The reference a user asks for, checked before any log is read."""

    GROUP = COMPARE

    #: One of `NAMES`, or ``file:PATH``.
    name: Annotated[
        str,
        Option(
            "--reference",
            "REF",
            "Compare with two-cycle, sensor, vendor, zero, file.",
            completes=lambda: (*NAMES, FILE),
        ),
    ]
    #: The column description of a reference file, None to recognise its columns.
    columns: Annotated[
        str | None,
        Option("--reference-columns", "SPEC", "Name the columns of a reference file."),
    ] = None
    #: Whether to compare the listed contacts with the reference's too.
    contacts: bool = False

    def __post_init__(self) -> None:
        if self.path is None and self.name not in NAMES:
            there = ", ".join((*NAMES, f"{FILE}PATH"))
            raise ReferenceTorqueError(f"no reference {self.name!r}; there is {there}")

    @property
    def path(self) -> Path | None:
        """The file of ``file:PATH``, None for a reference made from the log."""
        return Path(self.name.removeprefix(FILE)) if self.name.startswith(FILE) else None
