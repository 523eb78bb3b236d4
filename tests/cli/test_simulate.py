"""`vftcli simulate` as a user calls it."""

import json
import re
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from vftcli.cli.convert import simulate_log
from vftcli.readers.reading import read
from vftcli.signals.errors import VftError

app = typer.Typer()
app.command()(simulate_log)


def run(*arguments: str) -> str:
    result = CliRunner().invoke(app, arguments)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


def test_writes_log_truth_and_scenario(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    out = run("ur5-circle", "-o", str(path), "--set", "duration=0.5", "--seed", "3", "--json")
    about = json.loads(out)
    assert about["seed"] == 3
    assert about["samples"] == read(path).samples == 63
    assert [Path(f).name for f in about["files"]] == [
        "log.csv",
        "log.csv.truth.parquet",
        "log.csv.scenario.toml",
        "log.csv.run.json",
    ]


def test_the_scenario_beside_makes_the_same_log(tmp_path: Path) -> None:
    first, second = tmp_path / "a.csv", tmp_path / "b.csv"
    run("ur5-circle", "-o", str(first), "--set", "duration=0.5", "--seed", "3")
    run(f"{first}.scenario.toml", "-o", str(second))
    assert first.read_bytes() == second.read_bytes()


def test_pair_writes_two_logs(tmp_path: Path) -> None:
    lossy = ("--set", "duration=0.3", "--set", "sensing.dropped=0.5")
    out = run("payload-pair", "-o", str(tmp_path / "p.csv"), *lossy, "--json")
    rows = {p.name: p.read_text().count("\n") - 1 for p in tmp_path.glob("*.csv")}
    assert rows.keys() == {"p.csv", "p.free.csv"}
    assert json.loads(out)["samples"] == rows["p.csv"] != rows["p.free.csv"]


def test_lists_the_scenarios() -> None:
    assert re.search(r"^ur5-circle +UR5 on a horizontal circle", run("list"), re.MULTILINE)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["ur5-cirle", "-o", "x.csv"], "Did you mean ur5-circle"),
        (["ur5-circle", "-o", "none/x.csv"], "no such folder"),
        (["ur5-circle", "-o", "."], "-o"),
        (["ur5-circle", "-o", "x.csv", "--as", "csv"], "log format 'csv'"),
        (["ur5-circle", "-o", "x.csv", "--as", "libfranka"], "--as"),
    ],
)
def test_bad_input_is_one_clear_line(
    arguments: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(VftError, match=words) as error:
        run(*arguments)
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten_without_force(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("mine")
    with pytest.raises(VftError, match="--force"):
        run("ur5-circle", "-o", str(path), "--set", "duration=0.3")
    assert path.read_text() == "mine"


def test_without_a_place_nothing_is_simulated() -> None:
    result = CliRunner().invoke(app, ["ur5-circle"])
    assert (result.exit_code, "-o PATH says where" in result.output) == (2, True)
