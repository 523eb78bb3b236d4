"""`vftcli convert`: any readable log as a table or an MCAP."""

from pathlib import Path
from typing import Annotated

import typer

from vftcli.cli import options as opt


def convert_log(
    log: opt.Log,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FILE", help="x.parquet, x.mcap or x.csv."),
    ],
    format_: opt.Format = None,
    columns: opt.Columns = None,
    interval: opt.Interval = None,
    force: opt.Force = False,
    json: opt.Json = False,
) -> None:
    """Convert any readable log into a flat Parquet or CSV table, or a ros2-profile MCAP.

    Example: vftcli convert fixtures/ur5_circle.csv -o ur5_circle.mcap
    """
    from vftcli.outputs.log.conversion import convert as write
    from vftcli.pipeline import AnalysisChoice, open_log

    recording = open_log(log, AnalysisChoice(format=format_, columns=columns, interval=interval))
    write(recording, output, force=force)
    if json:
        import json as json_module

        told = {
            "output": str(output),
            "format": recording.source.format,
            "samples": recording.samples,
            "signals": recording.signals,
            "repairs": recording.source.repairs,
        }
        typer.echo(json_module.dumps(told))
        return
    for repair in recording.source.repairs:
        typer.echo(f"repair: {repair}", err=True)
    typer.echo(f"wrote {recording.samples} samples of {', '.join(recording.signals)}", err=True)
