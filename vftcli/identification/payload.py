"""A load on the flange from logs with and without it, poses at rest, or motion."""

from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from vftcli.free_motion.alignment import Alignment, aligned_at, best_fit
from vftcli.free_motion.free_motion import LEAST, PARTLY, SURE, columns, with_point_mass
from vftcli.identification.shapes import round_digits
from vftcli.identification.training import STATIC, load_columns, prepare
from vftcli.readers.table import listed
from vftcli.robots.chain import Payload
from vftcli.robots.friction import SMOOTHING
from vftcli.robots.kernels import usual_errors
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run, RunSamples
from vftcli.robots.terms import drive_torque, gain_sd, gravity_torque
from vftcli.signals.arrays import (
    Z_95,
    Array,
    Indices,
    intervals,
    resample_columns,
    root_mean_squares,
)
from vftcli.signals.errors import IdentificationError
from vftcli.signals.estimation import folds, inverse_of, solve
from vftcli.signals.filters import zero_phase
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact
from vftcli.signals.rest import faster, held

PASSES = 3  #: Fits, each with the joints' residuals of the last one.
SAME_MOTION = 5e-3  #: Largest difference of one motion's logs. [rad rms]
DWELL = 0.5  #: Shortest rest that is a pose. [s]
POSES = 4  #: Fewest different poses for mass and centre of mass.
APART = 0.1  #: A joint differs by this between two poses. [rad]
MOST_NAMED = 4  #: Logs called by name; episodes may be thousands.
STRETCHES = 12  #: Independent stretches of a motion.
REACH = 1.0  #: Farthest centre of mass from the flange. [m]
LOOKED_AT = 400  #: Most samples of a motion among which poses are counted.
#: Shortest motion: the masses of a UR10e and a UR3 scatter by .7 of their SD
#: over 9 stretches of 10 s, by 1.6 over those of 5 s, by 2.4 of 2.5 s. [s]
LONG = 10.0
#: Weighings with the load on the arm: a third moves it by less than .1 %.
ROUNDS = 3


def names_of(recordings: Sequence[Recording]) -> str:
    """Names of logs as one text; of many, the first."""
    return listed([recording.name for recording in recordings], MOST_NAMED)


class NotSameMotionError(IdentificationError):
    """Two logs do not repeat one motion."""


class TooFewPosesError(IdentificationError):
    """Logs hold too few poses at rest."""


class LoadFit(NamedTuple):
    """An identified load."""

    payload: Payload  #: The load, a point mass.
    mass_sd: float  #: SD of the mass. [kg]
    com_sd: Array  #: Those of its centre in flange axes. (3,) [m]
    residual: Array  #: RMS torque left in each joint. (n,) [N·m]
    loaded: tuple[Recording, ...]  #: The logs with the load.
    origin: Remark  #: Its source and method.

    def carried_by(self, recording: Recording) -> bool:
        """Whether a log is one that carries it; names may be equal."""
        return any(log is recording for log in self.loaded)


def load_at_flange(
    x: Array, sd: Array, left: Array, robot: Robot, loaded: Sequence[Recording], origin: Remark
) -> LoadFit:
    """A load in flange axes from a solution in the last link's frame.

    x and sd are of mass and first moments (4,) [kg, kg·m], `left` is RMS torque (n,) [N·m].
    """
    names, mass, mass_sd = names_of(loaded), float(x[0]), float(sd[0])
    if mass <= 0 or mass_sd > 0.5 * mass:
        raise IdentificationError(
            f"{names}: no load found: mass {mass:.3g} ± {Z_95 * mass_sd:.2g} kg; "
            "use poses or motions in which gravity loads several joints differently"
        )
    R = robot.chain.flange_rotation
    com = R.T @ (x[1:STATIC] / mass - robot.chain.flange_translation)
    spread = np.sqrt(np.diag(R.T @ np.diag((sd[1:STATIC] / mass) ** 2) @ R))
    if (away := np.linalg.norm(com)) > REACH:
        raise IdentificationError(
            f"{names}: the load's centre of mass comes out {away:.2g}"
            " m from the flange; the logs do not fit this robot"
        )
    load = Payload(mass=mass, com=com)
    return LoadFit(load, mass_sd, spread, left, tuple(loaded), origin)


