"""`vftcli bench`: Table II on this machine."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import typer

from vftcli.cli import options as opt
from vftcli.cli.bundles import Bundle, flag, option, taken_apart
from vftcli.cli.log_options import ROBOT


class BenchOptions(Bundle):
    """What is measured, and how often."""

    robot: str = option(*ROBOT, "ur5")
    samples: int = option("--samples", "N", "Length of the log.", 30_060, min=100)
    rounds: int = option("--rounds", "N", "Interleaved repetitions.", 7, min=1)
    examination: bool = flag(
        "--examination", "Measure the examination too, and estimate on a log of 118 MB."
    )
    latex: bool = flag("--latex", "Print a LaTeX table (booktabs).")
    memory: bool = flag("--memory", "Measure memory too, on a million samples of a Panda.")


@taken_apart
def bench(measured: BenchOptions, json: opt.Json = False) -> None:
    """Time the observers, and scripts that do the same.

    Example: vftcli bench --rounds 3
    """
    from vftcli.cli.console import say_json
    from vftcli.outputs.grid import latex, terminal
    from vftcli.outputs.listings import bench_grid
    from vftcli.reproduction.benchmark import benchmark, memory_per_sample
    from vftcli.signals.packages import check_installed

    check_installed("pinocchio", "vftcli bench")
    result = benchmark(measured.robot, measured.samples, measured.rounds)
    if measured.examination:
        result["examination"] = examined(measured)
        result["ratios"]["examination_over_estimate"] = result["examination"]["over_estimate"]
        result["ratios"]["estimate_over_reading"] = result["examination"]["over_reading"]
    if measured.memory:
        result["memory_bytes_per_sample"] = memory_per_sample()
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
    ratios = result["ratios"]
    typer.echo(
        f"all observers with dynamics / one bare pin.rnea loop: "
        f"{ratios['core_over_rnea_loop']:.2f}; on a clock that jitters "
        f"{ratios['core_over_rnea_loop_jittering']:.2f}; when first called "
        f"{ratios['core_over_rnea_loop_cold']:.2f}"
    )
    typer.echo(f"per-sample Pinocchio script / this: {ratios['analytic_script_over_core']:.0f}")
    typer.echo(f"the paper's literal method / this: {ratios['literal_script_over_core']:.0f}")
    typer.echo(
        "all of these with dynamics, smoother and tuning included / the four causal ones: "
        f"{ratios['complete_over_core']:.2f}"
    )
    typer.echo(
        "best, gains and correction given / the four causal ones, dynamics in neither: "
        f"{ratios['best_over_observers']:.2f}"
    )
    if measured.examination:
        cost = result["examination"]
        typer.echo(
            f"examination of 60 s at 100 Hz: {1e3 * cost['examination_minute_s']:.0f} ms; of "
            f"{measured.samples} samples in 200 columns {1e3 * cost['examination_s']:.0f} ms and "
            f"{1e3 * cost['columns_s']:.0f} ms for its columns, "
            f"{100 * cost['over_estimate']:.0f} % of the {cost['estimate_s']:.2f} s of an estimate"
        )
        typer.echo(
            f"vftcli estimate --causal of these: {cost['command_s']:.2f} s; a process that imports "
            f"polars and reads the same columns {cost['reading_s']:.2f} s: "
            f"{cost['over_reading']:.2f}"
        )
    if measured.memory:
        typer.echo(
            f"memory beyond the log's own, 1 000 000 samples of a Panda: "
            f"{result['memory_bytes_per_sample']:.0f} B per sample"
        )


def examined(measured: BenchOptions) -> dict[str, float]:
    """What the examination and a whole command cost, of a long log that is removed again."""
    import polars as pl

    from vftcli.reproduction.benchmark import command_costs, examination_costs, wide_table
    from vftcli.robots import load_robot

    with TemporaryDirectory() as folder:
        log = Path(folder) / "long.csv"
        pl.DataFrame(wide_table(load_robot(measured.robot), measured.samples)).write_csv(log)
        examination = examination_costs(measured.robot, log, measured.rounds)
        return {**examination, **command_costs(measured.robot, log, measured.rounds)}
