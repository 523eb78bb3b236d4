"""From a command's options to an AnalysisChoice, and the words every command prints alike."""

import json
import shlex
import sys
from typing import TYPE_CHECKING

import typer

from vftcli.signals.letters import printable, printable_lines

if TYPE_CHECKING:
    from collections.abc import Iterable

    from vftcli.analysis import Analysis
    from vftcli.doctor import Examination
    from vftcli.signals.recording import Recording
    from vftcli.virtual_sensor.sensor_reading import SensorReading


def command_line() -> str:
    """The command as the user typed it, for `run.json` and the report."""
    return printable(shlex.join(["vftcli", *sys.argv[1:]]))


def say(text: str) -> None:
    """Print words to stderr; tables go to stdout."""
    typer.echo(printable_lines(text), err=True)


def say_json(value: object) -> None:
    """Print what a command makes to stdout, for machines."""
    typer.echo(json.dumps(value, indent=2, ensure_ascii=False))


def say_recording(recording: "Recording") -> None:
    """One line on what was read, then what was repaired or looks odd."""
    source = recording.source
    rate = f", {1.0 / recording.median_step:.4g} Hz" if recording.samples > 1 else ""
    say(
        f"{recording.name}: {source.format}, {recording.joints} joints, "
        f"{recording.samples} samples, {recording.duration:.1f} s{rate}"
    )
    for remark in (*source.repairs, *source.warnings):
        say(f"  note: {remark}")


def say_health(examinations: "Iterable[Examination]", *, named: bool = False) -> None:
    """One line a log on what is wrong with it, and what is meaningless though it was wanted.

    Args:
        examinations: The log's, then those of its free runs, which are told by their names.
        named: Whether the log is told by its name too, for a command that has several.
    """
    from vftcli.outputs.examination import health_line

    made = list(examinations)
    codes = dict.fromkeys(finding.code for one in made for finding in one.refusals())
    if codes:
        say(f"MEANINGLESS unless this is wrong, and made with --anyway: {', '.join(codes)}")
    for k, examination in enumerate(made):
        say(health_line(examination, named=named or k > 0))


def say_analysis(analysis: "Analysis", *, named: bool = False, briefly: bool = False) -> None:
    """What was read, what is wrong with it, and what the reader of the numbers should know.

    Args:
        analysis: The log's.
        named: Whether the command has several logs.
        briefly: Whether only what is wrong is told, beside JSON that says the rest.
    """
    if briefly:
        say_health(analysis.examinations, named=named)
        return
    say_recording(analysis.recording)
    say_health(analysis.examinations, named=named)
    reference = analysis.reference.remarks if analysis.reference is not None else ()
    own = [f"{e.name}: {note}" for e in analysis.estimates for note in e.remarks]
    for note in (*analysis.robot.remarks, *analysis.remarks, *own, *reference):
        say(f"note: {note}")
    if analysis.virtual_sensor is not None:
        say_wrenches(analysis.virtual_sensor)


def say_wrenches(sensed: "SensorReading") -> None:
    """Frame, zero drift and remarks of the virtual sensor."""
    from vftcli.outputs.grid import terminal
    from vftcli.outputs.log.wrench_tables import drift_grid
    from vftcli.virtual_sensor.frames import FRAMES

    say(f"note: wrench: force on the robot, {FRAMES[sensed.sensor.frame]}; {sensed.sensor.solver}")
    if sensed.drifts:
        say(terminal(drift_grid(sensed.drifts)).rstrip())
    for remark in sensed.remarks:
        say(f"{'warning' if remark.level == 'warning' else 'note'}: {remark}")