class JointsFit(NamedTuple):
    """Least squares over all joints, each divided by its residual."""

    x: Array  #: The solution. (k,)
    left: Array  #: Its residual. (N, n)
    weights: Array  #: Of samples and joints, 0 where empty. (N, n)
    A: Array  #: Columns times weights. (N, n, k)
    inverse: Array  #: (AᵀA)⁻¹, columns scaled; zero without data. (k, k)

    def cluster_covariance(self, clusters: Sequence[slice | Indices]) -> Array:
        """Covariance of x with residuals that clusters share. (k, k)

        The pull of each of B clusters of rows on the solution makes G
        (Σ_b A_bᵀ r_b r_bᵀ A_b) G · B/(B − 1), G = (AᵀA)⁻¹ (K.-Y. Liang, S. Zeger,
        "Longitudinal data analysis using generalized linear models", Biometrika 73(1),
        1986).
        """
        inverse, rest = self.inverse, self.left * self.weights
        pulls = np.array([np.einsum("knp,kn->p", self.A[c], rest[c]) for c in clusters])
        covariance: Array = inverse @ (pulls.T @ pulls) @ inverse
        return covariance * len(clusters) / (len(clusters) - 1)

    def motion_covariance(self, y: Array, gain: float) -> Array:
        """Covariance of x of a motion, by `STRETCHES` and drives. (k, k)"""
        # Friction of another temperature lasts as long as a motion goes one way.
        stretches = folds(len(self.A), STRETCHES)
        return self.cluster_covariance(stretches) + self.gain_covariance(y, gain)

    def gain_covariance(self, y: Array, gain: float) -> Array:
        """Covariance of x by drive constants of a relative deviation. (k, k)

        Half of their variance belongs to all joints (gear, warmth), half to each one.
        """
        # Each joint's torque adds its part to the solution.
        shares = np.einsum("knp,kn->np", self.A, y * self.weights) @ self.inverse
        together = shares.sum(axis=0)
        both = np.outer(together, together) + shares.T @ shares
        return np.asarray(0.5 * gain**2 * both)


def fit_all_joints(A: Array, y: Array, usable: Array) -> JointsFit:
    """Least squares of A (N, n, k) to y (N, n), weights `usable` (N, n)."""
    left = y - y.mean(axis=0)
    for passes in range(PASSES + 1):
        w = np.sqrt(usable) / np.maximum(root_mean_squares(left), 1e-9)
        weighted = A * w[:, :, None]
        flat = weighted.reshape(-1, A.shape[2])
        if passes < PASSES:
            x = solve(flat, (y * w).ravel())
            left = y - np.einsum("knp,p->kn", A, x)
    return JointsFit(x, left, w, weighted, inverse_of(flat.T @ flat))


def payload_from_pair(first: Recording, second: Recording, robot: Robot) -> LoadFit:
    """A load from one motion with and without it, in either order."""
    for loaded, free in ((second, first), (first, second)):
        motion, t = prepare(loaded, robot), free.t
        if not len(motion.t):
            raise NotSameMotionError(
                f"no joint of {loaded.name} moves; a pair must repeat one trajectory"
            )
        found = alignment_of_pair(loaded, free)
        torque = zero_phase(t, drive_torque(free, robot), motion.cutoff)
        at = motion.t + found.shift
        inside = (at >= t[0]) & (at <= t[-1])
        extra = motion.tau - resample_columns(at, t, torque)
        sign = motion.filtered(np.tanh(loaded.require("dq") / SMOOTHING))
        signals = (motion.q, motion.dq, motion.ddq, motion.weights, extra, sign)
        q, dq, ddq, usable, extra, sign = (x[inside] for x in signals)
        Y = load_columns(robot, q, dq, ddq)
        fit = fit_all_joints(Y, extra, usable)
        # Friction grows with the load we seek: a few rounds settle it.
        for _ in range(4):
            A = np.concatenate([Y, load_friction(robot, q, sign, fit.x[:STATIC])], axis=2)
            fit = fit_all_joints(A, extra, usable)
        if fit.x[0] >= 0:
            break
    sd = np.sqrt(np.diag(fit.motion_covariance(extra, gain_sd(loaded, robot))))[:STATIC]
    values = {"loaded": loaded.name, "free": free.name, "distance_mrad": 1e3 * found.deviation}
    origin = Remark("load-from-pair", values={**values, "shift_s": round(-found.shift, 3) + 0.0})
    x = fit.x[:STATIC]
    return load_at_flange(x, sd, root_mean_squares(fit.left), robot, (loaded,), origin)


