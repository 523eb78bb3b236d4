"""`vftcli bench`: Table II on this machine."""

import typer

from vftcli.cli import options as opt
from vftcli.cli.bundles import Bundle, flag, option, taken_apart


class BenchOptions(Bundle):
    """What is measured, and how often."""

    robot: str = option(*opt.ROBOT, "ur5")
    samples: int = option("--samples", "N", "Length of the log.", 30_060, min=100)
    rounds: int = option("--rounds", "N", "Interleaved repetitions.", 7, min=1)
    memory: bool = flag("--memory", "Measure memory too, on a million samples of a Panda.")


@taken_apart
def bench(measured: BenchOptions, json: opt.Json = False) -> None:
    """Time the observers and print the ratios to a bare RNEA loop and to per-sample scripts.

    Example: vftcli bench --rounds 3
    """
    from vftcli.benchmark import benchmark, memory_per_sample
    from vftcli.cli.console import say_json
    from vftcli.outputs.grid import terminal
    from vftcli.outputs.listings import bench_grid

    result = benchmark(measured.robot, measured.samples, measured.rounds)
    if measured.memory:
        result["memory_bytes_per_sample"] = memory_per_sample()
    if json:
        say_json(result)
        return
    typer.echo(f"{result['robot']}, {measured.samples} samples, median of {measured.rounds} rounds")
    typer.echo(terminal(bench_grid(result)))
    ratios = result["ratios"]
    typer.echo(
        f"all observers with dynamics / one bare pin.rnea loop: {ratios['core_over_rnea_loop']:.2f}"
    )
    typer.echo(f"per-sample Pinocchio script / this: {ratios['analytic_script_over_core']:.0f}")
    typer.echo(f"the paper's literal method / this: {ratios['literal_script_over_core']:.0f}")
    typer.echo(
        "all of these with dynamics, smoother and tuning included / the four causal ones: "
        f"{ratios['complete_over_core']:.2f}"
    )
    if measured.memory:
        typer.echo(
            f"memory beyond the log's own, 1 000 000 samples of a Panda: "
            f"{result['memory_bytes_per_sample']:.0f} B per sample"
        )
