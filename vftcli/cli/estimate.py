"""`vftcli estimate`: a log becomes external torques."""

from typing import Annotated

import typer

from vftcli.cli import options as opt


def estimate(
    log: opt.Log,
    output: opt.Folder,
    robot: opt.RobotName = None,
    format_: opt.Format = None,
    columns: opt.Columns = None,
    interval: opt.Interval = None,
    observer: opt.Observers = None,
    assignments: opt.Assignments = None,
    friction: opt.Friction = "profile",
    payload: opt.PayloadName = None,
    as_printed: opt.AsPrinted = False,
    csv: Annotated[bool, typer.Option("--csv", help="Also write estimates.csv.")] = False,
    mcap: Annotated[bool, typer.Option("--mcap", help="Also write estimates.mcap.")] = False,
    rrd: Annotated[bool, typer.Option("--rrd", help="Also write recording.rrd.")] = False,
    wrench: opt.WrenchFlag = False,
    frame: opt.Frame = None,
    solver: opt.Solver = None,
    tool: opt.Tool = None,
    sensor_pose: opt.SensorPose = None,
    zero: opt.Zero = None,
    sensor_weight: opt.SensorWeight = False,
    torque_sd: opt.TorqueSd = None,
    match: opt.Match = None,
    free: opt.Free = None,
    period: opt.Period = None,
    free_cycles: opt.FreeCycles = None,
    gains_file: opt.GainsFile = None,
    free_part: opt.FreePart = None,
    bands: opt.Bands = False,
    remove_bias: opt.RemoveBias = "none",
    json: opt.Json = False,
    force: opt.Force = False,
) -> None:
    """Estimate the external joint torques along a log.

    Writes DIR/estimates.parquet (t, q/1…, tau_ext/OBSERVER/1…) and DIR/run.json.

    Example: vftcli estimate fixtures/ur5_circle.csv --robot ur5 -o out
    """
    from vftcli.cli.background import Background
    from vftcli.readers import read

    extras = [name for name, wanted in (("csv", csv), ("mcap", mcap), ("rrd", rrd)) if wanted]
    of_wrench = (wrench, frame, solver, tool, sensor_pose, zero, sensor_weight, torque_sd)
    signals = None if any(of_wrench) or extras else ("dq", "current", "torque")
    reading = Background(lambda: read(log, format=format_, columns=columns, signals=signals))

    from vftcli.cli.console import command_line, say, say_notes, say_recording
    from vftcli.observers import DEFAULT
    from vftcli.outputs.log.estimates import write_estimate_folder
    from vftcli.pipeline import AnalysisChoice, analyse, choose_robot, cut
    from vftcli.repetition.choice import FreeChoice
    from vftcli.virtual_sensor.choice import WrenchChoice

    free_choice = FreeChoice.parsed(
        free=free,
        free_part=free_part,
        period=period,
        free_cycles=free_cycles,
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
        match=match,
        free=free_choice,
        gains_file=gains_file,
        bands=bands,
        remove_bias=remove_bias,
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
    )
    recording = cut(reading.result(), request)
    analysis = analyse(recording, choose_robot(request, recording), request)
    record = write_estimate_folder(
        output, analysis, command=command_line(), extras=extras, force=force
    )
    if json:
        typer.echo(record)
        return
    say_recording(recording)
    say_notes(analysis)
    say(f"wrote {output}")
