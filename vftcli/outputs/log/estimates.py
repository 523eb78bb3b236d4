"""What `vftcli estimate` writes: the estimates, how they were made, and other formats on demand."""

from collections.abc import Callable, Sequence
from pathlib import Path

from vftcli.analysis import Analysis
from vftcli.outputs.files import OutputFolder
from vftcli.outputs.log.parquet import write_csv, write_estimates
from vftcli.outputs.log.run_record import run_record, to_json


def write_mcap_file(path: Path, analysis: Analysis) -> None:
    """Write a ros2-profile MCAP (imported only when it is wanted)."""
    from vftcli.outputs.log.mcap_output import write_mcap

    write_mcap(path, analysis)


def write_rrd_file(path: Path, analysis: Analysis) -> None:
    """Write a Rerun recording (imported only when it is wanted)."""
    from vftcli.outputs.log.rerun_recording import write_rrd

    write_rrd(path, analysis)


EXTRAS: dict[str, tuple[str, Callable[[Path, Analysis], None]]] = {
    "csv": ("estimates.csv", write_csv),
    "mcap": ("estimates.mcap", write_mcap_file),
    "rrd": ("recording.rrd", write_rrd_file),
}
"""Flag → file name and its writer."""


def write_estimate_folder(
    path: Path, analysis: Analysis, command: str, extras: Sequence[str] = (), force: bool = False
) -> str:
    """Write `estimates.parquet`, `run.json` and the extras into a folder, all or nothing.

    Returns:
        The text of `run.json`.

    Raises:
        OutputError: If the folder cannot be written, or a file exists and `force` is not set.
    """
    record = to_json(run_record(analysis, command))
    names = ["estimates.parquet", "run.json", *(EXTRAS[extra][0] for extra in extras)]
    with OutputFolder(path, force, names) as folder:
        write_estimates(folder / "estimates.parquet", analysis)
        for extra in extras:
            name, write = EXTRAS[extra]
            write(folder / name, analysis)
        (folder / "run.json").write_text(record, encoding="utf-8")
    return record
