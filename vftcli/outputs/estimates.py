"""Files of `vftcli estimate`: estimates as columns, `run.json`, extras; a report's names."""

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vftcli.analysis import Analysis
from vftcli.outputs import PLAIN, OutputChoice, Record
from vftcli.outputs.examination import overridden_lines
from vftcli.outputs.files import SEAL, OutputFolder, numbered, table_file
from vftcli.outputs.run_record import run_record, seal
from vftcli.signals.arrays import Array
from vftcli.signals.packages import needed
from vftcli.signals.progress import steps
from vftcli.signals.shown import ALL, frame_of, per_joint
from vftcli.signals.wrench import per_axis
from vftcli.wrench.solvers import FRAMES

if TYPE_CHECKING:
    import polars as pl


#: First part of a column's name → its unit, and the sign of a torque or a wrench.
UNITS = {
    "t": "s",
    "q": "rad",
    "dq": "rad/s",
    "tau_ext": "N·m, on the robot",
    "sd": "N·m",
    "band": "N·m",
    "wrench": "N and N·m, on the robot",
    "wrench_sd": "N and N·m",
    "wrench_masked": "N and N·m, on the robot",
    "null_space": "N·m, on the robot",
    "sigma_min": "m",
    "contact": "number in the list of contacts",
}
#: An analysis and its rows; None for the whole log, after its blocks.
Group = tuple[Analysis, slice | None]
GROUP_ROWS = 1 << 15  #: Rows of a group of a table.


def estimates_table(analysis: Analysis, rows: slice = ALL) -> "pl.DataFrame":
    """Time, motion, every torque, wrenches: one flat column each.

    docs/outputs.md lists them. Of a wrench there are also ``null_space/<observer>`` [N·m],
    and by the solver ``map`` the masked samples as
    ``wrench_masked/<observer>/fx``…. Unknown values are null.
    """
    return frame_of(columns(analysis, rows))


def columns(analysis: Analysis, rows: slice) -> Iterator[tuple[str, Array]]:
    """Name and values of every column, in order, of some rows."""
    recording = analysis.recording
    yield "t", recording.t[rows]
    yield from per_joint("q", recording.q[rows])
    if recording.dq is not None:
        yield from per_joint("dq", recording.dq[rows])
    for estimate in analysis.estimates:
        yield from estimate.columns(rows)
    if analysis.reference is not None:
        yield from per_joint("tau_ext/reference", analysis.reference.tau[rows])
        if analysis.reference.sd is not None:
            yield from per_joint("sd/reference", analysis.reference.sd[rows])
    yield from wrench_columns(analysis, rows)
    if analysis.contacts is not None:
        t = analysis.t[rows]
        number = np.full(len(t), np.nan)
        for contact in analysis.contacts.contacts:
            number[(t >= contact.start) & (t <= contact.stop)] = contact.number
        yield "contact", number


def wrench_columns(analysis: Analysis, rows: slice) -> Iterator[tuple[str, Array]]:
    """Columns of wrenches, null space and sigma_min."""
    sensed = analysis.virtual_sensor
    bounded = sensed is not None and sensed.sensor.solver != "pinv"
    for wrench in analysis.wrenches:
        yield from wrench.columns(rows)
        # Least squares has no answer there; `map` has a finite one.
        if bounded and wrench.hidden.any():
            said = np.where(wrench.hidden[rows, None], wrench.values[rows], np.nan)
            yield from per_axis(f"wrench_masked/{wrench.name}", said)
        if wrench.null_space is not None:
            yield f"null_space/{wrench.name}", wrench.null_space[rows]
    sigma = next((w.sigma_min for w in analysis.wrenches if w.sigma_min is not None), None)
    if sigma is not None:
        yield "sigma_min", sigma[rows]


def write_estimates(path: Path, analysis: Analysis) -> None:
    """Write the table as Parquet."""
    starts = range(0, len(analysis.t), GROUP_ROWS)
    write_groups(path, ((analysis, slice(at, at + GROUP_ROWS)) for at in steps(starts)))


def write_groups(path: Path, groups: Iterable[Group], csv: Path | None = None) -> Analysis:
    """Write a table as groups of rows; the analysis of the last group.

    The whole table would not fit in memory beside the log.
    """
    from pyarrow import Table
    from pyarrow.parquet import ParquetWriter

    # Measured numbers hardly repeat: a dictionary costs time and room.
    how: Any = {"compression": "zstd", "compression_level": 1, "use_dictionary": False}
    schema: Any = None
    with ExitStack() as files:
        file = files.enter_context(table_file(path))
        for analysis, rows in groups:
            if rows is None:
                continue
            table = estimates_table(analysis, rows)
            if schema is None:
                about = json.dumps(statement(analysis, table.columns))
                schema = table.to_arrow().schema.with_metadata({"vftcli": about})
                writer = ParquetWriter(file, schema, write_statistics=False, **how)
                files.enter_context(writer)
                if csv is not None:
                    text = files.enter_context(csv.open("wb"))
                    table.clear().write_csv(text)
            arrays = table.to_arrow().columns
            writer.write_table(Table.from_arrays(arrays, schema=schema))
            if csv is not None:
                table.write_csv(text, include_header=False, float_precision=9)
    return analysis


