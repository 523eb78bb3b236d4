"""Logs of one file name: every command tells them apart, and refuses copies of one run."""

import csv
import io
import json
import shutil
import tomllib
from itertools import islice
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vftcli.cli import make_app
from vftcli.signals.errors import ParameterError

app = make_app()

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"
RUNNER = CliRunner()
TRUTH = f"file:{FIXTURE}.truth.parquet"
ROWS = {"a": 1501, "b": 1001}
"""Lines kept of the fixture, header included: two different runs."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """`a/log.csv` and `b/log.csv`, two logs with one file name, and a copy of the first."""
    folder = tmp_path_factory.mktemp("logs")
    for name, rows in ROWS.items():
        (folder / name).mkdir()
        with FIXTURE.open(encoding="utf-8") as file:
            (folder / name / "log.csv").write_text("".join(islice(file, rows)), encoding="utf-8")
    shutil.copy(folder / "a" / "log.csv", folder / "copy.csv")
    return folder


def invoke(*words):
    return RUNNER.invoke(app, [str(word) for word in words])


def compared(logs, *options):
    both = [logs / name / "log.csv" for name in ROWS]
    result = invoke("compare", *both, "--robot", "ur5", "--reference", TRUTH, *options)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_json_has_the_rows_of_both_logs(logs):
    rows = json.loads(compared(logs, "--json"))["rows"]
    samples = {row["recording"]: row["samples"] for row in rows}
    assert samples["a/log.csv"] == ROWS["a"] - 1
    assert samples["b/log.csv"] == ROWS["b"] - 1


def test_csv_has_the_rows_of_both_logs(logs):
    rows = list(csv.DictReader(io.StringIO(compared(logs, "--csv"))))
    assert {row["recording"] for row in rows} == {"a/log.csv", "b/log.csv", "pooled"}


@pytest.mark.slow
def test_a_report_of_both_has_both_in_its_table(logs, tmp_path):
    both = [logs / name / "log.csv" for name in ROWS]
    result = invoke(
        "report", *both, "--robot", "ur5", "--reference", TRUTH, "-o", tmp_path / "out"
    )
    assert result.exit_code == 0, result.output
    rows = json.loads((tmp_path / "out" / "errors.json").read_text(encoding="utf-8"))
    assert {row["recording"] for row in rows} == {"a/log.csv", "b/log.csv"}


@pytest.mark.slow
def test_an_identified_robot_has_one_rms_a_joint_and_log(logs, tmp_path):
    robot = tmp_path / "robot.toml"
    both = [logs / name / "log.csv" for name in ROWS]
    result = invoke("identify", *both, "--robot", "ur5", "-o", robot)
    assert result.exit_code == 0, result.output
    sets = tomllib.loads(robot.read_text(encoding="utf-8"))["identification"]["residuals"]
    assert [one["log"] for one in sets] == ["a/log.csv", "b/log.csv"]
    assert all(len(one["rms_Nm"]) == 6 for one in sets)


@pytest.mark.slow
def test_a_payload_pair_of_equal_names_is_scored_on_the_log_without_load(tmp_path):
    """The loaded log of a pair is the heavier one, whatever the files are called."""
    made = invoke("simulate", "payload-pair", "-o", tmp_path / "log.csv", "--seed", 1)
    assert made.exit_code == 0, made.output
    for name, ending in (("a", "csv"), ("b", "free.csv")):
        (tmp_path / name).mkdir()
        (tmp_path / f"log.{ending}").rename(tmp_path / name / "log.csv")
    robot = tmp_path / "robot.toml"
    both = [tmp_path / name / "log.csv" for name in "ab"]
    options = ("--method", "payload", "--json", "-o", robot)
    result = invoke("identify", *both, "--robot", "ur5", *options)
    assert result.exit_code == 0, result.output
    record = json.loads(result.stdout)
    assert {row["log"] for row in record["residuals"]} == {"b/log.csv"}
    assert {row["parameter"] for row in record["parameters"]} == {
        "mass",
        "com_x",
        "com_y",
        "com_z",
    }


def test_one_run_given_twice_is_refused(logs, tmp_path):
    log, copy = logs / "a" / "log.csv", logs / "copy.csv"
    common = ("--robot", "ur5")
    zero = (*common, "--reference", "zero")
    for words in (
        ("compare", log, copy, *zero),
        ("compare", log, log, *zero),
        ("report", log, copy, *zero, "-o", tmp_path / "out"),
        ("identify", log, copy, *common, "-o", tmp_path / "robot.toml"),
        (
            "identify",
            log,
            "--free",
            copy,
            "--method",
            "payload",
            *common,
            "-o",
            tmp_path / "r.toml",
        ),
    ):
        result = invoke(*words)
        assert isinstance(result.exception, ParameterError), result.output
        assert "are the same run" in str(result.exception)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "command",
    [
        ("compare", "--reference", "two-cycle"),
        ("compare", "--reference", "zero"),
        ("estimate",),
        ("identify", "--method", "gains"),
    ],
    ids=" ".join,
)
def test_a_copy_of_the_log_is_no_free_run_and_a_free_run_counts_once(logs, tmp_path, command):
    name, *options = command
    log, other = logs / "a" / "log.csv", logs / "b" / "log.csv"
    out = () if name == "compare" else ("-o", tmp_path / "out.toml")
    words = (name, log, "--robot", "ur5", *options, *out)
    itself = invoke(*words, "--free", logs / "copy.csv")
    assert isinstance(itself.exception, ParameterError), itself.output
    assert "are the same run" in str(itself.exception)
    twice = invoke(*words, "--free", other, "--free", other)
    assert isinstance(twice.exception, ParameterError), twice.output
    assert "are the same run" in str(twice.exception)
    assert not list(tmp_path.iterdir())
