"""Findings about the clock: rate, jitter, gaps, repeated stamps, stale rows."""

from collections.abc import Iterator

import numpy as np

from vftcli.doctor.findings import Finding
from vftcli.signals.recording import JOINT_SIGNALS, Recording
from vftcli.signals.series import gaps_of

SLOW_RATE = 50.0
"""Below this rate a contact of a tenth of a second is a handful of samples. [Hz]"""
JITTER = 0.05
"""Spread of nine steps in ten, relative to their median, at which a fixed step is visibly wrong."""
GAP_STEPS = 4.0
MISSED = (1.6, 3.4)
"""Steps this many times the median are one or two samples that were missed."""
SHORT = 2.0
"""A log shorter than this tells little of noise and nothing of repeated motion. [s]"""
STALE = 0.01


def clock_findings(recording: Recording) -> Iterator[Finding]:
    """Findings about the clock."""
    if recording.samples < 3:
        yield Finding(
            name="too-short",
            severity="warning",
            evidence=f"{recording.samples} samples",
            consequence="Nothing can be estimated from them",
            remedy="Record at least some seconds",
        )
        return
    yield from _length_and_rate(recording)
    yield from _jitter(recording)
    yield from _gaps(recording)
    yield from _repeats(recording)
    yield from _stale_rows(recording)


def _length_and_rate(recording: Recording) -> Iterator[Finding]:
    if recording.duration < SHORT:
        yield Finding(
            name="short",
            severity="note",
            evidence=f"the log lasts {recording.duration:.3g} s",
            consequence="Observers of 10 1/s need half a second to settle",
            remedy="Record longer, from rest",
        )
    rate = 1 / recording.median_step
    if rate < SLOW_RATE:
        yield Finding(
            name="slow-rate",
            severity="warning",
            evidence=f"{rate:.3g} samples a second",
            consequence="Contacts shorter than a few samples are missed and inertia is misjudged",
            remedy=(
                "Record at the controller's rate: 125 Hz (CB3), 500 Hz (e-Series), 1 kHz (Franka)"
            ),
        )


def _jitter(recording: Recording) -> Iterator[Finding]:
    steps = np.diff(recording.t)
    usual = float(np.median(steps))
    regular = steps[(steps > MISSED[0] * usual) & (steps < MISSED[1] * usual)]
    missed = int(regular.size)
    if missed > 0.001 * len(steps):
        yield Finding(
            name="missing-samples",
            severity="note",
            evidence=f"{missed} of {len(steps)} steps are two or three sample times long",
            consequence="Torque between the samples is guessed by a straight line",
            remedy="Record from the receiving thread, or to a local disk",
        )
    low, high = np.percentile(steps[steps < GAP_STEPS * usual], [5, 95])
    spread = float(high - low) / usual
    if spread > JITTER:
        yield Finding(
            name="jitter",
            severity="note",
            evidence=(
                f"steps vary by {100 * spread:.0f} % of their median: nine in ten lie between "
                f"{1e3 * low:.3g} and {1e3 * high:.3g} ms ({recording.source.clock})"
            ),
            consequence="Filters of a fixed step would be wrong; every step is used as recorded",
            remedy="Record the robot's own clock rather than the host's",
        )


def _gaps(recording: Recording) -> Iterator[Finding]:
    steps = np.diff(recording.t)
    gaps = gaps_of(recording.t, GAP_STEPS)
    if gaps.size:
        k = int(gaps[np.argmax(steps[gaps])])
        yield Finding(
            name="gaps",
            severity="warning" if steps[k] > 0.1 else "note",
            evidence=(
                f"{gaps.size} steps of more than {GAP_STEPS:g} sample times, the longest "
                f"{steps[k]:.3g} s at t = {recording.t[k]:.3g} s"
            ),
            consequence="Torque between the samples is guessed by a straight line",
            remedy="Leave that part out with --interval, or record to a local disk",
        )


def _repeats(recording: Recording) -> Iterator[Finding]:
    source = recording.source
    if source.duplicates:
        share = 100 * source.duplicates / max(source.rows, 1)
        yield Finding(
            name="repeated-stamps",
            severity="warning" if share > 10 else "note",
            evidence=f"{source.duplicates} of {source.rows} rows ({share:.2g} %) repeat a stamp",
            consequence="They were dropped; the steps beside them are longer",
            remedy="Record from the receiving thread, or raise the recorder's rate",
        )


def _stale_rows(recording: Recording) -> Iterator[Finding]:
    """Rows that repeat every value of the row before under a new stamp: a packet that was late."""
    moving = [v for name in JOINT_SIGNALS if (v := getattr(recording, name)) is not None]
    same = np.ones(recording.samples - 1, dtype=bool)
    for value in moving:
        same &= (value[1:] == value[:-1]).all(axis=1)
    share = float(same.mean())
    if recording.dq is None or share < STALE or share > 0.9:
        return
    still = np.abs(recording.dq[1:][same]).max() if same.any() else 0.0
    if still < 1e-3:
        return
    yield Finding(
        name="stale-rows",
        severity="note",
        evidence=f"{same.sum()} rows ({100 * share:.2g} %) repeat the row before under a new stamp",
        consequence="Velocity and torque stand still for a step, which looks like noise",
        remedy="Stamp samples with the robot's clock; recorded stamps are used as they are",
    )
