"""A user's choice for a complete log: the bias to subtract."""

from dataclasses import dataclass

from vftcli.signals.parsing import check_known

#: The word for what the log allows: the whole log's bias for `best`, none for the others.
AUTOMATIC = "auto"
#: The word for the bias fitted to the whole log and subtracted before observers run.
WHOLE_LOG = "whole-log"
REMOVALS = (AUTOMATIC, WHOLE_LOG, "none")  #: What ``--remove-bias`` takes.


@dataclass(frozen=True, kw_only=True)
class RefinementChoice:
    """A user's choice for the estimates of a whole log.

    Raises:
        ParameterError: If there is no such way to remove a bias.
    """

    remove_bias: str = AUTOMATIC  #: One of `REMOVALS`.

    def __post_init__(self) -> None:
        check_known(self.remove_bias, REMOVALS, f"--remove-bias {self.remove_bias!r}")

    @classmethod
    def parsed(cls, *, remove_bias: str | None = None) -> "RefinementChoice":
        """The choice that ``--remove-bias`` states."""
        return cls(remove_bias=remove_bias or AUTOMATIC)

    @property
    def corrects_all(self) -> bool:
        """Whether every observer runs on what is left without the whole log's bias."""
        return self.remove_bias == WHOLE_LOG

    @property
    def corrects_best(self) -> bool:
        """Whether `best` does."""
        return self.remove_bias in {AUTOMATIC, WHOLE_LOG}
