"""From what was found to the rows of the list: peak, band, place, torques, and what others say."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vftcli.contacts.contact_list import SURE_NATS, WIDE, Contact, ForceCourse
from vftcli.contacts.places import (
    MORE_THAN_A_FORCE,
    ArmPart,
    PointFit,
    arm_parts,
    from_flange,
    link_jacobian,
    point_fits,
    those_that_fit,
)
from vftcli.contacts.search import Found
from vftcli.contacts.sizes import learn_prior, smooth_contacts
from vftcli.contacts.untouched import SelfTest, Untouched, self_test
from vftcli.contacts.windows import BlockLog, WindowWrench
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.linear_model import smoothed
from vftcli.signals.remarks import Remark, caution
from vftcli.signals.series import covered, median_step
from vftcli.virtual_sensor.model_error import UNKNOWN, ErrorProcess, error_model, error_process
from vftcli.virtual_sensor.smoother import BENT, WrenchPrior, hidden_by_blocks

#: What the model's own standard deviations of force and moment are multiplied by: the error of the
#: friction is not Gaussian. Chosen on simulated seeds together, for all logs.
WIDENED = np.repeat([1.3, 2.0], 3)
BESIDE = 0.1  #: A cut this near to a row may have removed a part of it. [s]
#: What the force's own standard deviation is multiplied by where its size is told: peaks are larger
#: than the mean that it was learned from, and would be drawn to zero.
LOOSER = 1.5
#: Share of its bend that the peak of a contact may hide that is short for the prior of them all.
BENT_SHORT = 0.4
NORMAL = 1.96  #: Half width of a 95 % band in standard deviations.
#: A contact's wrench changes within this share of its duration, however slow the others are.
OWN_TIME = 0.5
#: The peak of a contact shorter than this [s] is cut by a log of fewer samples a second [Hz]: a
#: tap's force lasts some 50 ms.
SHORT, SLOW = 0.25, 95.0
#: A contact's place is told from the blocks in which its force is above this share of the peak,
#: within so long [s] of it.
CORE, CORE_TIME = 0.5, 0.1
POINT_MOMENT = 1e-3  #: Standard deviation of the moment about the point of a point force. [N·m]


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurer:
    """Measures the contacts of one log."""

    run: Run  #: The log with its robot's model.
    found: Found  #: The contacts that were kept.
    log: BlockLog  #: The log in blocks; joints at rest may settle anew under a contact.
    prior: WrenchPrior  #: How the wrench of the contacts moves.
    test: SelfTest  #: How well free motion lets a wrench be told.
    #: Mean and variance of what the model errs by, bridged across the contacts. (K, n) [N·m], (K,
    #: n) [(N·m)²]
    quiet: tuple[Array, Array]
    bent: float = BENT  #: Share of a peak's bend that may be hidden.

    @classmethod
    def of(
        cls, run: Run, found: Found, free: Untouched, like: "Measurer | None" = None
    ) -> "Measurer":
        """Learn what the contacts' wrench is like, and how well free motion lets it be told."""
        blocks, J = found.log.blocks, found.places[0].jacobian
        gate = covered(found.runs, len(blocks.t), 1)
        course = error_process(free.noise, blocks, gate)._replace(white=found.log.course.white)
        log = BlockLog.of(blocks, course)
        bent = BENT
        if like is not None:
            prior, test, bent = like.prior, like.test, BENT_SHORT
        else:
            prior = found.prior
            if found.runs:
                prior = learn_prior(log, J, found.runs, prior, rounds=2)
            test = self_test(free, run.robot, prior)
        return cls(
            run=run,
            found=found,
            log=log,
            prior=prior,
            test=test,
            quiet=quiet_error(blocks.d, course, gate),
            bent=bent,
        )

    @cached_property
    def priors(self) -> list[WrenchPrior]:
        """How the wrench of every contact may move: one that is short moves faster."""
        blocks, own = self.found.log.blocks, loosened(self.prior)
        lasts = [float(blocks.length[slice(*run)].sum()) for run in self.found.runs]
        return [own._replace(time=min(own.time, OWN_TIME * seconds)) for seconds in lasts]

    @cached_property
    def courses(self) -> list[WindowWrench]:
        """The wrench of every contact at the flange."""
        runs, J = self.found.runs, self.found.places[0].jacobian
        return smooth_contacts(self.log, [J] * len(runs), runs, self.priors)

    @cached_property
    def sites(self) -> list["Site"]:
        """Where every contact is."""
        return [self.site(i, course) for i, course in enumerate(self.courses)]

    def rows(self, sites: Sequence["Site"] | None = None) -> tuple[Contact, ...]:
        """The contacts, in the order of time, numbered."""
        runs, priors = self.found.runs, self.priors
        courses, J = list(self.courses), self.found.places[0].jacobian
        sites = [site._replace(jacobian=J) for site in (self.sites if sites is None else sites)]
        moved = [i for i, site in enumerate(sites) if not site.on_wrist]
        points = [priors[i]._replace(moment=POINT_MOMENT) for i in moved]
        chain, q = self.run.robot.loaded_chain, self.log.blocks.q
        fits = [sites[i].fits[0] for i in moved]
        jacobians = [link_jacobian(chain, q, fit.link, fit.share) for fit in fits]
        if moved:
            some = self.found.kept(moved)
            again = smooth_contacts(self.log, jacobians, some.runs, points)
            for i, jacobian, course in zip(moved, jacobians, again, strict=True):
                courses[i] = course
                sites[i] = sites[i]._replace(jacobian=jacobian)
        return tuple(self.row(i, courses[i], sites[i]) for i in range(len(runs)))

    def site(self, number: int, course: WindowWrench) -> "Site":
        """Where a contact is, from the torque that is left of the disturbance."""
        run, blocks = self.found.runs[number], self.log.blocks
        inside = course.within(run)
        peak = run[0] + int(np.argmax(inside.size))
        core = np.arange(*run)[inside.size >= CORE * inside.size.max()]
        core = core[np.abs(blocks.t[core] - blocks.t[peak]) <= CORE_TIME]
        core = core[blocks.known[core]] if blocks.known[core].any() else core
        mean, variance = (series[core] for series in self.quiet)
        torque = (blocks.d[core] - mean).mean(axis=0)
        sd = np.sqrt(variance.mean(axis=0) + self.log.course.white[core].mean(axis=0) / len(core))
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
        values, factor = inside.values[k], WIDENED * self.test.widening
        # What the drives' constants and the blocks' length may hide, as in the wrench of `best`.
        hidden = hidden_by_blocks(course.values, self.bent)
        hidden = hidden[run[0] - course.first : run[1] - course.first]
        covariances = inside.covariance * np.outer(factor, factor) + hidden
        covariance = covariances[k]
        size, length = float(inside.size[k]), blocks.length[slice(*run)]
        u = values[:3] / max(size, 1e-12)
        where, named, lead = self.part(number, site)
        band = NORMAL * float(np.sqrt(u @ covariance[:3, :3] @ u))
        anywhere = site.sizes(size, band)
        on_wrist = named == "wrist" and lead >= SURE_NATS
        remarks = () if on_wrist else site.limits(size, anywhere)
        spread = 0.0 if on_wrist else site.spread(size)
        rate = 1.0 / median_step(self.run.t)
        if length.sum() < SHORT and rate < SLOW:
            remarks = (*remarks, caution("peak-cut-by-rate", rate_hz=rate))
        start = float(blocks.t[run[0]] - 0.5 * blocks.length[run[0]])
        stop = float(blocks.t[run[1] - 1] + 0.5 * blocks.length[run[1] - 1])
        for cut in self.run.recording.source.cuts_between(start - BESIDE, stop + BESIDE)[:1]:
            remarks = (*remarks, caution("samples-cut-inside", at_s=cut.start))
        sd = np.sqrt(np.diag(covariance))
        J = site.jacobian[peak]
        torque_sd = np.sqrt(np.einsum("in,ij,jn->n", J, covariance, J))
        wrench = values.copy()
        if site.jacobian is not self.found.places[0].jacobian:
            wrench[3:] += np.cross(
                from_flange(self.run.robot.loaded_chain, blocks.q[peak], site.fits[0]), values[:3]
            )
        force = inside.values[:, :3]
        return Contact(
            number=number + 1,
            start=start,
            stop=stop,
            peak=float(blocks.t[peak]),
            peak_force=size,
            peak_band=float(np.hypot(band, NORMAL * spread)),
            place_band=band,
            wrench=wrench,
            wrench_sd=sd,
            mean_force=np.average(force, axis=0, weights=length),
            impulse=length @ force,
            anywhere=anywhere,
            where=where,
            lead=lead,
            places=site.links(self.run.robot.joints),
            evidence=float(self.found.best[number]),
            joint_torque=J.T @ values,
            joint_torque_sd=torque_sd,
            at_rest=bool(blocks.rests[peak].all()),
            vendor_force=vendor_force(
                self.run, self.found.places[0].jacobian[peak], peak, blocks.t
            ),
            sensor_force=sensor_force(self.run, float(blocks.t[peak])),
            course=force_course(blocks.t[slice(*run)], force, covariances[:, :3, :3]),
            remarks=remarks,
        )

    def part(self, number: int, site: "Site") -> tuple[ArmPart, ArmPart, float]:
        """The part of the arm that alone fits, the one that leads, and by how much evidence."""
        parts = arm_parts(self.run.robot.joints)
        best: dict[ArmPart, float] = {}
        for place, nats in zip(self.found.places, self.found.evidence[number], strict=True):
            part = parts[place.link]
            best[part] = max(best.get(part, -np.inf), float(nats))
        fitting = site.parts
        where: ArmPart = fitting[0] if len(fitting) == 1 else "cannot tell"
        named = where if where in best else max(best, key=lambda part: best[part])
        return where, named, best[named] - max(v for part, v in best.items() if part != named)


