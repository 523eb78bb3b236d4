"""Logs of one file name: every command tells them apart, and refuses copies of one run.

Which commands refuse copies is in tests/test_metamorphic.py, but for the two below.
"""

import json
import shutil
import tomllib
from itertools import islice
from pathlib import Path

import pytest

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
ROWS = {"a": 1501, "b": 1001}
"""Lines kept of the fixture, header included: two different runs."""


@pytest.fixture
def logs(tmp_path: Path) -> list[Path]:
    """`a/log.csv` and `b/log.csv`, two logs with one file name."""
    paths = [tmp_path / name / "log.csv" for name in ROWS]
    for path, rows in zip(paths, ROWS.values(), strict=True):
        path.parent.mkdir()
        with FIXTURE.open(encoding="utf-8") as file:
            path.write_text("".join(islice(file, rows)), encoding="utf-8")
    return paths


def test_a_table_has_the_rows_of_both_logs(run, logs: list[Path]) -> None:
    words = ("--robot", "ur5", "--reference", f"file:{FIXTURE}.truth.parquet", "--json")
    code, out, err = run("compare", *logs, *words)
    assert code == 0, err
    samples = {row["recording"]: row["samples"] for row in json.loads(out)["rows"]}
    assert samples["a/log.csv"] == ROWS["a"] - 1
    assert samples["b/log.csv"] == ROWS["b"] - 1
    assert samples.keys() == {"a/log.csv", "b/log.csv", "pooled"}


@pytest.mark.slow
def test_an_identified_robot_has_one_rms_a_joint_and_log(run, logs: list[Path], here) -> None:
    code, _, err = run("identify", *logs, "--robot", "ur5", "-o", "robot.toml")
    assert code == 0, err
    robot = tomllib.loads((here / "robot.toml").read_text(encoding="utf-8"))
    sets = robot["identification"]["residuals"]
    assert [one["log"] for one in sets] == ["a/log.csv", "b/log.csv"]
    assert all(len(one["rms_Nm"]) == 6 for one in sets)


@pytest.mark.slow
def test_a_payload_pair_of_equal_names_is_scored_on_the_log_without_load(run, here) -> None:
    """The loaded log of a pair is the heavier one, whatever the files are called."""
    assert run("simulate", "payload-pair", "-o", "log.csv", "--seed", 1)[0] == 0
    for name, ending in (("a", "csv"), ("b", "free.csv")):
        (here / name).mkdir()
        (here / f"log.{ending}").rename(here / name / "log.csv")
    words = ("--robot", "ur5", "--method", "payload", "--json", "-o", "robot.toml")
    code, out, err = run("identify", "a/log.csv", "b/log.csv", *words)
    assert code == 0, err
    record = json.loads(out)
    assert {row["log"] for row in record["residuals"]} == {"b/log.csv"}
    found = {row["parameter"] for row in record["parameters"]}
    assert found == {"mass", "com_x", "com_y", "com_z"}


@pytest.mark.parametrize(
    "words",
    [("compare", "--reference", "zero"), ("identify", "--method", "payload", "-o", "r.toml")],
)
def test_a_copy_of_the_log_is_no_free_run(refused, logs: list[Path], here, words) -> None:
    copy = shutil.copy(logs[0], "copy.csv")
    error = refused(*words, logs[0], "--robot", "ur5", "--free", copy)
    assert "are the same run" in error
    assert {path.name for path in here.iterdir()} == {"a", "b", "copy.csv"}
