"""A user's choice of a log's files."""

from collections.abc import Sequence
from dataclasses import dataclass

from vftcli.signals.errors import ParameterError

#: How much of a log its recording holds: every sample, of a long one its levels, or no recording.
#:
#: Levels are the lowest and highest samples of many stretches, and every sample where contacts
#: begin.
FULL, LEVELS, NONE = "full", "levels", "none"


@dataclass(frozen=True, kw_only=True)
class OutputChoice:
    """Files of a log beside those always written."""

    extras: tuple[str, ...] = ()  #: Names of `estimates.EXTRAS`.
    #: How much of the log its recording holds: `FULL`, `LEVELS` or `NONE`.
    rrd_detail: str = LEVELS

    @classmethod
    def parsed(cls, *, extras: Sequence[str] = (), rrd_detail: str = LEVELS) -> "OutputChoice":
        """The choice that a user's words state."""
        if rrd_detail not in (FULL, LEVELS, NONE):
            raise ParameterError(
                f"--rrd-detail {rrd_detail} is none of {FULL}, {LEVELS} and {NONE}"
            )
        if rrd_detail == NONE and "rrd" in extras:
            raise ParameterError("--rrd-detail none writes no recording; leave --rrd or it away")
        return cls(extras=tuple(extras), rrd_detail=rrd_detail)

    @property
    def writes_recording(self) -> bool:
        """Whether a report has its recording."""
        return self.rrd_detail != NONE


PLAIN = OutputChoice()  #: What is written where nothing is asked for.
