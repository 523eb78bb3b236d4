"""Files of `vftcli report`: page, recording, estimates, errors, run.json."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import polars as pl

from vftcli.analysis import Analysis
from vftcli.outputs import NONE, PLAIN, OutputChoice, Record
from vftcli.outputs import error_tables as tables
from vftcli.outputs.believability import log_line
from vftcli.outputs.contacts import contacts_csv, contacts_latex, contacts_record
from vftcli.outputs.estimates import (
    CONTACT_TABLE,
    ERROR_TABLES,
    places_of,
    report_files,
    write_estimates,
    write_extras,
)
from vftcli.outputs.figures import error_figures, log_figures
from vftcli.outputs.files import SEAL, OutputFolder, put_text
from vftcli.outputs.paper import write_figures
from vftcli.outputs.run_record import envelope, log_entry, run_record, seal, to_json, versions
from vftcli.signals.packages import installed
from vftcli.signals.progress import steps
from vftcli.signals.recording import trim


def write_report(
    path: Path,
    analyses: Sequence[Analysis],
    *,
    command: str,
    force: bool = False,
    choice: OutputChoice = PLAIN,
    form: str | None = None,
    failed: Mapping[str, str] = {},
) -> str:
    """Write a report of one log, or a sub-folder a log below an index.

    All files are written or none. Returns the text of `run.json`, of several logs one record
    with theirs in it.
    """
    from vftcli.outputs.page.pages import render_logs

    labels, several = [a.recording.name for a in analyses], len(analyses) + len(failed) > 1
    pages = list(zip(places_of(labels), analyses, strict=True))
    names = report_files(labels, choice.extras, form, several=several)
    with OutputFolder(path, force, names) as folder:
        if not several:
            return fill(folder, "", analyses[0], command, choice, form)
        records = [
            fill(folder, f"{place}/", analysis, command, choice, form)
            for place, analysis in steps(pages)
        ]
        lines = [log_line(analysis, f"{place}/index.html") for place, analysis in pages]
        folder.write("index.html", render_logs(lines, failed, analyses))
        errors = put_errors(folder, "", analyses)
        put_contacts(folder, "", analyses, command)
        if form is not None and errors is not None:
            write_figures(folder, error_figures(errors), form)
        logs = [log_entry(a.recording, {"folder": place}) for place, a in pages]
        left_out = {"left_out": dict(failed)}
        seal(folder, SEAL, envelope(command, logs, found=left_out))
        each = zip(records, logs, strict=True)
        full = [json.loads(record) | {"folder": log["folder"]} for record, log in each]
        return to_json(envelope(command, full, found=left_out))


def fill(
    folder: OutputFolder,
    place: str,
    analysis: Analysis,
    command: str,
    choice: OutputChoice,
    form: str | None,
) -> str:
    """Write one log's files; return the text of its `run.json`."""
    from vftcli.outputs.page.pages import render  # templates, which no answer needs

    record = run_record(analysis, command)
    # The page shows the record beside it.
    analysis = replace(analysis, run=record)
    # Without the package the command says how to get it.
    recorded = choice.detail != NONE and installed("rerun")
    for name in steps(["estimates.parquet", *["recording.rrd"] * recorded, "index.html"]):
        path = folder / f"{place}{name}"
        analysis.recording.release()
        trim()
        if name == "estimates.parquet":
            write_estimates(path, analysis)
            put_errors(folder, place, [analysis])
            put_contacts(folder, place, [analysis], command)
        elif name == "recording.rrd":
            from vftcli.outputs.rerun_recording import write_rrd

            write_rrd(path, analysis, choice.detail)
            record["versions"] = versions()  # Rerun's too
        else:
            sizes = {file.name: file.stat().st_size for file in path.parent.iterdir()}
            put_text(path, render(analysis, {**sizes, SEAL: None}))
    write_extras(folder, place, analysis, choice)
    if form is not None:
        write_figures(folder, log_figures(analysis), form, f"{place}figures/")
        if analysis.contacts is not None and analysis.contacts.contacts:
            folder.write(f"{place}{CONTACT_TABLE}", contacts_latex(analysis.contacts))
    return seal(folder, f"{place}{SEAL}", record)


def put_contacts(
    folder: OutputFolder, place: str, analyses: Sequence[Analysis], command: str
) -> None:
    """Write the lists of contacts, if any, as JSON and CSV."""
    if lists := [each.contacts for each in analyses if each.contacts is not None]:
        folder.write(f"{place}contacts.json", to_json(contacts_envelope(analyses, command)))
        folder.write(f"{place}contacts.csv", contacts_csv(lists))


def contacts_envelope(
    analyses: Sequence[Analysis], command: str, failed: Mapping[str, str] = {}
) -> Record:
    """Contacts of logs for machines, and those that `failed`."""
    logs = [log_entry(a.recording, contacts_record(a.contacts)) for a in analyses if a.contacts]
    return envelope(command, logs, found={"left_out": dict(failed)} if failed else {})


def put_errors(
    folder: OutputFolder, place: str, analyses: Sequence[Analysis]
) -> pl.DataFrame | None:
    """Write the error tables of all logs, if any; their rows."""
    found = [a.errors for a in analyses if a.errors is not None]
    if not found:
        return None
    errors = pl.concat(found, how="diagonal")
    marked = tables.marked(errors, analyses)
    for name, text_of in zip(ERROR_TABLES, tables.FORMS.values(), strict=True):
        folder.write(f"{place}{name}", text_of(marked))
    return errors
