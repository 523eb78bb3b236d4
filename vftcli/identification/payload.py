"""A load on the flange, from a pair of logs with and without it or from poses at rest."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.identification.processing import (
    PreparedLog,
    Processing,
    gravity_torque,
    prepare,
)
from vftcli.identification.result import root_mean_square
from vftcli.readers.table import listed
from vftcli.robots.chain import Payload
from vftcli.robots.drive import drive_torque, gain_sd
from vftcli.robots.friction import SMOOTHING
from vftcli.robots.regressor import LINK, chain_parameters, torque_regressor
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, Indices
from vftcli.signals.errors import IdentificationError
from vftcli.signals.filters import zero_phase
from vftcli.signals.intervals import intervals
from vftcli.signals.least_squares import folds, inverse_of, solve
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact
from vftcli.signals.rest import held
from vftcli.signals.series import resample_columns

STATIC = 4  #: Parameters that gravity tells: mass and three first moments.
SAME_MOTION = 5e-3  #: Position difference up to which two logs are the same motion. [rad rms]
COARSE, FINE = 0.05, 5e-4  #: Steps in which the shift between two logs is sought. [s]
DWELL = 0.5  #: Shortest rest that counts as a pose. [s]
POSES = 4  #: Fewest different poses for mass and centre of mass.
APART = 0.1  #: Poses are different if a joint is this far elsewhere. [rad]
MOST_NAMED = 4  #: Logs that are called by their names; there may be thousands of episodes.
STRETCHES = 12  #: Stretches of a motion whose errors are taken as each other's strangers.
REACH = 1.0  #: A load's centre of mass further than this from the flange cannot be. [m]


def names_of(recordings: Sequence[Recording]) -> str:
    """Names of several logs as one text, for messages and tables; of many the first."""
    return listed([recording.name for recording in recordings], MOST_NAMED)


class NotSameMotionError(IdentificationError):
    """Two logs that were taken for a pair do not repeat one motion."""


class TooFewPosesError(IdentificationError):
    """Logs hold too few different poses at rest."""


class LoadFit(NamedTuple):
    """An identified load."""

    payload: Payload  #: The load on the flange, as a point mass.
    mass_sd: float  #: Standard deviation of the mass. [kg]
    com_sd: Array  #: Standard deviations of the centre of mass in flange axes. (3,) [m]
    residual: Array  #: RMS torque left in each joint. (n,) [N·m]
    loaded: tuple[Recording, ...]  #: The logs that carry it.
    origin: Remark  #: How it was found.

    def carried_by(self, recording: Recording) -> bool:
        """Whether a log carries it. Logs are told apart as objects: their names may be equal."""
        return any(log is recording for log in self.loaded)


class LoadSolution(NamedTuple):
    """Mass and first moments in the last link's frame, before they are known to be a load's."""

    x: Array  #: The solution. (4,) [kg, kg·m]
    sd: Array  #: Its standard deviations. (4,)
    residual: Array  #: RMS left in each joint. (n,) [N·m]


def load_at_flange(
    found: LoadSolution, robot: Robot, loaded: Sequence[Recording], origin: Remark
) -> LoadFit:
    """A solution as a load in flange axes."""
    names, mass, sd = names_of(loaded), float(found.x[0]), float(found.sd[0])
    if mass <= 0 or sd > 0.5 * mass:
        raise IdentificationError(
            f"{names}: no load can be told: mass {mass:.3g} ± {sd:.2g} kg; "
            "use poses or motions in which gravity loads several joints differently"
        )
    R = robot.chain.flange_rotation
    com = R.T @ (found.x[1:STATIC] / mass - robot.chain.flange_translation)
    spread = np.sqrt(np.diag(R.T @ np.diag((found.sd[1:STATIC] / mass) ** 2) @ R))
    if (away := float(np.linalg.norm(com))) > REACH:
        raise IdentificationError(
            f"{names}: the load's centre of mass comes out {away:.2g}"
            " m from the flange; the logs do not fit this robot"
        )
    load = Payload(mass=mass, com=com, inertia=np.zeros((3, 3)))
    return LoadFit(load, sd, spread, found.residual, tuple(loaded), origin)


def payload_from_pair(first: Recording, second: Recording, robot: Robot) -> LoadFit:
    """Find a load from the same motion with and without it; which is which shows by itself.

    The torque difference at the same phase is the load's, since friction and model errors are
    alike in both, but for friction that grows with the load: that is fitted along.
    """
    loaded = second
    solution, origin = solve_pair(second, first, robot)
    if solution.x[0] < 0:
        loaded = first
        solution, origin = solve_pair(first, second, robot)
    return load_at_flange(solution, robot, (loaded,), origin)


def solve_pair(loaded: Recording, free: Recording, robot: Robot) -> tuple[LoadSolution, Remark]:
    """Fit what the loaded log's torque has beyond the free one's at the same phase."""
    processing = Processing()
    motion = prepare(loaded, robot, processing)
    shift, distance = find_time_shift(motion, free)
    torque = zero_phase(free.t, drive_torque(free, robot), processing.cutoff)
    at = motion.t + shift
    inside = (at >= free.t[0]) & (at <= free.t[-1])
    extra = (motion.tau - resample_columns(at, free.t, torque))[inside]
    sign = motion.filtered(np.tanh(loaded.require("dq") / SMOOTHING))[inside]
    q, dq, ddq = motion.q[inside], motion.dq[inside], motion.ddq[inside]
    Y = torque_regressor(robot.chain, q, dq, ddq)[:, :, -LINK:][:, :, :STATIC]
    usable = motion.usable[inside].astype(float)
    x = fit_all_joints(Y, extra, usable)
    # How friction grows depends on the load that is sought: a few rounds settle it.
    for _ in range(4):
        A = np.concatenate([Y, load_friction(robot, q, sign, x)], axis=2)
        solution = fit_all_joints(A, extra, usable)
        x = solution[:STATIC]
    left = extra - np.einsum("knp,p->kn", A, solution)
    gain = gain_sd(loaded, robot)
    sd = np.sqrt(
        np.diag(stretch_covariance(A, left, usable) + gain_covariance(A, left, extra, usable, gain))
    )[:STATIC]
    origin = fact(
        "load-from-pair",
        loaded=loaded.name,
        free=free.name,
        shift_s=round(-shift, 3) + 0.0,
        distance_mrad=1e3 * distance,
    )
    return LoadSolution(x, sd, root_mean_square(left)), origin


def load_friction(robot: Robot, q: Array, sign: Array, x: Array) -> Array:
    """Columns sign(q̇)·(|g with load| − |g without|), one a joint. (N, n, n)"""
    n = robot.joints
    Y = torque_regressor(robot.chain, q, np.zeros_like(q), np.zeros_like(q))
    phi = chain_parameters(robot.loaded_chain)
    heavier = phi.copy()
    heavier[-LINK : -LINK + STATIC] += x
    growth = np.abs(Y @ heavier) - np.abs(Y @ phi)
    out = np.zeros((len(q), n, n))
    out[:, range(n), range(n)] = growth * sign
    return out


def fit_all_joints(A: Array, y: Array, usable: Array, passes: int = 3) -> Array:
    """Least squares over all joints, each divided by its own residual. (k,)"""
    scale = np.maximum(np.std(y, axis=0), 1e-9)
    for _ in range(passes):
        w = np.sqrt(usable) / scale
        x = solve((A * w[:, :, None]).reshape(-1, A.shape[2]), (y * w).ravel())
        left = y - np.einsum("knp,p->kn", A, x)
        scale = np.maximum(root_mean_square(left), 1e-9)
    return x


def weighted_rows(A: Array, values: Array, usable: Array, left: Array) -> tuple[Array, Array]:
    """Rows and values divided by their joint's residual; rows that tell nothing are zero.

    Args:
        A: Columns. (N, n, k)
        values: What goes with them. (N, n)
        usable: Weights. (N, n)
        left: The residual. (N, n)
    """
    w = np.sqrt(usable) / np.maximum(root_mean_square(left), 1e-9)
    return A * w[:, :, None], values * w


def inverse_gram(rows: Array) -> Array:
    """(AᵀA)⁻¹ of rows (N, n, k), columns scaled; zero where the data says nothing. (k, k)"""
    flat = rows.reshape(-1, rows.shape[2])
    return inverse_of(flat.T @ flat)


def stretch_covariance(A: Array, left: Array, usable: Array) -> Array:
    """Covariance of least squares for a residual that is coloured and shared by joints. (k, k)

    The motion is cut into `STRETCHES`. Friction that another temperature changed, or a model that
    misses, lasts as long as a motion goes one way; the residual's own correlation time, some tenths
    of a second, would not count it.

    Args:
        A: Columns. (N, n, k)
        left: Residual. (N, n)
        usable: Weights. (N, n)
    """
    return cluster_covariance(A, left, usable, folds(len(A), STRETCHES))


def cluster_covariance(
    A: Array, left: Array, usable: Array, clusters: Sequence[slice | Indices]
) -> Array:
    """Covariance of least squares for a residual that is a cluster's own. (k, k)

    What each cluster pulls the solution by is taken as it is: G (Σ_b A_bᵀ r_b r_bᵀ A_b) G ·
    B/(B − 1), G = (AᵀA)⁻¹ (K.-Y. Liang, S. Zeger, "Longitudinal data analysis using generalized
    linear models", Biometrika 73(1), 1986).

    Args:
        A: Columns. (N, n, k)
        left: Residual. (N, n)
        usable: Weights. (N, n)
        clusters: The rows of each, B of them.
    """
    rows, rest = weighted_rows(A, left, usable, left)
    inverse = inverse_gram(rows)
    pulls = np.array([np.einsum("knp,kn->p", rows[c], rest[c]) for c in clusters])
    covariance: Array = inverse @ (pulls.T @ pulls) @ inverse
    return covariance * len(clusters) / (len(clusters) - 1)


def gain_covariance(A: Array, left: Array, y: Array, usable: Array, gain: float) -> Array:
    """Covariance by drive constants that are not known exactly. (k, k)

    Half of their variance is taken as all joints' together (one gear, one warmth of the magnets),
    half as each joint's own: the first scales a load's mass, the second also moves its centre.

    Args:
        A: Columns. (N, n, k)
        left: Residual. (N, n)
        y: The torque that is explained. (N, n)
        usable: Weights. (N, n)
        gain: Relative standard deviation of a joint's torque.
    """
    rows, values = weighted_rows(A, y, usable, left)
    # What each joint's torque contributes to the solution: their sum is the solution.
    shares = np.einsum("knp,kn->np", rows, values) @ inverse_gram(rows)
    together = shares.sum(axis=0)
    covariance: Array = 0.5 * gain**2 * (np.outer(together, together) + shares.T @ shares)
    return covariance


def find_time_shift(motion: PreparedLog, other: Recording) -> tuple[float, float]:
    """Shift [s] that turns the motion's clock into the other log's, and what is left. [rad rms]"""

    def distance(shift: float) -> float:
        at = motion.t + shift
        inside = (at >= other.t[0]) & (at <= other.t[-1])
        # Two short ends may agree by chance: at least half of the motion must overlap.
        if np.count_nonzero(inside) < 0.5 * len(at):
            return float("inf")
        there = resample_columns(at[inside], other.t, other.q)
        return float(np.sqrt(np.mean((there - motion.q[inside]) ** 2)))

    low, high = other.t[0] - motion.t[-1], other.t[-1] - motion.t[0]
    # The distance has many local minima, so the whole range is tried before it is refined.
    best = min(np.arange(low, high, COARSE), key=distance)
    for step in (COARSE / 5, COARSE / 25, FINE):
        best = min(best + step * np.arange(-6, 7), key=distance)
    left = distance(float(best))
    if left > SAME_MOTION:
        raise NotSameMotionError(
            f"{motion.recording.name} and {other.name} are not the same motion: positions differ "
            f"by {1e3 * left:.3g} mrad rms at best; a pair must repeat one trajectory"
        )
    return float(best), left


def payload_from_poses(recordings: Sequence[Recording], robot: Robot) -> LoadFit:
    """Find a load from poses at rest: what the torque has beyond the robot's own gravity.

    Stiction hides in every pose; its size is what the residual shows, and many poses average it.
    What the model misses of an arm, and what a day does to its drives, is alike in all poses of a
    log: of several logs, how they differ is part of the standard deviations.
    """
    each = [resting_poses([recording], robot) for recording in recordings]
    q, torque = (np.concatenate(parts) for parts in zip(*each, strict=True))
    if (different := different_poses(q)) < POSES:
        raise TooFewPosesError(
            f"{names_of(recordings)}: {len(q)} poses at rest of at least {DWELL:g} s, {different} "
            f"of them different; a load needs {POSES} different ones, or a pair of logs of one "
            "motion with and without it"
        )
    zero = np.zeros_like(q)
    Y = torque_regressor(robot.chain, q, zero, zero)[:, :, -LINK:][:, :, :STATIC]
    extra = torque - gravity_torque(robot, q)
    usable = np.ones_like(extra)
    x = fit_all_joints(Y, extra, usable)
    left = extra - np.einsum("knp,p->kn", Y, x)
    # Poses are no series in time: each tells for itself.
    freedom = 1.0 - STATIC / left.size
    noise = inverse_gram(weighted_rows(Y, left, usable, left)[0]) / freedom
    gain = max(gain_sd(recording, robot) for recording in recordings)
    covariance = noise + gain_covariance(Y, left, extra, usable, gain)
    ends = np.cumsum([len(poses) for poses, _ in each])
    logs = [slice(end - len(poses), end) for end, (poses, _) in zip(ends, each, strict=True)]
    logs = [log for log in logs if log.stop > log.start]
    if len(logs) > 1:
        covariance = covariance + cluster_covariance(Y, left, usable, logs)
    sd = np.sqrt(np.diag(covariance))
    origin = fact("load-from-poses", poses=len(q), different=different, logs=len(logs))
    return load_at_flange(LoadSolution(x, sd, np.std(left, axis=0)), robot, recordings, origin)


def different_poses(q: Array) -> int:
    """How many poses (P, n) there are that lie `APART` from each other."""
    found: list[Array] = []
    for pose in q:
        if not found or np.min(np.max(np.abs(np.array(found) - pose), axis=1)) > APART:
            found.append(pose)
    return len(found)


def resting_poses(recordings: Sequence[Recording], robot: Robot) -> tuple[Array, Array]:
    """Mean position and torque of every rest. (P, n) [rad], (P, n) [N·m]"""
    q, torque = [], []
    for recording in recordings:
        effort, still = drive_torque(recording, robot), held(recording.q, recording.median_step)
        for start, stop in intervals(recording.t, still, least=DWELL):
            edge = (stop - start) // 5  # where the arm still settles or already leaves
            span = slice(start + edge, stop - edge)
            q.append(recording.q[span].mean(axis=0))
            torque.append(effort[span].mean(axis=0))
    n = robot.joints
    return np.reshape(q, (-1, n)), np.reshape(torque, (-1, n))
