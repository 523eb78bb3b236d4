"""From what was found to the rows of the list: peak, band, place, torques, and what others say."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.contacts.contact_list import Contact, ForceCourse
from vftcli.contacts.model_error import UNKNOWN, ErrorCourse, error_course
from vftcli.contacts.places import (
    MORE_THAN_A_FORCE,
    ArmPart,
    PointFit,
    arm_parts,
    link_jacobian,
    point_fits,
    those_that_fit,
)
from vftcli.contacts.search import Found
from vftcli.contacts.sizes import learn_prior, smooth_contacts
from vftcli.contacts.untouched import Untouched, self_test
from vftcli.contacts.windows import BlockLog, ContactPrior, WindowWrench, gate_of
from vftcli.repetition.free_run import ModelledRun
from vftcli.robots.kinematics import link_poses
from vftcli.signals.arrays import Array, Mask
from vftcli.virtual_sensor.smoother.noise import resting

WIDENED = np.repeat([1.3, 2.0], 3)
"""What the model's own standard deviations of force and moment are multiplied by: the error of the
friction is not Gaussian. Chosen on simulated seeds together, for all logs."""

LOOSER = 1.5
"""What the force's own standard deviation is multiplied by where its size is told: peaks are larger
than the mean that it was learned from, and would be drawn to zero."""

DRIVES = 0.03
"""Share of a reading that the drives' constants may be off by."""

NORMAL = 1.96
"""Half width of a 95 % band in standard deviations."""

CORE, CORE_TIME = 0.5, 0.1
"""A contact's place is told from the blocks in which its force is above this share of the peak,
within so long [s] of it."""

