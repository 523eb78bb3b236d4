"""The work of `--do` on one log of a batch, written before it counts as done."""

from dataclasses import dataclass, replace
from pathlib import Path

from vftcli.analysis import Analysis
from vftcli.batch.outcome import begin
from vftcli.doctor.examination import Examiner
from vftcli.outputs.batch_folder import BatchFolder
from vftcli.outputs.log.choice import PLAIN, OutputChoice
from vftcli.pipeline import Analyser, AnalysisChoice, analyse, list_touches, prepared
from vftcli.readers.estimates import refuse_estimates
from vftcli.readers.library import Library
from vftcli.robots.run import Runs
from vftcli.signals.errors import LogError
from vftcli.signals.parsing import check_known

COMMANDS = ("estimate", "compare", "report", "contacts")  #: What may be done with a log.


@dataclass(frozen=True, kw_only=True)
class LogJob:
    """Work on every log of a batch."""

    do: str  #: One of `COMMANDS`.
    choice: AnalysisChoice  #: What is asked of each log.
    anyway: bool = False  #: Whether results are wanted even where a finding makes them meaningless.
    written: OutputChoice = PLAIN  #: What is written of each log besides what always is.

    def __post_init__(self) -> None:
        check_known(self.do, COMMANDS, f"--do {self.do!r}")


@dataclass(frozen=True, kw_only=True)
class LogTask:
    """One log of a batch."""

    job: LogJob  #: What is done with it.
    folder: Path  #: Where the batch is written, from the root.
    command: str  #: The command line, for the records.
    path: Path  #: The log's file or folder, from the root.
    episode: int | None  #: Its episode, None for a file of one recording.
    label: str  #: What it is called.
    key: str  #: What its result is kept under.
    sha256: str  #: Of its file's bytes; "" for several files.


def work_on_log(task: LogTask) -> None:
    """Analyse a log and write its result, unless it is there."""
    folder = BatchFolder(task.folder)
    if folder.row_file(task.key).exists():
        return
    analysis = analysed(task)
    begin("writing")
    write_result(folder.result(task.key), analysis, task)
    from vftcli.batch.rows import rows_of

    folder.put_rows(task.key, rows_of(analysis, task.key))


def analysed(task: LogTask) -> Analysis:
    """The log as its job asks, as the command of that name alone would analyse it."""
    begin("reading")
    choice = replace(
        task.job.choice,
        read=replace(task.job.choice.read, episode=task.episode, all_episodes=False),
        library=Library([task.path]),
        examiner=Examiner(anyway=task.job.anyway),
    )
    if choice.read.columns is None:
        refuse_estimates(task.path)
    recording = choice.library.open(task.path, choice.read)
    if task.sha256 and recording.source.sha256 != task.sha256:
        raise LogError(f"{task.path} was changed while the batch ran; run the command again")
    source = replace(recording.source, label=task.label, path=task.path)
    recording = replace(recording, source=source)
    begin("analysing")
    work: Analyser = list_touches if task.job.do == "contacts" else analyse
    return work(*prepared(recording, choice), choice, Runs())


def write_result(folder: Path, analysis: Analysis, task: LogTask) -> None:
    """Write what the command of that name writes of a log; of `compare` the errors are the rows."""
    job = task.job
    if job.do == "estimate":
        from vftcli.outputs.log.estimates import write_estimate_folder

        write_estimate_folder(folder, analysis, task.command, job.written, force=True)
    elif job.do == "report":
        from vftcli.outputs.log.report import write_report

        write_report(folder, analysis, command=task.command, force=True, choice=job.written)
    elif job.do == "contacts":
        from vftcli.outputs.files import OutputFolder
        from vftcli.outputs.log.report import CONTACTS, put_contacts

        with OutputFolder(folder, True, CONTACTS) as files:
            put_contacts(files, "", [analysis])
