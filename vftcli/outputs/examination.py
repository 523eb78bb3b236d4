"""Findings of the log doctor, for people and for machines."""

import shlex
from collections.abc import Iterable, Sequence

import numpy as np

from vftcli.doctor import Examination, finding_record, in_words
from vftcli.doctor.examination import doubt
from vftcli.outputs import Record
from vftcli.signals.parsing import counted, printable
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark

MOST_FITS = 3  #: Most profiles shown, the nearest, if they do not fit.


def examination_record(examination: Examination) -> Record:
    """All of the doctor's facts for machines, and the reader's."""
    recording, source = examination.recording, examination.recording.source
    read = [remark for remark in source.remarks if remark.level == "warning"]
    return {
        **recording_record(recording),
        "duration_s": recording.duration,
        "max_gap_s": largest_step(recording),
        "repairs": source.repairs,
        "warnings": [*source.warnings, *map(str, map(in_words, examination.warnings))],
        "joint_names": recording.joint_names,
        "robot": recording.robot_hint,
        "wrench_frame": recording.wrench_frame and str(recording.wrench_frame),
        "payload_kg": recording.payload_mass,
        "robots": [fit._asdict() for fit in examination.robots],
        "findings": [finding_record(finding) for finding in (*read, *examination.findings)],
    }


def recording_record(recording: Recording) -> Record:
    """A log's format, digest, clock, samples and signals."""
    source = recording.source
    return {
        "format": source.format,
        "sha256": source.sha256 or None,
        "clock": source.clock,
        "t0_s": source.t0,
        "rows": source.rows,
        "duplicates": source.duplicates,
        **({"derived": source.derived} if source.derived else {}),
        "samples": recording.samples,
        "joints": recording.joints,
        "rate_hz": rate_of(recording),
        "signals": recording.signals,
    }


def rate_of(recording: Recording) -> float | None:
    """Samples a second, or None for a single sample. [Hz]"""
    return 1 / recording.median_step if recording.samples > 1 else None


def largest_step(recording: Recording) -> float | None:
    """The longest step, or None for a single sample. [s]"""
    return float(np.max(np.diff(recording.t))) if recording.samples > 1 else None


def holdings(recording: Recording) -> list[str]:
    """Lines on a log's joints, samples, clock and signals."""
    source = recording.source
    rate, gap = rate_of(recording), largest_step(recording)
    names = f" ({', '.join(recording.joint_names)})" if recording.joint_names else ""
    pace = f", {rate:.4g} Hz, longest step {1e3 * gap:.4g} ms" if rate and gap else ""
    lines = [
        f"{source.path}: {source.format}",
        f"  joints    {recording.joints}{names}",
        f"  samples   {recording.samples} of {source.rows} rows, {recording.duration:.3f} s{pace}",
        f"  clock     {source.clock}; first stamp {source.t0:.6f} s",
        f"  signals   {', '.join(recording.signals)}",
    ]
    if recording.wrench_frame:
        lines.append(f"  wrench    {recording.wrench_frame}")
    if recording.payload_mass is not None:
        lines.append(f"  payload   {recording.payload_mass:.3g} kg, as the controller assumes")
    return list(map(printable, lines))


def examination_text(examination: Examination) -> str:
    """The report for people."""
    recording, source = examination.recording, examination.recording.source
    lines = holdings(recording)
    lines.append(f"  robot     {recording.robot_hint or 'not named in the log'}")
    # With a misread effort the misfits of arms mean nothing.
    misread = examination.refusals(fitting=False)
    lines += [
        f"  fit       {'--robot ' if fit.fits else ''}{fit}{'' if fit.fits else ': does not fit'}"
        for k, fit in enumerate(examination.robots)
        if fit.fits or (k < MOST_FITS and not misread)
    ]
    lines += [f"  repair    {repair}" for repair in source.repairs]
    lines += [f"  suspect   {warning}" for warning in source.warnings]
    for finding in map(in_words, examination.findings):
        lines += ["", f"{finding.severity}: {finding.name}: {finding.evidence}."]
        lines += [f"  {finding.consequence}.", f"  {finding.remedy}."]
    if len(examination.findings) == len(examination.assumptions):
        lines += ["", "nothing suspicious found"]
    return "\n".join(map(printable, lines))


def warnings_of(examination: Examination) -> tuple[Remark, ...]:
    """Warnings about a log, its reader's first."""
    read = (r for r in examination.recording.source.remarks if r.level == "warning")
    return (*read, *examination.warnings)


def examinations_text(examinations: Sequence[Examination], most: float) -> str:
    """Texts of logs; a line each if they have over `most` lines."""
    text = "\n\n".join(map(examination_text, examinations))
    if len(examinations) == 1 or text.count("\n") < most:
        return text
    lines = (health_line(each, named=True) for each in examinations)
    return "\n".join((*lines, "Each log by itself: --details"))


def health_line(examination: Examination, *, named: bool = False) -> str:
    """Faults of a log on one line: number, first, names of others."""
    recording, found = examination.recording, warnings_of(examination)
    head = f"{recording.name}: log health" if named else "log health"
    if not found:
        return f"{head}: sound"
    first, *others = found
    names = list(dict.fromkeys(in_words(other).name for other in others))
    more = f"; also {', '.join(names)}" if names else ""
    text = f"{head}: {counted(len(found), 'warning')}: {in_words(first).name}: {first}{more}"
    return printable(f"{text}; {command('inspect', recording)} says more")


def command(name: str, log: Recording | None, *words: str) -> str:
    """A command on a log as typed; None: on a free log to record."""
    if log is None:
        return shlex.join(["vftcli", name, "free.csv", *words])
    columns = [f"--columns={log.source.columns}"] if log.source.columns else []
    return shlex.join(["vftcli", name, path_of(log), *columns, *words])


def path_of(log: Recording) -> str:
    """A log's path as given, or a stand-in."""
    return str(log.source.path or "LOG")


def health_record(examinations: Iterable[Examination], *, fitting: bool = True) -> list[Record]:
    """Findings of a run's logs for `run.json`: the log's first, then others'.

    `overridden` are codes of findings that make results meaningless; `fitting` is whether
    the robot had to be the log's.
    """
    return [
        {
            "log": one.recording.name,
            "sound": not warnings_of(one),
            "overridden": [finding.code for finding in one.refusals(fitting=fitting)],
            "read": one.recording.source.remarks,
            "findings": list(map(finding_record, one.findings)),
        }
        for one in examinations
    ]


def refused_codes(examinations: Iterable[Examination]) -> list[str]:
    """Codes of refused findings, each once."""
    codes = (finding.code for one in examinations for finding in one.refusals())
    return list(dict.fromkeys(codes))


def overridden_lines(examinations: Sequence[Examination], *, fitting: bool = True) -> list[str]:
    """Warnings above outputs that findings make meaningless."""
    return [
        doubt(f"{one.recording.name}: {words}")
        for one in examinations
        for words in map(in_words, one.refusals(fitting=fitting))
    ]
