"""Estimates of a complete log: its free part gives noise, bias, bands, gains.

Here is the user's choice: bias subtracted, contacts listed or not.
"""

from typing import Annotated

from vftcli.signals.option import ESTIMATE, Choice, Option, is_yes

#: What the log allows: a bias for `best`, none for others.
AUTOMATIC = "auto"
#: The word for the bias fitted to the whole log.
WHOLE_LOG = "whole-log"


class RefinementChoice(Choice):
    """A user's choice for the estimates of a whole log."""

    GROUP = ESTIMATE

    bias: Annotated[
        str,
        Option(
            "bias.method",
            f"{AUTOMATIC}|{WHOLE_LOG}|none",
            "Whether to subtract the fitted model error; auto: from best only.",
        ),
    ] = AUTOMATIC
    contacts: Annotated[
        bool, Option("contacts.list", "yes|no", "Whether to list contacts.", is_yes)
    ] = True

    @property
    def corrects_all(self) -> bool:
        """Whether every observer runs without the whole log's bias."""
        return self.bias == WHOLE_LOG
