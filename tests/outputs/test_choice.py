"""What is written of a log: words that are taken, and those that are refused."""

import pytest

from vftcli.outputs import FULL, LEVELS, NONE, OutputChoice
from vftcli.signals.errors import ParameterError


def test_a_report_has_its_recording_unless_none_is_asked_for() -> None:
    assert OutputChoice.parsed() == OutputChoice(extras=(), detail=LEVELS)
    assert OutputChoice(extras=("rrd",), detail=FULL).detail == FULL
    assert OutputChoice.parsed(settings={"recording.detail": NONE}).detail == NONE


def test_words_that_mean_nothing_are_refused() -> None:
    with pytest.raises(
        ParameterError, match=r"recording\.detail=much is none of full, levels and none"
    ):
        OutputChoice.parsed(settings={"recording.detail": "much"})
    with pytest.raises(ParameterError, match="writes no recording"):
        OutputChoice(extras=("rrd",), detail=NONE)
