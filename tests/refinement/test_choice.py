"""RefinementChoice: which bias comes off what."""

import pytest

from vftcli.refinement import bias
from vftcli.refinement.choice import AUTOMATIC, REMOVALS, RefinementChoice
from vftcli.signals.errors import ParameterError


def test_nothing_said_asks_for_no_complete_log_by_itself() -> None:
    """The observers do: `best` runs on what the whole log allows."""
    assert RefinementChoice.parsed() == RefinementChoice(remove_bias=AUTOMATIC)
    assert not RefinementChoice().looks_back


@pytest.mark.parametrize(
    ("word", "best", "everyone", "afterwards"),
    [
        ("auto", True, False, False),
        ("whole-log", True, True, False),
        ("model", False, False, True),
        ("none", False, False, False),
    ],
)
def test_what_is_taken_off(word: str, best: bool, everyone: bool, afterwards: bool) -> None:
    asked = RefinementChoice.parsed(remove_bias=word)
    assert (asked.corrects_best, asked.corrects_all) == (best, everyone)
    assert asked.removes_bias == afterwards
    assert asked.looks_back == (everyone or afterwards)
    # What comes off once the observers have run has its maker; what comes off before has none.
    assert (word in bias.REMOVALS) == afterwards


def test_the_words_are_all_there_is() -> None:
    assert REMOVALS == ("auto", "whole-log", "model", "none")
    with pytest.raises(ParameterError, match="there is auto, whole-log, model, none"):
        RefinementChoice(remove_bias="all")
