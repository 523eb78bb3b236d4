"""What `identify` writes: a robot file, a page that opens offline, run.json."""

import json

import numpy as np
import pytest

from vftcli.doctor import examine
from vftcli.outputs.files import OutputFolder
from vftcli.outputs.identification import write_identification
from vftcli.robots import load_robot
from vftcli.signals.errors import OutputError


def test_all_files_are_written_and_the_robot_loads(found, tmp_path):
    result, log = found
    path = tmp_path / "mine.toml"
    text = write_identification(path, result, [examine(log)], "vftcli identify", force=False)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "mine.html",
        "mine.run.json",
        "mine.toml",
    ]
    robot = load_robot(path)
    assert robot.name == "mine"
    assert robot.friction == result.robot.friction
    assert np.array_equal(robot.chain.rotor_inertia, result.robot.chain.rotor_inertia)
    account = robot.document["identification"]
    assert account["sha256"] == ["0" * 64]
    assert account["method"] == "friction"
    assert "0" * 64 in robot.friction[0].confidence
    assert robot.document["joints"][0]["rotor_inertia_source"].startswith("identified")
    record = json.loads(text)
    assert record["processing"]["cutoff_hz"] == 8.0
    assert "never" in record["processing"]["differentiation"]
    assert record["inputs"][0]["sha256"] == "0" * 64
    with pytest.raises(OutputError, match="--force"):
        write_identification(path, result, [examine(log)], "", force=False)


def test_a_name_without_toml_is_refused(found, tmp_path):
    result, log = found
    with pytest.raises(OutputError, match=r"ends in \.toml"):
        write_identification(tmp_path / "mine", result, [examine(log)], "", force=False)
    assert not list(tmp_path.iterdir())


def test_a_failure_at_the_last_file_leaves_everything_as_it_was(found, tmp_path, monkeypatch):
    """The files were written one by one: a full disk left a page beside another run's robot."""
    result, log = found
    path = tmp_path / "mine.toml"
    path.write_text("earlier", encoding="utf-8")
    write = OutputFolder.write

    def failing(folder, name, text):
        if name.endswith(".toml"):
            raise OutputError("the disk is full")
        write(folder, name, text)

    monkeypatch.setattr(OutputFolder, "write", failing)
    with pytest.raises(OutputError, match="disk is full"):
        write_identification(path, result, [examine(log)], "", force=True)
    assert [p.name for p in tmp_path.iterdir()] == ["mine.toml"]
    assert path.read_text(encoding="utf-8") == "earlier"