def loosened(prior: WrenchPrior) -> WrenchPrior:
    """The prior under which the size of a contact is told."""
    return prior._replace(force=LOOSER * prior.force)


class Site(NamedTuple):
    """Where a contact is, as far as it can be told."""

    fits: list[PointFit]  #: Points that fit, the best first.
    names: dict[int, ArmPart]  #: Link → part of the arm.
    jacobian: Array  #: J of the point whose wrench is measured, along the log. (K, 6, n)

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

    def spread(self, size: float) -> float:
        """What the size may be off by for the place, 0 of a contact at the wrist alone. [N]

        The root mean square over the points that fit, each as likely as its score makes it.
        """
        if self.parts == ["wrist"] or self.fits[0].misfit > MORE_THAN_A_FORCE:
            return 0.0
        likely = np.exp(-0.5 * np.array([fit.score - self.fits[0].score for fit in self.fits]))
        apart = np.array([fit.size for fit in self.fits]) - size
        return float(np.sqrt(likely @ apart**2 / likely.sum()))

    def limits(self, size: float, anywhere: tuple[float, float]) -> tuple[Remark, ...]:
        """Where another part may have been touched, another force touched it: a remark if so."""
        if len(self.parts) == 1 or NORMAL * self.spread(size) <= WIDE * size:
            return ()
        return (caution("size-goes-with-place", least_N=anywhere[0], most_N=anywhere[1]),)

    def sizes(self, size: float, band: float) -> tuple[float, float]:
        """Smallest and largest |F| over the places that fit, bands included. [N]"""
        spans = [(size, band), *((fit.size, fit.band) for fit in self.fits)]
        low, high = min(s - b for s, b in spans), max(s + b for s, b in spans)
        return max(low, 0.0), high


