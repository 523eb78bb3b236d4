"""Friction fitted on free motion alone: contacts left out, and a robot that is another doubted."""

from collections.abc import Sequence

import numpy as np

from vftcli.identification.excitation import (
    ContactSpan,
    find_contacts,
    outside_contacts,
    unexplained_torque,
)
from vftcli.identification.friction_fit import LIGHT
from vftcli.identification.friction_shapes import Shape
from vftcli.identification.processing import PreparedLog
from vftcli.identification.scoring import apparent_load, predicted_torque
from vftcli.identification.stacking import ParameterColumns, WeightedLog, residuals
from vftcli.identification.training import JointFit, Training, all_residuals, fit_frictions
from vftcli.identification.warm_up import warm_up_remarks
from vftcli.robots.friction import dry_torque
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import IdentificationError
from vftcli.signals.least_squares import NormalEquations, normal_equations
from vftcli.signals.remarks import Remark, Where, caution, fact, warning

LOAD_EXPLAINS = 0.8  #: Share of what the profile misses that a load must explain to be suspected.
UNKNOWN_LOAD = 0.5  #: Smallest load that is suspected. [kg]
#: A joint carries the arm's weight if its gravity torque varies by this share of the largest.
HEAVY = 0.1
#: Times what free links leave from which on the profile's links are another arm's: of right ones
#: 1.0 to 2.5 where friction or contact hide the torque, of wrong ones 4 to 12.
OTHER_LINKS = 3.0
#: The fits, the weights of every sample (M, n) a log, and remarks.
CleanFit = tuple[list[JointFit | None], list[Array], list[Remark]]


def fit_without_contacts(data: Training, strict: bool) -> CleanFit:
    """Fit friction, leave out contacts, and fit again without them.

    Returns:
        The fits, the weights of every sample (M, n) a log, and remarks.
    """
    weights = [m.usable.astype(float) for m in data.motions]
    fits = fit_frictions(data, weights)
    left, remarks = all_residuals(data, fits), list[Remark]()
    for k, (motion, residual) in enumerate(zip(data.motions, left, strict=True)):
        if found := find_contacts(motion, residual, fitted_dry_friction(data, k, fits)):
            weights[k] = weights[k] * outside_contacts(motion, found)[:, None]
            remarks.append(contacts_remark(motion, found))
    if remarks:
        fits = fit_frictions(data, weights)
        left = all_residuals(data, fits)
    remarks += warm_up_remarks(data, left, weights, fits)
    doubts = model_doubts(data, left, weights)
    if strict and any(doubt.code == "unexplained-torque" for doubt in doubts):
        shares = links_explain(data, fits, left, weights)
        if np.max(shares, initial=0.0) > OTHER_LINKS:
            raise IdentificationError(
                f"{doubts[0]}. Choose another --robot, find the load with --find-payload, or let "
                "--method base identify the links too"
            )
        # What other links would not explain either is not the links' fault.
        doubts = [doubt for doubt in doubts if doubt.code != "unexplained-torque"]
        doubts.append(caution("noisy-effort", ratio=float(np.max(shares, initial=0.0))))
    for doubt in doubts:
        remarks.append(doubt)
        if not strict:
            remarks.append(fact("absorbed-doubt", Where(doubt.where.about)))
    return fits, weights, remarks


