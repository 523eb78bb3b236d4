"""`vftcli batch` and `vftcli annotate`: one work on many logs, forces for a dataset."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from vftcli.batch import WorkersChoice
from vftcli.cli import options as opt
from vftcli.cli.console import SOME_FAILED, detail, echo_data, say
from vftcli.cli.progress import STAGES
from vftcli.evaluation import ReferenceChoice
from vftcli.observers import ObserverChoice
from vftcli.outputs import OutputChoice
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice
from vftcli.signals.option import WRITE, Anyway, Asked, Option, names_at
from vftcli.signals.parsing import check_known, counted
from vftcli.wrench import WrenchChoice

#: Commands that compare logs with nothing.
WITHOUT_REFERENCE = ("estimate", "contacts")
MOST_NAMED = 10  #: Failures that are printed.
ADDED = ("wrench", "sd", "contact")  #: Values of ``--add``.


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

    choice, anyway = opt.choice_for(asked, Library()), asked.anyway
    choice.robot.check()
    if do == "compare" and choice.reference is None:
        raise ParameterError("--do compare needs --reference: two-cycle, sensor, vendor, zero, …")
    if do in WITHOUT_REFERENCE and choice.reference is not None:
        say(f"note: --do {do} compares with nothing: --reference is left out")
        choice = replace(choice, reference=None)
    if narrowed := {"estimate": for_estimates, "compare": for_comparison}.get(do):
        choice = narrowed(choice)
    choice = replace(choice, examiner=Examiner())  # each worker's own
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


@opt.command(*opt.OF_LOG, ObserverChoice, WrenchChoice, WorkersChoice, Anyway, opt.Talk)
def annotate_dataset(
    dataset: Annotated[
        Path, Option("", "DATASET", "A LeRobot folder, a DROID folder, or HDF5 episodes.")
    ],
    output: opt.Folder,
    asked: Asked,
    add: Annotated[
        list[str] | None,
        Option(
            "--add",
            "NAMES",
            "Add wrench, sd or contact columns as well.",
            group=WRITE,
            completes=lambda: ADDED,
        ),
    ],
    json: opt.Json,
    force: opt.Force,
) -> None:
    """Add forces to every frame of a dataset's copy.

    Adds observation.external_torque, with --add wrench observation.wrench, and their statistics;
    COPY/meta/vftcli.json says what was done. A run that was cut off goes on where it stopped.
    With --anyway frames without an answer are 0, and columns ..._valid say so.

    Example: vftcli annotate fixtures/panda_episodes -o forces
    """
    from vftcli.batch.annotation import USUAL, ForceChoice, annotate
    from vftcli.outputs.run_record import to_json

    added = [name.strip() for word in add or () for name in word.split(",")]
    for name in added:
        check_known(name, ADDED, f"--add {name}")
    anyway, wanted = asked.anyway, "wrench" in added or asked.states(WrenchChoice)
    choice = ForceChoice(
        read=asked.of(ReadChoice),
        robot=asked.of(RobotChoice),
        observers=asked.but(observer=asked.words["observer"] or [USUAL]).of(ObserverChoice),
        wrench=asked.of(WrenchChoice) if wanted else None,
        sd="sd" in added,
        contacts="contact" in added,
        anyway=anyway,
    )
    engine = asked.of(WorkersChoice)
    engine.check_closed(anyway=anyway)
    record = annotate(dataset, output, choice, engine, asked.line, detail, force=force)
    if json:
        echo_data(to_json(record))
        return
    for line in copy_lines(record, choice.observer):
        say(line)
    say(f"wrote {output}")


def copy_lines(record: Mapping[str, Any], observer: str) -> list[str]:
    """Lines on the written copy, and on its limits."""
    from vftcli.doctor.examination import doubt

    done, frames = record["status"], sum(one.get("frames", 0) for one in record["episodes"])
    count = ", ".join(f"{n} {status}" for status, n in done.items())
    kind = "causal" if record["causal"] else "NOT causal: it looks ahead, no policy can run on it"
    lines = [
        f"{counted(sum(done.values()), 'episode')} ({count}), {frames} frames, "
        f"{record['robot']['name']}, {observer}, {kind}"
    ]
    for name, column in record["columns"].items():
        # Unit and axes of a force, else the meaning of 1 and 0.
        force = f"{column['units']}, {column['frame']}"
        lines.append(f"  {name}: {column['sign'] if column['units'] == '1' else force}")
    if delay := record["transient_frames"]:
        lines.append(f"  the observer settles in the first {delay} frames of each episode")
    clocks = dict.fromkeys(one["clock"] for one in record["episodes"] if "clock" in one)
    lines += [f"  clock: {clock}" for clock in clocks]
    overridden = sorted(
        {code for one in record["episodes"] for code in one.get("overridden", ())}
    )
    if overridden:
        lines.append(doubt(", ".join(overridden)))
    return lines
