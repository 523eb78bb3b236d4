"""RefinementChoice: which bias comes off what."""

import pytest

from vftcli.bias import AUTOMATIC, REMOVALS, RefinementChoice
from vftcli.signals.errors import ParameterError


def test_the_whole_log_s_bias_comes_off_for_everyone_if_asked_for() -> None:
    """Else the observers ask for it: `best` runs on what the whole log allows."""
    assert RefinementChoice.parsed() == RefinementChoice(bias=AUTOMATIC)
    words = {word: RefinementChoice.parsed(settings={"bias.method": word}) for word in REMOVALS}
    assert {word: asked.corrects_all for word, asked in words.items()} == {
        "auto": False,
        "whole-log": True,
        "none": False,
    }
    with pytest.raises(ParameterError, match="there is auto, whole-log, none"):
        RefinementChoice(bias="all")
