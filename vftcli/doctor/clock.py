"""Findings about the clock: rate, jitter, gaps, repeated stamps, stale rows."""

from collections.abc import Iterator

import numpy as np

from vftcli.doctor.stuck import repeated_rows
from vftcli.doctor.velocity import VelocityFit, common_cause
from vftcli.signals.names import JOINT_SIGNALS
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact, warning
from vftcli.signals.rest import NONZERO
from vftcli.signals.series import gaps_of

SLOW_RATE = 50.0  #: Rate below which a contact of .1 s is a handful of samples. [Hz]
#: Spread of nine steps in ten, relative to their median, at which a fixed step is visibly wrong.
JITTER = 0.05
GAP_STEPS = 4.0  #: A step this many times the median is a gap.
LONG_GAP = 0.1  #: A gap longer than this can hide a whole contact. [s]
MISSED = (1.6, 3.4)  #: Steps over the median where one or two samples were missed.
SHORT = 2.0  #: Shorter logs tell little of noise and nothing of repeated motion. [s]
STALE = 0.003  #: Share of rows that repeat the one before, from which it is worth telling.


def clock_findings(
    recording: Recording,
    fit: VelocityFit | None,
    part: Recording | None = None,
) -> Iterator[Remark]:
    """Findings about the clock, each check independent of the others.

    Args:
        recording: The log.
        fit: How its velocities fit its positions.
        part: Stretches of it where all signals have no room; None for all of it.
    """
    common = common_cause(fit)
    if common is not None and common.code in {"time-unit", "clock-rate"}:
        yield common
        if common.code == "time-unit":
            return  # what else is odd about its steps is this
    if recording.duration < SHORT:
        yield fact("short", duration_s=recording.duration)
    rate = 1 / recording.median_step
    if rate < SLOW_RATE:
        yield warning("slow-rate", rate_Hz=rate)
    yield from uneven_steps(recording)
    yield from long_steps(recording)
    source = recording.source
    if source.duplicates:
        share = 100 * source.duplicates / max(source.rows, 1)
        level = warning if share > 10 else fact
        yield level(
            "repeated-stamps", repeats=source.duplicates, rows=source.rows, share_percent=share
        )
    yield from stale_rows(part or recording)


def uneven_steps(recording: Recording) -> Iterator[Remark]:
    """Samples that were missed, and steps that vary."""
    usual = recording.median_step
    steps = np.diff(recording.t)
    missed = int(np.sum((steps > MISSED[0] * usual) & (steps < MISSED[1] * usual)))
    if missed > 0.001 * len(steps):
        yield fact("missing-samples", missed=missed, steps=len(steps))
    # A gap is no jitter: it has its own finding.
    steps = steps[steps < GAP_STEPS * usual]
    low, high = np.percentile(steps, [5, 95], overwrite_input=True)
    spread = float(high - low) / usual
    if spread > JITTER:
        yield fact(
            "jitter",
            spread_percent=100 * spread,
            low_ms=1e3 * float(low),
            high_ms=1e3 * float(high),
            clock=recording.source.clock,
        )


def long_steps(recording: Recording) -> Iterator[Remark]:
    """Gaps, with the longest of them."""
    t, at = recording.t, gaps_of(recording.t, GAP_STEPS)
    gaps = np.column_stack([t[at + 1] - t[at], t[at]])
    for cut in recording.source.cuts:  # has a finding of its own
        gaps = gaps[(gaps[:, 1] > cut.start) | (gaps.sum(axis=1) < cut.start)]
    if len(gaps):
        longest, begun = gaps[np.argmax(gaps[:, 0])].tolist()
        level = warning if longest > LONG_GAP else fact
        yield level("gaps", gaps=len(gaps), steps=GAP_STEPS, longest_s=longest, at_s=begun)


def stale_rows(recording: Recording) -> Iterator[Remark]:
    """Rows that repeat the row before under a new stamp: a packet that was late."""
    last = repeated_rows(recording, JOINT_SIGNALS)
    share = len(last) / (recording.samples - 1)
    # Nearly all rows alike is an arm at rest, and so are alike rows without velocity.
    if recording.dq is None or share < STALE or share > 0.9:
        return
    if np.abs(recording.dq[last]).max() >= NONZERO:
        yield fact("stale-rows", stale=len(last), share_percent=100 * share)
