"""Findings about the signals: units, signs, saturation, joints that never move, empty fields."""

from collections.abc import Iterable, Iterator

import numpy as np

from vftcli.doctor.findings import Finding
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.series import runs_of

MOVING = 1e-3
"""Speed from which a joint counts as moving. [rad/s]"""
TRAVEL = 0.05
"""Travel from which a joint's own data tell anything. [rad]"""
STRONG = -0.4
"""Net share of work from which a joint's effort counts as inverted.

Joints hand energy to one another through gravity, so a single joint may well give some back.
"""
ALONE = -0.85
"""The same for a joint whose neighbours' effort is sound."""
LARGE_CURRENT = 60.0
"""No joint of these arms draws this much; readings in mA do. [A]"""


def signal_findings(recording: Recording) -> Iterator[Finding]:
    """Findings about the signals, each check independent of the others."""
    yield from _missing(recording)
    yield from _units(recording)
    yield from _velocity(recording)
    yield from _effort_sign(recording)
    yield from _still_joints(recording)
    yield from _saturation(recording)
    yield from _zeros(recording)


def named(joints: Iterable[int]) -> str:
    """Joints for a sentence, counted from one."""
    return ", ".join(f"J{int(j) + 1}" for j in joints)


def _missing(recording: Recording) -> Iterator[Finding]:
    if recording.dq is None:
        yield Finding(
            name="no-velocity",
            severity="warning",
            evidence="the log has no joint velocities",
            consequence="No observer can run",
            remedy="Record actual_qd (UR) or dq (Franka)",
        )
    if recording.current is None and recording.torque is None:
        yield Finding(
            name="no-effort",
            severity="warning",
            evidence="the log has neither motor currents nor joint torques",
            consequence="No observer can run",
            remedy="Record actual_current (UR) or tau_J (Franka), or name it with --columns",
        )


def _units(recording: Recording) -> Iterator[Finding]:
    largest = float(np.max(np.abs(recording.q)))
    if largest > 13.0:
        yield Finding(
            name="degrees",
            severity="warning",
            evidence=f"positions reach {largest:.4g}",
            consequence="Radians of that size are two turns; degrees would be taken for radians",
            remedy="If they are degrees, say so: --columns q[deg]=…",
        )
    if recording.current is not None:
        typical = float(np.percentile(np.abs(recording.current), 99))
        if typical > LARGE_CURRENT:
            yield Finding(
                name="milliamperes",
                severity="warning",
                evidence=f"currents reach {typical:.4g} A",
                consequence="Torques would be a thousandfold",
                remedy="If they are mA, say so: --columns current[mA]=…",
            )


