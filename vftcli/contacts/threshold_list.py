"""A list of contacts where no free motion is known: a threshold, and a point force at the peak.

What a joint's torque may be without contact is taken from its drive's dry friction alone. The force
is the one at the point that fits best, or the flange's where no point does.
"""

import numpy as np

from vftcli.contacts.candidates import LEVEL, threshold_contacts
from vftcli.contacts.contact_list import Contact, ForceCourse
from vftcli.contacts.places import (
    MORE_THAN_A_FORCE,
    PointFit,
    arm_parts,
    link_jacobian,
    point_fits,
    those_that_fit,
)
from vftcli.contacts.rows import (
    NORMAL,
    Site,
    force_course,
    from_flange,
    sensor_force,
    vendor_force,
    with_drives,
)
from vftcli.contacts.untouched import MOVING, SETTLED, expected_torque, observed
from vftcli.repetition.free_run import ModelledRun
from vftcli.robots.kinematics import flange_jacobian
from vftcli.signals.arrays import Array
from vftcli.signals.series import median_step, runs_of
from vftcli.virtual_sensor.smoother.smoothing import DRIVES

HALF = 0.015
"""A peak's torque is the mean over so long before and after it. [s]"""

PRIOR = np.repeat([100.0, 10.0], 3)
"""Standard deviation that force and moment at the flange are given beforehand. [N, N·m]"""

SPLIT = 0.5
"""A contact is split where |F| falls below this share of the peaks on both sides."""

APART = 0.1
"""Shortest piece of a contact that is split. [s]"""


def flange_forces(J: Array, torque: Array, sd: Array) -> tuple[Array, Array]:
    """Wrench at the flange with its prior, and its covariance. (T, 6), (T, 6, 6)

    With the first three rows of a point's Jacobian alone: the force at that point.

    Args:
        J: Jacobian of the flange. (T, 6, n)
        torque: Joint torque. (T, n) [N·m]
        sd: Its standard deviation. (T, n) [N·m]
    """
    A = J.swapaxes(1, 2) / sd[:, :, None]
    covariance: Array = np.asarray(
        np.linalg.inv(A.swapaxes(1, 2) @ A + np.diag(1.0 / PRIOR[: J.shape[1]] ** 2)),
        dtype=np.float64,
    )
    values: Array = (covariance @ (A.swapaxes(1, 2) @ (torque / sd)[..., None]))[..., 0]
    return values, covariance


def threshold_rows(run: ModelledRun) -> tuple[Contact, ...]:
    """The contacts of a log of which nothing is known to be free."""
    t = run.recording.t
    torque, sd = observed(run), expected_torque(run, None)
    above = threshold_contacts(t, torque, sd) & (t >= t[0] + SETTLED)
    J = flange_jacobian(run.robot.loaded_chain, run.recording.q)
    least = max(round(APART / median_step(t)), 1)
    rows: list[Contact] = []
    best, _, told = axes_told(run)
    for start, stop in runs_of(above):
        span = slice(start, stop)
        size = np.linalg.norm(flange_forces(J[span], torque[span], sd[span])[0][:, :3], axis=1)
        for first, last in split_at_valleys(size, least, told):
            peak = start + first + int(np.argmax(size[first:last]))
            row = peak_row(run, (start + first, start + last), peak, torque, sd)
            # Less than is told along the best of axes is no contact, whatever joint shows it.
            if row.is_told and (row.peak_force is None or row.peak_force >= best):
                rows.append(row)
    return tuple(rows[i].numbered(i + 1) for i in range(len(rows)))


def split_at_valleys(size: Array, least: int, told: float) -> list[tuple[int, int]]:
    """Stretches between which |F| falls below `SPLIT` of the peaks on both sides.

    Deepest valleys first: what lies between two valleys is a stretch of its own only if it rises
    above both, and to a force that can be told, so that noise does not split a steady load.

    Args:
        size: |F| along a contact. (k,) [N]
        least: Fewest samples of a stretch.
        told: Least peak of a stretch. [N]
    """
    pieces, asked = [], [(0, len(size))]
    while asked:
        first, last = asked.pop()
        piece = size[first:last]
        before = np.maximum.accumulate(piece)
        after = np.maximum.accumulate(piece[::-1])[::-1]
        lower = np.minimum(before, after)
        depth = np.where(lower >= told, piece / np.maximum(lower, 1e-12), 1.0)
        depth = depth[least : len(piece) - least]
        if len(depth) and depth.min() < SPLIT:
            valley = first + least + int(np.argmin(depth))
            asked += [(valley, last), (first, valley)]
        else:
            pieces.append((first, last))
    return pieces


