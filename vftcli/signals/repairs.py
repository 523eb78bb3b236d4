"""Repairs of a recording: velocities that it lacks, samples that stand alone.

Such a sample is a transmission error, a wrapped angle, a spike of one current reading: no
arm or drive moves away and back within two samples. One can spoil a spectrum or a fit of
a whole log.

References:
    F. R. Hampel, P. J. Rousseeuw, E. M. Ronchetti, W. A. Stahel, "Robust Statistics: The
    Approach Based on Influence Functions", Wiley, 1986, Sec. 2.6, for a limit beyond which
    influence falls.
"""

from dataclasses import replace

import numpy as np

from vftcli.signals.arrays import Array, Mask, handed_over
from vftcli.signals.filters import low_pass
from vftcli.signals.recording import EFFORTS, Recording
from vftcli.signals.remarks import caution, fact, on_joints

#: Cutoff of the derivative, twice. [Hz] UR10e positions, to 1e-4 rad at 100 Hz, give speeds
#: off by .003 rad/s rms so, by .10 to .44 as plain differences; 5 and 20 Hz differ little.
CUTOFF = 12.0
OF_NYQUIST = 0.4  #: The same in a slow log, as a share of half its rate.
#: Cutoff times length of the pushes below which the filter blunts them: 40 ms at 12 Hz.
BLUNTED = 0.48
#: How far positions travel at most that are logged within a turn. [rad]
ONE_TURN = 2 * np.pi + 0.1
RATE = 50.0  #: Rate from which velocities are derived unasked. [Hz]


def with_velocity(recording: Recording, slowest: float = 0.0) -> Recording:
    """A log with velocities, derived if it has none and is as fast as `slowest`. [Hz]"""
    if recording.dq is not None or recording.samples < 3:
        return recording
    if recording.median_step * slowest > 1.001:
        return recording
    dq, cutoff = derived_velocity(recording)
    said = caution("derived-velocity", cutoff_Hz=cutoff, blunted_ms=1e3 * BLUNTED / cutoff)
    changed = recording.changed(said, dq=dq)
    return replace(changed, source=replace(changed.source, derived=("dq",)))


def derived_velocity(recording: Recording) -> tuple[Array, float]:
    """The low-passed gradient of q on the log's own stamps, and the cutoff. [Hz]"""
    cutoff = min(CUTOFF, OF_NYQUIST * 0.5 / recording.median_step)
    # Endless joints logged within one turn jump; a motor's count does not.
    within = np.ptp(recording.q, axis=0) < ONE_TURN
    q = np.where(within, np.unwrap(recording.q, axis=0), recording.q)
    slopes = np.gradient(q, recording.t, axis=0)
    return low_pass(recording.t, slopes, cutoff), cutoff


#: A sample is compared with so many before it and so many behind it, by their median.
NEAR = 2
#: Quantile of usual bends, 2.7 sd of white noise: 1 % of bad samples make 3 % of bad bends.
USUAL = 0.97
#: A sample this far off is alone: 16 sd of white noise. 24 of 36 sound logs have none, one 11.
FAR = 6.0
#: And beyond this share of what a velocity or effort spans without its outer hundredths.
SPREAD = 0.03

#: Smaller steps are never alone: gear teeth give as much, slower joints rest. [rad, rad/s]
LEAST = {"q": 5e-4, "dq": 1e-2}

#: Factor for first and last samples: a line of six bends.
END = 4.0
#: An effort is no further off than so many times what its three closest neighbours in
#: size differ by: a tap of three samples is a tap. Two samples of one stand alone.
PEAK = 2.0
#: And efforts off by less: a log in single precision keeps 1e-5 of 100 N·m. [A, N·m]
FINEST = 1e-6


def without_isolated(recording: Recording) -> Recording:
    """A recording without samples that stand alone, said; itself where there are none.

    A little too far off it is drawn to the limit, twice as far to its neighbours' median.
    """
    there = [name for name in ("q", "dq", *EFFORTS) if getattr(recording, name) is not None]
    changed = np.zeros(recording.q.shape, bool)
    values = {}
    for name in there:
        x = getattr(recording, name)
        with np.errstate(all="ignore"):  # what no arm does overflows
            inner = np.quantile(x, (0.01, 0.99), axis=0)  # all but its outer hundredths
            span = SPREAD * (inner[1] - inner[0]) if name != "q" else 0.0
            least = np.maximum(span, LEAST.get(name, FINEST))
            even, alone = drawn_in(x, least, PEAK if name in EFFORTS else 0.0)
        if alone.any():
            changed |= alone
            values[name] = handed_over(even)
    if not values:
        return recording
    count = np.count_nonzero(changed.any(axis=1))
    said = fact("isolated-samples-evened", on_joints(np.any(changed, axis=0)), samples=count)
    return recording.changed(said, **values)


def drawn_in(x: Array, least: Array | float, peak: float) -> tuple[Array, Mask]:
    """Columns without samples that stand alone, and where these are. (T, n) each

    Up to `least` (n,) nothing is too far off; `peak` is as `PEAK`, 0 where no peak is meant.
    """
    made = np.array(x)
    if len(x) <= 6 * NEAR:
        return made, np.zeros(x.shape, bool)
    bend, travel = 0.5 * abs(np.diff(x, 2, axis=0)), 0.5 * abs(x[2:] - x[:-2]) + least
    # Jitter of the stamps bends only angles of moving joints.
    by_travel = np.quantile(bend / travel, USUAL, axis=0) * travel
    limit = np.maximum(FAR * np.minimum(np.quantile(bend, USUAL, axis=0), by_travel), least)
    # Of two bad samples in a row each bends by half of what it is off.
    rows = np.flatnonzero(np.any(bend > 0.5 * limit, axis=1)) + 1
    rows = rows[(rows >= NEAR) & (rows < len(x) - NEAR)]
    around = np.arange(-NEAR, NEAR + 1)
    for ends, far in ((made, limit), (made[::-1], limit[::-1])):
        # A line of median slope and place through the log's end.
        slope = np.median(np.diff(ends[: 3 * NEAR], axis=0), axis=0)
        level = ends[: 3 * NEAR] - np.arange(3 * NEAR)[:, None] * slope
        each = (np.median(np.delete(level, k, axis=0), axis=0) for k in range(NEAR))
        line = np.array([place + k * slope for k, place in enumerate(each)])
        ends[:NEAR] = drawn_to(line, line, ends[:NEAR], END * far[:NEAR])
    # The worst of its neighbours first: beside a bad sample others look bad.
    for _ in range(NEAR):
        near = np.sort(made[rows[:, None] + around], axis=1)
        others = np.median(made[rows[:, None] + around[around != 0]], axis=1)
        three = np.min(near[:, NEAR:] - near[:, : NEAR + 1], axis=1)
        far = np.maximum(limit[rows - 1], peak * three)
        beyond = np.zeros(x.shape)
        beyond[rows] = np.maximum(abs(made[rows] - near[:, NEAR]) - far, 0.0)
        worst = beyond[rows[:, None] + around].max(axis=1)
        drawn = drawn_to(near[:, NEAR], others, made[rows], far)
        made[rows] = np.where(beyond[rows] >= worst, drawn, made[rows])
    return made, abs(made - x) > 0.0


def drawn_to(middle: Array, place: Array, x: Array, limit: Array) -> Array:
    """Samples, those off `middle` by more than the limit nearer to their place."""
    off = x - middle
    bad = np.clip(abs(off) / limit - 1.0, 0.0, 1.0)
    drawn = (1.0 - bad) * (middle + np.sign(off) * limit) + bad * place
    return np.where(bad > 0.0, drawn, x)