def load_friction(robot: Robot, q: Array, sign: Array, x: Array) -> Array:
    """Columns sign(q̇)·(|g with load| − |g without|) per joint. (N, n, n)"""
    before, zero = gravity_torque(robot, q), np.zeros_like(q)
    after = before + load_columns(robot, q, zero, zero) @ x
    return ((abs(after) - abs(before)) * sign)[:, :, None] * np.eye(robot.joints)


def alignment_of_pair(loaded: Recording, free: Recording) -> Alignment:
    """Alignment of two logs of one motion, at equal clock rates."""
    shift, rate = best_fit(loaded, free)
    found = aligned_at(loaded, free, shift + (rate - 1.0) * loaded.t.mean(), 1.0)
    if found.deviation > SAME_MOTION:
        raise NotSameMotionError(
            f"{loaded.name} and {free.name} are different motions: positions differ by "
            f"{1e3 * found.deviation:.3g} mrad rms at best; a pair must repeat one trajectory"
        )
    return found


def payload_from_poses(recordings: Sequence[Recording], robot: Robot) -> LoadFit:
    """A load from poses at rest, by torque beyond the robot's own gravity.

    The logs' differences are part of the SDs; of one log what the links may be wrong by.
    """
    each = [resting_poses(recording, robot) for recording in recordings]
    q, torque = (np.concatenate(parts) for parts in zip(*each, strict=True))
    if (different := different_poses(q)) < POSES:
        raise TooFewPosesError(
            f"{names_of(recordings)}: {len(q)} poses at rest of at least {DWELL:g} s, {different} "
            f"of them different; a load needs {POSES} different ones, or a pair of logs of one "
            "motion with and without it"
        )
    zero = np.zeros_like(q)
    extra = torque - gravity_torque(robot, q)
    fit = fit_all_joints(load_columns(robot, q, zero, zero), extra, np.ones_like(extra))
    # Poses are no series in time.
    noise = fit.inverse / (1.0 - STATIC / extra.size)
    gain = max(gain_sd(recording, robot) for recording in recordings)
    covariance = noise + fit.gain_covariance(extra, gain)
    counts = [len(poses) for poses, _ in each if len(poses)]
    logs = np.split(np.arange(len(q)), np.cumsum(counts)[:-1])
    if len(logs) > 1:
        covariance += fit.cluster_covariance(logs)
    else:  # links' errors pass for a load
        links = (fit.weights[..., None] * usual_errors(robot.chain, q)).reshape(extra.size, -1)
        by_links, rest, *_ = np.linalg.lstsq(fit.A.reshape(-1, STATIC), links)
        share = ((fit.left * fit.weights) ** 2).sum() / (rest.sum() or np.inf)
        covariance += min(share, 1.0) * by_links @ by_links.T
    sd, left = np.sqrt(np.diag(covariance)), fit.left.std(axis=0)
    origin = fact("load-from-poses", poses=len(q), different=different, logs=len(logs))
    return load_at_flange(fit.x, sd, left, robot, recordings, origin)


def different_poses(q: Array) -> int:
    """Number of poses (P, n) at least `APART` apart."""
    found: list[Array] = []
    for pose in q:
        if all(abs(other - pose).max() > APART for other in found):
            found.append(pose)
    return len(found)


