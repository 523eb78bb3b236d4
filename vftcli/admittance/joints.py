"""Joint positions from flange poses, by damped least squares sample by sample."""

from typing import NamedTuple

import numpy as np

from vftcli.robots.robot import LARGEST_STEP, FlangeSolver, Robot
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.pose import exp_matrix


def check_start(robot: Robot, q: Array) -> Array:
    """Return a start pose. (n,) [rad]"""
    if robot.joints < 6:
        raise ParameterError(
            f"{robot.name} has {robot.joints} joints; Cartesian admittance needs at least 6"
        )
    q = np.asarray(q, float)
    if q.shape != (robot.joints,):
        raise ParameterError(
            f"the start pose has {q.size} joints; {robot.name} has {robot.joints}"
        )
    lower, upper = np.fmax(robot.limits.q_min, -np.inf), np.fmin(robot.limits.q_max, np.inf)
    if np.any(wrong := ~((q >= lower) & (q <= upper))):
        j = wrong.argmax()
        raise ParameterError(
            f"the start pose is outside the joint limits of {robot.name}: joint {j + 1} "
            f"is at {q[j]:.4g} rad and may be {lower[j]:.4g} to {upper[j]:.4g} rad"
        )
    return q


class JointPath(NamedTuple):
    """Joint positions along the motions of N controllers."""

    #: Positions; out of reach it waits at the last one. (T, N, n) [rad]
    q: Array
    reached: Mask  #: Whether the flange pose is reached inside the joint limits. (T, N)
    speed: (
        #: Largest joint speed as a share of its limit, NaN where no limit is known. (N,)
        Array
    )


def follow(robot: Robot, start: Array, x: Array, period: float) -> JointPath:
    """Joints along flange deviations (T, N, 6) [m, rad] from `start` (n,) [rad].

    Deviations are in base axes, rotation vectors last, a `period` [s] apart.
    """
    solver = FlangeSolver(robot)
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
                # Straight on from the two poses before.
                guess = 2.0 * last - before if good else last
                found, good = try_pose(solver, goal, point, guess, last)
                last, before = found, last if good else found
                shown = found if good else shown
            q[k, i], reached[k, i] = shown, good
    return JointPath(q, reached, largest_speed(robot, q, reached, period))


def try_pose(
    solver: FlangeSolver, rotation: Array, point: Array, guess: Array, last: Array
) -> tuple[Array, bool]:
    """Joints at a pose, from a guess or, if that fails or leaps, from `last`. (n,)"""
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
