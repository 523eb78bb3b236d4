"""`vftcli batch`: one command on many logs."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from vftcli.batch import WorkersChoice
from vftcli.cli import options as opt
from vftcli.cli.console import SOME_FAILED, echo_data, say
from vftcli.cli.progress import STAGES
from vftcli.evaluation import ReferenceChoice
from vftcli.outputs import OutputChoice
from vftcli.signals.option import Asked, Option, names_at

#: Commands that compare logs with nothing.
WITHOUT_REFERENCE = ("estimate", "contacts")
MOST_NAMED = 10  #: Failures that are printed.


@opt.command(WorkersChoice, ReferenceChoice, *opt.OF_ANALYSIS, OutputChoice)
def batch(
    logs: Annotated[
        list[Path],
        Option("", "LOG|FOLDER|DATASET...", "Logs, folders, data sets; an episode is a log."),
    ],
    output: opt.Folder,
    do: Annotated[
        str,
        Option(
            "--do",
            "COMMAND",
            "Run estimate, compare, report or contacts.",
            completes=names_at("batch.log_work:COMMANDS"),
        ),
    ],
    asked: Asked,
    json: opt.Json,
    force: opt.Force,
) -> None:
    """Run a command on many logs; resume where it stopped.

    Writes PATH/batch.parquet, failures.parquet, index.html and run.json; a second run does what
    is missing or failed. Exit code 3: some failed.

    Example: vftcli batch fixtures/ur5_t*.csv --robot ur5 --do estimate -o out
    """
    from vftcli.batch.log_work import LogJob
    from vftcli.batch.run import BatchRun, LogCollection
    from vftcli.doctor.examination import Examiner
    from vftcli.outputs.batch_folder import BatchFolder
    from vftcli.pipeline import for_comparison, for_estimates
    from vftcli.readers.reading import Library, absolute
    from vftcli.readers.table import listed
    from vftcli.signals.errors import LogError, ParameterError
    from vftcli.signals.parsing import counted

    choice, anyway = opt.choice_for(asked, Library()), asked.anyway
    choice.robot.check()
    if do == "compare" and choice.reference is None:
        raise ParameterError("--do compare needs --reference: two-cycle, sensor, vendor, zero, …")
    if do in WITHOUT_REFERENCE and choice.reference is not None:
        say(f"note: --do {do} compares with nothing: --reference is left out")
        choice = replace(choice, reference=None)
    if narrowed := {"estimate": for_estimates, "compare": for_comparison}.get(do):
        choice = narrowed(choice)
    # These are of each worker.
    choice = replace(choice, library=Library(), examiner=Examiner())
    engine = asked.of(WorkersChoice)
    engine.check_closed(anyway=anyway)
    collection = LogCollection(choice.read, output)
    free = {*map(absolute, choice.free.logs)}
    found = [entry for entry in collection.find(logs) if entry.path not in free]
    if passed := sorted(path.name for path in collection.passed):
        say(f"note: left out, not a log: {listed(passed, 3)}")
    if not found:
        raise LogError(
            f"no log in {', '.join(map(str, logs[:3]))}; give files, folders or patterns of logs"
        )
    run = BatchRun(
        logs=found,
        job=LogJob(do=do, choice=choice, anyway=anyway, written=asked.of(OutputChoice)),
        folder=BatchFolder(absolute(output)),
        workers=engine,
        command=asked.line,
        tell=say,
    )
    failures, count = run.run(force=force)
    STAGES.end()
    for name, reason in failures.select("log", "line").head(MOST_NAMED).iter_rows():
        say(f"error: {name}: {reason}")
    if failures.height > MOST_NAMED:
        say(f"… {failures.height - MOST_NAMED} more in failures.parquet")
    say(
        f"{counted(count.logs, 'log')}: {count.done} done now, {count.before} earlier, "
        f"{count.failed} failed; {output / 'index.html'}, {output / 'batch.parquet'}"
    )
    if json:
        echo_data((output / "run.json").read_text("utf-8"))
    if count.failed:
        raise typer.Exit(SOME_FAILED if count.done + count.before else 1)
