"""RefinementChoice: which bias comes off what."""

import pytest

from vftcli.bias.choice import AUTOMATIC, REMOVALS, RefinementChoice
from vftcli.signals.errors import ParameterError


def test_nothing_said_asks_for_no_complete_log_by_itself() -> None:
    """The observers do: `best` runs on what the whole log allows."""
    assert RefinementChoice.parsed() == RefinementChoice(bias=AUTOMATIC)
    assert not RefinementChoice().corrects_all


@pytest.mark.parametrize(
    ("word", "everyone"), [("auto", False), ("whole-log", True), ("none", False)]
)
def test_what_is_taken_off(word: str, everyone: bool) -> None:
    asked = RefinementChoice.parsed(settings={"bias.method": word})
    assert asked.corrects_all == everyone


def test_the_words_are_all_there_is() -> None:
    assert REMOVALS == ("auto", "whole-log", "none")
    with pytest.raises(ParameterError, match="there is auto, whole-log, none"):
        RefinementChoice(bias="all")
