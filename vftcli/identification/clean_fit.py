"""Friction fitted on free motion: contacts left out, another robot doubted."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.identification.friction_fit import LIGHT, JointFit, all_residuals, fit_frictions
from vftcli.identification.links import residuals
from vftcli.identification.shapes import Shape
from vftcli.identification.training import ParameterColumns, PreparedLog, Training, apparent_load
from vftcli.robots.friction import SMOOTHING, dry_torque
from vftcli.signals.arrays import Array, Mask, covered, intervals, median_step, near
from vftcli.signals.errors import IdentificationError
from vftcli.signals.estimation import NormalEquations, folds, normal_equations, robust_sd
from vftcli.signals.remarks import Remark, Where, caution, fact, on_joints, warning
from vftcli.signals.rest import SLIDES, slower

TOUCH = 7.0  #: Residual of a contact, in robust SDs.
TOUCH_TIME = 0.15  #: Time it must last. [s]
TOUCH_MARGIN = 0.3  #: Time left out before and after. [s]
#: Least share of heavy joints' torque that the profile explains; .99 with the right robot.
WRONG = 0.95
LOAD_EXPLAINS = 0.8  #: Least share of the misfit that a load explains.
UNKNOWN_LOAD = 0.5  #: Smallest suspected load. [kg]
#: Least variation of a heavy joint's gravity torque, by the largest.
HEAVY = 0.1
#: Least ratio of the profile's rest to free links' for another arm: right links leave 1.0 to
#: 2.5 if friction or contact hide the torque, wrong ones 4 to 12.
OTHER_LINKS = 3.0
THIRDS = 3  #: Stretches of a log compared for a warm-up.
#: Least fall of dry friction from the first to the last stretch.
DRIFT = 0.05
LEAST = 0.1  #: Least such fall. [N·m]


class CleanFit(NamedTuple):
    """Friction fits of free motion."""

    data: Training  #: Training data, contacts at weight 0.
    fits: dict[int, JointFit]  #: Joint, from 0 → its fit; none at rest.
    remarks: list[Remark]  #: Contacts, drift and doubts.


def fit_without_contacts(data: Training, strict: bool) -> CleanFit:
    """Friction fitted twice, the second time without contacts."""
    fits, remarks = fit_frictions(data), list[Remark]()
    logs = list(data.logs)
    for k, (log, residual) in enumerate(zip(data.logs, all_residuals(data, fits), strict=True)):
        if contacts := find_contacts(log, residual, fitted_dry_friction(log, fits)):
            starts, stops, joints, sizes = map(np.array, zip(*contacts, strict=True))
            t = log.t[:, None]
            touched = (t > starts - TOUCH_MARGIN) & (t < stops + TOUCH_MARGIN)
            free = ~touched.any(axis=1, keepdims=True)
            logs[k] = replace(log, weights=log.weights * free)
            values = {
                "count": len(contacts),
                "total_s": np.sum(stops - starts),
                "starts_s": starts,
                "stops_s": stops,
                "worst_joints": joints,
                "residuals_Nm": sizes,
            }
            remarks.append(caution("suspected-contacts", Where(log.recording.name), **values))
    if remarks:
        data = data._replace(logs=tuple(logs))
        fits = fit_frictions(data)
    remarks += warm_up_remarks(data, fits)
    doubts = list(model_doubts(data, fits))
    # Torque that other links alone explain is refused.
    if strict and any(doubt.code == "unexplained-torque" for doubt in doubts):
        ratio = links_explain(data, fits).max(initial=0.0)
        if ratio > OTHER_LINKS:
            raise IdentificationError(
                f"{doubts[0]}. Choose another --robot, find the load with --method payload, or "
                "let --method base identify the links too"
            )
        # Links are not at fault for torque that no links explain.
        doubts = [doubt for doubt in doubts if doubt.code != "unexplained-torque"]
        doubts.append(caution("noisy-effort", ratio=ratio))
    for doubt in doubts:
        remarks.append(doubt)
        if not strict:
            remarks.append(fact("absorbed-doubt", Where(doubt.where.about)))
    return CleanFit(data, fits, remarks)


class ContactSpan(NamedTuple):
    """A stretch of probable contact."""

    start: float  #: First instant. [s]
    stop: float  #: Last instant. [s]
    joint: int  #: Joint of the largest residual, from 1.
    size: float  #: Its residual there. [N·m]


def find_contacts(motion: PreparedLog, residual: Array, dry: Array) -> list[ContactSpan]:
    """Stretches with a large residual (M, n), neighbours joined. [N·m]"""
    t, usable = motion.t, motion.weights > 0
    sd = np.array([robust_sd(r[u]) for r, u in zip(residual.T, usable.T, strict=True)])
    # The filter spreads an event at rest over a period of its cutoff.
    reach = max(1, round(1.0 / (motion.cutoff * median_step(t))))
    # Near a reversal a joint may stick: only torque above dry friction counts.
    excess = abs(residual) - abs(dry) * near(slower(motion.dq, SLIDES), reach)
    z = excess * usable / np.maximum(sd, 1e-9)
    touched = covered(intervals(t, z.max(axis=1) > TOUCH, least=TOUCH_TIME), len(t))
    z *= touched[:, None]
    found = list[ContactSpan]()
    for start, stop in intervals(t, touched, gap=2 * TOUCH_MARGIN):
        k, j = np.unravel_index(z[start:stop].argmax(), z[start:stop].shape)
        found.append(ContactSpan(t[start], t[stop - 1], int(j) + 1, residual[start + k, j]))
    return found


def fitted_dry_friction(log: PreparedLog, fits: Mapping[int, JointFit]) -> Array:
    """Dry friction of each joint by its fit, with load. (M, n) [N·m]"""
    load = log.load[log.kept]
    out = np.zeros(load.shape)
    for j, fit in fits.items():
        out[:, j] = dry_torque(fit.friction, load[:, j])
    return out


def links_explain(data: Training, fits: Mapping[int, JointFit]) -> Array:
    """Rest of the profile's links over free ones', heavy joints. (h,)"""
    joints = range(data.robot.joints)
    shapes = tuple(fits[j].shape if j in fits else Shape(()) for j in joints)
    layout = ParameterColumns(data.robot.chain, data.rotor, shapes)
    logs = [replace(log, weights=log.weights * data.moves) for log in data.logs]
    data = data._replace(logs=tuple(logs))
    before = weighted_rms(data, all_residuals(data, fits))
    parts = []
    for log in logs:
        for span in log.chunks():
            A = layout.rows(log, span).reshape(-1, layout.size)
            weights = (log.weights[span] / np.where(before > 0, before, 1.0) ** 2).ravel()
            parts.append(normal_equations(A, log.tau[span].ravel(), weights))
    x = NormalEquations(*(sum(sums) for sums in zip(*parts, strict=True))).solution()
    freed = weighted_rms(data, [residuals(layout, log, x) for log in logs])
    heavy = heavy_joints(data)
    return before[heavy] / np.maximum(freed[heavy], 1e-12)


def weighted_rms(data: Training, residual: Sequence[Array]) -> Array:
    """Weighted RMS of each joint over all logs. (n,) [N·m]"""
    weights = data.joined("weights")
    square = np.sum(weights * np.concatenate(residual) ** 2, axis=0)
    return np.asarray(np.sqrt(square / np.maximum(weights.sum(axis=0), 1e-12)))


def heavy_joints(data: Training) -> Mask:
    """Joints that move and carry the arm's weight. (n,)"""
    spread = data.joined("load").std(axis=0)
    return np.asarray((spread > HEAVY * spread.max()) & (spread > LIGHT) & data.moves)


