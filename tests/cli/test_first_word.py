"""Without a command the words are of `contacts`: a log or options may come first."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import vftcli as vft

Run = Callable[..., tuple[int, str, str]]

LOG = Path(__file__).parents[2] / "fixtures" / "ur5_taps_ur_rtde.csv"


@pytest.mark.parametrize("words", [(LOG, "--robot", "ur5"), ("--robot", "ur5", LOG)])
def test_a_log_alone_is_asked_what_touched_the_arm(run: Run, words: tuple[object, ...]) -> None:
    asked = ("--interval", "0:3", "--csv", "-q")
    expected = run("contacts", *words, *asked)
    assert expected[0] == 0
    assert run(*words, *asked) == expected


@pytest.mark.parametrize("name", ["nowhere.csv", "no/where", "-"])
def test_a_word_that_looks_as_a_path_is_a_log(run: Run, name: str) -> None:
    code, out, err = run(name)
    assert (code, out) == (1, "")
    assert err.startswith(f"error: {name}: ")


def test_a_file_of_the_folder_is_a_log_and_a_command_goes_before_it(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("push", "report"):
        (tmp_path / name).write_text("no log\n")
    assert run("push")[2].startswith("error: push: ")
    assert "Missing argument" in run("report")[2]
    assert run("./report")[2].startswith("error: report: ")


@pytest.mark.parametrize(
    ("word", "said"),
    [("reprot", "No such command 'reprot'. Did you mean report?"), ("dance", "command 'dance'.")],
)
def test_any_other_word_is_refused_with_the_nearest_command(
    run: Run, word: str, said: str
) -> None:
    code, out, err = run(word, "x.csv")
    assert (code, out) == (2, "")
    assert said in err


def test_an_arm_that_is_not_settled_is_asked_for(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Behind what the log holds, on one line, with the two that fit best."""
    log = vft.read(LOG)
    held = np.column_stack([log.t, log.q, log.require("dq"), log.require("current")])
    np.savetxt(tmp_path / "push.csv", held, delimiter=",")
    # A longer path would leave no room for the format beside it.
    monkeypatch.chdir(tmp_path)
    words = ("push.csv", "--columns", "t,q:6,dq:6,current:6")
    code, out, err = run(*words)
    assert code == 1
    assert out.startswith("push.csv: headerless\n  joints    6\n")
    assert re.fullmatch(
        r"error: Which arm\? Best fits: ur5 .*%\), .*%\)\. Add --robot ur5\n", err
    )
    assert run(*words, "--json") == (code, "", err)
