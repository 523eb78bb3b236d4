"""Outputs: screens, pages, tables, figures, recordings and files."""

from typing import Annotated, Any

from vftcli.signals.errors import ParameterError
from vftcli.signals.option import WRITE, Choice, Option

#: What machines read: key, with its unit → value.
Record = dict[str, Any]
#: How much of a log its recording holds: every sample, of a long one its levels, or no
#: recording.
#:
#: Levels are the lowest and highest samples of many stretches, and every sample where
#: contacts begin.
FULL, LEVELS, NONE = "full", "levels", "none"


class OutputChoice(Choice):
    """Files of a log beside those always written."""

    GROUP = WRITE

    extras: tuple[str, ...] = ()  #: Names of `estimates.EXTRAS`.
    #: How much of the log its recording holds: `FULL`, `LEVELS` or `NONE`.
    detail: Annotated[
        str,
        Option(
            "recording.detail",
            f"{FULL}|{LEVELS}|{NONE}",
            "How much of a long log recording.rrd holds; levels: the lowest and highest samples of "
            "5000 stretches, every sample where the strongest contacts begin.",
        ),
    ] = LEVELS

    def __post_init__(self) -> None:
        if self.detail not in (FULL, LEVELS, NONE):
            raise ParameterError(
                f"--set recording.detail={self.detail} is none of {FULL}, {LEVELS} and {NONE}"
            )
        if self.detail == NONE and "rrd" in self.extras:
            raise ParameterError(
                "recording.detail=none writes no recording; leave it or --rrd away"
            )


PLAIN = OutputChoice()  #: What is written where nothing is asked for.