POINT_MOMENT = 1e-3
"""Standard deviation of the moment about the point of a point force. [N·m]"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurer:
    """Measures the contacts of one log.

    Attributes:
        run: The log with its robot's model.
        found: The contacts that were kept.
        log: The log in blocks; joints at rest may settle anew under a contact.
        prior: How the wrench of the contacts moves.
        widening: Factor on each axis' standard deviation. (6,)
        smallest_force: The smallest force that this log can tell. [N]
        quiet: What the model errs by, bridged across the contacts.
    """

    run: ModelledRun
    found: Found
    log: BlockLog
    prior: ContactPrior
    widening: Array
    smallest_force: float
    quiet: "QuietError"

    @classmethod
    def of(cls, run: ModelledRun, found: Found, free: Untouched) -> "Measurer":
        """Learn what the contacts' wrench is like, and how well free motion lets it be told."""
        blocks, J = found.log.blocks, found.places[0].jacobian
        gate = gate_of(len(blocks.t), found.runs)
        course = error_course(free.noise, blocks, gate)._replace(white=found.log.course.white)
        log = BlockLog.of(blocks, course)
        prior = found.prior
        if found.runs:
            prior = learn_prior(log, J, found.runs, prior, rounds=2)
        test = self_test(free, run.robot, prior)
        return cls(
            run=run,
            found=found,
            log=log,
            prior=prior,
            widening=WIDENED * test.widening,
            smallest_force=test.smallest_force,
            quiet=QuietError.across(blocks.d, course, gate[:, None]),
        )

    def rows(self) -> tuple[Contact, ...]:
        """The contacts, in the order of time, numbered."""
        runs, J = self.found.runs, self.found.places[0].jacobian
        prior = self.prior._replace(force=LOOSER * self.prior.force)
        courses = smooth_contacts(self.log, [J] * len(runs), runs, prior)
        sites = [self.site(i, course) for i, course in enumerate(courses)]
        moved = [i for i, site in enumerate(sites) if not site.on_wrist]
        point = prior._replace(moment=POINT_MOMENT)
        jacobians = [self.point_jacobian(sites[i].fits[0]) for i in moved]
        if moved:
            some = self.found.kept(moved)
            again = smooth_contacts(self.log, jacobians, some.runs, point)
            for i, jacobian, course in zip(moved, jacobians, again, strict=True):
                courses[i] = course
                sites[i] = sites[i]._replace(jacobian=jacobian)
        return tuple(self.row(i, courses[i], sites[i]) for i in range(len(runs)))

    def point_jacobian(self, fit: PointFit) -> Array:
        """J of a fitted point along the log. (K, 6, n)"""
        return link_jacobian(self.run.robot.loaded_chain, self.log.blocks.q, fit.link, fit.share)

    def site(self, number: int, course: WindowWrench) -> "Site":
        """Where a contact is, from the torque that is left of the disturbance."""
        run, blocks = self.found.runs[number], self.log.blocks
        inside = course.within(run)
        peak = run[0] + int(np.argmax(inside.size))
        core = np.arange(*run)[inside.size >= CORE * inside.size.max()]
        core = core[np.abs(blocks.t[core] - blocks.t[peak]) <= CORE_TIME]
        core = core[blocks.known[core]] if blocks.known[core].any() else core
        torque = (blocks.d[core] - self.quiet.mean[core]).mean(axis=0)
        variance = self.quiet.variance[core].mean(axis=0)
        sd = np.sqrt(variance + self.log.course.white[core].mean(axis=0) / len(core))
        chain = self.run.robot.loaded_chain
        fits = those_that_fit(point_fits(chain, blocks.q[peak], torque, sd))
        jacobian = self.found.places[0].jacobian
        return Site(fits, arm_parts(chain.joints), jacobian)

    def row(self, number: int, course: WindowWrench, site: "Site") -> Contact:
        """One row of the list."""
        run, blocks = self.found.runs[number], self.log.blocks
        inside = course.within(run)
        k = int(np.argmax(inside.size))
        peak = run[0] + k
        values, covariance = inside.values[k], inside.covariance[k]
        covariance = covariance * np.outer(self.widening, self.widening)
        size, length = float(inside.size[k]), blocks.length[slice(*run)]
        u = values[:3] / max(size, 1e-12)
        band = NORMAL * float(np.hypot(np.sqrt(u @ covariance[:3, :3] @ u), DRIVES * size))
        sd = np.sqrt(np.diag(covariance) + (DRIVES * values) ** 2)
        J = site.jacobian[peak]
        torque_sd = np.sqrt(np.einsum("in,ij,jn->n", J, covariance, J))
        wrench = values.copy()
        if site.jacobian is not self.found.places[0].jacobian:
            wrench[3:] += np.cross(from_flange(self.run, blocks.q[peak], site.fits[0]), values[:3])
        where, lead = self.part(number, site)
        force = inside.values[:, :3]
        return Contact(
            number=number + 1,
            start=float(blocks.t[run[0]] - 0.5 * length[0]),
            stop=float(blocks.t[run[1] - 1] + 0.5 * length[-1]),
            peak=float(blocks.t[peak]),
            peak_force=size,
            peak_band=band,
            wrench=wrench,
            wrench_sd=sd,
            mean_force=np.average(force, axis=0, weights=length),
            impulse=length @ force,
            anywhere=site.sizes(size, band),
            where=where,
            lead=lead,
            places=site.links(self.run.robot.joints),
            evidence=float(self.found.best[number]),
            joint_torque=J.T @ values,
            joint_torque_sd=torque_sd,
            at_rest=bool(resting(blocks)[peak].all()),
            vendor_force=vendor_force(
                self.run, self.found.places[0].jacobian[peak], peak, blocks.t
            ),
            sensor_force=sensor_force(self.run, float(blocks.t[peak])),
            course=force_course(
                blocks.t[slice(*run)],
                force,
                inside.covariance[:, :3, :3] * np.outer(self.widening[:3], self.widening[:3]),
            ),
        )

    def part(self, number: int, site: "Site") -> tuple[ArmPart, float]:
        """The part of the arm that alone fits, and by how much its evidence leads."""
        parts = arm_parts(self.run.robot.joints)
        best: dict[ArmPart, float] = {}
        for place, nats in zip(self.found.places, self.found.evidence[number], strict=True):
            part = parts[place.link]
            best[part] = max(best.get(part, -np.inf), float(nats))
        fitting = site.parts
        where: ArmPart = fitting[0] if len(fitting) == 1 else "cannot tell"
        named = where if where in best else max(best, key=lambda part: best[part])
        return where, best[named] - max(v for part, v in best.items() if part != named)


