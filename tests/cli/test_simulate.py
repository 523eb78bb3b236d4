"""`vftcli simulate` as a user calls it."""

import json
import re
from pathlib import Path

import pytest

from vftcli.readers.reading import read

CIRCLE = ("simulate", "ur5-circle", "-o")
pytestmark = pytest.mark.usefixtures("here")


def test_writes_log_truth_and_a_scenario_that_makes_the_same_log(run) -> None:
    code, out, _ = run(*CIRCLE, "a.csv", "--set", "duration=0.5", "--seed", "3", "--json")
    about = json.loads(out)
    assert (code, about["seed"]) == (0, 3)
    assert about["samples"] == read(Path("a.csv")).samples == 63
    endings = ("", ".truth.parquet", ".scenario.toml", ".run.json")
    assert [Path(f).name for f in about["files"]] == [f"a.csv{ending}" for ending in endings]
    assert run("simulate", "a.csv.scenario.toml", "-o", "b.csv")[0] == 0
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


def test_pair_writes_two_logs(run, here: Path) -> None:
    lossy = ("--set", "duration=0.3", "--set", "sensing.dropped=0.5")
    _, out, _ = run("simulate", "payload-pair", "-o", "p.csv", *lossy, "--json")
    rows = {p.name: p.read_text().count("\n") - 1 for p in here.glob("*.csv")}
    assert rows.keys() == {"p.csv", "p.free.csv"}
    assert json.loads(out)["samples"] == rows["p.csv"] != rows["p.free.csv"]


def test_lists_the_scenarios(run) -> None:
    text = run("simulate", "list")[1]
    assert re.search(r"^ur5-circle +UR5 on a horizontal circle", text, re.MULTILINE)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("simulate", "ur5-cirle", "-o", "x.csv"), "Did you mean ur5-circle"),
        ((*CIRCLE, "none/x.csv"), "no such folder"),
        ((*CIRCLE, "."), "-o"),
        ((*CIRCLE, "x.csv", "--as", "csv"), "log format 'csv'"),
        ((*CIRCLE, "x.csv", "--as", "libfranka"), "--as"),
    ],
)
def test_bad_input_is_one_clear_line(refused, here: Path, words: tuple[str, ...], said) -> None:
    assert said in refused(*words)
    assert list(here.iterdir()) == []


def test_nothing_is_overwritten_without_force_or_simulated_without_a_place(run, refused) -> None:
    path = Path("log.csv")
    path.write_text("mine")
    assert "--force" in refused(*CIRCLE, path, "--set", "duration=0.3")
    assert path.read_text() == "mine"
    code, _, err = run("simulate", "ur5-circle")
    assert (code, "-o PATH says where" in err) == (2, True)
    code, _, err = run(*CIRCLE, "x.csv", "--seed", "-1")
    assert (code, "'--seed': -1 is not in the range x>=0" in err) == (2, True)
