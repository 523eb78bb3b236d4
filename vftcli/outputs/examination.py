"""What the log doctor found, for people and for machines."""

from dataclasses import asdict
from typing import Any

import numpy as np

from vftcli.doctor import Examination, finding_record, in_words
from vftcli.signals.recording import Recording


def examination_record(examination: Examination) -> dict[str, Any]:
    """Everything the doctor knows, for machines."""
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


def rate_of(recording: Recording) -> float | None:
    """Samples a second, or None for a single sample. [Hz]"""
    return 1 / recording.median_step if recording.samples > 1 else None


def largest_step(recording: Recording) -> float | None:
    """The longest time between two samples, or None for a single one. [s]"""
    return float(np.max(np.diff(recording.t))) if recording.samples > 1 else None


def examination_text(examination: Examination) -> str:
    """The report for people."""
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
    return "\n".join(printable(line) for line in lines)


def printable(line: str) -> str:
    """A line without control characters that a log's names may carry."""
    return "".join(c if c.isprintable() else "?" for c in line)
