"""ReadChoice: which part of a log is used, and which signals are read."""

import numpy as np
import pytest

from vftcli.readers.reader import ReadChoice
from vftcli.signals.errors import ParameterError
from vftcli.signals.recording import Recording

LOG = Recording(t=0.5 * np.arange(9), q=np.arange(9.0)[:, None])


def test_an_interval_holds_both_of_its_ends() -> None:
    part = ReadChoice.parsed(interval="1:2").within(LOG)
    np.testing.assert_array_equal(part.t, [1.0, 1.5, 2.0])


@pytest.mark.parametrize(("text", "samples"), [(":1", 3), ("3:", 3), (":", 9)])
def test_an_end_may_be_left_out(text: str, samples: int) -> None:
    assert ReadChoice.parsed(interval=text).within(LOG).samples == samples


def test_without_an_interval_the_recording_is_the_same() -> None:
    assert ReadChoice().within(LOG) is LOG


def test_a_free_run_is_read_whole_in_the_same_way() -> None:
    choice = ReadChoice(format="table", columns="t,q:6", interval=(1.0, 2.0))
    assert choice.whole == ReadChoice(format="table", columns="t,q:6")


def test_a_malformed_interval_is_refused() -> None:
    with pytest.raises(ParameterError, match="is not A:B with A < B"):
        ReadChoice.parsed(interval="2:1")


def test_the_clock_and_the_positions_are_always_read() -> None:
    few = ReadChoice(signals=frozenset({"current"}))
    assert [few.wants(s) for s in ("t", "q", "current", "dq")] == [True, True, True, False]
    assert ReadChoice().wants("wrench")
