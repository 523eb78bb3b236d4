"""`vftcli reproduce` and `vftcli bench`: a paper's experiments and times, beside its numbers."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.console import command_line, echo, echo_data, say, say_json, show, stages
from vftcli.robots.choice import RobotChoice
from vftcli.signals.option import Choice, Option, setting


@opt.command
def reproduce(
    paper: Annotated[str, Option("", "PAPER", "Which: huang2025.")],
    output: Annotated[Path | None, opt.OUT._replace(help="Write here; default: huang2025.vft.")],
    figures: opt.Figures,
    only: Annotated[
        str | None,
        Option("--only", "NAME,...", "Run only these: table1...table4, fig1...fig13."),
    ],
    fast: Annotated[bool, Option("--fast", "", "Use one seed a scenario instead of five.")],
    force: opt.Force,
    _talk: opt.TalkOptions,
) -> None:
    """Run the paper's experiments beside its numbers.

    On simulated equivalents, with stated seeds. Writes PATH/index.html, reproduction.md and
    run.json. An experiment that fails says so in its row; the others are written, and the
    exit code is 1.

    Example: vftcli reproduce huang2025 --only table3
    """
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.grid import terminal
    from vftcli.reproduction.experiments import (
        files_of,
        gather,
        jobs_of,
        run_jobs,
        short_overview,
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
    jobs, progress = jobs_of(wanted, names, fast), stages()
    progress(f"{len(jobs)} runs", 0.0, 0.0)

    def told(done: int, of: int, what: str) -> None:
        progress(f"{done} of {of} runs done: {what}", done / of, done / of)

    found = gather(wanted, names, run_jobs(jobs, told))
    with folder:
        write_reproduction(folder, wanted, found, jobs, command_line(), figures)
    show(terminal(short_overview(found)))
    say(f"wrote {output}: open {output / 'index.html'}")
    if any(shown.failures for shown in found.values()):
        raise typer.Exit(1)


@dataclass(frozen=True, kw_only=True)
class BenchChoice(Choice):
    """How much is timed."""

    samples: Annotated[int, setting("bench.samples", "N", "Log length.", least=100)] = 30_060
    rounds: Annotated[int, setting("bench.rounds", "N", "Interleaved runs.", least=1)] = 7


@opt.command
def bench(
    *,
    robot: Annotated[str, RobotChoice.option("robot")] = "ur5",
    length: opt.Typed[BenchChoice],
    latex: Annotated[bool, opt.LATEX],
    json: opt.Json,
) -> None:
    """Time the observers on this machine.

    Example: vftcli bench --set bench.rounds=3
    """
    from vftcli.outputs import grid
    from vftcli.outputs.grids import bench_grid
    from vftcli.reproduction.timing import benchmark

    asked = length.choice()
    result = benchmark(robot, asked.samples, asked.rounds)
    if json:
        say_json([], **result)
        return
    title = (
        f"{result['robot']}, {asked.samples} samples, median of {asked.rounds} rounds, "
        f"NumPy with {result['simd']}"
    )
    if latex:
        echo_data(grid.latex(replace(bench_grid(result), title=f"Computing time: {title}")))
        return
    echo(title)
    echo(grid.terminal(bench_grid(result)))
    if ratios := [f"{ratio:.2f}" for ratio in result["ratios"].values()]:
        echo(f"Dynamics with four observers take {ratios[0]} of the time of a loop of pin.rnea,")
        echo(f"{ratios[1]} on a clock that jitters by 5 %.")
