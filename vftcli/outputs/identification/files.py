"""Files of an identification: the robot file, its page, its Rerun recording and `run.json`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vftcli.identification.result import Identification
from vftcli.outputs.files import atomic, refuse_existing, write_text
from vftcli.outputs.log.run_record import (
    CONVENTIONS,
    file_sha256,
    input_record,
    robot_record,
    to_json,
    versions,
)
from vftcli.robots.writing import robot_toml
from vftcli.signals.errors import OutputError
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import as_record


def beside(path: Path) -> dict[str, Path]:
    """The files that go with a robot file, by kind.

    Raises:
        OutputError: If the path does not end in .toml.
    """
    if path.suffix.lower() != ".toml":
        raise OutputError(f"{path}: -o needs a name that ends in .toml, as my_robot.toml")
    return {
        "toml": path,
        "html": path.with_suffix(".html"),
        "rrd": path.with_suffix(".rrd"),
        "run": path.with_suffix(".run.json"),
    }


def write_identification(
    path: Path, found: Identification, logs: Sequence[Recording], command: str, force: bool
) -> str:
    """Write all files, the robot file last, so that it is there only if all the others are.

    Args:
        path: The robot file.
        found: What to write.
        logs: Every log that was read.
        command: The command line.
        force: Whether files that are there may be replaced.

    Returns:
        The text of `run.json`.

    Raises:
        OutputError: If one exists and `force` is not set, or cannot be written.
    """
    from vftcli.outputs.identification.page import render_identification
    from vftcli.outputs.identification.recording import write_identification_rrd

    files = beside(path)
    for file in files.values():
        refuse_existing(file, force)
    record = identification_record(found, logs, command)
    text = to_json(record)
    write_text(files["html"], render_identification(found, record), force)
    with atomic(files["rrd"], force) as temporary:
        write_identification_rrd(temporary, found)
    write_text(files["run"], text, force)
    heading = [f"{found.robot.title}; written by vftcli identify, keys: docs/robots.md.", command]
    write_text(files["toml"], robot_toml(found.robot, heading), force)
    return text


def identification_record(
    found: Identification, logs: Sequence[Recording], command: str
) -> dict[str, Any]:
    """Everything `run.json` holds, and `--json` prints."""
    return {
        "command": command,
        "versions": versions(),
        "method": found.method,
        "inputs": [input_record(log) for log in logs],
        "profile": robot_record(found.profile),
        "profile_sha256": file_sha256(found.profile.path),
        "robot": found.robot.name,
        "processing": dict(found.processing),
        "residuals": found.residuals.to_dicts(),
        "parameters": found.parameters.to_dicts(),
        "friction_models": found.shape_choices.to_dicts(),
        "base_parameters": found.base.to_dicts() if found.base is not None else [],
        "conventions": CONVENTIONS,
        "repairs": [note for log in logs for note in log.source.repairs],
        "warnings": [note for log in logs for note in log.source.warnings],
        "remarks": [as_record(remark) for remark in found.remarks],
    }
