"""No command writes over what it reads, with --force or without, under whatever name."""

import os
import shutil
from pathlib import Path

import pytest

from vftcli.robots import PROFILES
from vftcli.simulation.scenario import FOLDER

SIMULATE = ("simulate", "ur5-circle", "--as", "rosbag2", "--set", "duration=1", "-o", "bag")
FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"


@pytest.fixture
def there(here: Path) -> Path:
    """A working folder with a log, its names, a robot, a scenario and a table called as ours."""
    for name in ("log.csv", "log", "estimates.parquet", "recording.rrd"):
        shutil.copy(FIXTURE, here / name)
    (here / "link.csv").symlink_to("log.csv")
    os.link(here / "log.csv", here / "hard.csv")
    shutil.copy(PROFILES["ur5"], here / "arm.toml")
    shutil.copy(FOLDER / "ur5-circle.toml", here / "scene.toml")
    return here


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
        "identify log.csv --method gains --robot ur5 --free log -o log",
        "simulate scene.toml -o scene.toml",
    ],
)
def test_no_input_is_ever_overwritten(refused, there: Path, words: str) -> None:
    before = {path: path.read_bytes() for path in there.iterdir()}
    assert "what this command reads" in refused(*words.split(), "--force")
    assert {path: path.read_bytes() for path in there.iterdir()} == before


def test_a_folder_given_as_log_keeps_its_files(run, refused, here: Path) -> None:
    """A bag's folder: a file in it is refused as output, a new name beside it is not."""
    assert run(*SIMULATE)[0] == 0
    data = next((here / "bag").glob("*.mcap"))
    before = data.read_bytes()
    (here / "bag.csv").symlink_to(data)
    assert "what this command reads" in refused("convert", "bag", "-o", "bag.csv", "--force")
    assert data.read_bytes() == before
    assert run("convert", "bag", "-o", "bag/flat.csv")[0] == 0
