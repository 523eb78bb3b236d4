"""Two-cycle difference: the paper's truth, from cycles or a free run."""

from collections.abc import Mapping, Sequence
from itertools import permutations

import numpy as np

from vftcli.free_motion import AUTOMATIC
from vftcli.free_motion.cycles import pair_with_cycle
from vftcli.free_motion.difference import (
    LOW_PASS,
    RUNGS,
    TRUSTED_SHARE,
    Difference,
    Pairing,
    differences,
    most_certain,
    pair_with_run,
    rms,
)
from vftcli.free_motion.free_motion import FreeMotion
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array, Mask, root_mean_squares
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, caution, fact, on_joints
from vftcli.signals.rest import REST, faster

BLOCK = 1.0  #: Length of pieces; their scatter is chance. [s]
#: Standard errors of a change that is believed.
SURE = 3.0


def two_cycle_reference(motion: FreeMotion) -> ExternalTorque:
    """The two-cycle difference of a log and its free motion, with its own error.

    Where position and velocity repeat, all but the external torque cancels (Sec. IV-A of
    the paper; sign of (18)). A single free cycle has no reference of its own.
    """
    log, choice = motion.log, motion.choice
    clocks, remarks = partners_in_logs(motion) if motion.runs else partners_in_log(motion)
    rungs = tuple(RUNGS) if choice.alignment == AUTOMATIC else (choice.alignment,)
    low_pass, nyquist = choice.low_pass, 0.5 / log.step
    if isinstance(low_pass, float | int) and not low_pass < nyquist:
        raise ReferenceTorqueError(
            f"two-cycle.low-pass={low_pass:g} is not a cutoff between 0 and {nyquist:.4g} Hz, "
            "none or auto"
        )
    cutoffs = (None, min(LOW_PASS, 0.4 * nyquist)) if isinstance(low_pass, str) else (low_pass,)
    chosen, floors = most_certain(differences(log, clocks, rungs, cutoffs))
    measured = measured_scale(motion, clocks["found"], chosen)
    scale = np.ones(log.robot.joints) if measured is None else measured
    moving = np.isfinite(chosen.tau) & ~chosen.error.standing
    # Between cycles of one log friction has no time to change.
    change = friction_change(log, chosen.tau, moving) if motion.runs else np.zeros(len(scale))
    # Friction changes in motion, in which the scale was measured too.
    wider = np.hypot(chosen.error.sd * scale, change)
    sd = np.where(chosen.error.standing, chosen.error.sd, wider)
    return ExternalTorque(
        name="two-cycle",
        t=log.t,
        tau=chosen.tau,
        sd=sd,
        floor=rms(sd, np.isfinite(sd)),
        moving=moving,
        remarks=(
            *remarks,
            *floors,
            chosen.remark(
                "alignment-chosen" if len(floors) > 1 else "alignment-asked",
                title=RUNGS[chosen.rung].title,
            ),
            *floor_remarks(chosen, measured, change),
        ),
    )


#: "found" and "commanded" → a pairing for each free run; remarks.
Partners = tuple[Mapping[str, Sequence[Pairing]], list[Remark]]


def partners_in_log(motion: FreeMotion) -> Partners:
    """The free cycles of a log, paired with the others."""
    cycles, free, stated = motion.cycles, motion.free_cycles, motion.choice.period
    clocks = {"found": cycles.period}
    values = {
        "period_s": cycles.period,
        "deviation_rad": cycles.deviation,
        "whole": cycles.whole,
        "begin_s": cycles.begin,
        "end_s": cycles.end,
    }
    remarks = [fact("period", **values)]
    if stated is not None:
        clocks["commanded"] = stated
        remarks = [fact("period-near-stated", stated_s=stated, **values)]
    remarks += free.remarks(cycles.whole)
    if len(free.numbers) == 1:
        remarks.append(fact("free-cycle-without-reference"))
    pairings = {
        clock: [pair_with_cycle(motion.log, cycles, number, seconds) for number in free.drawn]
        for clock, seconds in clocks.items()
    }
    return pairings, remarks