def velocity_slopes(recording: Recording) -> Array:
    """Slope of the logged velocity against the change of position; NaN at rest. (n,)

    Both are taken over stretches of a tenth of a second, in which jitter and quantisation of
    single samples cancel.
    """
    if recording.dq is None or recording.samples < 20:
        return np.full(recording.joints, np.nan)
    t, length = recording.t, max(1, round(0.1 / recording.median_step))
    length = min(length, (recording.samples - 1) // 4)
    first = np.arange(0, recording.samples - length, length)
    steps = np.diff(t)[:, None]
    ways = np.cumsum((recording.dq[1:] + recording.dq[:-1]) / 2 * steps, axis=0)
    ways = np.vstack([np.zeros(recording.joints), ways])
    by_velocity = ways[first + length] - ways[first]
    by_position = recording.q[first + length] - recording.q[first]
    even = (t[first + length] - t[first] < 2 * length * recording.median_step)[:, None]
    weight = np.sum(even * by_position**2, axis=0)
    slopes = np.sum(even * by_position * by_velocity, axis=0) / np.where(weight > 0, weight, 1.0)
    slopes[np.ptp(recording.q, axis=0) < TRAVEL] = np.nan
    return np.asarray(slopes)


def _velocity(recording: Recording) -> Iterator[Finding]:
    slopes = velocity_slopes(recording)
    known = np.flatnonzero(np.isfinite(slopes))
    if known.size == 0:
        return
    if np.all(np.abs(slopes[known] - 57.3) < 10) or np.all(np.abs(slopes[known] - 1 / 57.3) < 0.01):
        yield Finding(
            name="velocity-unit",
            severity="warning",
            evidence=f"velocities are {np.median(slopes[known]):.3g} times dq/dt",
            consequence="Positions and velocities are in different units",
            remedy="Say the unit: --columns dq[deg/s]=… or q[deg]=…",
        )
        return
    wrong = known[np.abs(slopes[known] - 1) > 0.3]
    if wrong.size:
        told = ", ".join(f"J{j + 1} {slopes[j]:.2f}" for j in wrong)
        yield Finding(
            name="velocity-mismatch",
            severity="warning",
            evidence=f"logged velocity over differentiated position is {told} (should be 1)",
            consequence="Momentum is wrong by the same factor",
            remedy="Check the columns' order, sign and filter; the clock may be the host's",
        )


def work_shares(recording: Recording, effort: Array) -> Array:
    """Net work of each joint's effort over its gross work; NaN where it hardly moved. (n,)

    Friction makes the drives put energy in; what gravity and inertia take they give back.
    """
    if recording.dq is None:
        return np.full(recording.joints, np.nan)
    steps = np.gradient(recording.t)[:, None]
    power = effort * recording.dq * steps
    gross = np.sum(np.abs(power), axis=0)
    share = np.sum(power, axis=0) / np.where(gross > 0, gross, 1.0)
    travel = np.sum(np.abs(np.diff(recording.q, axis=0)), axis=0)
    reversing = (recording.dq.max(axis=0) > MOVING) & (recording.dq.min(axis=0) < -MOVING)
    share[(travel < 0.3) | ~reversing | (gross == 0)] = np.nan
    return np.asarray(share)


def effort_of(recording: Recording) -> tuple[str, Array] | None:
    """The log's effort and its name."""
    for name in ("torque", "current"):
        if (value := getattr(recording, name)) is not None:
            return name, value
    return None


def inverted_joints(recording: Recording) -> tuple[list[int], int]:
    """Joints whose effort opposes friction, and how many joints could be judged."""
    if (effort := effort_of(recording)) is None:
        return [], 0
    shares = work_shares(recording, effort[1])
    judged = np.flatnonzero(np.isfinite(shares))
    found = [int(j) for j in judged if shares[j] < STRONG]
    if len(found) < max(2, round(0.6 * judged.size)):  # a few joints only: nearly all their work
        found = [j for j in found if shares[j] < ALONE]
    return found, int(judged.size)


def _effort_sign(recording: Recording) -> Iterator[Finding]:
    found, judged = inverted_joints(recording)
    effort = effort_of(recording)
    if not found or effort is None or recording.dq is None:
        return
    name, value = effort
    shares = work_shares(recording, value)
    forward = recording.dq[:, found[0]] > MOVING
    mean = float(np.mean(value[forward, found[0]])) if forward.any() else float("nan")
    unit = "A" if name == "current" else "N·m"
    whole = len(found) >= max(2, round(0.6 * judged))
    word = "current" if name == "current" else "tau"
    yield Finding(
        name="effort-sign",
        severity="warning",
        evidence=(
            f"the {name} of {named(found)} takes energy out of a moving arm "
            f"({', '.join(f'{100 * shares[j]:.0f} %' for j in found)} of its gross work; mean "
            f"{mean:.3g} {unit} while J{found[0] + 1} moves forward)"
        ),
        consequence=(
            "Friction only takes energy, so the sign is inverted"
            if whole
            else "Either the sign of these joints is inverted or somebody moved the arm by hand"
        ),
        remedy=(
            f"Turn it with a leading minus: --columns '-{word}=effort' for a bag, or -{word}:"
            f"{recording.joints} for a table"
        ),
    )


def _still_joints(recording: Recording) -> Iterator[Finding]:
    travel = np.ptp(recording.q, axis=0)
    still = np.flatnonzero(travel < 1e-3)
    if still.size == recording.joints:
        yield Finding(
            name="at-rest",
            severity="note",
            evidence=f"no joint moves by more than {1e3 * travel.max():.2g} mrad",
            consequence="Stiction hides torques up to breakaway; nothing can be identified",
            remedy="Use it for held poses only",
        )
    elif still.size:
        yield Finding(
            name="still-joints",
            severity="note",
            evidence=f"{named(still)} never move{'s' if still.size == 1 else ''}",
            consequence="Their estimate keeps their stiction, and no friction can be identified",
            remedy="Move every joint in logs that are meant for identification",
        )


def _saturation(recording: Recording) -> Iterator[Finding]:
    for name in ("current", "torque"):
        value = getattr(recording, name)
        if value is None:
            continue
        joints = [j for j in range(recording.joints) if _is_clipped(value[:, j])]
        if joints:
            yield Finding(
                name="saturation",
                severity="warning",
                evidence=f"{name} of {named(joints)} stays at its very extreme for whole stretches",
                consequence="The true effort was larger; the estimate is too small there",
                remedy="Move more slowly, or leave these parts out with --interval",
            )


def _is_clipped(value: Array, least: int = 10) -> bool:
    """Whether an effort that varies stays exactly at its extreme for several samples in a row."""
    if np.ptp(value) == 0:
        return False
    for extreme in (value.max(), value.min()):
        at = value == extreme
        if abs(extreme) < 0.5 * np.ptp(value) or at.sum() < least or at.mean() > 0.5:
            continue
        if max(stop - start for start, stop in runs_of(at)) >= least:
            return True
    return False


def _zeros(recording: Recording) -> Iterator[Finding]:
    for name in ("current", "torque", "tau_ext", "wrench", "target_torque", "dq"):
        value = getattr(recording, name)
        if value is None or np.any(value):
            continue
        other = (
            recording.tau_ext is not None and name == "wrench" and bool(np.any(recording.tau_ext))
        )
        yield Finding(
            name=f"zero-{name.replace('_', '-')}",
            severity="warning" if name in {"current", "torque", "wrench", "tau_ext"} else "note",
            evidence=f"{name} is zero in every sample"
            + (", while tau_ext is not" if other else ""),
            consequence=(
                "libfranka reports zeros near singularities; as a reference it would be wrong"
                if name == "wrench"
                else "It was not measured, or its recorder was not running"
            ),
            remedy=(
                "Do not use --reference sensor with this log"
                if name == "wrench"
                else "Do not rely on it"
            ),
        )
