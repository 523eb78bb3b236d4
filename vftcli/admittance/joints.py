"""From flange poses to joint positions: damped least squares, each sample started from the last."""

from typing import Any, NamedTuple

import numpy as np

from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.packages import needed
from vftcli.signals.pose import exp_matrix

ITERATIONS = 12
#: A pose counts as reached when position and rotation error are below this. [m, rad]
REACHED = 1e-6
#: λ² of the damped step is this times the error, so that it vanishes at the pose.
DAMPING = 1e-3
#: Share of the error that is left after three steps where a pose is out of reach.
STALLED = 0.7
LARGEST_STEP = 0.2  #: Longest joint step of one iteration. [rad]


class FlangeSolver:
    """Joint positions that bring the flange to a pose, inside the joint limits."""

    def __init__(self, robot: Robot) -> None:
        pin = needed("pinocchio", "an admittance replay")
        from scipy.linalg.lapack import dposv

        if robot.joints < 6:
            raise ParameterError(
                f"{robot.name} has {robot.joints} joints; Cartesian admittance needs at least 6"
            )
        self.robot, self.pin, self.solve = robot, pin, dposv
        self.model: Any = robot.model
        self.data: Any = self.model.createData()
        self.frame = self.model.getFrameId("flange")
        self.lower = np.fmax(robot.limits.q_min, -np.inf)
        self.upper = np.fmin(robot.limits.q_max, np.inf)

    def pose(self, q: Array) -> tuple[Array, Array]:
        """Orientation (3, 3) and origin (3,) [m] of the flange in the base at `q` (n,) [rad]."""
        self.pin.framesForwardKinematics(self.model, self.data, np.asarray(q, float))
        place = self.data.oMf[self.frame]
        return np.array(place.rotation), np.array(place.translation)

    def check_start(self, q: Array) -> Array:
        """Return a start pose."""
        q = np.asarray(q, float)
        if q.shape != (self.robot.joints,):
            raise ParameterError(
                f"the start pose has {q.size} joints; {self.robot.name} has {self.robot.joints}"
            )
        if np.any(wrong := ~((q >= self.lower) & (q <= self.upper))):
            j = wrong.argmax()
            raise ParameterError(
                f"the start pose is outside the joint limits of {self.robot.name}: joint {j + 1} "
                f"is at {q[j]:.4g} rad and may be {self.lower[j]:.4g} to {self.upper[j]:.4g} rad"
            )
        return q

    def reach(self, rotation: Array, translation: Array, guess: Array) -> tuple[Array, bool]:
        """Joint positions at a pose, from a guess nearby, and whether the pose is reached.

        A step is Jᵀ(JJᵀ + λ²I)⁻¹e in base axes, cut at the joint limits; where the pose
        is not reached the joints are those of the last step.
        """
        pin, model, data, frame = self.pin, self.model, self.data, self.frame
        q, error, sizes = guess, np.empty(6), [np.inf, np.inf, np.inf]
        for _ in range(ITERATIONS):
            J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
            place = pin.updateFramePlacement(model, data, frame)
            error[:3] = translation - place.translation
            error[3:] = pin.log3(rotation @ place.rotation.T)
            size = float(np.sqrt(error @ error))
            if size < REACHED:
                return q, True
            if size > STALLED * sizes[-3]:
                break
            sizes.append(size)
            normal = J @ J.T
            normal.flat[::7] += DAMPING * min(size, 1.0) ** 2
            _, weights, _ = self.solve(normal, error)
            step = J.T @ weights
            step *= LARGEST_STEP / max(float(abs(step).max()), LARGEST_STEP)
            q = np.minimum(np.maximum(q + step, self.lower), self.upper)
        return q, False


class JointPath(NamedTuple):
    """Joint positions along the motions of N controllers."""

    #: Positions; where a pose is out of reach the arm waits at the last it reached.
    #: (T, N, n) [rad]
    q: Array
    reached: Mask  #: Whether the flange pose is reached inside the joint limits. (T, N)
    speed: (
        Array  #: Largest joint speed as a share of its limit, NaN where no limit is known. (N,)
    )


def follow(solver: FlangeSolver, start: Array, x: Array, period: float) -> JointPath:
    """Joint positions for flange deviations (T, N, 6) [m, rad] from a start pose (n,) [rad].

    Deviations are in base axes, rotation vectors last, a `period` [s] apart.
    """
    rotation, translation = solver.pose(start)
    q, reached = np.empty((*x.shape[:2], len(start))), np.zeros(x.shape[:2], bool)
    for i in range(x.shape[1]):
        goals, points = exp_matrix(x[:, i, 3:]) @ rotation, translation + x[:, i, :3]
        same = np.all(x[1:, i] == x[:-1, i], axis=1)
        shown, last, before, good = start, start, start, True
        for k, (goal, point) in enumerate(zip(goals, points, strict=True)):
            if k and same[k - 1]:
                before = last
            else:
                # Straight on from the two poses before: the arm moves evenly between
                # periods.
                guess = 2.0 * last - before if good else last
                found, good = try_pose(solver, goal, point, guess, last)
                last, before = found, last if good else found
                shown = found if good else shown
            q[k, i], reached[k, i] = shown, good
    return JointPath(q, reached, largest_speed(solver.robot, q, reached, period))


def try_pose(
    solver: FlangeSolver, rotation: Array, point: Array, guess: Array, last: Array
) -> tuple[Array, bool]:
    """Joints at a pose from a guess, and if that fails or leaps, from the joints before it."""
    if not np.isfinite(point).all():
        return last, False
    found, good = solver.reach(rotation, point, guess)
    if good and abs(found - last).max() <= LARGEST_STEP:
        return found, True
    return solver.reach(rotation, point, last)


def largest_speed(robot: Robot, q: Array, reached: Mask, period: float) -> Array:
    """Largest joint speed between reached samples as a share of the limit. (N,)"""
    share = abs(np.diff(q, axis=0)) / period / robot.limits.qd_max
    both = (reached[1:] & reached[:-1])[:, :, None] & np.isfinite(share)
    largest = np.where(both, share, -1.0).max(axis=(0, 2), initial=-1.0)
    return np.where(largest >= 0.0, largest, np.nan)
