"""A simulated log with its truth, its scenario and its record beside it: all of them or none."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from vftcli.outputs.files import SEAL, OutputFolder, table_file
from vftcli.outputs.run_record import envelope, seal
from vftcli.signals.errors import OutputError
from vftcli.simulation.experiment import Simulation
from vftcli.simulation.scenario import to_toml


def free_path(path: Path) -> Path:
    """Path of a pair's free run: ``log.csv`` → ``log.free.csv``."""
    return path.with_name(f"{path.stem}.free{path.suffix}")


def companions(path: Path) -> tuple[Path, Path, Path]:
    """The truth, the scenario and the record beside a log."""
    return (
        path.with_name(f"{path.name}.truth.parquet"),
        path.with_name(f"{path.name}.scenario.toml"),
        path.with_name(f"{path.name}.{SEAL}"),
    )


def log_folder(paths: Iterable[Path], force: bool) -> OutputFolder:
    """The folder of logs that stand beside one another, checked."""
    names: list[str] = []
    for path in paths:
        if not path.name:
            raise OutputError(f"{path} is a folder; give the name of a log file with -o")
        # A bag is a folder: the files of the one that is there go when the new ones come.
        inside = [file for file in path.rglob("*") if not file.is_dir()] if path.is_dir() else []
        # A killed run may have left it without its metadata, or empty.
        if any(file.suffix not in {".mcap", ".db3", ".yaml"} for file in inside):
            raise OutputError(f"{path} is a folder and no bag; give another -o")
        if not path.parent.is_dir():
            raise OutputError(
                f"{path.parent}: there is no such folder; make it, or give another -o"
            )
        if inside and not force:
            raise OutputError(f"{path} exists; give another -o, or --force to overwrite it")
        names += [
            file.relative_to(path.parent).as_posix()
            for file in (*(inside if path.is_dir() else [path]), *companions(path))
        ]
    folder = OutputFolder(path.parent, force, names)
    folder.check()
    return folder


def save(
    runs: Mapping[Path, Simulation], format: str = "", force: bool = False, command: str = ""
) -> list[Path]:
    """Write each log and its companions; return the paths of all files, of a bag its folder."""
    from vftcli.simulation.writers import WRITERS, usual_format, write_truth

    formats = [usual_format(run.scenario, run.robot, format) for run in runs.values()]
    with log_folder(runs, force) as folder:
        for (path, run), form in zip(runs.items(), formats, strict=True):
            truth, scenario, record = (file.name for file in companions(path))
            with table_file(folder / path.name) as file:
                WRITERS[form](file, run)
            with table_file(folder / truth) as file:
                write_truth(file, run.truth, run.scenario.sensing.start)
            folder.write(scenario, to_toml(replace(run.scenario, format=form), run.seed))
            own = {truth, scenario, path.name}
            files = {n: sha for n, sha in folder.digests().items() if n.partition("/")[0] in own}
            # The scenario file says the rest.
            about = {
                "scenario": run.scenario.name,
                "seed": run.seed,
                "robot": run.scenario.robot,
                "format": form,
                "samples": len(run.measured.rows),
            }
            seal(folder, record, envelope(command, found=about), files)
    return [file for path in runs for file in (path, *companions(path))]