def peak_row(
    run: ModelledRun, span: tuple[int, int], peak: int, torque: Array, sd: Array
) -> Contact:
    """A contact's row, its numbers taken at the peak."""
    recording, chain = run.recording, run.robot.loaded_chain
    t, n = recording.t, run.robot.joints
    count = max(round(HALF / median_step(t)), 1)
    near = slice(max(peak - count, 0), peak + count + 1)
    tau, spread, q = torque[near].mean(axis=0), sd[peak], recording.q[peak]
    J = flange_jacobian(chain, q[None])
    values, covariance = (x[0] for x in flange_forces(J, tau[None], spread[None]))
    fits = those_that_fit(point_fits(chain, q, tau, spread))
    best = fits[0]
    site = Site(fits, arm_parts(n), J)
    if best.misfit > MORE_THAN_A_FORCE:
        covariance = covariance * best.misfit / max(n - 3, 1)
        wrench, size = values, float(np.linalg.norm(values[:3]))
        u = values[:3] / max(size, 1e-12)
        band = NORMAL * float(np.sqrt(u @ covariance[:3, :3] @ u))
    else:
        arm = from_flange(run, q, best)
        wrench, size, band = (
            np.concatenate([best.force, np.cross(arm, best.force)]),
            best.size,
            best.band,
        )
    band = float(np.hypot(band, NORMAL * DRIVES * size))
    inside = slice(*span)
    force = flange_forces(flange_jacobian(chain, recording.q[inside]), torque[inside], sd[inside])[
        0
    ][:, :3]
    parts, anywhere = site.parts, site.sizes(size, band)
    quiet = float(np.sum((tau / spread) ** 2))
    return Contact(
        number=0,
        start=float(t[span[0]]),
        stop=float(t[span[1] - 1]),
        peak=float(t[peak]),
        peak_force=size,
        peak_band=band,
        wrench=wrench,
        wrench_sd=np.sqrt(np.diag(covariance)),
        mean_force=force.mean(axis=0),
        impulse=np.asarray(np.trapezoid(force, t[inside], axis=0)),
        anywhere=anywhere,
        where=parts[0] if len(parts) == 1 else "cannot tell",
        lead=None,
        places=site.links(n),
        evidence=0.5 * (quiet - best.misfit),
        joint_torque=tau,
        joint_torque_sd=spread,
        at_rest=bool(np.all(np.abs(recording.require("dq")[peak]) < MOVING)),
        vendor_force=vendor_force(run, J[0], peak, t),
        sensor_force=sensor_force(run, float(t[peak])),
        course=course_at(run, inside, best, torque, sd),
        remarks=site.limits(size, anywhere),
    )


def course_at(
    run: ModelledRun, inside: slice, best: PointFit, torque: Array, sd: Array
) -> ForceCourse:
    """|F| over a contact, at the point that fits best, or at the flange where no point does."""
    t, q = run.recording.t[inside], run.recording.q[inside]
    chain, excess = run.robot.loaded_chain, 1.0
    if best.misfit > MORE_THAN_A_FORCE:
        J = flange_jacobian(chain, q)
        excess = best.misfit / max(run.robot.joints - 3, 1)
    else:
        J = link_jacobian(chain, q, best.link, best.share)[:, :3]
    values, covariance = flange_forces(J, torque[inside], sd[inside])
    force = values[:, :3]
    return force_course(t, force, with_drives(force, excess * covariance[:, :3, :3]))


def axes_told(run: ModelledRun) -> Array:
    """Median over the log of the force that is told along the best, middle and worst axis. (3,) [N]

    Along an axis the joint that feels it best decides: min over joints of 4 sd/|J|.
    """
    sd, J = expected_torque(run, None), flange_jacobian(run.robot.loaded_chain, run.recording.q)
    felt = np.maximum(np.abs(J[:, :3]), 1e-9)
    least = np.sort(np.min(LEVEL * sd[:, None, :] / felt, axis=2), axis=1)
    found: Array = np.median(least, axis=0)
    return found
