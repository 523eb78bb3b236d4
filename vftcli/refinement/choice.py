"""What a user may choose of what only a complete log allows: which bias is taken off."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from vftcli.signals.option import ESTIMATE, Choice, Option
from vftcli.signals.parsing import check_known

#: The word for what the log allows: the whole log's bias for `best`, none for the others.
AUTOMATIC = "auto"
#: The word for the bias that is fitted to the whole log and taken off before observers run.
WHOLE_LOG = "whole-log"
REMOVALS = (AUTOMATIC, WHOLE_LOG, "none")  #: What ``--remove-bias`` takes.


@dataclass(frozen=True, kw_only=True)
class RefinementChoice(Choice):
    """What is done with the estimates once the whole log is known.

    Raises:
        ParameterError: If there is no such way to remove a bias.
    """

    GROUP: ClassVar[str] = ESTIMATE

    remove_bias: Annotated[
        str,
        Option(
            "--remove-bias",
            "|".join(REMOVALS),
            "Whether the bias fitted to the whole log comes off; auto: for best alone.",
            seldom=True,
        ),
    ] = AUTOMATIC

    def __post_init__(self) -> None:
        check_known(self.remove_bias, REMOVALS, f"--remove-bias {self.remove_bias!r}")

    @property
    def corrects_all(self) -> bool:
        """Whether every observer runs on what is left without the whole log's bias."""
        return self.remove_bias == WHOLE_LOG

    @property
    def corrects_best(self) -> bool:
        """Whether `best` does."""
        return self.remove_bias in {AUTOMATIC, WHOLE_LOG}
