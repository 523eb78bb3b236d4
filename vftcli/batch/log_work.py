"""The work of `--do` on one log of a batch, written before it counts as done.

Its rows are of a log × observer × joint or axis, in fixed columns. A second run finds them
by a key, the sha256 of the log's bytes, the options, the files they name (robot, gains,
free runs, reference) and the program's version.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from polars import Boolean, Float64, Int64, String

from vftcli.analysis import Analysis
from vftcli.batch.cluster import begin
from vftcli.doctor.examination import Examiner
from vftcli.evaluation.references import WRENCH_SCHEMA
from vftcli.outputs import PLAIN, OutputChoice
from vftcli.outputs.batch_folder import BatchFolder
from vftcli.outputs.believability import log_line
from vftcli.outputs.examination import rate_of
from vftcli.outputs.files import digest
from vftcli.pipeline import Analyser, AnalysisChoice, analyse, list_touches, prepared
from vftcli.readers.opening import files_of
from vftcli.readers.reading import Library
from vftcli.readers.references import refuse_estimates
from vftcli.signals.arrays import Array, root_mean_square
from vftcli.signals.errors import LogError, ParameterError
from vftcli.signals.option import FILE
from vftcli.signals.packages import VERSION
from vftcli.signals.parsing import check_known
from vftcli.signals.wrench import AXES


@cache
def digest_of(path: Path) -> str:
    """The sha256 of a file, or of a folder's names and files."""
    if not path.is_dir():
        return digest(path)
    lines = (f"{file.relative_to(path).as_posix()} {digest(file)}" for file in files_of(path))
    return sha256("\n".join(lines))


def content_digest(files: Iterable[Path]) -> str:
    """The sha256 of a log's file, or of several files' digests."""
    each = [digest_of(path) for path in files]
    return each[0] if len(each) == 1 else sha256("\n".join(each))


def options_digest(options: Any) -> str:  # noqa: ANN401 - choices of every room
    """The sha256 of options, their files, and the program's version."""
    named = with_files(options, lambda path: Path(digest_of(path)))
    return sha256(json.dumps([VERSION, named], sort_keys=True, default=plain))


def key_of(content: str, options: str, part: object = None) -> str:
    """The key of a log's result, by content, options, part."""
    return sha256("\n".join((content, options, "" if part is None else str(part))))


def sha256(text: str) -> str:
    """The sha256 of a text, in hex."""
    return hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()


def with_files(value: Any, change: Callable[[Path], Path]) -> Any:  # noqa: ANN401
    """Options with every file name changed, in ``file:PATH`` too."""
    match value:
        case Path():
            return change(value)
        case str() if value.startswith(FILE):
            return f"{FILE}{change(Path(value.removeprefix(FILE)))}"
        case str() if Path(value).suffix and len(value) < 4096 and Path(value).is_file():
            return str(change(Path(value)))
        case tuple() if hasattr(value, "_fields"):
            return type(value)(*(with_files(item, change) for item in value))
        case tuple() | list():
            return type(value)(with_files(item, change) for item in value)
        case Mapping():
            return {key: with_files(item, change) for key, item in value.items()}
        case _ if is_dataclass(value) and not isinstance(value, type):
            own = {f.name: getattr(value, f.name) for f in fields(value) if f.compare}
            changed = {name: with_files(item, change) for name, item in own.items()}
            different = {name: x for name, x in changed.items() if x is not own[name]}
            return replace(value, **different)
    return value


def plain(value: Any) -> Any:  # noqa: ANN401
    """A form for JSON, equal in every process: sets in order."""
    match value:
        case frozenset() | set():
            return sorted(map(str, value))
        case Mapping():
            return dict(value)
        case _ if is_dataclass(value) and not isinstance(value, type):
            own = {f.name: getattr(value, f.name) for f in fields(value) if f.compare}
            return {type(value).__name__: own}
    return value.tolist() if hasattr(value, "tolist") else str(value)


COMMANDS = ("estimate", "compare", "report", "contacts")


@dataclass(frozen=True, kw_only=True)
class LogJob:
    """Work on every log of a batch."""

    do: str  #: One of `COMMANDS`.
    choice: AnalysisChoice  #: Choices for each log.
    anyway: bool = False  #: Whether to go on where a finding makes results meaningless.
    written: OutputChoice = PLAIN  #: Extra files of each log.

    def __post_init__(self) -> None:
        check_known(self.do, COMMANDS, f"--do {self.do!r}")
        if self.written.extras and self.do in {"compare", "contacts"}:
            raise ParameterError(f"--do {self.do} writes no estimates; leave --csv, --mcap out")


class LogTask(NamedTuple):
    """One log of a batch."""

    job: LogJob
    folder: Path  #: Where the batch is written, from the root.
    command: str  #: The command line, for the records.
    path: Path  #: The log's file or folder, from the root.
    episode: int | None  #: Its episode, None for a file of one recording.
    label: str
    key: str
    sha256: str  #: Of its file's bytes; "" for several files.


