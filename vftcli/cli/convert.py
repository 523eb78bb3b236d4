"""`vftcli convert` and `vftcli simulate`: a log as a file, or simulated."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.console import command_line, echo, say, say_json
from vftcli.readers.reader import ReadChoice
from vftcli.signals.option import Asked, Option, names_at


@opt.command(ReadChoice, opt.Talk)
def convert_log(
    log: opt.Log, output: opt.Folder, asked: Asked, json: opt.Json, force: opt.Force
) -> None:
    """Write any log as Parquet, CSV or MCAP.

    The ending of -o says which: x.parquet, x.csv, x.mcap.

    Example: vftcli convert fixtures/ur5_circle.csv -o ur5_circle.mcap
    """
    from vftcli.doctor import examine
    from vftcli.outputs.conversion import check_conversion, convert
    from vftcli.outputs.examination import health_line
    from vftcli.readers.reading import Library
    from vftcli.signals.errors import ParameterError

    check_conversion(output, force)
    choice = asked.of(ReadChoice)
    if choice.derive == "dq":
        raise ParameterError(
            "convert writes what was logged; --set log.derive=dq belongs to an estimate"
        )
    recording = Library().open(log, replace(choice, derive="none"))
    convert(recording, output, force=force)
    say(health_line(examine(recording)))
    if json:
        held = recording.source
        say_json(
            [recording],
            held.remarks,
            output=str(output),
            format=held.format,
            samples=recording.samples,
            signals=recording.signals,
            repairs=list(map(str, held.repairs)),
            warnings=list(map(str, held.warnings)),
        )
        return
    for repair in recording.source.repairs:
        say(f"repair: {repair}")
    for warning in recording.source.warnings:
        say(f"note: {warning}")
    say(f"wrote {output}: {recording.samples} samples of {', '.join(recording.signals)}")


@opt.command()
def simulate_log(
    *,
    scenario: Annotated[
        str,
        Option(
            "",
            "SCENARIO",
            "list, a scenario's name or a FILE.toml.",
            completes=names_at("simulation:SCENARIOS"),
        ),
    ],
    seed: Annotated[int | None, opt.SEED],
    log_format: Annotated[
        str,
        Option(
            "--as",
            "FORMAT",
            "Write rtde, ur-rtde, libfranka, rosbag2 or parquet.",
            completes=names_at("simulation.writers:WRITERS"),
        ),
    ] = "",
    changes: Annotated[list[str] | None, opt.SET._replace(group="")],
    output: Annotated[Path | None, opt.OUT],
    json: opt.Json,
    force: opt.Force,
) -> None:
    """Simulate an experiment, with its true forces.

    The true forces go beside the log, as PATH.truth.parquet. The settings are the scenario's keys,
    as duration=8. Without --as, PATH.parquet is a table, a UR writes rtde, a Franka arm libfranka.

    Example: vftcli simulate ur5-circle -o log.csv --seed 2
    """
    from vftcli.outputs.conversion import log_folder, save
    from vftcli.robots import load_robot
    from vftcli.signals.packages import check_installed
    from vftcli.simulation import SCENARIOS, load_scenario
    from vftcli.simulation.experiment import simulate_pair
    from vftcli.simulation.writers import usual_format

    if scenario == "list":
        titles = {name: load_scenario(name).title for name in SCENARIOS}
        if json:
            say_json([], scenarios=titles)
        else:
            width = max(map(len, titles))
            echo("\n".join(f"{name:<{width}} {title}" for name, title in titles.items()))
        return
    if output is None:
        raise typer.BadParameter("-o PATH says where the log goes")
    log_format = log_format or "parquet" * (output.suffix == ".parquet")
    check_installed("pinocchio", "vftcli simulate")
    setup = load_scenario(scenario, changes or ())
    paths = [output]
    if setup.pair:  # its free run: ``log.csv`` → ``log.free.csv``
        paths.append(output.with_name(f"{output.stem}.free{output.suffix}"))
    log_folder(paths, force)
    # Refused before the run.
    form = usual_format(setup, load_robot(setup.robot), log_format)
    runs = simulate_pair(setup, seed)
    places = dict(zip(paths, runs, strict=True))
    files = [str(f) for f in save(places, log_format, force, command_line())]
    if json:
        say_json(
            [],
            scenario=setup.name,
            seed=runs[0].seed,
            files=files,
            samples=len(runs[0].measured.rows),
            robot=setup.robot,
            format=form,
        )
        return
    for file in files:
        say(f"wrote {file}")
