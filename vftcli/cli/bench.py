"""`vftcli bench`: Table II on this machine."""

from dataclasses import replace

import typer

from vftcli.cli import options as opt
from vftcli.cli.bundles import Bundle, flag, option, taken_apart
from vftcli.cli.log_options import ROBOT


class BenchOptions(Bundle):
    """What is measured, and how often."""

    robot: str = option(*ROBOT, "ur5")
    samples: int = option("--samples", "N", "Length of the log.", 30_060, min=100)
    rounds: int = option("--rounds", "N", "Interleaved repetitions.", 7, min=1)
    latex: bool = flag("--latex", "Print a LaTeX table (booktabs).")


@taken_apart
def bench(measured: BenchOptions, json: opt.Json = False) -> None:
    """Time the observers.

    Example: vftcli bench --rounds 3
    """
    from vftcli.cli.console import say_json
    from vftcli.outputs.grid import latex, terminal
    from vftcli.outputs.listings import bench_grid
    from vftcli.reproduction.timing import benchmark

    result = benchmark(measured.robot, measured.samples, measured.rounds)
    if json:
        say_json(result)
        return
    title = (
        f"{result['robot']}, {measured.samples} samples, median of {measured.rounds} rounds, "
        f"NumPy with {result['simd']}"
    )
    if measured.latex:
        grid = replace(bench_grid(result), title=f"Computing time: {title}")
        typer.echo(latex(grid), nl=False)
        return
    typer.echo(title)
    typer.echo(terminal(bench_grid(result)))
