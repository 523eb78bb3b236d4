"""`vftcli inspect`: the log doctor."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from vftcli.cli import options as opt
from vftcli.cli.bundles import taken_apart

if TYPE_CHECKING:
    from vftcli.doctor import Examination
    from vftcli.signals.recording import Recording


@taken_apart
def inspect_log(
    log: opt.Log,
    reading: opt.ReadOptions,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with 1 if there is any warning, for CI.")
    ] = False,
    json: opt.Json = False,
) -> None:
    """Examine a log: format, signals, clock, and what looks wrong, with its remedy.

    Example: vftcli inspect fixtures/ur5_circle.csv
    """
    import json as json_module

    from vftcli.doctor import examine
    from vftcli.readers import read_first_recording

    choice = reading.choice()
    recording = read_first_recording(log, format=choice.format, columns=choice.columns)
    examination = examine(choice.within(recording))
    if json:
        typer.echo(json_module.dumps(report_of(examination), indent=2))
    else:
        for line in lines_of(examination):
            typer.echo(line)
    warnings = len(examination.warnings)
    if strict and warnings:
        typer.echo(f"{warnings} warning{'s' if warnings > 1 else ''} (--strict)", err=True)
        raise typer.Exit(1)


def report_of(examination: "Examination") -> dict[str, Any]:
    """Everything the doctor knows, for machines."""
    from dataclasses import asdict

    from vftcli.doctor import finding_record, in_words

    recording = examination.recording
    source = recording.source
    return {
        "format": source.format,
        "joints": recording.joints,
        "samples": recording.samples,
        "duration_s": recording.duration,
        "rate_hz": rate_of(recording),
        "max_gap_s": largest_step(recording),
        "duplicates": source.duplicates,
        "rows": source.rows,
        "repairs": list(source.repairs),
        "warnings": [
            *source.warnings,
            *(str(in_words(finding)) for finding in examination.warnings),
        ],
        "signals": list(recording.signals),
        "clock": source.clock,
        "t0_s": source.t0,
        "joint_names": list(recording.joint_names),
        "robot": recording.robot_hint,
        "wrench_frame": None if recording.wrench_frame is None else str(recording.wrench_frame),
        "payload_kg": recording.payload_mass,
        "sha256": source.sha256,
        "robots": [asdict(fit) for fit in examination.robots],
        "findings": [finding_record(finding) for finding in examination.findings],
    }


def rate_of(recording: "Recording") -> float | None:
    """Samples a second, or None for a single sample. [Hz]"""
    return 1 / recording.median_step if recording.samples > 1 else None


def largest_step(recording: "Recording") -> float | None:
    """The longest time between two samples, or None for a single one. [s]"""
    import numpy as np

    return float(np.max(np.diff(recording.t))) if recording.samples > 1 else None


def lines_of(examination: "Examination") -> list[str]:
    """The report for people."""
    from vftcli.doctor import in_words

    recording = examination.recording
    source = recording.source
    rate, gap = rate_of(recording), largest_step(recording)
    lines = [
        f"{source.path}: {source.format}",
        f"  joints    {recording.joints}"
        + (f" ({', '.join(recording.joint_names)})" if recording.joint_names else ""),
        f"  samples   {recording.samples} of {source.rows} rows, {recording.duration:.3f} s"
        + (f", {rate:.4g} Hz, longest step {1e3 * gap:.4g} ms" if rate and gap else ""),
        f"  clock     {source.clock}; first stamp {source.t0:.6f} s",
        f"  signals   {', '.join(recording.signals)}",
    ]
    if recording.wrench_frame:
        lines.append(f"  wrench    {recording.wrench_frame}")
    if recording.payload_mass is not None:
        lines.append(f"  payload   {recording.payload_mass:.3g} kg, as the controller was told")
    lines.append(f"  robot     {recording.robot_hint or 'not settled by the log'}")
    lines += [
        f"  fit       {fit}{'' if fit.fits else ': does not fit'}" for fit in examination.robots
    ]
    lines += [f"  repair    {repair}" for repair in source.repairs]
    lines += [f"  suspect   {warning}" for warning in source.warnings]
    for finding in map(in_words, examination.findings):
        lines += [
            "",
            f"{finding.severity}: {finding.name}: {finding.evidence}.",
            f"  {finding.consequence}.",
            f"  {finding.remedy}.",
        ]
    if not examination.findings:
        lines += ["", "nothing suspicious found"]
    return [printable(line) for line in lines]


def printable(line: str) -> str:
    """A line without control characters that a log's names may carry."""
    return "".join(c if c.isprintable() else "?" for c in line)
