"""Flange poses and the joint angles that reach them."""

from typing import Any

import numpy as np

from vftcli.robots import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError

ITERATIONS = 100
#: A pose counts as reached when position and rotation error are below this. [m, rad]
REACHED = 1e-10
#: Number of joints → a pose from which such an arm can work, the flange looking down. [rad]
HOMES: dict[int, tuple[float, ...]] = {
    6: (0.0, -1.35, 1.9, -2.1208, -1.5708, 0.0),
    7: (0.0, -0.7854, 0.0, -2.3562, 0.0, 1.5708, 0.7854),
}


def flange_pose(model: Any, q: Array) -> Any:  # noqa: ANN401 - Pinocchio is untyped
    """Pose of the flange in the base frame at joint positions `q` (n,) [rad], an SE3 [m]."""
    import pinocchio as pin

    data = model.createData()
    pin.framesForwardKinematics(model, data, np.asarray(q, dtype=float))
    return data.oMf[model.getFrameId("flange")].copy()


def reach(model: Any, goal: Any, guess: Array) -> Array | None:  # noqa: ANN401
    """Joint positions that bring the flange to a pose, from a nearby guess, or None. (n,) [rad]

    Gauss–Newton on the error twist log(T⁻¹ T_d) with damping that vanishes with the error, so that
    redundant arms move by the least joint motion.
    """
    import pinocchio as pin

    data, frame = model.createData(), model.getFrameId("flange")
    q = np.array(guess, dtype=float)
    for _ in range(ITERATIONS):
        pin.framesForwardKinematics(model, data, q)
        error = pin.log6(data.oMf[frame].inverse() * goal).vector
        size = float(np.linalg.norm(error))
        if size < REACHED:
            return q
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL)
        # Far away damping keeps steps short at singularities; near the goal it must not slow down.
        damping = 1e-3 * min(size, 1.0) ** 2
        q = q + J.T @ np.linalg.solve(J @ J.T + damping * np.eye(6), error)
    return None


def follow(robot: Robot, rotation: Array, points: Array, start: Array, what: str) -> Array:
    """Joint positions along flange points (K, 3) [m], each from the one before. (K, n) [rad]"""
    import pinocchio as pin

    q, path = np.array(start, dtype=float), []
    for k, point in enumerate(points):
        found = reach(robot.model, pin.SE3(rotation, point), q)
        # A jump of a radian is another branch of the inverse kinematics, not the path's next pose.
        if found is None or np.max(np.abs(found - q)) > 1.0:
            x, y, z = point
            raise ParameterError(
                f"{what}: the flange of {robot.name!r} cannot reach ({x:.3f}, {y:.3f}, {z:.3f}) m "
                f"(point {k + 1} of {len(points)}); choose a smaller motion or another start"
            )
        q = found
        path.append(q)
    return np.array(path)


def check_limits(robot: Robot, q: Array, dq: Array, what: str) -> None:
    """Raise a ParameterError unless a motion (T, n) stays inside the robot's limits."""
    limits = robot.limits
    for j in range(robot.joints):
        low, high, fastest = limits.q_min[j], limits.q_max[j], limits.qd_max[j]
        span = (float(np.min(q[:, j])), float(np.max(q[:, j])))
        if span[0] < low or span[1] > high:
            raise ParameterError(
                f"{what}: joint {j + 1} of {robot.name!r} would move over {span[0]:.3f} to "
                f"{span[1]:.3f} rad; its limits are {low:.3f} to {high:.3f}"
            )
        speed = float(np.max(np.abs(dq[:, j])))
        if speed > fastest:
            raise ParameterError(
                f"{what}: joint {j + 1} of {robot.name!r} would move at {speed:.2f} rad/s; "
                f"its limit is {fastest:.2f}"
            )


def check_start(robot: Robot, start: tuple[float, ...]) -> Array:
    """Return a start pose, the usual one if none is given. (n,) [rad]"""
    start = start or HOMES.get(robot.joints, (0.0,) * robot.joints)
    if len(start) != robot.joints:
        raise ParameterError(
            f"trajectory.start has {len(start)} angles; robot {robot.name!r} has {robot.joints} "
            "joints"
        )
    return np.array(start, dtype=float)
