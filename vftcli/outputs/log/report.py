"""Files of `vftcli report`: page, recording, estimates, errors, run.json."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from vftcli.analysis import Analysis
from vftcli.outputs.contacts import contacts_csv, contacts_record
from vftcli.outputs.figures.paper import figure_files, write_figures
from vftcli.outputs.files import SEAL, OutputFolder, numbered
from vftcli.outputs.log import tables
from vftcli.outputs.log.choice import PLAIN, OutputChoice
from vftcli.outputs.log.estimates import extra_files, write_estimates, write_extras
from vftcli.outputs.log.figures import ERROR_FIGURES, LOG_FIGURES, error_figures, log_figures
from vftcli.outputs.log.rmse_tables import PaperBounds, paper_bounds
from vftcli.outputs.log.run_record import jsonable, run_record, seal, versions
from vftcli.outputs.page.pages import render, render_index
from vftcli.signals.packages import installed
from vftcli.signals.progress import steps

if TYPE_CHECKING:
    import polars as pl

#: File name → how its text is made from the errors table.
ERROR_TABLES: dict[str, Callable[["pl.DataFrame", PaperBounds], str]] = {
    "errors.csv": tables.to_csv,
    "errors.json": tables.to_json,
    "errors.md": tables.to_markdown,
    "errors.tex": tables.to_latex,
}
CONTACTS = ("contacts.json", "contacts.csv")  #: The list of contacts, where it is made.
#: What a report of one log may hold; the error tables only where there is a reference.
FILES = ("index.html", "recording.rrd", "estimates.parquet", SEAL, *CONTACTS, *ERROR_TABLES)
#: Head above the sub-folders of several logs.
SUMMARY_FILES = ("index.html", SEAL, *CONTACTS, *ERROR_TABLES)


def places_of(labels: Sequence[str]) -> list[str]:
    """The sub-folder of each of several logs: called as its file without the ending."""
    return numbered(Path(label).stem or "log" for label in labels)


def report_files(
    labels: Sequence[str],
    extras: Sequence[str] = (),
    form: str | None = None,
    *,
    several: bool | None = None,
) -> list[str]:
    """Names of all files that a report of logs with these labels may hold, with these extras.

    `form` is what figures are written as, None without any; `several` is whether there is a
    sub-folder a log, None for where there is more than one.
    """
    own = [*FILES, *extra_files(extras), *figure_files(form, LOG_FIGURES)]
    if not (len(labels) > 1 if several is None else several):
        return own
    above = [*SUMMARY_FILES, *figure_files(form, ERROR_FIGURES)]
    return [*above, *(f"{place}/{name}" for place in places_of(labels) for name in own)]


def write_report(
    path: Path,
    analysis: Analysis,
    *,
    command: str,
    force: bool = False,
    choice: OutputChoice = PLAIN,
    form: str | None = None,
) -> str:
    """Write the report of one log, all files or none; figures in a form, or none.

    Returns:
        The text of `run.json`.
    """
    names = report_files([analysis.recording.name], choice.extras, form)
    with OutputFolder(path, force, names) as folder:
        return fill(folder, "", analysis, command, choice, form)


def write_reports(
    path: Path,
    analyses: Sequence[Analysis],
    *,
    command: str,
    force: bool = False,
    choice: OutputChoice = PLAIN,
    form: str | None = None,
    failed: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """Write one sub-folder a log, and above them an index, all errors in one, and run.json.

    Returns:
        The texts of the logs' own `run.json`, as one JSON array.
    """
    import polars as pl

    labels = [a.recording.name for a in analyses]
    places = places_of(labels)
    names = report_files(labels, choice.extras, form, several=True)
    with OutputFolder(path, force, names) as folder:
        records = [
            fill(folder, f"{place}/", analysis, command, choice, form)
            for place, analysis in steps(list(zip(places, analyses, strict=True)))
        ]
        pages = list(zip(places, analyses, strict=True))
        folder.write("index.html", render_index(pages, failed))
        found = [a.errors for a in analyses if a.errors is not None]
        together = pl.concat(found, how="diagonal") if found else None
        put_errors(folder, "", together, analyses)
        put_contacts(folder, "", analyses, several=True)
        if form is not None and together is not None:
            write_figures(folder, error_figures(together), form)
        logs = dict(zip(places, labels, strict=True))
        seal(
            folder,
            SEAL,
            {"command": command, "versions": versions(), "logs": logs, "left_out": dict(failed)},
        )
        return "[\n" + ",\n".join(record.rstrip("\n") for record in records) + "\n]\n"


def fill(
    folder: OutputFolder,
    place: str,
    analysis: Analysis,
    command: str,
    choice: OutputChoice,
    form: str | None = None,
) -> str:
    """Write one log's files; return the text of its `run.json`."""
    record = run_record(analysis, command)
    # The page shows the record that is written beside it, not one of its own.
    analysis = replace(analysis, run=record)
    writers: list[Callable[[], None]] = [
        lambda: folder.write(f"{place}index.html", render(analysis)),
        lambda: write_estimates(folder / f"{place}estimates.parquet", analysis),
    ]
    if choice.writes_recording and installed("rerun"):  # else `left_out` says how to get it
        from vftcli.outputs.log.rerun_recording import write_rrd

        path = folder / f"{place}recording.rrd"
        writers.insert(1, lambda: write_rrd(path, analysis, choice.detail))
    for write in steps(writers):
        write()
    put_errors(folder, place, analysis.errors, [analysis])
    put_contacts(folder, place, [analysis])
    write_extras(folder, place, analysis, choice)
    if form is not None:
        write_figures(folder, log_figures(analysis), form, f"{place}figures/")
    return seal(folder, f"{place}{SEAL}", record)


def put_contacts(
    folder: OutputFolder, place: str, analyses: Sequence[Analysis], *, several: bool = False
) -> None:
    """Write the lists of contacts, if there are any: as `vftcli contacts` prints them."""
    lists = [analysis.contacts for analysis in analyses if analysis.contacts is not None]
    if not lists:
        return
    records = [jsonable(contacts_record(found)) for found in lists]
    shown = records if several else records[0]
    text = json.dumps(shown, indent=2, ensure_ascii=False, allow_nan=False)
    folder.write(f"{place}contacts.json", f"{text}\n")
    folder.write(f"{place}contacts.csv", contacts_csv(lists))


def put_errors(
    folder: OutputFolder,
    place: str,
    errors: "pl.DataFrame | None",
    analyses: Sequence[Analysis],
) -> None:
    """Write the error tables, if there are errors."""
    if errors is None:
        return
    errors, bounds = tables.marked(errors, analyses), paper_bounds(analyses)
    for name, text_of in ERROR_TABLES.items():
        folder.write(f"{place}{name}", text_of(errors, bounds))
