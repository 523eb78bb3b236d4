"""`vftcli annotate` as a user types it."""

import json
from pathlib import Path

import pytest

FIXTURE = Path(__file__).parents[2] / "fixtures" / "panda_episodes"


@pytest.mark.slow
def test_it_says_what_was_written(run, tmp_path: Path) -> None:
    words = ("annotate", FIXTURE, "-o", tmp_path / "copy", "--add", "wrench,contact")
    code, _, err = run(*words)
    assert code == 0, err
    assert "3 episodes (3 done), 540 frames, panda, kfo-zoh, causal" in err
    assert "wrench: N, N·m, flange axes" in err
    assert "contact: 1 in a contact of the list, else 0" in err
    assert "the first 4 frames of an episode still show" in err
    again = run(*words, "--force", "--json", "--observer", "kfo-rts")
    assert json.loads(again[1])["causal"] is False


def test_a_load_is_sought_in_all_episodes_and_too_few_poses_are_refused(
    refused, tmp_path
) -> None:
    error = refused("identify", FIXTURE, "--method", "payload", "-o", tmp_path / "robot.toml")
    assert "panda_episodes episode 0, panda_episodes episode 1, panda_episodes episode 2" in error
    assert "the arm passes 2 different poses, and a load needs 4 at least" in error


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-o", FIXTURE / "copy"), "one inside the other"),
        (("-o", "c", "--add", "sd,force"), "--add force; there is wrench, sd,"),
        (("-o", "c", "--robot", "ur5"), "Choose this log's arm with --robot"),
    ],
)
def test_refusals_are_one_line(refused, here: Path, words: tuple[object, ...], said: str) -> None:
    assert said in refused("annotate", FIXTURE, *words)
    assert not any(here.iterdir())