def resting_poses(recording: Recording, robot: Robot) -> tuple[Array, Array]:
    """Mean position and torque of every rest. (P, n) [rad], (P, n) [N·m]"""
    effort = drive_torque(recording, robot)
    rests = intervals(recording.t, held(recording.q, recording.median_step), least=DWELL)
    # In the outer fifths the arm still settles or leaves.
    spans = [slice(a + (b - a) // 5, b - (b - a) // 5) for a, b in rests]
    means = [[x[span].mean(axis=0) for span in spans] for x in (recording.q, effort)]
    return tuple(np.reshape(means, (2, -1, robot.joints)))


def payload_from_motion(recordings: Sequence[Recording], robot: Robot) -> LoadFit:
    """A load from motion, by torque beyond the robot's own weight.

    A second weighing carries the load found, so that its inertia is no weight.
    """
    names = names_of(recordings)
    q = np.concatenate([recording.q for recording in recordings])
    if (different := different_poses(q[:: 1 + len(q) // LOOKED_AT])) < POSES:
        raise IdentificationError(
            f"{names}: the arm passes {different} different poses, and a load needs {POSES} at "
            f"least, {APART:g} rad apart; move more joints, or give a pair of logs of one motion "
            "with and without it"
        )
    if (seconds := sum(recording.duration for recording in recordings)) < LONG:
        raise IdentificationError(
            f"{names}: {seconds:.3g} s of motion are too short to weigh a load; record {LONG:g} s "
            "at least"
        )
    runs = [Run(recording=recording, robot=robot) for recording in recordings]
    x, covariance, left, share = weigh_motion(runs, np.zeros(STATIC))
    least = max(LEAST, SURE * np.sqrt(covariance[0, 0]))
    if not x[0] >= least or share > PARTLY:
        raise IdentificationError(
            f"{names}: no load shows; in this motion one from "
            f"{round_digits(least, 2):g} kg would, a lighter one in {POSES} different poses at "
            f"rest of at least {DWELL:g} s, or in a pair of logs of one motion with and without it"
        )
    origin = fact("load-from-motion", logs=len(runs), left_percent=100.0 * share)
    for _ in range(ROUNDS):
        x, covariance, left, _ = weigh_motion(runs, x)
    in_link = np.eye(STATIC)
    in_link[1:, 0], in_link[1:, 1:] = robot.chain.flange_translation, robot.chain.flange_rotation
    sd = np.sqrt(np.diag(in_link @ covariance @ in_link.T))
    return load_at_flange(in_link @ x, sd, left, robot, recordings, origin)


def weigh_motion(runs: Sequence[Run], carried: Array) -> tuple[Array, Array, Array, float]:
    """A load weighed in motion, beside the load in its models. (4,) [kg, kg·m]

    A joint counts where it moves; its friction is free: a tanh(q̇/v₀) + b q̇ + o. Nothing
    through these drives is subtracted: their errors act on the arm's own weight.

    Returns:
        Mass and first moment in flange axes (4,) [kg, kg·m], their covariance (4, 4), RMS left in
        each joint (n,) [N·m], and the torque's rest beside the arm's weight and friction, by power.
    """
    robot, signals = runs[0].robot, []
    for run in [with_point_mass(run, carried) for run in runs] if carried.any() else runs:
        piece = RunSamples(run, np.ones(run.recording.samples, bool))
        if (own := columns(piece)) is not None:
            at = own[0]
            signals.append((*own[1:], run.recording.q[at], run.recording.require("dq")[at]))
    if not signals:
        names = names_of([run.recording for run in runs])
        raise IdentificationError(f"{names}: no log is long enough to be filtered")
    d, A, q, dq = (np.concatenate(each) for each in zip(*signals, strict=True))
    A = np.concatenate([A, dq[:, :, None] * np.eye(robot.joints)], axis=2)
    usable = faster(dq).astype(float)
    fit, bare = fit_all_joints(A, d, usable), fit_all_joints(A[:, :, STATIC:], d, usable)
    x = carried + fit.x[:STATIC]
    weight = gravity_torque(robot, q) - np.einsum("knp,p->kn", A[:, :, :STATIC], x)
    gain = max(gain_sd(run.recording, robot) for run in runs)
    covariance = fit.motion_covariance(weight, gain)[:STATIC, :STATIC]
    power = np.sum(usable * fit.left**2) / max(np.sum(usable * bare.left**2), 1e-12)
    return x, covariance, root_mean_squares(fit.left), np.sqrt(power)


def find_load(logs: Sequence[Recording], robot: Robot, free: Recording | None) -> LoadFit:
    """The load, from a pair, else from poses, else from motion."""
    bare = robot.with_payload(None)
    if free is not None:
        if (fit := payload_from_pair(logs[0], free, bare)).carried_by(free):
            raise IdentificationError(
                f"{free.name}, given as free of load, is the heavier one; swap the two logs"
            )
        return fit
    # A pair repeats a motion. Episodes carry one load.
    moved = all(np.ptp(r.q, axis=0).max() > 0.05 for r in logs)
    if len(logs) == 2 and moved and not all(r.source.part for r in logs):
        # Two different motions with the load may still show it.
        with suppress(NotSameMotionError):
            return payload_from_pair(logs[0], logs[1], bare)
    with suppress(TooFewPosesError):
        return payload_from_poses(logs, bare)
    return payload_from_motion(logs, bare)