def links_explain(
    data: Training,
    fits: Sequence[JointFit | None],
    left: Sequence[Array],
    weights: Sequence[Array],
) -> Array:
    """How much less free links leave than the profile's do, in joints that carry weight. (h,) [1]

    All inertial parameters are let go, be they physical or not, the structure of the friction
    held: what they leave is what no links explain, the noise of this log.

    Args:
        data: The training logs.
        fits: The friction fits.
        left: What they leave of each log with the profile's links. (M, n) each [N·m]
        weights: Weight of every sample. (M, n) each
    """
    moves = data.excited.moves
    shapes = tuple(Shape(()) if fit is None else fit.shape for fit in fits)
    layout = ParameterColumns(data.robot.chain, data.rotor, shapes)
    used = [w * moves for w in weights]
    before = weighted_rms(left, used)
    parts = []
    for motion, columns, w in zip(data.motions, data.columns, used, strict=True):
        for span in motion.chunks():
            A = layout.rows(motion, columns, span).reshape(-1, layout.size)
            rest = (w[span] / np.where(before > 0, before, 1.0) ** 2).ravel()
            parts.append(normal_equations(A, motion.tau[span].ravel(), rest))
    x = NormalEquations(*(sum(sums) for sums in zip(*parts, strict=True))).solution()
    freed = [
        residuals(layout, WeightedLog(motion, columns, w), x)
        for motion, columns, w in zip(data.motions, data.columns, used, strict=True)
    ]
    heavy = heavy_joints(data)
    share: Array = before[heavy] / np.maximum(weighted_rms(freed, used)[heavy], 1e-12)
    return share


def weighted_rms(residual: Sequence[Array], weights: Sequence[Array]) -> Array:
    """Root of the weighted mean square of each joint over all logs; 0 of no weight. (n,) [N·m]"""
    square = sum(np.sum(w * r**2, axis=0) for r, w in zip(residual, weights, strict=True))
    total = sum(np.sum(w, axis=0) for w in weights)
    value: Array = np.sqrt(square / np.maximum(total, 1e-12))
    return value


def heavy_joints(data: Training) -> Mask:
    """Joints that move and carry the arm's weight. (n,)"""
    spread = np.std(np.concatenate([c.load for c in data.columns]), axis=0)
    heavy: Mask = (spread > HEAVY * spread.max()) & (spread > LIGHT) & data.excited.moves
    return heavy


def contacts_remark(motion: PreparedLog, found: Sequence[ContactSpan]) -> Remark:
    """A remark on the stretches of a log that are left out of the fit."""
    return caution(
        "suspected-contacts",
        Where(motion.recording.name),
        count=len(found),
        total_s=sum(c.stop - c.start for c in found),
        starts_s=[c.start for c in found],
        stops_s=[c.stop for c in found],
        worst_joints=[c.joint for c in found],
        residuals_Nm=[c.size for c in found],
    )


def model_doubts(data: Training, left: Sequence[Array], weights: Sequence[Array]) -> list[Remark]:
    """Remarks on logs whose torque the profile's links do not explain.

    Args:
        data: The training logs.
        left: What the friction fits leave of each log. (M, n) each [N·m]
        weights: Weight of every sample, 0 where it tells nothing. (M, n) each
    """
    heavy, doubts = heavy_joints(data), list[Remark]()
    for motion, residual, w in zip(data.motions, left, weights, strict=True):
        used, name = np.where(w > 0, residual, 0.0), motion.recording.name
        # A load is looked for in what the profile leaves before friction is fitted: Coulomb
        # friction would take some of it up.
        before = motion.tau - predicted_torque(data.robot, motion)
        mass, explained = apparent_load(data.robot, motion, before)
        if explained >= LOAD_EXPLAINS and abs(mass) >= UNKNOWN_LOAD:
            load = {"mass_kg": mass, "robot": data.robot.name, "share_percent": 100.0 * explained}
            doubts.append(warning("unknown-load", Where(name), **load))
        if remark := unexplained_torque(name, data.robot.name, motion.tau, used, heavy):
            doubts.append(remark)
    return doubts


def fitted_dry_friction(data: Training, log: int, fits: Sequence[JointFit | None]) -> Array:
    """Dry friction of each joint along a log by its fit, load included. (M, n) [N·m]"""
    motion, load = data.motions[log], data.columns[log].load
    out = np.zeros(motion.q.shape)
    for j, fit in enumerate(fits):
        if fit is not None:
            out[:, j] = dry_torque(fit.friction, load[motion.kept, j])
    return out
