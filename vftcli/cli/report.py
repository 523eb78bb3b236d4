"""`vftcli report`: everything about a log in one folder."""

from dataclasses import replace

import typer

from vftcli.cli import options as opt


def report(
    logs: opt.Logs,
    output: opt.Folder,
    reference: opt.Reference = None,
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
    published: opt.PublishedTable = None,
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
    force: opt.Force = False,
) -> None:
    """Write a report page, a Rerun recording, tables and estimates of a log into one folder.

    Writes index.html (opens offline), recording.rrd, estimates.parquet, errors.{csv,json,md,tex}
    and run.json; several logs get a sub-folder each and an index.

    Example: vftcli report fixtures/ur5_circle.csv --robot ur5 -o out
    """
    from vftcli.cli.console import command_line, say, say_notes, say_recording
    from vftcli.evaluation.print_table import check_published, compare_with
    from vftcli.observers import DEFAULT
    from vftcli.outputs.log.published import terminal_published
    from vftcli.outputs.log.report import write_report, write_reports
    from vftcli.outputs.log.tables import terminal
    from vftcli.pipeline import AnalysisChoice, analyse, choose_robot, open_logs
    from vftcli.readers.library import Library
    from vftcli.repetition.choice import FreeChoice
    from vftcli.virtual_sensor.choice import WrenchChoice

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
    if published is not None:
        check_published(published, reference)
    analyses = []
    for recording in open_logs(logs, request):
        analysis = analyse(recording, choose_robot(request, recording), request)
        if published is not None and analysis.errors is not None:
            found = compare_with(published, analysis.errors, analysis.observers, analysis.tunings)
            analysis = replace(analysis, published=found)
        analyses.append(analysis)
        if not json:
            say_recording(recording)
            say_notes(analysis)
    command = command_line()
    if len(analyses) == 1:
        record = write_report(output, analyses[0], command=command, force=force)
    else:
        record = write_reports(output, analyses, command=command, force=force)
    if json:
        typer.echo(record)
        return
    for analysis in analyses:
        if analysis.errors is not None:
            typer.echo(terminal(analysis.errors))
        if analysis.published is not None:
            typer.echo(terminal_published(analysis.published))
    say(f"wrote {output}: open {output / 'index.html'}; rerun {output / 'recording.rrd'}")
