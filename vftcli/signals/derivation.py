"""Velocities that a log lacks, derived from its positions over the complete log."""

from dataclasses import replace

import numpy as np

from vftcli.signals.filters import low_pass
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import caution

#: Where the derivative is cut off, twice. [Hz]
#:
#: Positions of UR10e logs, rounded to 1e-4 rad at 100 Hz, give velocities off by .0024 to .0031
#: rad/s rms so, and by .10 to .44 as plain differences; 5 and 20 Hz differ little.
CUTOFF = 12.0
OF_NYQUIST = 0.4  #: The same in a slow log, as a share of half its rate.
#: Cutoff times length of the pushes below which the filter blunts them: 40 ms at 12 Hz.
BLUNTED = 0.48
ONE_TURN = 2 * np.pi + 0.1  #: How far positions travel at most that are logged within a turn. [rad]
RATE = 50.0  #: Rate from which velocities are derived without being asked for. [Hz]


def with_velocity(recording: Recording) -> Recording:
    """A log with velocities derived from its positions, and a caution; as it is if it has them.

    dq = the gradient of q on the log's own stamps, low-passed without phase shift.
    """
    if recording.dq is not None or recording.samples < 3:
        return recording
    cutoff = min(CUTOFF, OF_NYQUIST * 0.5 / recording.median_step)
    # An endless joint that is logged within one turn jumps by it; a motor's count does not.
    within = np.ptp(recording.q, axis=0) < ONE_TURN
    q = np.where(within, np.unwrap(recording.q, axis=0), recording.q)
    slopes = np.gradient(q, recording.t, axis=0)
    told = caution("derived-velocity", cutoff_Hz=cutoff, blunted_ms=1e3 * BLUNTED / cutoff)
    source = recording.source
    source = replace(source, derived=("dq",), remarks=(*source.remarks, told))
    return replace(recording, dq=low_pass(recording.t, slopes, cutoff), source=source)


def is_fast(recording: Recording) -> bool:
    """Whether a log is sampled often enough that its velocities can be derived unasked."""
    return recording.samples >= 3 and recording.median_step * RATE <= 1.001
