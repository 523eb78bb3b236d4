"""`vftcli bench`: Table II on this machine."""

from typing import Annotated

import typer

from vftcli.cli import options as opt


def bench(
    robot: Annotated[
        str, typer.Option(opt.ROBOT[0], metavar=opt.ROBOT[1], help=opt.ROBOT[2])
    ] = "ur5",
    samples: Annotated[int, typer.Option(min=100, help="Length of the log.")] = 30_060,
    rounds: Annotated[int, typer.Option(min=1, help="Interleaved repetitions.")] = 7,
    memory: Annotated[
        bool, typer.Option("--memory", help="Measure memory too, on a million samples of a Panda.")
    ] = False,
    json: opt.Json = False,
) -> None:
    """Time the observers and print the ratios to a bare RNEA loop and to per-sample scripts.

    Example: vftcli bench --rounds 3
    """
    import json as json_module

    from vftcli.benchmark import benchmark, memory_per_sample

    result = benchmark(robot, samples, rounds)
    if memory:
        result["memory_bytes_per_sample"] = memory_per_sample()
    if json:
        typer.echo(json_module.dumps(result, indent=2))
        return
    typer.echo(f"{result['robot']}, {samples} samples, median of {rounds} rounds")
    typer.echo(f"{'':<10} {'total':>10} {'per sample':>12} {'paper, its laptop':>18}")
    back = [{"paper_s": None, **row} for row in result["complete_log"]]
    rows = [
        {"name": "dynamics", "paper_s": None, **result["dynamics"]},
        *result["observers"],
        *back,
    ]
    for row in rows:
        paper = f"{row['paper_s']:.3f} s" if row["paper_s"] else ""
        typer.echo(
            f"{row['name']:<10} {row['total_s'] * 1e3:7.2f} ms {row['per_sample_us']:9.3f} µs "
            f"{paper:>18}"
        )
    ratios = result["ratios"]
    typer.echo("")
    typer.echo(
        f"all observers with dynamics / one bare pin.rnea loop: {ratios['core_over_rnea_loop']:.2f}"
    )
    typer.echo(f"per-sample Pinocchio script / this: {ratios['analytic_script_over_core']:.0f}")
    typer.echo(f"the paper's literal method / this: {ratios['literal_script_over_core']:.0f}")
    typer.echo(
        "all of these with dynamics, smoother and tuning included / the four causal ones: "
        f"{ratios['complete_over_core']:.2f}"
    )
    if memory:
        typer.echo(
            f"memory beyond the log's own, 1 000 000 samples of a Panda: "
            f"{result['memory_bytes_per_sample']:.0f} B per sample"
        )