def quiet_error(d: Array, course: ErrorProcess, hidden: Mask) -> tuple[Array, Array]:
    """Mean and variance of the model error b from the blocks outside of contacts. (K, n) each

    Args:
        d: Mean disturbance. (K, n) [N·m]
        course: How b goes.
        hidden: Blocks that say nothing. (K,)
    """
    known = course._replace(white=np.where(hidden[:, None], UNKNOWN, course.white))
    mean, covariance = smoothed(error_model(d, known))
    return mean[..., 0], covariance[..., 0, 0]


def force_course(t: Array, force: Array, covariance: Array) -> ForceCourse:
    """|F| over a contact with its band, along the force itself.

    Args:
        t: Time. (K,) [s]
        force: (K, 3) [N]
        covariance: (K, 3, 3) [N²]
    """
    size: Array = np.linalg.norm(force, axis=1)
    u = force / np.maximum(size, 1e-12)[:, None]
    variance = np.einsum("ki,kij,kj->k", u, covariance, u)
    return ForceCourse(t, size, NORMAL * np.sqrt(variance))


def vendor_force(run: Run, J: Array, peak: int, t: Array) -> float | None:
    """|F| at the flange of the log's own torque estimate at the peak, None without one. [N]"""
    own = run.recording.tau_ext
    if own is None or J.shape[1] < 6:
        return None
    torque = np.array([np.interp(t[peak], run.t, column) for column in own.T])
    found = float(np.linalg.norm(np.linalg.lstsq(J.T, torque, rcond=None)[0][:3]))
    return found if np.isfinite(found) else None


def sensor_force(run: Run, at: float) -> float | None:
    """|F| of the log's own wrench at a time, None without one or where it is all zeros. [N]"""
    own = run.recording.wrench
    if own is None or not own.any():
        return None
    force = [np.interp(at, run.t, column) for column in own[:, :3].T]
    found = float(np.linalg.norm(force))
    return found if np.isfinite(found) else None
