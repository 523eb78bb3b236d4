"""`vftcli convert`: any readable log as a table or an MCAP."""

from dataclasses import replace

from vftcli.cli import options as opt
from vftcli.readers.reader import ReadChoice


@opt.command
def convert_log(
    log: opt.Log,
    output: opt.Folder,
    reading: opt.Typed[ReadChoice],
    _talk: opt.TalkOptions,
    json: opt.Json,
    force: opt.Force,
) -> None:
    """Write any log as Parquet, CSV or MCAP.

    The ending of -o says which: x.parquet, x.csv, x.mcap.

    Example: vftcli convert fixtures/ur5_circle.csv -o ur5_circle.mcap
    """
    from vftcli.cli.console import say, say_json, say_left_out
    from vftcli.doctor import examine
    from vftcli.outputs.examination import health_line
    from vftcli.outputs.log.conversion import check_conversion, convert
    from vftcli.readers.library import Library
    from vftcli.signals.errors import ParameterError

    check_conversion(output, force)
    choice = reading.choice()
    if choice.derive == "dq":
        raise ParameterError(
            "convert writes what was logged; --set log.derive=dq belongs to an estimate"
        )
    recording = Library().open(log, replace(choice, derive="none"))
    convert(recording, output, force=force)
    # A table may be made of any log, also of one that no estimate should be made of.
    say(health_line(examine(recording)))
    say_left_out([output])
    if json:
        summary = {
            "output": str(output),
            "format": recording.source.format,
            "samples": recording.samples,
            "signals": recording.signals,
            "repairs": [str(repair) for repair in recording.source.repairs],
            "warnings": [str(warning) for warning in recording.source.warnings],
        }
        say_json(summary)
        return
    for repair in recording.source.repairs:
        say(f"repair: {repair}")
    for warning in recording.source.warnings:
        say(f"note: {warning}")
    say(f"wrote {recording.samples} samples of {', '.join(recording.signals)}")
