"""The two-cycle difference: the paper's ground truth, from repeated cycles or from a free run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.repetition.alignment import align
from vftcli.repetition.cycles import check_cycles, parse_cycles, segment
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
from vftcli.signals.recording import Recording

AUTOMATIC = "auto"


@dataclass(frozen=True, kw_only=True)
class TwoCycleOptions:
    """How the two-cycle difference is made.

    Attributes:
        period: The commanded period, or None to go by the positions alone. [s]
        free_cycles: Free cycles as ``1`` or ``1,2`` or ``1-3``, or None to find them.
        alignment: A name in `RUNGS`, or "auto" for the best for the log at hand.
        low_pass: Cutoff in Hz as text, "none", or "auto".
    """

    period: float | None = None
    free_cycles: str | None = None
    alignment: str = AUTOMATIC
    low_pass: str = AUTOMATIC


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
    options: TwoCycleOptions | None = None,
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
        options: Period, free cycles, alignment and low-pass, each found if not given.

    Raises:
        ReferenceTorqueError: If nothing repeats, or what is asked for is not there.
        MissingSignalError: If a log has neither currents nor torques, or no velocities.
    """
    options = options or TwoCycleOptions()
    motion = drive_run_of(recording, robot)
    runs = (free,) if isinstance(free, Recording) else tuple(free)
    if runs:
        partners = partners_in_logs(recording, motion, runs, robot, options)
    else:
        partners = partners_in_log(recording, motion, options)
    cutoffs = cutoffs_for(options.low_pass, recording.step)
    ladder = climb(motion, partners.clocks, rungs_for(options), cutoffs)
    chosen = best(ladder)
    measured = measured_scale(partners, chosen)
    trusted = np.isfinite(chosen.tau) * (1.0 - chosen.error.rest)
    scale = measured if measured is not None else np.ones(motion.torque.shape[1])
    change = friction_change(motion, chosen.tau, trusted) if runs else np.zeros(len(scale))
    return ExternalTorque(
        name="two-cycle",
        t=recording.t,
        tau=chosen.tau,
        sd=np.hypot(chosen.error.sd * scale, change),
        floor=np.hypot(chosen.floor * scale, change),
        trusted=trusted,
        remarks=(
            *partners.notes,
            *ladder_notes(ladder, chosen),
            *floor_notes(chosen, measured),
            *change_notes(change),
        ),
    )


def partners_in_log(recording: Recording, motion: DriveRun, options: TwoCycleOptions) -> Partners:
    """Find the cycles of a log and lay its free ones under the others."""
    period = find_period(recording, options.period)
    cycles = segment(recording, period)
    if options.free_cycles is not None:
        asked = parse_cycles(options.free_cycles)
        check_cycles(recording, cycles, asked)
        numbers = tuple(c - 1 for c in asked)
        note = f"free: {named(numbers)} of {cycles.whole}, as given"
    else:
        numbers, note = find_free_cycles(motion, cycles)
    found = (
        f"period {cycles.period:.6g} s, found on the joint positions to {period.deviation:.2g} rad"
    )
    stated = f" (stated: {options.period:g} s)" if options.period is not None else ""
    span = f"{cycles.whole} whole cycles from {cycles.begin:.4g} to {cycles.end:.4g} s"
    clocks = {"found": [pair_with_cycle(motion, cycles, c, cycles.period) for c in numbers]}
    if options.period is not None:
        clocks["commanded"] = [pair_with_cycle(motion, cycles, c, options.period) for c in numbers]
    lone = "; the free cycle has no reference of its own" if len(numbers) == 1 else ""
    inside = np.isin(cycles.number(motion.t), numbers)
    return Partners(clocks, (f"{found}{stated}: {span}", f"{note}{lone}"), inside)


def partners_in_logs(
    recording: Recording,
    motion: DriveRun,
    free: Sequence[Recording],
    robot: Robot,
    options: TwoCycleOptions,
) -> Partners:
    """Lay free runs in other logs under a log."""
    if options.free_cycles is not None or options.period is not None:
        raise ReferenceTorqueError(
            "--period and --free-cycles are for cycles of one log; leave them away with --free"
        )
    pairings, notes = [], []
    for other in free:
        if other.source.path is not None and other.source.path == recording.source.path:
            raise ReferenceTorqueError(
                f"{other.name} is the log itself: a free run is another log of the same motion; "
                "for free cycles within one log leave --free away"
            )
        found = align(recording, other)
        pairing = pair_with_run(motion, drive_run_of(other, robot), found.shift, found.rate)
        pairings.append(pairing._replace(times=np.where(found.overlap, pairing.times, np.nan)))
        rate = f", clock rate {found.rate:.6f}" if abs(found.rate - 1.0) > 1e-4 else ""
        covered = float(np.count_nonzero(pairings[-1].known)) * recording.step
        notes.append(
            f"free run {other.name}: shift {found.shift:+.4f} s{rate}, joint positions agree to "
            f"{found.deviation * 1e3:.3g} mrad rms over {covered:.1f} s"
        )
    return Partners({"found": pairings}, tuple(notes), np.zeros(recording.samples, dtype=bool))


def rungs_for(options: TwoCycleOptions) -> tuple[str, ...]:
    """The rungs to make: the one asked for, else all.

    Raises:
        ReferenceTorqueError: If there is no such rung, or it needs a period nobody stated.
    """
    if options.alignment == AUTOMATIC:
        return tuple(RUNGS)
    if options.alignment not in RUNGS:
        raise ReferenceTorqueError(
            f"no alignment {options.alignment!r}; there is auto, {', '.join(RUNGS)}"
        )
    if options.alignment == "commanded" and options.period is None:
        raise ReferenceTorqueError("alignment commanded needs the commanded period: add --period S")
    return (options.alignment,)


def cutoffs_for(text: str, step: float) -> tuple[float | None, ...]:
    """Cutoffs of the low-pass to make: both none and the default for "auto". [Hz]

    Raises:
        ReferenceTorqueError: If it is not a number below half the sample rate, "none" or "auto".
    """
    if text == AUTOMATIC:
        return (None, min(LOW_PASS, 0.2 / step))
    if text == "none":
        return (None,)
    try:
        cutoff = float(text)
    except ValueError:
        cutoff = float("nan")
    if not 0.0 < cutoff < 0.5 / step:
        raise ReferenceTorqueError(
            f"--low-pass {text!r} is not a cutoff between 0 and {0.5 / step:.4g} Hz, none or auto"
        )
    return (cutoff,)


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
