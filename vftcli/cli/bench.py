"""`vftcli bench`: Table II on this machine."""

from dataclasses import replace
from typing import Annotated

import typer

from vftcli.cli import options as opt
from vftcli.robots.choice import RobotChoice
from vftcli.signals.option import Option


@opt.command
def bench(
    *,
    robot: Annotated[str, RobotChoice.option("robot")] = "ur5",
    samples: Annotated[int, Option("--samples", "N", "Length of the log.", least=100)] = 30_060,
    rounds: Annotated[int, Option("--rounds", "N", "Interleaved repetitions.", least=1)] = 7,
    latex: Annotated[bool, opt.LATEX],
    json: opt.Json,
) -> None:
    """Time the observers.

    Example: vftcli bench --rounds 3
    """
    from vftcli.cli.console import say_json
    from vftcli.outputs import grid
    from vftcli.outputs.listings import bench_grid
    from vftcli.reproduction.timing import benchmark

    result = benchmark(robot, samples, rounds)
    if json:
        say_json(result)
        return
    title = (
        f"{result['robot']}, {samples} samples, median of {rounds} rounds, "
        f"NumPy with {result['simd']}"
    )
    if latex:
        table = replace(bench_grid(result), title=f"Computing time: {title}")
        typer.echo(grid.latex(table), nl=False)
        return
    typer.echo(title)
    typer.echo(grid.terminal(bench_grid(result)))
