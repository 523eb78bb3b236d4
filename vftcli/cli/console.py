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
    from vftcli.doctor import Examination, Examiner
    from vftcli.readers.library import Library
    from vftcli.robots.robot import Robot
    from vftcli.signals.recording import Recording
    from vftcli.virtual_sensor.sensor_reading import SensorReading


PARTS = frozenset({"episode-taken", "episode-taken-first", "arm-side-taken"})
"""Remarks that a part of a file was taken which nobody asked for."""


def command_line() -> str:
    """The command as the user typed it, for `run.json` and the report."""
    return printable(shlex.join(["vftcli", *sys.argv[1:]]))


def say(text: str) -> None:
    """Print words to stderr; tables go to stdout."""
    typer.echo(printable_lines(text), err=True)


def say_json(value: object) -> None:
    """Print what a command makes to stdout, for machines; what is no finite number is null."""
    from vftcli.outputs.log.run_record import jsonable

    typer.echo(json.dumps(jsonable(value), indent=2, ensure_ascii=False, allow_nan=False))


def say_recording(recording: "Recording") -> None:
    """One line on what was read, then what was repaired or looks odd."""
    source = recording.source
    rate = f", {1.0 / recording.median_step:.4g} Hz" if recording.samples > 1 else ""
    say(
        f"{recording.name}: {source.format}, {recording.joints} joints, "
        f"{recording.samples} samples, {recording.duration:.1f} s{rate}"
    )
    # That a part was taken is said with the health of the log.
    others = [remark for remark in source.remarks if remark.code not in PARTS]
    for remark in sorted(others, key=lambda remark: remark.level != "fact"):
        say(f"  note: {remark}")


def health_of(library: "Library", *, anyway: bool, fitting: bool = True) -> "Examiner":
    """Who examines a command's logs, and says one line on the health of each as soon as it is told.

    Args:
        library: Where the logs are read; of several each is told by its name.
        anyway: Whether results are wanted even where a finding makes them meaningless.
        fitting: Whether the robot must be the log's.
    """
    from vftcli.doctor.examiner import Examiner
    from vftcli.outputs.examination import health_line

    def tell(examination: "Examination") -> None:
        recording = examination.recording
        for remark in recording.source.remarks:
            if remark.code in PARTS:
                say(f"note: {recording.name}: {remark}")
        if codes := dict.fromkeys(f.code for f in examination.refusals(fitting=fitting)):
            say(f"MEANINGLESS unless this is wrong, and made with --anyway: {', '.join(codes)}")
        named = len(library) > 1 or bool(recording.source.part)
        say(health_line(examination, named=named))
        for assumption in examination.assumptions:
            say(f"note: {recording.name}: {assumption}")

    return Examiner(anyway=anyway, fitting=fitting, tell=tell)


def say_robots(robots: "Iterable[Robot]") -> None:
    """What a user of the robots' numbers should know."""
    for remark in dict.fromkeys(str(remark) for robot in robots for remark in robot.remarks):
        say(f"note: {remark}")


def say_analysis(analysis: "Analysis") -> None:
    """What was read, and what the reader of the numbers should know."""
    say_recording(analysis.recording)
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

    say(f"note: wrench: force on the robot, {FRAMES[sensed.sensor.frame]}; {sensed.solver}")
    if sensed.drifts:
        say(terminal(drift_grid(sensed.drifts)).rstrip())
    for remark in sensed.remarks:
        say(f"{'warning' if remark.level == 'warning' else 'note'}: {remark}")
