"""The two-cycle difference: the paper's ground truth, from repeated cycles or from a free run."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vftcli.repetition.alignment import align
from vftcli.repetition.choice import AUTOMATIC, FreeChoice
from vftcli.repetition.cycles import check_cycles, segment
from vftcli.repetition.drive_run import DriveRun, drive_run_of
from vftcli.repetition.error_model import TRUSTED_SHARE, rms
from vftcli.repetition.free_cycles import find_free_cycles, named
from vftcli.repetition.friction_change import friction_change
from vftcli.repetition.ladder import LOW_PASS, RUNGS, Difference, best, climb
from vftcli.repetition.pairing import Pairing, pair_with_cycle, pair_with_run
from vftcli.repetition.periodicity import find_period
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.identity import refuse_repeated_runs
from vftcli.signals.recording import Recording


class Partners(NamedTuple):
    """A log's free runs, laid under it.

    Attributes:
        clocks: "found" and, where a period is stated, "commanded" → one pairing a free run.
        notes: How they were found, one sentence each.
        free: Whether a sample is itself free, so that its difference is all error. (T,)
    """

    clocks: Mapping[str, Sequence[Pairing]]
    notes: tuple[str, ...]
    free: Mask


def two_cycle_difference(
    recording: Recording,
    free: Recording | Sequence[Recording],
    robot: Robot,
    choice: FreeChoice | None = None,
) -> ExternalTorque:
    """τ_ext = τ_free − τ at the same place of a repeated motion, with its own error.

    Where position and velocity repeat, gravity, inertia and friction cancel and what is left is
    the torque the environment exerts (Sec. IV-A of the paper; sign of (18)). The free run is one
    or more cycles of the same log, which then have no reference of their own unless there are two,
    or other logs of the same motion.

    Args:
        recording: The log with contact.
        free: A free run in another log or several; none to find free cycles in the log itself.
        robot: For drive constants and the model's torque.
        choice: Period, free cycles, alignment and low-pass, each found if not given.

    Raises:
        ReferenceTorqueError: If nothing repeats, or what is asked for is not there.
        MissingSignalError: If a log has neither currents nor torques, or no velocities.
    """
    choice = choice or FreeChoice()
    motion = drive_run_of(recording, robot)
    runs = (free,) if isinstance(free, Recording) else tuple(free)
    if runs:
        partners = partners_in_logs(recording, motion, runs, robot, choice)
    else:
        partners = partners_in_log(recording, motion, choice)
    cutoffs = cutoffs_for(choice.low_pass, recording.median_step)
    ladder = climb(motion, partners.clocks, rungs_for(choice), cutoffs)
    chosen = best(ladder)
    measured = measured_scale(partners, chosen)
    moving = np.isfinite(chosen.tau) & (chosen.error.rest == 0.0)
    scale = measured if measured is not None else np.ones(motion.torque.shape[1])
    change = friction_change(motion, chosen.tau, moving) if runs else np.zeros(len(scale))
    return ExternalTorque(
        name="two-cycle",
        t=recording.t,
        tau=chosen.tau,
        sd=np.hypot(chosen.error.sd * scale, change),
        floor=np.hypot(chosen.floor * scale, change),
        moving=moving,
        remarks=(
            *partners.notes,
            *ladder_notes(ladder, chosen),
            *floor_notes(chosen, measured),
            *change_notes(change),
        ),
    )


def partners_in_log(recording: Recording, motion: DriveRun, choice: FreeChoice) -> Partners:
    """Find the cycles of a log and lay its free ones under the others."""
    period = find_period(recording, choice.period)
    cycles = segment(recording, period)
    if choice.cycles:
        check_cycles(recording, cycles, choice.cycles)
        numbers = tuple(c - 1 for c in choice.cycles)
        note = f"free: {named(numbers)} of {cycles.whole}, as given"
    else:
        numbers, note = find_free_cycles(motion, cycles)
    found = (
        f"period {cycles.period:.6g} s, found on the joint positions to {period.deviation:.2g} rad"
    )
    stated = f" (stated: {choice.period:g} s)" if choice.period is not None else ""
    span = f"{cycles.whole} whole cycles from {cycles.begin:.4g} to {cycles.end:.4g} s"
    clocks = {"found": [pair_with_cycle(motion, cycles, c, cycles.period) for c in numbers]}
    if choice.period is not None:
        clocks["commanded"] = [pair_with_cycle(motion, cycles, c, choice.period) for c in numbers]
    lone = "; the free cycle has no reference of its own" if len(numbers) == 1 else ""
    inside = np.isin(cycles.number(motion.t), numbers)
    return Partners(clocks, (f"{found}{stated}: {span}", f"{note}{lone}"), inside)


def partners_in_logs(
    recording: Recording,
    motion: DriveRun,
    free: Sequence[Recording],
    robot: Robot,
    choice: FreeChoice,
) -> Partners:
    """Lay free runs in other logs under a log."""
    if choice.cycles or choice.period is not None:
        raise ReferenceTorqueError(
            "--period and --free-cycles are for cycles of one log; leave them away with --free"
        )
    refuse_repeated_runs(recording, free)
    pairings, notes = [], []
    for other in free:
        found = align(recording, other)
        pairing = pair_with_run(motion, drive_run_of(other, robot), found.shift, found.rate)
        pairings.append(pairing._replace(times=np.where(found.overlap, pairing.times, np.nan)))
        rate = f", clock rate {found.rate:.6f}" if abs(found.rate - 1.0) > 1e-4 else ""
        covered = float(np.count_nonzero(pairings[-1].known)) * recording.median_step
        notes.append(
            f"free run {other.name}: shift {found.shift:+.4f} s{rate}, joint positions agree to "
            f"{found.deviation * 1e3:.3g} mrad rms over {covered:.1f} s"
        )
    return Partners({"found": pairings}, tuple(notes), np.zeros(recording.samples, dtype=bool))


def rungs_for(choice: FreeChoice) -> tuple[str, ...]:
    """The rungs to make: the one that is chosen, else all."""
    return tuple(RUNGS) if choice.alignment == AUTOMATIC else (choice.alignment,)


def cutoffs_for(low_pass: float | str | None, step: float) -> tuple[float | None, ...]:
    """Cutoffs of the low-pass to make: both none and the default for "auto". [Hz]

    Raises:
        ReferenceTorqueError: If it is not below half the sample rate.
    """
    if low_pass is None:
        return (None,)
    if isinstance(low_pass, str):
        return (None, min(LOW_PASS, 0.2 / step))
    if not low_pass < 0.5 / step:
        raise ReferenceTorqueError(
            f"--low-pass {low_pass:g} is not a cutoff between 0 and {0.5 / step:.4g} Hz, none or "
            "auto"
        )
    return (low_pass,)


def measured_scale(partners: Partners, chosen: Difference) -> Array | None:
    """Measured over expected error where two free runs can be compared, None else. (n,)"""
    pairings = partners.clocks["found"]
    if len(pairings) < 2:
        return None
    if np.any(partners.free):
        both = partners.free & chosen.error.known
        return ratio(chosen, both)
    first, second = pairings[:2]
    shared = [pair_runs(first, second)]
    cutoffs = (chosen.cutoff,)
    spread = climb(first.free, {"found": shared, "commanded": shared}, (chosen.rung,), cutoffs)[0]
    return ratio(spread, spread.error.known)


def pair_runs(first: Pairing, second: Pairing) -> Pairing:
    """Pair one free run with another by way of the log both are laid under."""
    both = first.known & second.known
    if np.count_nonzero(both) < 2:
        raise ReferenceTorqueError(
            f"{first.free.name} and {second.free.name} do not overlap, so they measure no floor; "
            "give two free runs of the same part of the motion"
        )
    here, there = first.times[both], second.times[both]
    rate, shift = np.polyfit(here, there, 1)
    return pair_with_run(first.free, second.free, float(shift), float(rate))


def ratio(found: Difference, where: Mask) -> Array:
    """Root mean square of a difference that should be zero, over its expected error. (n,)"""
    moving = found.error.rest[where] == 0.0
    expected = rms(found.error.sd[where], moving)
    shown = rms(found.tau[where], moving)
    return np.asarray(np.clip(shown / np.maximum(expected, 1e-12), 0.3, 3.0))


def ladder_notes(ladder: Sequence[Difference], chosen: Difference) -> tuple[str, ...]:
    """Every rung with its floor, and which one is used and why."""
    lines = [f"alignment {d.name}: floor {listed(d.floor)} N·m on J1…" for d in ladder]
    title = RUNGS[chosen.rung].title
    smooth = (
        "" if chosen.cutoff is None else f", then a zero-phase low-pass at {chosen.cutoff:g} Hz"
    )
    why = (
        "the smallest expected error, or the simplest within 3 % of it"
        if len(ladder) > 1
        else "as asked for"
    )
    return (*lines, f"alignment used: {chosen.name} ({title}{smooth}): {why}")


def floor_notes(chosen: Difference, measured: Array | None) -> tuple[str, ...]:
    """Where the floor comes from, and which joints it cannot speak for."""
    origin = (
        "floor measured between the free runs (shown over expected error: "
        f"{listed(measured)}) and carried to the other samples"
        if measured is not None
        else "floor by propagation: noise of the two torques, the motion difference's torque and "
        "the stiction of stops; two free runs would measure it"
    )
    notes = [origin]
    rests = chosen.error.at_rest
    for j in np.flatnonzero(rests > 0.02):
        size = f"up to about {chosen.error.floor_at_rest[j]:.2g} N·m rms"
        marked = "the joint is marked" if rests[j] > 1.0 - TRUSTED_SHARE else "they are marked"
        notes.append(
            f"J{j + 1} rests in {100 * rests[j]:.0f} % of the samples, where it keeps its "
            f"stiction ({size}): {marked}"
        )
    return tuple(notes)


def change_notes(change: Array) -> tuple[str, ...]:
    """Joints whose friction changed between the free run and the log."""
    found = [f"J{j + 1} {change[j]:+.2f}" for j in np.flatnonzero(change)]
    if not found:
        return ()
    return (
        f"friction changed between the free run and the log ({', '.join(found)} N·m along the "
        "motion; joints warm up): it does not cancel and is in the floor",
    )


def listed(values: Array) -> str:
    """Numbers with two decimals."""
    return " ".join(f"{value:.2f}" for value in values)
