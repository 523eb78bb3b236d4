"""What `vftcli report` writes: page, recording, estimates, errors and run.json in one folder."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vftcli.analysis import Analysis
from vftcli.outputs.files import OutputFolder, numbered
from vftcli.outputs.log import tables
from vftcli.outputs.log.estimates import write_estimates
from vftcli.outputs.log.rerun_recording import write_rrd
from vftcli.outputs.log.run_record import run_record, to_json
from vftcli.outputs.log.wrench_tables import PaperBounds, paper_bounds
from vftcli.outputs.page.page import render, render_index

if TYPE_CHECKING:
    import polars as pl

ERROR_TABLES: dict[str, Callable[["pl.DataFrame", PaperBounds], str]] = {
    "errors.csv": tables.to_csv,
    "errors.json": tables.to_json,
    "errors.md": tables.to_markdown,
    "errors.tex": tables.to_latex,
}
"""File name → how its text is made from the errors table."""

FILES = ("index.html", "recording.rrd", "estimates.parquet", "run.json", *ERROR_TABLES)
"""What a report of one log may hold; the error tables only where there is a reference."""


def write_report(path: Path, analysis: Analysis, *, command: str, force: bool = False) -> str:
    """Write the report of one log, all files or none.

    Returns:
        The text of `run.json`.

    Raises:
        OutputError: If the folder cannot be written, or a file exists and `force` is not set.
    """
    with OutputFolder(path, force, FILES) as folder:
        return to_json(fill(folder, "", analysis, command))


def write_reports(
    path: Path, analyses: Sequence[Analysis], *, command: str, force: bool = False
) -> str:
    """Write one sub-folder a log, and above them an index, all errors in one, and run.json.

    Returns:
        The text of the upper `run.json`: a list with the record of every log.

    Raises:
        OutputError: If the folder cannot be written, or a file exists and `force` is not set.
    """
    import polars as pl

    # One folder a log, called as its file without the ending.
    places = numbered(Path(a.recording.name).stem or "log" for a in analyses)
    # All names that any log may have are declared, so that --force removes stale ones.
    below = [f"{place}/{name}" for place in places for name in FILES]
    with OutputFolder(path, force, ["index.html", "run.json", *ERROR_TABLES, *below]) as folder:
        records = [
            fill(folder, f"{place}/", analysis, command)
            for place, analysis in zip(places, analyses, strict=True)
        ]
        folder.write("index.html", render_index(list(zip(places, analyses, strict=True))))
        found = [a.errors for a in analyses if a.errors is not None]
        together = pl.concat(found, how="diagonal") if found else None
        put_errors(folder, "", together, paper_bounds(analyses))
        texts = ",\n".join(to_json(record).rstrip("\n") for record in records)
        folder.write("run.json", f"[\n{texts}\n]\n")
        return f"[\n{texts}\n]\n"


def fill(folder: OutputFolder, place: str, analysis: Analysis, command: str) -> dict[str, Any]:
    """Write one log's files; return its record."""
    record = run_record(analysis, command)
    # The page shows the record that is written beside it, not one of its own.
    analysis = replace(analysis, run=record)
    folder.write(f"{place}index.html", render(analysis))
    write_rrd(folder / f"{place}recording.rrd", analysis)
    write_estimates(folder / f"{place}estimates.parquet", analysis)
    put_errors(folder, place, analysis.errors, paper_bounds([analysis]))
    folder.write(f"{place}run.json", to_json(record))
    return record


def put_errors(
    folder: OutputFolder, place: str, errors: "pl.DataFrame | None", bounds: PaperBounds
) -> None:
    """Write the error tables, if there are errors."""
    if errors is None:
        return
    for name, text_of in ERROR_TABLES.items():
        folder.write(f"{place}{name}", text_of(errors, bounds))
