"""Parts: the one asked for, else the first, and said; never one that is not there."""

from pathlib import Path

import pytest
import seed_logs
from hypothesis import given
from hypothesis import strategies as st

from vftcli.readers.reader import ALL, ReadChoice, arm_of, episode_of
from vftcli.readers.reading import read
from vftcli.signals.errors import LogError, ParameterError

PATH = Path("log")
NUMBERS = st.lists(st.integers(0, 50), min_size=1, unique=True).map(sorted)


@given(NUMBERS)
def test_the_first_of_several_is_said_and_the_only_one_is_not(numbers: list[int]) -> None:
    number, part, remarks = episode_of(PATH, ReadChoice(), numbers)
    assert number == numbers[0]
    assert bool(part) == bool(remarks) == (len(numbers) > 1)


@given(NUMBERS, st.integers(0, 60))
def test_what_is_asked_for_is_taken_or_refused(numbers: list[int], wanted: int) -> None:
    choice = ReadChoice(episode=wanted)
    if wanted in numbers:
        assert episode_of(PATH, choice, numbers)[::2] == (wanted, ())
        return
    with pytest.raises(LogError, match=f"no episode {wanted}; it holds {len(numbers)}, from "):
        episode_of(PATH, choice, numbers)


def test_one_arm_of_two_has_to_be_named_but_to_look_at() -> None:
    arms = ("left", "right")
    assert arm_of(PATH, ReadChoice(arm="right"), arms) == ("right", ())
    assert arm_of(PATH, ReadChoice(), arms[:1]) == ("left", ())
    seen, remarks = arm_of(PATH, ReadChoice(examining=True), arms)
    assert (seen, [remark.code for remark in remarks]) == ("left", ["arm-side-chosen"])
    with pytest.raises(LogError, match="--arm left or --arm right"):
        arm_of(PATH, ReadChoice(), arms)
    with pytest.raises(LogError, match="holds the left arm alone"):
        arm_of(PATH, ReadChoice(arm="right"), arms[:1])


def test_an_arm_of_a_log_of_one_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="a log of one arm; leave --arm out"):
        read(seed_logs.table_csv(tmp_path / "x"), arm="left")


@pytest.mark.parametrize(("text", "number"), [("3", 3), ("all", ALL), (None, None)])
def test_the_words_of_the_option(text: str | None, number: int | None) -> None:
    assert ReadChoice.parsed(episode=text).episode == number


@pytest.mark.parametrize("text", ["-1", "last", "", "1.5", "1:3", "٣"])
def test_what_is_no_episode_is_refused(text: str) -> None:
    with pytest.raises(ParameterError, match="is neither a number, as in 0, nor all"):
        ReadChoice.parsed(episode=text)
    with pytest.raises(ParameterError, match="there is left, right"):
        ReadChoice.parsed(arm=text)
