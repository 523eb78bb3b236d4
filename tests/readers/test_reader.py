"""ReadChoice: which part of a log is used, which signals, episode and arm are read."""

import numpy as np
import pytest
import seed_logs

from vftcli.readers.reader import ALL, ReadChoice, arm_of
from vftcli.readers.reading import read
from vftcli.signals.errors import LogError, ParameterError
from vftcli.signals.recording import Recording

LOG = Recording(t=0.5 * np.arange(9), q=np.arange(9.0)[:, None])


@pytest.mark.parametrize(
    ("text", "first", "samples"), [("1:2", 1.0, 3), (":1", 0.0, 3), ("3:", 3.0, 3), (":", 0.0, 9)]
)
def test_an_interval_holds_both_of_its_ends(text, first, samples):
    part = ReadChoice.parsed(interval=text).within(LOG)
    np.testing.assert_array_equal(part.t, first + 0.5 * np.arange(samples))
    assert ReadChoice().within(LOG) is LOG


def test_a_free_run_is_read_whole_in_the_same_way():
    choice = ReadChoice(columns="t,q:6", arm="left", episode=2, interval=(1.0, 2.0))
    assert choice.whole == ReadChoice(columns="t,q:6", arm="left")


def test_the_clock_and_the_positions_are_always_read():
    few = ReadChoice(signals=frozenset({"current"}))
    assert [few.wants(s) for s in ("t", "q", "current", "dq")] == [True, True, True, False]
    assert ReadChoice().wants("wrench")


def test_an_arm_of_a_log_of_one_is_refused(tmp_path):
    with pytest.raises(LogError, match="a log of one arm; leave --arm out"):
        read(seed_logs.table_csv(tmp_path / "x"), arm="left")
    with pytest.raises(LogError, match="holds the left arm alone"):
        arm_of(tmp_path, ReadChoice(arm="right"), ["left"])
    assert arm_of(tmp_path, ReadChoice(), ["left"]) == ("left", ())


@pytest.mark.parametrize(("text", "number"), [("3", 3), ("all", ALL), (None, None)])
def test_the_words_of_the_option(text, number):
    assert ReadChoice.parsed(episode=text).episode == number


@pytest.mark.parametrize("text", ["-1", "last", "", "1.5", "1:3", "٣"])
def test_what_is_no_episode_is_refused(text):
    with pytest.raises(ParameterError, match="is neither a number, as in 0, nor all"):
        ReadChoice.parsed(episode=text)


def test_no_arm_and_no_interval_are_refused():
    with pytest.raises(ParameterError, match="there is left, right"):
        ReadChoice.parsed(arm="both")
    with pytest.raises(ParameterError, match="is not A:B with A < B"):
        ReadChoice.parsed(interval="2:1")
