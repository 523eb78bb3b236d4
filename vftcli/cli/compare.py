"""`vftcli compare`: errors of the observers against a reference."""

from typing import Annotated

import typer

from vftcli.cli import options as opt


def compare(
    logs: opt.Logs,
    reference: opt.RequiredReference,
    robot: opt.RobotName = None,
    format_: opt.Format = None,
    columns: opt.Columns = None,
    interval: opt.Interval = None,
    observer: opt.Observers = None,
    assignments: opt.Assignments = None,
    friction: opt.Friction = "profile",
    payload: opt.PayloadName = None,
    as_printed: opt.AsPrinted = False,
    free: opt.Free = None,
    reference_columns: opt.ReferenceColumns = None,
    period: opt.Period = None,
    free_cycles: opt.FreeCycles = None,
    alignment: opt.Alignment = "auto",
    low_pass: opt.LowPass = "auto",
    match: opt.Match = None,
    wrench: opt.WrenchFlag = False,
    frame: opt.Frame = None,
    solver: opt.Solver = None,
    tool: opt.Tool = None,
    sensor_pose: opt.SensorPose = None,
    zero: opt.Zero = None,
    sensor_weight: opt.SensorWeight = False,
    torque_sd: opt.TorqueSd = None,
    contacts: opt.Contacts = False,
    gains_file: opt.GainsFile = None,
    free_part: opt.FreePart = None,
    bands: opt.Bands = False,
    remove_bias: opt.RemoveBias = "none",
    json: opt.Json = False,
    csv: Annotated[bool, typer.Option("--csv", help="One row per observer and joint.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="A Markdown table.")] = False,
    latex: Annotated[bool, typer.Option("--latex", help="A LaTeX table (booktabs).")] = False,
    significance: Annotated[
        bool,
        typer.Option("--significance", help="Every pair of observers: difference, interval, p."),
    ] = False,
) -> None:
    """Print the RMSE of every observer against a reference, with the reference's own floor.

    Example: vftcli compare fixtures/ur5_circle.csv --robot ur5 --reference zero --interval 0:4
    """
    import polars as pl

    from vftcli.cli.console import chosen, say_notes, say_recording
    from vftcli.evaluation.pooling import ScoredLog, pooled_rows
    from vftcli.observers import DEFAULT
    from vftcli.outputs.log import tables
    from vftcli.outputs.log.significance import pairs_text
    from vftcli.pipeline import AnalysisChoice, analyse, choose_robot, open_logs
    from vftcli.readers.library import Library
    from vftcli.repetition.choice import FreeChoice
    from vftcli.virtual_sensor.choice import WrenchChoice

    wanted = {"json": json, "csv": csv, "markdown": markdown, "latex": latex}
    show = {
        "terminal": tables.terminal,
        "json": tables.to_json,
        "csv": tables.to_csv,
        "markdown": tables.to_markdown,
        "latex": tables.to_latex,
    }[chosen(wanted, default="terminal")]
    free_choice = FreeChoice.parsed(
        free=free,
        free_part=free_part,
        period=period,
        free_cycles=free_cycles,
        alignment=alignment,
        low_pass=low_pass,
    )
    request = AnalysisChoice(
        format=format_,
        columns=columns,
        robot=robot,
        interval=interval,
        observers=tuple(observer or DEFAULT),
        settings=tuple(assignments or ()),
        friction=friction,
        payload=payload,
        as_printed=as_printed,
        contacts=contacts,
        wrench=WrenchChoice.parsed(
            wrench=wrench,
            frame=frame,
            solver=solver,
            tool=tool,
            sensor_pose=sensor_pose,
            zero=zero,
            sensor_weight=sensor_weight,
            torque_sd=torque_sd,
        ),
        reference=reference,
        free=free_choice,
        reference_columns=reference_columns,
        match=match,
        gains_file=gains_file,
        bands=bands,
        remove_bias=remove_bias,
        library=Library([*logs, *free_choice.logs]),
    )
    analyses = []
    for recording in open_logs(logs, request):
        analysis = analyse(recording, choose_robot(request, recording), request)
        if not json:
            say_recording(recording)
            say_notes(analysis)
        analyses.append(analysis)
    if significance:
        typer.echo(pairs_text(analyses, as_json=json))
        return
    errors = [a.errors for a in analyses if a.errors is not None]
    runs = [ScoredLog(a.estimates, a.reference) for a in analyses if a.reference is not None]
    typer.echo(show(pl.concat([*errors, *pooled_rows(runs)], how="diagonal")))
