"""`vftcli benchmark`: methods scored against truth on many logs; the observers' times."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from vftcli.batch.choice import WorkersChoice
from vftcli.cli import options as opt
from vftcli.cli.batch import SOME_FAILED
from vftcli.cli.compare import TableOptions
from vftcli.cli.console import command_line, echo, echo_data, open_made, say, say_json, show, stages
from vftcli.robots.choice import RobotChoice
from vftcli.signals.option import LOG, Choice, Option, setting
from vftcli.signals.parsing import printable

SPEED = "speed"  #: The benchmark of times.


@dataclass(frozen=True, kw_only=True)
class BenchChoice(Choice):
    """How much is timed."""

    samples: Annotated[int, setting("bench.samples", "N", "Log length.", least=100)] = 30_060
    rounds: Annotated[int, setting("bench.rounds", "N", "Interleaved runs.", least=1)] = 7


@opt.command
def benchmark(
    what: Annotated[
        str,
        Option(
            "",
            "[sim|field|speed|FILE]",
            "Simulated or public logs, times, or your manifest.",
            completes=lambda: ("sim", "field", "speed"),
        ),
    ] = "sim",
    *,
    data: Annotated[
        Path | None, Option("--data", "DIR", "Look here for the manifest's logs.", group=LOG)
    ],
    outside: Annotated[
        list[str] | None,
        Option("--outside", "NAME=DIR", "Score these estimates too. Repeatable."),
    ],
    robot: Annotated[str, RobotChoice.option("robot")] = "ur5",
    length: opt.Typed[BenchChoice],
    output: Annotated[Path | None, opt.OUT._replace(help="Write here; default: benchmark.vft.")],
    table: TableOptions,
    workers: opt.Typed[WorkersChoice],
    anyway: opt.Anyway,
    talk: opt.TalkOptions,
    force: opt.Force,
    open_page: opt.Open,
) -> None:
    """Score observers against truth on many logs.

    Writes PATH/index.html, scores.parquet and run.json; a second run does what is missing.
    Nothing is downloaded: a log that is not there is named, with where it is had. Exit code 3:
    some log failed.

    Example: vftcli benchmark sim
    """
    if what == SPEED:
        time_observers(robot, length.choice(), table.form)
        return
    from vftcli.observers.table import DEFAULT
    from vftcli.outputs import benchmark as shown
    from vftcli.outputs.batch_folder import BatchFolder
    from vftcli.readers.library import absolute
    from vftcli.reproduction.benchmark import BenchmarkRun
    from vftcli.reproduction.manifest import load_manifest, rival_of

    form = table.form
    manifest = load_manifest(what, data)
    rivals = [rival_of(text, ("zero", "vendor", *DEFAULT)) for text in outside or ()]
    complaints = manifest.complaints(rivals)
    if complaints:
        head = "warning" if anyway else "error"
        for line in (line for lines in complaints.values() for line in lines):
            echo(printable(f"{head}: {line}"), err=True)
        if not anyway:
            raise typer.Exit(1)
    engine, begin = workers.choice(), stages()
    engine.check_closed(anyway=anyway)
    output = output or Path("benchmark.vft")
    run = BenchmarkRun(
        manifest=manifest,
        rivals=rivals,
        folder=BatchFolder(absolute(output), "scores.parquet"),
        workers=engine,
        command=command_line(),
        marked=frozenset(complaints),
        tell=say,
        progress=lambda stage, share: begin(stage, share, share),
    )
    results = run.run(force=force)
    if form == "json":
        say_json([], rows=results.rows, left_out=run.absent)
    elif form == "terminal":
        show(shown.to_terminal(results, every=talk.details))
    else:
        echo_data(shown.FORMS[form](results))
    for name, failure in run.failures:
        echo(printable(f"error: {name}: {failure.line}"), err=True)
    say("\n".join([*run.absent, f"{output / 'index.html'}, {output / 'scores.parquet'}"]))
    if open_page:
        open_made(output)
    if run.failures:
        raise typer.Exit(SOME_FAILED if results.arms else 1)


def time_observers(robot: str, asked: BenchChoice, form: str) -> None:
    """Print how long the dynamics and each observer take on this machine."""
    if form == "csv":
        raise typer.BadParameter("benchmark speed has --json, --markdown and --latex")
    from vftcli.outputs import grid
    from vftcli.outputs.grids import bench_grid
    from vftcli.reproduction.timing import benchmark as measured

    result = measured(robot, asked.samples, asked.rounds)
    if form == "json":
        say_json([], **result)
        return
    title = (
        f"{result['robot']}, {asked.samples} samples, median of {asked.rounds} rounds, "
        f"NumPy with {result['simd']}"
    )
    table = replace(bench_grid(result), title=f"Computing time: {title}")
    if form != "terminal":
        write = grid.latex if form == "latex" else grid.markdown
        echo_data(write(table))
        return
    echo(title)
    echo(grid.terminal(bench_grid(result)))
    if ratios := [f"{ratio:.2f}" for ratio in result["ratios"].values()]:
        echo(f"Dynamics with four observers take {ratios[0]} of the time of a loop of pin.rnea,")
        echo(f"{ratios[1]} on a clock that jitters by 5 %.")