def model_doubts(data: Training, fits: Mapping[int, JointFit]) -> Iterator[Remark]:
    """Remarks on torque that profile links and friction leave."""
    heavy, robot = np.flatnonzero(heavy_joints(data)), data.robot
    for log, residual in zip(data.logs, all_residuals(data, fits), strict=True):
        tau, name = log.tau, log.recording.name
        # A load first: Coulomb friction would absorb some of it.
        mass, explained = apparent_load(log, tau - log.predicted)
        if explained >= LOAD_EXPLAINS and abs(mass) >= UNKNOWN_LOAD:
            load = {"mass_kg": mass, "robot": robot.name, "share_percent": 100.0 * explained}
            yield warning("unknown-load", Where(name), **load)
        left = np.where(log.weights > 0, residual, 0.0)[:, heavy]
        shares = 1.0 - np.mean(left**2, axis=0) / np.maximum(tau[:, heavy].var(axis=0), 1e-12)
        if (worst := shares.min(initial=1.0)) < WRONG:
            where = on_joints([heavy[shares.argmin()]], name)
            share = 100.0 * max(worst, 0.0)
            yield warning("unexplained-torque", where, robot=robot.name, share_percent=share)


def warm_up_remarks(data: Training, fits: Mapping[int, JointFit]) -> Iterator[Remark]:
    """Remarks on logs in which dry friction falls from third to third."""
    dry = np.zeros(data.robot.joints)
    dry[[*fits]] = [dry_torque(fit.friction) for fit in fits.values()]
    for log, residual in zip(data.logs, all_residuals(data, fits), strict=True):
        sign, parts = np.tanh(log.dq / SMOOTHING) * log.weights, folds(log.samples, THIRDS)
        both = (sign * residual, abs(sign))
        pushes, sizes = (np.array([x[part].sum(axis=0) for part in parts]) for x in both)
        more = pushes / np.maximum(sizes, 1e-9)
        fall = more[0] - more[-1]
        falls = np.all(np.diff(more, axis=0) < 0.0, axis=0) & data.moves
        joints = np.flatnonzero(falls & (fall > np.maximum(DRIFT * dry, LEAST)))
        if joints.size:
            where, (first, *_, last) = on_joints(joints, log.recording.name), more[:, joints]
            yield caution("warm-up", where, first_Nm=first, last_Nm=last)
