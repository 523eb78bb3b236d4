"""The command that mends a finding, as it is typed."""

import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from vftcli.analysis import Analysis
from vftcli.outputs.believability import (
    SUBJECTS,
    is_profile,
    payload_command,
    remedy_of,
    robot_option,
    subject_of,
)
from vftcli.outputs.examination import command
from vftcli.readers.reading import read
from vftcli.signals.remarks import warning, words


def test_every_subject_stands_for_remarks_that_exist_once() -> None:
    codes = [code for group in SUBJECTS.values() for code in group]
    assert len(codes) == len(set(codes))
    for code in codes:
        assert words(code)["short"]
    assert subject_of("saturation") == "effort"


@pytest.mark.parametrize(
    ("code", "ending"),
    [
        ("light-load", "--method payload --robot ur5 -o loaded.toml"),
        ("payload-not-mounted", "--robot ur5 --payload log"),
        ("no-robot-fits", "--robot ur5 --method base -o my_robot.toml"),
        ("saturation", "--robot ur5"),
    ],
)
def test_the_command_of_a_finding(without_reference: Analysis, code: str, ending: str) -> None:
    made = without_reference
    assert remedy_of(warning(code), made.recording, made).endswith(ending)


def test_a_hostile_name_is_quoted_as_a_shell_wants_it(without_reference: Analysis) -> None:
    made = without_reference
    assert f"'{made.recording.source.path}'" in command("inspect", made.recording)
    assert "identify" in payload_command(made)


def test_a_command_names_the_columns_that_the_log_was_read_by(tmp_path: Path) -> None:
    """Without them the log may not be read, or its torques for currents."""
    table = tmp_path / "log.csv"
    rows = (f"{0.01 * k},{0.1 * k},{0.2 * k},{0.1},{1.0}\n" for k in range(20))
    table.write_text("t,a1,a2,b1,b2\n" + "".join(rows), encoding="utf-8")
    log = read(table, columns="t=t,q=a{i},-tau=b{i}")
    typed = shlex.split(command("inspect", log, "--robot", "ur5"))
    assert typed[3:] == ["--columns=t=t,q=a{i},-tau=b{i}", "--robot", "ur5"]


def test_a_robot_file_is_named_by_its_path(without_reference: Analysis) -> None:
    made = without_reference
    assert is_profile(made)
    assert robot_option(made) == "ur5"
    log = made.motion.log
    own = replace(log, robot=replace(log.robot, path=Path("my.toml")))
    assert robot_option(replace(made, motion=replace(made.motion, log=own))) == "my.toml"