def partners_in_logs(motion: FreeMotion) -> Partners:
    """Free runs in other logs, paired with a log."""
    remarks = []
    for run in motion.runs:
        found, code = run.alignment, "free-run-aligned"
        values = {
            "shift_s": found.shift,
            "deviation_mrad": 1e3 * found.deviation,
            "covered_s": float(np.count_nonzero(run.pairing.known)) * motion.log.step,
        }
        if abs(found.rate - 1.0) > 1e-4:
            code, values["rate"] = "free-run-on-another-clock", found.rate
        remarks.append(fact(code, Where(about=run.recording.name), **values))
    return {"found": [run.pairing for run in motion.runs]}, remarks


def measured_scale(
    motion: FreeMotion, pairings: Sequence[Pairing], chosen: Difference
) -> Array | None:
    """Measured over expected error of two free runs. (n,)"""
    if len(pairings) < 2:
        return None
    if not motion.runs:
        # A free cycle's samples are free: their difference is all error.
        free = np.isin(motion.cycles.number(motion.log.t), motion.free_cycles.numbers)
        return error_ratio(chosen, free & chosen.error.known)
    ratios = []
    # Every pair both ways round: the order must not decide the floor.
    for first, second in permutations(pairings, 2):
        shared = first.known & second.known
        if np.count_nonzero(shared) < 2:
            raise ReferenceTorqueError(
                f"{first.free.name} and {second.free.name} do not overlap, so they measure no "
                "floor; give two free runs of one part of the motion"
            )
        # One free run with another by way of the log both are paired with.
        rate, shift = np.polyfit(first.times[shared], second.times[shared], 1)
        pair = [pair_with_run(first.free.t, second.free, shift, rate)]
        both = {"found": pair, "commanded": pair}
        spread = next(differences(first.free, both, (chosen.rung,), (chosen.cutoff,)))
        ratios.append(error_ratio(spread, spread.error.known))
    return root_mean_squares(np.array(ratios))


def error_ratio(found: Difference, where: Mask) -> Array:
    """RMS of a zero difference over its expected error. (n,)"""
    moving = ~found.error.standing[where]
    expected = rms(found.error.sd[where], moving)
    shown = rms(found.tau[where], moving)
    # Beyond these limits the error model is not the cause.
    return np.clip(shown / np.maximum(expected, 1e-12), 0.3, 3.0)


def friction_change(motion: Run, tau: Array, moving: Mask) -> Array:
    """Change of dry friction since the free run, 0 if maybe chance. (n,) [N·m]

    The mean of the difference (T, n) [N·m] times the velocity's sign, which contacts do not
    follow; its scatter over pieces of `BLOCK` is its uncertainty.
    """
    t, n = motion.t, tau.shape[1]
    piece = ((t - t[0]) / BLOCK).astype(np.int64)
    change = np.zeros(n)
    for j in range(n):
        used = np.isfinite(tau[:, j]) & moving[:, j] & faster(motion.dq[:, j], REST)
        along = tau[used, j] * np.sign(motion.dq[used, j])
        count = np.bincount(piece[used]).astype(float)
        total = np.bincount(piece[used], weights=along)
        means = total[count > 0] / count[count > 0]
        if len(means) < 5:
            continue
        spread = means.std(ddof=1) / np.sqrt(len(means))
        if abs(means.mean()) > SURE * spread:
            change[j] = along.mean()
    return change


def floor_remarks(chosen: Difference, measured: Array | None, change: Array) -> list[Remark]:
    """Origin of the floor; joints that stand or have another friction."""
    remarks = [fact("floor-propagated")]
    if measured is not None:
        remarks = [fact("floor-measured", ratio=measured)]
    share, error = chosen.error.standing_share, chosen.error
    stiction = rms(error.sd, error.standing & error.known[:, None])
    for j in np.flatnonzero(share > 0.02):
        code = "joint-stands" if share[j] > 1.0 - TRUSTED_SHARE else "joint-stands-at-times"
        values = {"share": float(share[j]), "stiction_Nm": float(stiction[j])}
        remarks.append(caution(code, on_joints([int(j)]), **values))
    changed = change != 0.0
    if changed.any():
        size = change[changed]
        remarks.append(caution("friction-changed", on_joints(changed), change_Nm=size))
    return remarks
