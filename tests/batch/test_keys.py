"""Keys change with whatever a result is made from, and with nothing else."""

import hashlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from vftcli.batch.log_work import content_digest, key_of, options_digest, with_files
from vftcli.evaluation import ReferenceChoice
from vftcli.free_motion import FreeChoice
from vftcli.observers import ObserverChoice
from vftcli.pipeline import AnalysisChoice
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice


def test_the_content_of_one_file_is_its_own_digest(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_bytes(b"t,q\n")
    assert content_digest([log]) == hashlib.sha256(b"t,q\n").hexdigest()
    with pytest.raises(OSError, match="gone"):
        content_digest([tmp_path / "gone.csv"])


def test_every_choice_is_in_the_key() -> None:
    plain = AnalysisChoice()
    others = [
        replace(plain, contacts=False),
        replace(plain, read=ReadChoice(interval=(0.0, 1.0))),
        replace(plain, robot=RobotChoice(name="ur5")),
        replace(plain, observers=ObserverChoice(names=("gmo",))),
        replace(plain, observers=ObserverChoice(settings={"gmo": {"gain": 5.0}})),
        replace(plain, reference=ReferenceChoice(name="zero")),
    ]
    assert len({options_digest(choice) for choice in (plain, *others)}) == len(others) + 1
    keys = {key_of("a", "b"), key_of("b", "a"), key_of("a", "b", 0), key_of("a", "b", 1)}
    assert len(keys) == 4


def test_files_that_options_name_count_by_content_not_by_name(tmp_path: Path) -> None:
    one, same, other = (tmp_path / name for name in ("a.toml", "b.toml", "c.toml"))
    one.write_text("x = 1")
    same.write_text("x = 1")
    other.write_text("x = 2")

    def digest(path: Path) -> str:
        free = FreeChoice(logs=(path,))
        reference = ReferenceChoice(name=f"file:{path}")
        robot = RobotChoice(name=str(path))
        return options_digest(AnalysisChoice(free=free, robot=robot, reference=reference))

    assert digest(one) == digest(same) != digest(other)


def test_files_are_found_in_paths_references_and_robots(tmp_path: Path) -> None:
    robot = tmp_path / "arm.toml"
    robot.touch()
    choice = AnalysisChoice(
        robot=RobotChoice(name=str(robot)),
        free=FreeChoice(logs=(Path("free.csv"),)),
        reference=ReferenceChoice(name="file:truth.parquet"),
        observers=ObserverChoice(gains=Path("gains.toml")),
    )
    there = with_files(choice, lambda path: Path("/there") / path.name)
    assert there.robot.name == "/there/arm.toml"
    assert there.free.logs == (Path("/there/free.csv"),)
    assert there.reference.name == "file:/there/truth.parquet"
    assert there.observers.gains == Path("/there/gains.toml")
    assert there.library is not None


def test_another_process_makes_the_same_key() -> None:
    """Sets and dictionaries have another order there."""
    script = (
        "from vftcli.batch.log_work import options_digest as d\n"
        "from vftcli.readers.reader import ReadChoice as R\n"
        "print(d(R(signals=frozenset('abcdefgh'))))"
    )
    path = ":".join(sys.path)
    one, other = (
        subprocess.check_output(
            [sys.executable, "-c", script], env={"PYTHONHASHSEED": seed, "PYTHONPATH": path}
        )
        for seed in ("1", "2")
    )
    assert one == other
