"""A user's choice of a log's files."""

from dataclasses import dataclass
from typing import Annotated

from vftcli.signals.errors import ParameterError
from vftcli.signals.option import WRITE, Choice, Option

#: How much of a log its recording holds: every sample, of a long one its levels, or no recording.
#:
#: Levels are the lowest and highest samples of many stretches, and every sample where contacts
#: begin.
FULL, LEVELS, NONE = "full", "levels", "none"


@dataclass(frozen=True, kw_only=True)
class OutputChoice(Choice):
    """Files of a log beside those always written."""

    GROUP = WRITE

    extras: tuple[str, ...] = ()  #: Names of `estimates.EXTRAS`.
    #: How much of the log its recording holds: `FULL`, `LEVELS` or `NONE`.
    rrd_detail: Annotated[
        str,
        Option(
            "--rrd-detail",
            f"{FULL}|{LEVELS}|{NONE}",
            "How much of a long log recording.rrd holds. Levels, unless another is given: the "
            "lowest and highest samples of 5000 stretches, every sample where the strongest "
            "contacts begin.",
            seldom=True,
            shows_default=True,
        ),
    ] = LEVELS

    def __post_init__(self) -> None:
        if self.rrd_detail not in (FULL, LEVELS, NONE):
            raise ParameterError(
                f"--rrd-detail {self.rrd_detail} is none of {FULL}, {LEVELS} and {NONE}"
            )
        if self.rrd_detail == NONE and "rrd" in self.extras:
            raise ParameterError("--rrd-detail none writes no recording; leave --rrd or it away")

    @property
    def writes_recording(self) -> bool:
        """Whether a report has its recording."""
        return self.rrd_detail != NONE


PLAIN = OutputChoice()  #: What is written where nothing is asked for.
