"""From candidates to rows of the list: peak, band, place, torques."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vftcli.contacts.contact_list import SURE_NATS, WIDE, Contact, ForceCourse
from vftcli.contacts.free_statistics import FreeStatistics, self_test
from vftcli.contacts.search import Candidates
from vftcli.contacts.windows import (
    LEAST_IN_MOTION,
    MORE_THAN_A_FORCE,
    ArmPart,
    PointFit,
    WindowWrench,
    arm_parts,
    contact_lanes,
    jacobian_of,
    learn_prior,
    point_fits,
    quiet_error,
    smooth_lanes,
    times_of,
)
from vftcli.robots.chain import link_poses, points_on
from vftcli.robots.run import Run
from vftcli.signals.arrays import Z_95, Array, covered, resample_columns
from vftcli.signals.remarks import Remark, caution
from vftcli.wrench.model_error import error_process
from vftcli.wrench.smoother import BENT, BlockLog, JacobianIn, WrenchPrior, hidden_by_blocks

#: Factors on SDs of force and moment, by simulation: friction is not Gaussian.
WIDENED = np.repeat([1.3, 2.0], 3)
BESIDE = 0.1  #: A cut this near may have removed a part of a row. [s]
#: Share of its bend that a short contact's peak may hide.
BENT_SHORT = 0.4
#: Least correlation time of a contact, as a share of its length.
OWN_TIME = 0.5
#: A contact shorter than this [s] loses its peak below such a rate [Hz]: a tap lasts 50 ms.
SHORT, SLOW = 0.25, 95.0
#: Without known free motion a push may act for so long beyond its blocks: else its ends would
#: be model error, and it would look smaller. On nine simulated arms 14 % of the sizes were
#: below their bands, so 2 %. [s]
TAIL = 0.5
#: A contact's place comes from blocks above this share of its peak, so near it [s].
CORE, CORE_TIME = 0.5, 0.1
#: SD of the moment about the point of a point force. [N·m]
POINT_MOMENT = 1e-3


class ContactLocation(NamedTuple):
    """Place of a contact, as far as it is known."""

    fits: list[PointFit]  #: Points that fit, the best first.
    joints: int  #: Number of joints.
    #: Links that a force and a moment may have touched; 0 is the flange.
    likely: tuple[int, ...]

    @property
    def is_force(self) -> bool:
        """Whether a force at a point explains it."""
        return self.fits[0].misfit <= MORE_THAN_A_FORCE

    @property
    def parts(self) -> list[ArmPart]:
        """Parts of the arm that fit."""
        names = arm_parts(self.joints)
        return list(dict.fromkeys(names[link] for link in self.links))

    @property
    def on_wrist(self) -> bool:
        """Whether a wrench at the flange explains it."""
        return "wrist" in self.parts or not self.is_force

    @property
    def links(self) -> tuple[int, ...]:
        """Links that fit, 0 for the flange."""
        if not self.is_force:
            return self.likely
        last = self.joints
        links = {0 if fit.link == last and fit.share > 0.99 else fit.link for fit in self.fits}
        return tuple(sorted(links))

    def spread(self, size: float) -> float:
        """RMS error of the size for the place, 0 at the wrist alone. [N]"""
        if self.parts == ["wrist"] or not self.is_force:
            return 0.0
        likely = np.exp(-0.5 * np.array([fit.score - self.fits[0].score for fit in self.fits]))
        apart = np.array([fit.size for fit in self.fits]) - size
        return float(np.sqrt(likely @ apart**2 / likely.sum()))

    def sizes(self, size: float, band: float) -> tuple[float, float]:
        """Smallest and largest |F| of places that fit, with bands. [N]"""
        fits = self.fits if self.is_force else []
        spans = [(size, band), *((fit.size, fit.band) for fit in fits)]
        high = max(s + b for s, b in spans)
        return max(min(s - b for s, b in spans), 0.0), high


@dataclass(frozen=True, eq=False)
class ContactMeasurement:
    """Measures the contacts of one log."""

    run: Run  #: The log with its robot's model.
    found: Candidates  #: The contacts that were kept.
    log: BlockLog  #: The log in blocks; under a contact joints may settle anew.
    prior: WrenchPrior  #: Prior of the contacts' wrench.
    widening: Array  #: Factor on each axis' SD that free motion asks. (6,)
    bent: float  #: Share of a peak's bend that may be hidden.
    tail: float = 0.0  #: How long a push may act beyond its blocks. [s]

    @classmethod
    def of(
        cls,
        found: Candidates,
        free: FreeStatistics,
        like: "ContactMeasurement | None" = None,
        bent: float = BENT,
    ) -> "ContactMeasurement":
        """Contacts of `free`'s log; prior and widening from `like` or the log."""
        blocks, J = found.log.blocks, found.places[0].jacobian
        gate = covered(found.runs, len(blocks.t), 1)
        process = error_process(free.noise, blocks, gate)._replace(white=found.log.process.white)
        log = BlockLog(blocks, process)
        if like is None:
            prior = learn_prior(log, J, found.runs, found.prior, rounds=2 if found.runs else 0)
            return cls(free.log, found, log, prior, self_test(free, prior), bent)
        return cls(free.log, found, log, like.prior, like.widening, bent, like.tail)

    @cached_property
    def quiet(self) -> tuple[Array, Array]:
        """Mean [N·m] and variance of the error beside contacts. (K, n)"""
        d, touched = self.log.blocks.d, covered(self.found.runs, len(self.log.blocks.d), 1)
        return quiet_error(d, self.log.process.hiding(touched))

    @cached_property
    def priors(self) -> list[WrenchPrior]:
        """Prior of every contact's wrench: a short contact moves faster."""
        own = self.prior.looser
        return [own._replace(time=min(own.time, OWN_TIME * s)) for s in self.found.lasts]

    @cached_property
    def wrenches(self) -> list[WindowWrench]:
        """The wrench of every contact at the flange."""
        runs, J = self.found.runs, self.found.places[0].jacobian
        return smooth_lanes(contact_lanes(self.log, runs, J, tail=self.tail), self.priors)

    @cached_property
    def locations(self) -> list[ContactLocation]:
        """Place of every contact, by torque beyond the model error."""
        blocks, chain, found = self.log.blocks, self.run.robot.loaded_chain, []
        each = zip(self.found.runs, self.wrenches, self.found.evidence, strict=True)
        for run, wrench, nats in each:
            size = wrench.within(run).size
            peak = run[0] + size.argmax()
            core = np.arange(*run)[size >= CORE * size.max()]
            core = core[abs(blocks.t[core] - blocks.t[peak]) <= CORE_TIME]
            known = core[blocks.known[core]]
            core = known if known.size else core
            mean, variance = (series[core] for series in self.quiet)
            torque = (blocks.d[core] - mean).mean(axis=0)
            white = self.log.process.white[core].mean(axis=0) / len(core)
            fits = point_fits(
                chain, blocks.q[peak], torque, np.sqrt(variance.mean(axis=0) + white)
            )
            likely = np.flatnonzero(nats > nats.max() - SURE_NATS)
            links = tuple(self.found.places[k].link for k in likely)
            found.append(ContactLocation(fits, chain.joints, links))
        return found

    def rows(self, locations: Sequence[ContactLocation] | None = None) -> list[Contact]:
        """The contacts in the order of time; better places may be given."""
        runs, J, wrenches = self.found.runs, self.found.places[0].jacobian, [*self.wrenches]
        chain, q = self.run.robot.loaded_chain, self.log.blocks.q
        locations = locations or self.locations
        moved = {
            i: jacobian_of(lambda a, b: link_poses(chain, q[a:b]), *where.fits[0][:2])
            for i, where in enumerate(locations)
            if not where.on_wrist
        }
        points = [self.priors[i]._replace(moment=POINT_MOMENT) for i in moved]
        lanes = contact_lanes(self.log, [runs[i] for i in moved], J, tail=self.tail)
        pairs = zip(lanes, moved.values(), strict=True)
        there = (lane._replace(jacobian=own) for lane, own in pairs)
        for i, wrench in zip(moved, smooth_lanes(there, points), strict=True):
            wrenches[i] = wrench
        each = enumerate(zip(wrenches, locations, strict=True))
        return [self.row(i, *pair, moved.get(i, J)) for i, pair in each]

    def row(
        self, number: int, course: WindowWrench, location: ContactLocation, jacobian: JacobianIn
    ) -> Contact:
        """One row of the list."""
        run, blocks = self.found.runs[number], self.log.blocks
        span, inside, factor = slice(*run), course.within(run), WIDENED * self.widening
        # Hidden by drive constants and block length, as for `best`.
        hidden = hidden_by_blocks(course.values, self.bent)[run[0] - course.first :]
        covariances = inside.covariance * np.outer(factor, factor) + hidden[: len(inside.values)]
        force, length = inside.values[:, :3], blocks.length[span]
        forces = force_course(blocks.t[span], force, covariances[:, :3, :3])
        k = int(forces.force.argmax())
        peak, size, band, covariance = run[0] + k, forces.force[k], forces.band[k], covariances[k]
        where, named, lead = self.part(number, location)
        anywhere = location.sizes(size, band)
        spread = 0.0 if named == "wrist" and lead >= SURE_NATS else location.spread(size)
        remarks = list[Remark]()
        if len(location.parts) > 1 and Z_95 * spread > WIDE * size:
            # Another place means another force.
            least, most = anywhere
            remarks.append(caution("size-goes-with-place", least_N=least, most_N=most))
        rate = 1.0 / self.run.step
        if length.sum() < SHORT and rate < SLOW:
            remarks.append(caution("peak-cut-by-rate", rate_hz=rate))
        (start, stop), cuts = times_of(blocks, run), self.run.recording.source.cuts
        near = [c.start for c in cuts if c.start <= stop + BESIDE and c.stop >= start - BESIDE]
        remarks += [caution("samples-cut-inside", at_s=at) for at in near[:1]]
        J, at, values = jacobian(peak, peak + 1)[0], blocks.t[peak], inside.values[k]
        flange, wrench = self.found.places[0].jacobian(peak, peak + 1)[0], values.copy()
        if not location.on_wrist:
            poses = link_poses(self.run.robot.loaded_chain, blocks.q[[peak]])
            fit = location.fits[0]
            lever = points_on(poses, fit.link, fit.share) - poses.translation[:, -1]
            wrench[3:] += np.cross(lever[0], values[:3])
        return Contact(
            number=number + 1,
            start=start,
            stop=stop,
            peak=at,
            peak_force=size,
            peak_band=np.hypot(band, Z_95 * spread),
            place_band=band,
            wrench=wrench,
            wrench_sd=np.sqrt(np.diag(covariance)),
            mean_force=np.average(force, axis=0, weights=length),
            impulse=length @ force,
            anywhere=anywhere,
            where=where,
            lead=lead,
            places=location.links,
            evidence=self.found.best[number],
            joint_torque=J.T @ values,
            joint_torque_sd=np.sqrt(np.einsum("in,ij,jn->n", J, covariance, J)),
            at_rest=bool(blocks.part(slice(peak, peak + 1)).rests.all()),
            vendor_force=vendor_force(self.run, flange, at),
            sensor_force=sensor_force(self.run, at),
            course=forces,
            remarks=tuple(remarks),
        )

    def part(self, number: int, location: ContactLocation) -> tuple[ArmPart, ArmPart, float]:
        """The only part that fits, the likeliest, and its lead. [nats]"""
        names, best = arm_parts(self.run.robot.joints), dict[ArmPart, float]()
        for place, nats in zip(self.found.places, self.found.evidence[number], strict=True):
            part = names[place.link]
            best[part] = max(best.get(part, nats), nats)
        fitting = location.parts
        where = fitting[0] if len(fitting) == 1 else "cannot tell"
        named = where if where in best else max(best, key=lambda part: best[part])
        return where, named, best.pop(named) - max(best.values())