def work_on_log(task: LogTask) -> None:
    """Analyse a log and write its result, unless it is there."""
    folder, job = BatchFolder(task.folder), task.job
    if folder.row_file(task.key).exists():
        return
    begin("reading")
    choice, library = job.choice, Library([task.path])
    read = replace(choice.read, episode=task.episode)
    examiner = Examiner(anyway=job.anyway)
    choice = replace(choice, read=read, library=library, examiner=examiner)
    if choice.read.columns is None:
        refuse_estimates(task.path)
    recording = choice.library.open(task.path, choice.read)
    if task.sha256 and recording.source.sha256 != task.sha256:
        raise LogError(f"{task.path} was changed while the batch ran; run the command again")
    source = replace(recording.source, label=task.label, path=task.path)
    recording = replace(recording, source=source)
    begin("analysing")
    work: Analyser = list_touches if job.do == "contacts" else analyse
    analysis = work(prepared(recording, choice), choice)
    begin("writing")
    place, line = folder.path / folder.place(task.key), task.command
    if job.do == "estimate":
        from vftcli.outputs.estimates import write_estimate_folder

        write_estimate_folder(place, analysis, line, job.written, force=True)
    elif job.do == "report":
        from vftcli.outputs.report import write_report

        write_report(place, [analysis], command=line, force=True, choice=job.written)
    elif job.do == "contacts":  # `compare` has its rows alone
        from vftcli.outputs.estimates import CONTACTS
        from vftcli.outputs.files import OutputFolder
        from vftcli.outputs.report import put_contacts

        with OutputFolder(place, True, CONTACTS) as files:
            put_contacts(files, "", [analysis], line)
    folder.put_rows(task.key, rows_of(analysis, task.key))


Kinds = dict[str, Any]  #: Column → its type in polars.
#: Columns with one value a log.
OF_LOG: Kinds = {
    "robot": String,
    "samples": Int64,
    "duration_s": Float64,
    "rate_hz": Float64,
    "health": String,
    "reason": String,
    "findings": pl.List(String),
    "contacts": Int64,
    "load": Boolean,
    "hardest_N": Float64,
    "hardest_band_N": Float64,
    "hardest_s": Float64,
    "hardest_anywhere_N": pl.List(Float64),
    "detectable_N": Float64,
}
#: An estimate and its size: root mean square, and 99 % quantile of |τ̂|.
OF_ESTIMATE: Kinds = {
    "observer": String,
    "joint": Int64,
    "axis": String,
    "rms_Nm": Float64,
    "p99_Nm": Float64,
    "rms_N": Float64,
    "p99_N": Float64,
}
COMPARED = "compared_samples"  #: Samples of a comparison; `samples` are the log's.
#: Errors as in `vftcli compare --json`; null without a reference.
OF_ERROR: Kinds = {
    COMPARED if name == "samples" else name: kind
    for name, kind in WRENCH_SCHEMA.items()
    if name not in {"recording", *OF_ESTIMATE}
}
#: Columns of a log's rows.
SCHEMA: Kinds = {"key": String, **OF_LOG, **OF_ESTIMATE, **OF_ERROR}
JOINED = ("observer", "joint", "axis")  #: Key of an estimate and its error.


def rows_of(analysis: Analysis, key: str) -> pl.DataFrame:
    """The rows of one log; one row without an observer if none ran."""
    sizes, sensed = list[dict[str, Any]](), analysis.virtual_sensor
    for estimate in analysis.estimates:
        for joint, column in enumerate(estimate.tau.T, start=1):
            rms, most = size_of(column)
            place = {"observer": estimate.name, "joint": joint}
            sizes.append(place | {"rms_Nm": rms, "p99_Nm": most})
    for wrench in sensed.wrenches if sensed is not None else ():
        for k, (axis, column) in enumerate(zip(AXES, wrench.known.T, strict=True)):
            (rms, most), unit = size_of(column), "N" if k < 3 else "Nm"
            place = {"observer": wrench.name, "axis": axis}
            sizes.append(place | {f"rms_{unit}": rms, f"p99_{unit}": most})
    rows, empty = pl.DataFrame(sizes, schema=OF_ESTIMATE), pl.DataFrame(schema=SCHEMA)
    if analysis.errors is not None:
        others = pl.all().exclude("recording", "samples")
        errors = analysis.errors.select(others, pl.col("samples").alias(COMPARED))
        errors = pl.concat([empty.select(*JOINED, *OF_ERROR), errors], how="diagonal_relaxed")
        order = {"how": "full", "coalesce": True, "nulls_equal": True}
        rows = rows.join(errors, on=JOINED, maintain_order="left_right", **order)  # type: ignore[arg-type]
    if rows.is_empty():
        rows = pl.DataFrame({"observer": [None]})
    codes = [f.code for one in analysis.examinations[:1] for f in one.warnings]
    facts = log_line(analysis)._asdict() | {
        "key": key,
        "samples": analysis.recording.samples,
        "rate_hz": rate_of(analysis.recording),
        "findings": list(dict.fromkeys(codes)),
    }
    rows = rows.with_columns(pl.lit(facts[n], SCHEMA[n]).alias(n) for n in ("key", *OF_LOG))
    return pl.concat([empty, rows], how="diagonal_relaxed").select(*SCHEMA)


def size_of(values: Array) -> tuple[float | None, float | None]:
    """RMS and 99 % quantile of known |values|, or None."""
    known = np.abs(values[np.isfinite(values)])
    if not len(known):
        return None, None
    return root_mean_square(known), float(np.quantile(known, 0.99))
