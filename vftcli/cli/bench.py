"""`vftcli bench`: Table II on this machine."""

from dataclasses import dataclass, replace
from typing import Annotated

from vftcli.cli import options as opt
from vftcli.cli.progress import echo
from vftcli.robots.choice import RobotChoice
from vftcli.signals.option import Choice, setting


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
    from vftcli.cli.console import say_json
    from vftcli.outputs import grid
    from vftcli.outputs.listings import bench_grid
    from vftcli.reproduction.timing import benchmark

    asked = length.choice()
    result = benchmark(robot, asked.samples, asked.rounds)
    if json:
        say_json(result)
        return
    title = (
        f"{result['robot']}, {asked.samples} samples, median of {asked.rounds} rounds, "
        f"NumPy with {result['simd']}"
    )
    if latex:
        table = replace(bench_grid(result), title=f"Computing time: {title}")
        echo(grid.latex(table), nl=False)
        return
    echo(title)
    echo(grid.terminal(bench_grid(result)))