def shows_force(row: Contact, smallest: float) -> bool:
    """Whether a force exceeds its band, or is sure and reaches `smallest`. [N]"""
    force, sure = row.peak_force or 0.0, (row.evidence or 0.0) >= LEAST_IN_MOTION
    return force > (row.place_band or 0.0) or (sure and not force < smallest)


def force_course(t: Array, force: Array, covariance: Array) -> ForceCourse:
    """|F| of a force (K, 3) [N], and its band by a covariance."""
    size = np.linalg.norm(force, axis=1)
    u = force / np.maximum(size, 1e-12)[:, None]
    return ForceCourse(t, size, Z_95 * np.sqrt(np.einsum("ki,kij,kj->k", u, covariance, u)))


def vendor_force(run: Run, J: Array, at: float) -> float | None:
    """|F| at the flange of the log's own torque at a time, or None. [N]"""
    own = run.recording.tau_ext
    if own is None or J.shape[1] < 6:
        return None
    torque = resample_columns(np.array([at]), run.t, own)[0]
    return size_of(np.linalg.lstsq(J.T, torque, rcond=None)[0][:3])


def sensor_force(run: Run, at: float) -> float | None:
    """|F| of the log's own wrench at a time, None if all zeros. [N]"""
    own = run.recording.wrench
    if own is None or not own.any():
        return None
    return size_of(resample_columns(np.array([at]), run.t, own[:, :3])[0])


def size_of(force: Array) -> float | None:
    """|F| of a force (3,), None where it is not finite. [N]"""
    size = float(np.linalg.norm(force))
    return size if np.isfinite(size) else None
