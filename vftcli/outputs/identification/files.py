"""Files of an identification: the robot file, its page and `run.json`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vftcli.doctor.examination import Examination
from vftcli.identification.result import Identification
from vftcli.outputs.examination import health_record, overridden_lines
from vftcli.outputs.figures.paper import figure_files, write_figures
from vftcli.outputs.files import OutputFolder
from vftcli.outputs.identification.figures import IDENTIFICATION_FIGURES, identification_figures
from vftcli.outputs.identification.page import render_identification
from vftcli.outputs.log.run_record import (
    CONVENTIONS,
    file_sha256,
    input_record,
    log_remarks,
    robot_record,
    seal,
    versions,
)
from vftcli.outputs.seals import SEAL
from vftcli.robots.writing import robot_toml
from vftcli.signals.errors import OutputError


def beside(path: Path) -> dict[str, Path]:
    """The files that go with a robot file, by kind."""
    if path.suffix.lower() != ".toml":
        raise OutputError(f"{path}: -o needs a name that ends in .toml, as my_robot.toml")
    return {
        "toml": path,
        "html": path.with_suffix(".html"),
        "run": path.with_suffix(f".{SEAL}"),
    }


def files_beside(path: Path, form: str | None) -> list[str]:
    """Names of all files that go with a robot file; `form` is what figures are written as."""
    figures = figure_files(form, IDENTIFICATION_FIGURES, f"{path.stem}-")
    return [*(file.name for file in beside(path).values()), *figures]


def write_identification(
    path: Path,
    found: Identification,
    logs: Sequence[Examination],
    command: str,
    force: bool,
    form: str | None = None,
) -> str:
    """Write all files or none; those of an earlier run stay as they were if one fails.

    `logs` are the examinations of all that were read, also of those that no fit used; `form` is
    what figures are written as, None for no figures.

    Returns:
        The text of `run.json`.
    """
    # One folder for all three, so that they appear together or not at all.
    names = {kind: file.name for kind, file in beside(path).items()}
    record = identification_record(found, logs, command)
    heading = [
        *overridden_lines(logs, fitting=False),
        f"{found.robot.title}; written by vftcli identify, keys: docs/robots.md.",
        command,
    ]
    texts = {
        "html": render_identification(found, record, logs),
        "toml": robot_toml(found.robot, heading),
    }
    with OutputFolder(path.parent, force, files_beside(path, form)) as folder:
        for kind, text in texts.items():
            folder.write(names[kind], text)
        if form is not None:
            write_figures(folder, identification_figures(found), form, f"{path.stem}-")
        return seal(folder, names["run"], record)


def identification_record(
    found: Identification, logs: Sequence[Examination], command: str
) -> dict[str, Any]:
    """Everything `run.json` holds, and `--json` prints."""
    recordings = [one.recording for one in logs]
    return {
        "command": command,
        "versions": versions(),
        "examination": health_record(logs, fitting=False),
        "method": found.method,
        "inputs": [input_record(log) for log in recordings],
        "profile": robot_record(found.profile),
        "profile_sha256": file_sha256(found.profile.path),
        "robot": found.robot.name,
        "processing": dict(found.processing),
        "residuals": found.residuals.to_dicts(),
        "parameters": found.parameters.to_dicts(),
        "friction_models": found.shape_choices.to_dicts(),
        "base_parameters": found.base.to_dicts() if found.base is not None else [],
        "conventions": CONVENTIONS,
        **log_remarks(recordings),
        "remarks": list(found.remarks),
    }
