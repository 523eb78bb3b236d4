"""Outputs: screens, pages, tables, figures, recordings and files."""

from typing import Annotated, Any

from vftcli.signals.errors import ParameterError
from vftcli.signals.option import WRITE, Choice, Option

#: Data for machines: key, with its unit → value.
Record = dict[str, Any]
#: A recording's part of its log: every sample, levels, or no recording.
#:
#: Levels are the lowest and highest samples of many stretches, and every sample where
#: contacts begin.
FULL, LEVELS, NONE = "full", "levels", "none"


class OutputChoice(Choice):
    """Files of a log beside those always written."""

    GROUP = WRITE

    mcap: Annotated[
        bool, Option("--mcap", "", "Also write estimates.mcap (ROS 2, Foxglove).")
    ] = False
    csv: Annotated[bool, Option("--csv", "", "Also write estimates.csv.")] = False
    rrd: bool = False  #: Whether `estimate` writes a recording.
    #: The recording's part of the log: `FULL`, `LEVELS` or `NONE`.
    detail: Annotated[
        str,
        Option(
            "recording.detail",
            f"{FULL}|{LEVELS}|{NONE}",
            "How much of a long log recording.rrd holds; levels: lowest and highest samples of "
            "5000 stretches, and every sample where the strongest contacts begin.",
        ),
    ] = LEVELS

    def __post_init__(self) -> None:
        if self.detail == NONE and self.rrd:
            raise ParameterError(
                "recording.detail=none writes no recording; leave it or --rrd out"
            )

    @property
    def extras(self) -> tuple[str, ...]:
        """Names of `estimates.EXTRAS` that are written."""
        return tuple(name for name in ("csv", "rrd", "mcap") if getattr(self, name))


PLAIN = OutputChoice()