class Site(NamedTuple):
    """Where a contact is, as far as it can be told.

    Attributes:
        fits: Points that fit, the best first.
        names: Link → part of the arm.
        jacobian: J of the point whose wrench is measured, along the log. (K, 6, n)
    """

    fits: list[PointFit]
    names: dict[int, ArmPart]
    jacobian: Array

    @property
    def parts(self) -> list[ArmPart]:
        """Parts of the arm that fit."""
        return list(dict.fromkeys(self.names[fit.link] for fit in self.fits))

    @property
    def on_wrist(self) -> bool:
        """Whether a wrench at the flange explains it: at the wrist, or more than a point force."""
        return "wrist" in self.parts or self.fits[0].misfit > MORE_THAN_A_FORCE

    def links(self, joints: int) -> tuple[int, ...]:
        """Links that fit, 0 for the flange."""
        found = {0 if fit.link == joints and fit.share > 0.99 else fit.link for fit in self.fits}
        return tuple(sorted(found))

    def sizes(self, size: float, band: float) -> tuple[float, float]:
        """Smallest and largest |F| over the places that fit, bands included. [N]"""
        spans = [(size, band), *((fit.size, fit.band) for fit in self.fits)]
        low, high = min(s - b for s, b in spans), max(s + b for s, b in spans)
        return max(low, 0.0), high


class QuietError(NamedTuple):
    """The model error b as the blocks outside of contacts tell it, bridged across these.

    Attributes:
        mean: (K, n) [N·m]
        variance: (K, n) [(N·m)²]
    """

    mean: Array
    variance: Array

    @classmethod
    def across(cls, d: Array, course: ErrorCourse, hidden: Mask) -> "QuietError":
        """Filter and smooth b alone, without the hidden blocks.

        Args:
            d: Mean disturbance. (K, n) [N·m]
            course: How b goes.
            hidden: Blocks that say nothing. (K, 1)
        """
        white = np.where(hidden, UNKNOWN, course.white)
        b, P, ahead = np.empty_like(d), np.empty_like(d), np.empty_like(d)
        x, p = np.zeros(d.shape[1]), np.zeros(d.shape[1])
        for k in range(len(d)):
            f = course.decay[k]
            x, p = f * x, f * f * p + course.added[k]
            ahead[k] = p
            gain = p / (p + white[k])
            x, p = x + gain * (d[k] - x), p * (1.0 - gain)
            b[k], P[k] = x, p
        for k in range(len(d) - 2, -1, -1):
            f = course.decay[k + 1]
            C = P[k] * f / ahead[k + 1]
            b[k] += C * (b[k + 1] - f * b[k])
            P[k] += C * C * (P[k + 1] - ahead[k + 1])
        return cls(b, P)


def force_course(t: Array, force: Array, covariance: Array) -> ForceCourse:
    """|F| over a contact with its band: along the force itself, the drives' share added.

    Args:
        t: Time. (K,) [s]
        force: (K, 3) [N]
        covariance: (K, 3, 3) [N²]
    """
    size: Array = np.linalg.norm(force, axis=1)
    u = force / np.maximum(size, 1e-12)[:, None]
    variance = np.einsum("ki,kij,kj->k", u, covariance, u)
    return ForceCourse(t, size, NORMAL * np.hypot(np.sqrt(variance), DRIVES * size))


def from_flange(run: ModelledRun, q: Array, fit: PointFit) -> Array:
    """A fitted point's position from the flange point, in base axes. (3,) [m]

    Args:
        run: The log with its robot.
        q: Joint positions. (n,) [rad]
        fit: The point.
    """
    frames = link_poses(run.robot.loaded_chain, q[None]).translation[0]
    start, end = frames[fit.link - 1], frames[fit.link]
    offset: Array = start + fit.share * (end - start) - frames[-1]
    return offset


def vendor_force(run: ModelledRun, J: Array, peak: int, t: Array) -> float | None:
    """|F| at the flange of the log's own torque estimate at the peak, None without one. [N]"""
    own = run.recording.tau_ext
    if own is None or J.shape[1] < 6:
        return None
    torque = np.array([np.interp(t[peak], run.recording.t, column) for column in own.T])
    found = float(np.linalg.norm(np.linalg.lstsq(J.T, torque, rcond=None)[0][:3]))
    return found if np.isfinite(found) else None


def sensor_force(run: ModelledRun, at: float) -> float | None:
    """|F| of the log's own wrench at a time, None without one. [N]"""
    own = run.recording.wrench
    if own is None:
        return None
    force = [np.interp(at, run.recording.t, column) for column in own[:, :3].T]
    found = float(np.linalg.norm(force))
    return found if np.isfinite(found) else None
