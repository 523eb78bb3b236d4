"""A simulated log with its truth and its scenario beside it: all of the files or none."""

import os
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

from vftcli.signals.errors import OutputError
from vftcli.simulation.experiment import Simulation
from vftcli.simulation.load import to_toml


def free_path(path: Path) -> Path:
    """Where the free run of a pair goes: ``log.csv`` → ``log.free.csv``."""
    return path.with_name(f"{path.stem}.free{path.suffix}")


def companions(path: Path) -> tuple[Path, Path]:
    """The truth file and the scenario file beside a log."""
    return (
        path.with_name(f"{path.name}.truth.parquet"),
        path.with_name(f"{path.name}.scenario.toml"),
    )


def check_target(paths: list[Path], force: bool) -> None:
    """Raise unless logs can be written to `paths`.

    Raises:
        OutputError: If one exists and `force` is not set, or the folder is missing or closed.
    """
    for path in paths:
        if not path.name:
            raise OutputError(f"{path} is a folder; give the name of a log file with -o")
        for file in (path, *companions(path)):
            if file.exists() and not force:
                raise OutputError(f"{file} exists; give another -o, or --force to overwrite it")
        if path.is_dir() and not (path / "metadata.yaml").is_file():
            raise OutputError(f"{path} is a folder and no bag; give another -o")
        if not path.parent.is_dir():
            raise OutputError(
                f"{path.parent}: there is no such folder; make it, or give another -o"
            )
        if not os.access(path.parent, os.W_OK | os.X_OK):
            raise OutputError(f"{path.parent}: no permission to write there; give another -o")


def save(simulation: Simulation, path: Path, format: str = "", force: bool = False) -> list[Path]:
    """Write the log, ``PATH.truth.parquet`` and ``PATH.scenario.toml``; return their paths.

    Args:
        simulation: The finished run.
        path: The log.
        format: A name in `WRITERS`, or "" for the scenario's or the vendor's usual one.
        force: Whether files that are there may be replaced.

    Raises:
        ParameterError: If the robot cannot log in the format.
        OutputError: If a file exists and `force` is not set, or cannot be written.
    """
    from vftcli.simulation.writers import WRITERS, usual_format
    from vftcli.simulation.writers.parquet import write_truth

    chosen = usual_format(simulation, format)
    check_target([path], force)
    truth, scenario = companions(path)
    ran = replace(simulation.scenario, format=chosen)
    try:
        with tempfile.TemporaryDirectory(prefix=".vftcli-", dir=path.parent) as folder:
            parts = {file: Path(folder) / file.name for file in (path, truth, scenario)}
            WRITERS[chosen](parts[path], simulation)
            write_truth(parts[truth], simulation.truth, simulation.scenario.sensing.start)
            parts[scenario].write_text(to_toml(ran, simulation.seed), encoding="utf-8")
            # All parts are complete before the first takes its place.
            for file, part in parts.items():
                if file.is_dir():
                    shutil.rmtree(file)
                part.replace(file)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise OutputError(f"{path} cannot be written: {reason}; give another -o") from None
    return [path, truth, scenario]