def statement(analysis: Analysis, columns: Iterable[str]) -> Record:
    """Units and signs of the table's columns, frames of its wrenches, what was overridden."""
    kinds = dict.fromkeys(name.partition("/")[0] for name in columns)
    return {
        "columns": {kind: UNITS[kind] for kind in kinds},
        "frames": {wrench.name: FRAMES[wrench.frame] for wrench in analysis.wrenches},
        "overridden": overridden_lines(analysis.examinations),
    }


#: Flag → name of its file.
EXTRAS = {"csv": "estimates.csv", "mcap": "estimates.mcap", "rrd": "recording.rrd"}


def extra_files(extras: Sequence[str]) -> tuple[str, ...]:
    """Names of the files of these extras."""
    return tuple(EXTRAS[extra] for extra in extras)


def estimate_files(extras: Sequence[str]) -> tuple[str, ...]:
    """Names of the files of a folder with these extras."""
    return ("estimates.parquet", SEAL, *extra_files(extras))


#: Files of the errors table, in the order of `error_tables.FORMS`.
ERROR_TABLES = ("errors.csv", "errors.json", "errors.md", "errors.tex")
CONTACTS = ("contacts.json", "contacts.csv")  #: The list of contacts, where it is made.
CONTACT_TABLE = "figures/contacts.tex"  #: The list for a paper, beside its figures.
#: Files of a report of one log; error tables only with a reference.
FILES = ("index.html", "recording.rrd", "estimates.parquet", SEAL, *CONTACTS, *ERROR_TABLES)
#: Head above the sub-folders of several logs.
SUMMARY_FILES = ("index.html", SEAL, *CONTACTS, *ERROR_TABLES)


def places_of(labels: Iterable[str]) -> list[str]:
    """The sub-folder of each log: its name without the ending."""
    return numbered(Path(label).stem or "log" for label in labels)


def report_files(
    labels: Iterable[str], extras: Sequence[str], form: str | None, *, several: bool
) -> list[str]:
    """Names of a report's files; `several` logs have sub-folders."""
    own, above = [*FILES, *extra_files(extras)], [*SUMMARY_FILES]
    if form is not None:
        from vftcli.outputs.figures import ERROR_FIGURES, LOG_FIGURES
        from vftcli.outputs.paper import figure_files

        own += [CONTACT_TABLE, *figure_files(form, LOG_FIGURES)]
        above += figure_files(form, ERROR_FIGURES)
    if not several:
        return own
    return [*above, *(f"{place}/{name}" for place in places_of(labels) for name in own)]


def write_extras(
    folder: OutputFolder, place: str, analysis: Analysis, choice: OutputChoice
) -> None:
    """Write the extra files below a place of a folder."""
    for extra in choice.extras:
        path = folder / f"{place}{EXTRAS[extra]}"
        if extra == "csv":
            # Nine digits after the point; unknown is empty.
            with table_file(path) as file:
                estimates_table(analysis).write_csv(file, float_precision=9)
        elif extra == "mcap":
            from vftcli.outputs.conversion import write_mcap

            write_mcap(path, analysis)
        else:
            needed("rerun", path.name)
            from vftcli.outputs.rerun_recording import write_rrd

            write_rrd(path, analysis, choice.detail)


def write_estimate_folder(
    path: Path,
    analysis: Analysis | Iterator[Group],
    command: str,
    choice: OutputChoice = PLAIN,
    force: bool = False,
) -> tuple[Analysis, str]:
    """Write a folder of `estimates.parquet`, `run.json` and extras, all or nothing.

    A long log comes as groups, with CSV as the only extra. Returns the analysis of the whole
    log, and the text of `run.json`.
    """
    with OutputFolder(path, force, estimate_files(choice.extras)) as folder:
        table = folder / "estimates.parquet"
        if isinstance(analysis, Analysis):
            record = run_record(analysis, command)
            write_estimates(table, analysis)
            # After the record, which names the packages of the numbers.
            write_extras(folder, "", analysis, choice)
        else:
            csv = folder / "estimates.csv" if "csv" in choice.extras else None
            analysis = write_groups(table, analysis, csv)
            record = run_record(analysis, command)
        return analysis, seal(folder, SEAL, record)
