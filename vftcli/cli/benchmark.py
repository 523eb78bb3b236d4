"""`vftcli benchmark`, `vftcli reproduce`: scores against truth; a paper's numbers."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.batch import WorkersChoice
from vftcli.cli import options as opt
from vftcli.cli.console import SOME_FAILED, echo, echo_data, open_made, say, say_json, show
from vftcli.robots import RobotChoice
from vftcli.signals.errors import ParameterError
from vftcli.signals.option import LOG, Anyway, Asked, Choice, Option
from vftcli.signals.parsing import printable

if TYPE_CHECKING:
    from vftcli.reproduction.manifest import Manifest, Rival

SPEED = "speed"  #: The benchmark of times.
#: Line below the table.
ABOUT = "ours / print: our number over the paper's, median of an item's lines (least … most)"


class BenchChoice(Choice):
    """Size of the timing."""

    samples: Annotated[int, Option("bench.samples", "N", "Log length.", least=100)] = 30_060
    rounds: Annotated[int, Option("bench.rounds", "N", "Interleaved runs.", least=1)] = 7


@opt.command(BenchChoice, opt.TableForm, WorkersChoice, Anyway, opt.Talk)
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
    robot: Annotated[str | None, RobotChoice.option("robot")],
    output: Annotated[Path | None, opt.OUT._replace(help="Write here; default: benchmark.vft.")],
    asked: Asked,
    force: opt.Force,
    open_page: opt.Open,
) -> None:
    """Score observers against truth on many logs.

    Writes PATH/index.html, scores.parquet and run.json; a second run does what is missing.
    Nothing is downloaded: a log that is not there is named, with its source. Exit code 3: some
    logs failed; 1: all.

    Example: vftcli benchmark sim
    """
    form = opt.form_of(asked)
    unfit: dict[str, object] = {"--robot": robot, "--set bench": asked.states(BenchChoice)}
    if what == SPEED:
        unfit = {"--outside": outside, "-o": output, "--anyway": asked.anyway, "--force": force}
        unfit |= {"--open": open_page, "--jobs": asked.of(WorkersChoice) != WorkersChoice()}
        unfit["--csv"] = form == "csv"
    if what in {SPEED, "sim"}:
        unfit["--data"] = data
    if given := [name for name, value in unfit.items() if value]:
        raise typer.BadParameter(f"benchmark {what} takes no {', '.join(given)}")
    if what == SPEED:
        time_observers(robot or "ur5", asked.of(BenchChoice), form)
        return
    if data is not None and not data.is_dir():
        raise typer.BadParameter(f"--data {data}: there is no such folder")
    from vftcli.reproduction.manifest import load_manifest, rival_of

    manifest, output = load_manifest(what, data), output or Path("benchmark.vft")
    try:
        rivals = [rival_of(text, manifest.logs) for text in outside or ()]
    except ParameterError as error:
        raise typer.BadParameter(str(error)) from None
    code = score(manifest, rivals, output, asked, force=force)
    if open_page and code != 1 and output.exists():
        open_made(output)
    raise typer.Exit(code)


def score(
    manifest: "Manifest", rivals: "list[Rival]", output: Path, asked: Asked, *, force: bool
) -> int:
    """Score every log and print the results; the exit code."""
    from vftcli.outputs.benchmark import text_of
    from vftcli.reproduction.benchmark import BenchmarkRun

    engine, form, anyway = asked.of(WorkersChoice), opt.form_of(asked), asked.anyway
    complaints, absent = manifest.complaints(rivals), manifest.absent()
    for _, line in complaints:
        echo(printable(f"{'warning' if anyway else 'error'}: {line}"), err=True)
    if complaints and not anyway:
        return 1
    if all(log.missing for log in manifest.logs.values()):
        if form == "json":
            say_json([], rows=[], left_out=absent)
        none = f"Nothing is scored: {manifest.data.absolute()} has none of the logs. "
        absent.append(f"{none}Put them there, or name their folder with --data.")
        echo("\n".join(map(printable, absent)), err=True)
        return 0
    engine.check_closed(anyway=anyway)
    marked = frozenset(name for name, _ in complaints)
    run = BenchmarkRun(manifest, rivals, output, engine, asked.line, marked, say)
    results = run.run(force=force)
    if form == "json":
        say_json([], rows=results.rows, left_out=absent)
    elif form != "terminal":
        echo_data(text_of(results, form, every=True))
    elif len(results.table):
        show(text_of(results, form, every=asked.words["details"]))
    for name, failure in run.failures.items():
        echo(printable(f"error: {name}: {failure.line}"), err=True)
    say("\n".join([*absent, f"wrote {output / 'index.html'}, {output / 'scores.parquet'}"]))
    failed = SOME_FAILED if results.rows else 1
    return failed if run.failures else 0


def time_observers(robot: str, asked: BenchChoice, form: str) -> None:
    """Print the times of dynamics and observers."""
    from vftcli.outputs import grid
    from vftcli.outputs.grids import bench_grid
    from vftcli.reproduction.timing import benchmark as measured

    result = measured(robot, asked.samples, asked.rounds)
    if form == "json":
        say_json([], **result)
        return
    length = f"{asked.samples} samples, median of {asked.rounds} rounds"
    title = f"{result['robot']}, {length}, NumPy with {result['simd']}"
    times = replace(bench_grid(result), title=f"Computing time: {title}")
    if form != "terminal":
        echo_data(grid.latex(times) if form == "latex" else grid.markdown(times))
        return
    echo(grid.terminal(times))
    if ratios := [f"{ratio:.2f}" for ratio in result["ratios"].values()]:
        echo(f"Dynamics with four observers take {ratios[0]} of the time of a loop of pin.rnea,")
        echo(f"{ratios[1]} on a clock that jitters by 5 %.")


@opt.command(opt.Talk)
def reproduce(
    paper: Annotated[str, Option("", "huang2025", "Which paper.")],
    output: Annotated[Path | None, opt.OUT._replace(help="Write here; default: huang2025.vft.")],
    figures: opt.Figures,
    only: Annotated[
        str | None, Option("--only", "NAME,...", "Run only these: table1...table4, fig1...fig13.")
    ],
    fast: Annotated[bool, Option("--fast", "", "Use one seed a scenario instead of five.")],
    force: opt.Force,
    json: opt.Json,
    asked: Asked,
) -> None:
    """Run the paper's experiments beside its numbers.

    On simulated equivalents, with stated seeds. Writes PATH/index.html, its tables as
    reproduction.md, and run.json. An experiment that fails says so in its row; the others are
    written, and the exit code is 1.

    Example: vftcli reproduce huang2025 --only table3
    """
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.grid import terminal
    from vftcli.reproduction.experiments import (
        experiments_of,
        files_of,
        gather,
        overview,
        run_jobs,
        write_reproduction,
    )
    from vftcli.reproduction.paper import paper_of
    from vftcli.signals.packages import check_installed

    check_installed("pinocchio", "vftcli reproduce")
    wanted = paper_of(paper)
    names = wanted.chosen(only)
    output = output or Path(f"{paper}.vft")
    folder = OutputFolder(output, force, files_of(wanted, names, figures))
    folder.check()
    chosen = experiments_of(wanted, names, fast=fast)
    found = gather(wanted, names, run_jobs(chosen))
    with folder:
        write_reproduction(folder, wanted, found, chosen, asked.line, figures)
    if json:
        echo_data((output / "run.json").read_text("utf-8"))
    else:
        show(terminal(overview(found)) + ABOUT)
    say(f"wrote {output}: open {output / 'index.html'}")
    if any(item.failures for item in found.values()):
        raise typer.Exit(1)
