"""Without a command the words are of `contacts`: a log or options may come first."""

import re
from pathlib import Path

import numpy as np
import pytest

import vftcli as vft

LOG = Path(__file__).parents[2] / "fixtures" / "ur5_taps_ur_rtde.csv"


@pytest.mark.parametrize("words", [(LOG, "--robot", "ur5"), ("--robot", "ur5", LOG)])
def test_a_log_alone_is_asked_what_touched_the_arm(run, words: tuple[object, ...]) -> None:
    asked = ("--interval", "0:3", "--csv", "-q")
    expected = run("contacts", *words, *asked)
    assert expected[0] == 0
    assert run(*words, *asked) == expected


@pytest.mark.parametrize("name", ["nowhere.csv", "no/where", "-"])
def test_a_word_that_looks_as_a_path_is_a_log(refused, name: str) -> None:
    assert refused(name).startswith(f"error: {name}: ")


def test_a_file_of_the_folder_is_a_log_and_a_command_goes_before_it(run, here: Path) -> None:
    for name in ("push", "report"):
        (here / name).write_text("no log\n")
    assert run("push")[2].startswith("error: push: ")
    assert "Missing argument" in run("report")[2]
    assert run("./report")[2].startswith("error: report: ")


@pytest.mark.usefixtures("here")
def test_an_arm_that_is_not_settled_is_asked_for(run) -> None:
    """Behind what the log holds, on one line, with the two that fit best."""
    log = vft.read(LOG)
    held = np.column_stack([log.t, log.q, log.require("dq"), log.require("current")])
    # A longer path would leave no room for the format beside it.
    np.savetxt("push.csv", held, delimiter=",")
    words = ("push.csv", "--columns", "t,q:6,dq:6,current:6")
    code, out, err = run(*words)
    assert code == 1
    assert out.startswith("push.csv: headerless\n  joints    6\n")
    assert re.fullmatch(
        r"error: Which arm\? Best fits: ur5 .*%\), .*%\)\. Add --robot ur5\n", err
    )
    assert run(*words, "--json") == (code, "", err)
