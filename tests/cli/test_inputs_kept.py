"""No command writes over what it reads, with --force or without, under whatever name."""

import os
import shutil
from pathlib import Path

import pytest

from vftcli.cli import options
from vftcli.robots import PROFILES
from vftcli.simulation.scenario import FOLDER

SIMULATE = ("simulate", "ur5-circle", "--as", "rosbag2", "--set", "duration=1", "-o", "bag")
FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a log, its names, a robot, a scenario and a table called as ours."""
    shutil.copy(FIXTURE, tmp_path / "log.csv")
    (tmp_path / "link.csv").symlink_to("log.csv")
    os.link(tmp_path / "log.csv", tmp_path / "hard.csv")
    shutil.copy(PROFILES["ur5"], tmp_path / "arm.toml")
    shutil.copy(FOLDER / "ur5-circle.toml", tmp_path / "scene.toml")
    shutil.copy(FIXTURE, tmp_path / "estimates.parquet")
    shutil.copy(FIXTURE, tmp_path / "recording.rrd")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "words",
    [
        "convert log.csv -o log.csv",
        "convert log.csv -o link.csv",
        "convert log.csv -o hard.csv",
        "convert link.csv -o ./log.csv",
        "estimate estimates.parquet --robot ur5 -o .",
        "estimate log.csv --free recording.rrd --robot ur5 --rrd -o .",
        "report log.csv --robot ur5 --reference file:estimates.parquet -o .",
        "identify log.csv --robot arm.toml -o arm.toml",
        "identify log.csv --method gains --robot arm.toml -o arm.toml",
        "simulate scene.toml -o scene.toml",
    ],
)
def test_no_input_is_ever_overwritten(run, here: Path, words: str) -> None:
    before = {path: path.read_bytes() for path in here.iterdir()}
    code, _out, err = run(*words.split(), "--force")
    assert code == 1
    assert "what this command reads" in err
    assert {path: path.read_bytes() for path in here.iterdir()} == before


def test_a_folder_given_as_log_keeps_its_files(run, here: Path) -> None:
    """A bag's folder: a file in it is refused as output, a new name beside it is not."""
    assert run(*SIMULATE)[0] == 0
    data = next((here / "bag").glob("*.mcap"))
    before = data.read_bytes()
    (here / "bag.csv").symlink_to(data)
    code, _out, err = run("convert", "bag", "-o", "bag.csv", "--force")
    assert (code, data.read_bytes()) == (1, before)
    assert "what this command reads" in err
    assert run("convert", "bag", "-o", "bag/flat.csv")[0] == 0


def test_what_an_option_names_is_an_input_unless_it_is_one_of_ours() -> None:
    values = {
        "log": Path("log.csv"),
        "output": Path("out"),
        "robot": "ur5",
        "observer": ["gmo", "fdo"],
        "free": ["bag", "1:2"],
        "reference": "file:truth.parquet",
        "seed": 3,
    }
    names = {str(path) for path in options.inputs_of(values)}
    assert names == {"log.csv", "bag", "1:2", "truth.parquet"}
