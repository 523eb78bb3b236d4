"""`vftcli identify`: logs become a robot."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.cli import options as opt

if TYPE_CHECKING:
    from vftcli.identification import Identification


def identify_robot(
    logs: opt.Logs,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE.toml", help="The new robot file.")
    ],
    robot: opt.RobotName = None,
    method: Annotated[
        str | None,
        typer.Option(
            metavar="METHOD",
            help="friction, base, consistent or targets. Default: friction; none with "
            "--find-payload.",
        ),
    ] = None,
    validate: Annotated[
        list[Path] | None,
        typer.Option(metavar="LOG", help="Score on this log too. Repeatable."),
    ] = None,
    find_payload: Annotated[
        bool,
        typer.Option(
            "--find-payload",
            help="Find a load on the flange: from two LOGs of one motion, from --free, or poses.",
        ),
    ] = False,
    free: Annotated[
        Path | None, typer.Option(metavar="LOG", help="The same motion without the load.")
    ] = None,
    fit_constants: Annotated[
        bool, typer.Option("--fit-constants", help="Friction method: drive constants K too.")
    ] = False,
    cutoff: Annotated[
        float, typer.Option(metavar="HZ", help="Cutoff of the zero-phase filter.")
    ] = 8.0,
    format_: opt.Format = None,
    columns: opt.Columns = None,
    interval: opt.Interval = None,
    validate_interval: Annotated[
        str | None, typer.Option(metavar="A:B", help="Use only this span of the --validate logs.")
    ] = None,
    payload: opt.PayloadName = None,
    json: opt.Json = False,
    force: opt.Force = False,
) -> None:
    """Make a robot file from logs: friction, rotor inertia, link inertias, payload.

    Writes FILE.toml for --robot, and FILE.html, FILE.rrd and FILE.run.json beside it.

    Example: vftcli identify free.csv --robot ur5 --method friction -o my_robot.toml
    """
    from vftcli.cli.console import command_line, paths, say, say_recording
    from vftcli.identification import Processing, Task, identify
    from vftcli.outputs.files import refuse_existing
    from vftcli.outputs.identification.files import beside, write_identification
    from vftcli.pipeline import AnalysisChoice, choose_robot, open_log
    from vftcli.readers.library import Library

    task = Task(
        method=method or (None if find_payload else "friction"),
        name=output.stem,
        find_payload=find_payload,
        fit_constants=fit_constants,
        processing=Processing(cutoff=cutoff),
    )
    for file in beside(output).values():
        refuse_existing(file, force)
    without_load = [free] if free is not None else []
    request = AnalysisChoice(
        format=format_,
        columns=columns,
        robot=robot,
        interval=interval,
        payload=payload,
        library=Library([*logs, *paths(validate), *without_load]),
    )
    train = [open_log(log, request) for log in logs]
    whole = replace(request, interval=validate_interval)
    held_out = [open_log(log, whole) for log in paths(validate)]
    unloaded = [open_log(log, request) for log in without_load]
    read = [*train, *held_out, *unloaded]
    for recording in read:
        say_recording(recording)
    profile = choose_robot(request, train[0])
    found = identify(train, profile, task, held_out, unloaded[0] if unloaded else None)
    record = write_identification(output, found, read, command_line(), force)
    for note in found.notes:
        say(f"note: {note}")
    say(f"wrote {', '.join(str(file) for file in beside(output).values())}")
    typer.echo(record.rstrip("\n") if json else tables(found))


def tables(found: "Identification") -> str:
    """Residuals and identified numbers as text."""
    lines = []
    joints = range(1, found.robot.joints + 1)
    if not found.residuals.is_empty():
        head = "".join(f"{f'J{j}':>8}" for j in joints)
        lines.append(f"{'residual rms [N·m]':<44}{head}{'mean':>8}")
        for (log, role, model), part in found.residuals.group_by(
            ["log", "role", "model"], maintain_order=True
        ):
            values = part["rms_Nm"].to_list()
            numbers = "".join(f"{v:>8.3f}" for v in (*values, sum(values) / len(values)))
            lines.append(f"{f'{log}, {role}, {model}':<44}{numbers}")
        lines.append("")
    if not found.parameters.is_empty():
        lines.append(f"{'number':<20}{'joint':>6}{'value':>12}{'sd':>10}{'profile':>12}  unit")
        for row in found.parameters.iter_rows(named=True):
            doubt = "" if row["determined"] else "  (not determined)"
            lines.append(
                f"{row['parameter']:<20}{row['joint']:>6}{row['value']:>12.5g}{row['sd']:>10.2g}"
                f"{row['profile']:>12.5g}  {row['unit']}{doubt}"
            )
    return "\n".join(lines)
