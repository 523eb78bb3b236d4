"""A scenario's motion suited to another arm than the one it was written for, every change said.

A circle keeps what the arm can do: first the whole of it, then its place and size with a longer
period, then another start, then a smaller radius. An excitation without an optimised series is made
for the arm. What the user states stays as it is.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np

from vftcli.robots import Robot
from vftcli.robots.kinematics import flange_jacobian, link_poses
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.simulation.calibration_motions import TABLE, ExcitationSpec, is_optimised
from vftcli.simulation.excitation import (
    ACCELERATION,
    SHARE,
    SPEED,
    ends_of,
    make_excitation,
    torque_share,
)
from vftcli.simulation.kinematics import HOMES, FlangePose, check_limits, follow, reach
from vftcli.simulation.trajectories import CircleSpec, TrajectorySpec

DRAWS = 8000
"""Poses among which a start is looked for."""
STARTS = 12
"""Most of them that are tried for one radius."""
DOWN = 0.94
"""Least cosine between the flange's axis and straight down in such a pose."""
MARGIN = 0.3
"""Distance to a joint's end beyond which more is of no use. [rad]"""
RADIUS_SHARE = 0.22
"""Radius of a circle as a share of the arm's reach: the 0.2 m of a UR5."""
SMALLER = 0.8
"""By how much a radius that no start allows is made smaller, and how often at most."""
RADII = 6
LONGER = 1.5
"""Growth of the period beyond which another start is looked for."""
INSTANTS = 192
"""Instants of a round at which speeds and torques are looked at."""
DECIMALS = 4
"""Digits to which what is found is rounded. [rad, m, s]"""


@dataclass(frozen=True)
class Suited:
    """A circle that an arm can run.

    Attributes:
        circle: The circle, its period long enough.
        growth: The period over the one asked for.
    """

    circle: CircleSpec
    growth: float


def adapt(
    spec: TrajectorySpec, robot: Robot, stated: Collection[str]
) -> tuple[TrajectorySpec, tuple[Remark, ...]]:
    """Suit a motion to a robot, and say what was changed; a motion that fits stays as it is.

    Args:
        spec: The motion.
        robot: The arm.
        stated: Keys of ``[trajectory]`` that the user has set; they are not changed.
    """
    if isinstance(spec, CircleSpec):
        circle = adapt_circle(spec, robot, stated)
        return circle, tuple(circle_remarks(spec, circle, robot))
    if isinstance(spec, ExcitationSpec) and not spec.mean and not is_optimised(robot.name):
        made = make_excitation(robot, spec.period, spec.cycles)
        series = made.series
        excitation = replace(
            spec,
            period=series.period,
            mean=tuple(series.mean.tolist()),
            cosine=tuple(map(tuple, series.cosine.tolist())),
            sine=tuple(map(tuple, series.sine.tolist())),
        )
        about = {"robot": robot.name, "condition": made.condition, "columns": made.rank}
        remark = fact("excitation-made", **about, period_s=series.period)
        return excitation, (remark, *open_limits(robot))
    return spec, ()


def open_limits(robot: Robot) -> Iterator[Remark]:
    """What was assumed of an excitation where the robot's limits leave it open."""
    limits = robot.limits
    endless = ~(np.isfinite(limits.q_min) & np.isfinite(limits.q_max))
    assumed = (
        ("no-position-limit", endless, {"way_rad": np.pi}),
        ("no-speed-limit", ~np.isfinite(limits.qd_max), {"speed_rad_s": SPEED}),
        (
            "no-acceleration-limit",
            ~np.isfinite(limits.qdd_max),
            {"acceleration_rad_s2": ACCELERATION},
        ),
        ("no-torque-limit", ~np.isfinite(limits.tau_max), {}),
    )
    for code, lacking, values in assumed:
        if np.any(lacking):
            joints = tuple(int(j) + 1 for j in np.flatnonzero(lacking))
            yield caution(code, Where(joints=joints), **values)


def adapt_circle(spec: CircleSpec, robot: Robot, stated: Collection[str]) -> CircleSpec:
    """The circle, or one that the robot can run; what nothing can be found for stays as it is."""
    if spec.radius <= 0 or spec.period <= 0 or spec.cycles <= 0:
        return spec
    start = spec.start
    if "start" not in stated and len(start) != robot.joints:
        start = HOMES.get(robot.joints, (0.0,) * robot.joints)
    same = replace(spec, start=start)
    found = suit(same, robot)
    if found is not None and found.growth == 1.0:
        return found.circle
    free_period = "period" not in stated
    if not free_period and found is not None:
        found = None
    if "start" not in stated and (found is None or found.growth > LONGER):
        others = other_circles(same, robot, longer=free_period, smaller="radius" not in stated)
        found = min([*others, *([found] if found else [])], key=lambda s: s.growth, default=None)
    return spec if found is None else found.circle


def suit(circle: CircleSpec, robot: Robot) -> Suited | None:
    """The circle with a period that speeds and torques allow, None if it cannot be run at all."""
    try:
        motion = circle.motion(robot)
        at_rest = motion.at(np.linspace(0.0, circle.period, INSTANTS, endpoint=False))
        check_limits(robot, at_rest.q, np.zeros_like(at_rest.q), "the circle")
    except ParameterError:
        return None
    growth = 1.0
    for _ in range(20):
        reference = replace(motion, period=circle.period * growth).at(
            np.linspace(0.0, circle.period * growth, INSTANTS, endpoint=False)
        )
        speed = np.nanmax(
            np.append(np.max(np.abs(reference.dq), axis=0) / robot.limits.qd_max, 0.0)
        )
        torque = float(np.max(torque_share(robot, reference)))
        most = 1.0 if growth == 1.0 else SHARE
        if speed <= most and torque <= most:
            period = circle.period if growth == 1.0 else round(circle.period * growth, 1)
            return Suited(replace(circle, period=period), growth)
        growth *= max(float(speed) / SHARE, 1.1)
    return None


def other_circles(
    circle: CircleSpec, robot: Robot, *, longer: bool, smaller: bool
) -> Iterator[Suited]:
    """Circles about other centres, as large as can be, those of the first radius that fits.

    Args:
        circle: The circle asked for.
        robot: The arm.
        longer: Whether the period may grow.
        smaller: Whether the radius may be smaller.
    """
    centres = centre_poses(robot)
    radius = circle.radius
    if smaller:
        radius = min(radius, round(RADIUS_SHARE * reach_of(robot), 3))
    found = False
    for _ in range(RADII if smaller else 1):
        for centre in centres:
            start = start_of(robot, centre, radius, circle.towards)
            if start is None:
                continue
            suited = suit(replace(circle, start=start, radius=radius), robot)
            if suited is None or (suited.growth > 1.0 and not longer):
                continue
            found = True
            yield suited
            if suited.growth <= LONGER:
                return
        if found:
            return
        radius = round(SMALLER * radius, 3)


def drawn_poses(robot: Robot) -> Array:
    """Joint positions drawn evenly between the ends of the joints. (N, n) [rad]"""
    low, high = ends_of(robot)
    # Two turns either way lead nowhere that one does not.
    low, high = np.maximum(low, -np.pi), np.minimum(high, np.pi)
    share = np.random.default_rng(0).uniform(0.02, 0.98, (DRAWS, robot.joints))
    poses: Array = low + share * (high - low)
    return poses


def reach_of(robot: Robot) -> float:
    """Largest distance of the flange from the second joint over the drawn poses. [m]"""
    places = link_poses(robot.loaded_chain, drawn_poses(robot)).translation
    second = min(1, robot.joints - 1)
    return float(np.max(np.linalg.norm(places[:, -1] - places[:, second], axis=1)))


def centre_poses(robot: Robot) -> list[Array]:
    """Poses about which an arm moves freely, the best first. (n,) each [rad]

    The flange looks down where that can be, and is above the table; what counts is the smallest
    singular value of its Jacobian (lengths by the reach) and the distance to the joints' ends.
    """
    q, chain = drawn_poses(robot), robot.loaded_chain
    poses = link_poses(chain, q)
    jacobian = flange_jacobian(chain, q)
    jacobian[:, :3] /= reach_of(robot)
    low, high = ends_of(robot)
    room = np.clip(np.min(np.minimum(q - low, high - q), axis=1), 0.0, MARGIN)
    worth = np.linalg.svd(jacobian, compute_uv=False)[:, -1] * room
    # A planar or a five-jointed arm has no sixth direction: none of its poses is worth anything.
    fit = (poses.translation[:, -1, 2] > TABLE) & (worth > 0.0)
    down = fit & (poses.rotation[:, -1, 2, 2] < -DOWN)
    if np.count_nonzero(down) >= STARTS:
        fit = down
    order = [k for k in np.argsort(-worth) if fit[k]][:STARTS]
    return [q[k] for k in order]


def start_of(
    robot: Robot, centre: Array, radius: float, towards: float
) -> tuple[float, ...] | None:
    """The start of a circle about the flange of a pose, turned to look straight down, or None."""
    here = link_poses(robot.loaded_chain, centre[None])
    rotation, place = here.rotation[0, -1], here.translation[0, -1]
    if rotation[2, 2] < -DOWN:
        x = np.array([rotation[0, 0], rotation[1, 0], 0.0])
        x /= np.linalg.norm(x)
        z = np.array([0.0, 0.0, -1.0])
        rotation = np.column_stack([x, np.cross(z, x), z])
    upright = reach(robot.model, FlangePose(rotation, place), centre)
    if upright is None:
        return None
    away = -radius * np.array([np.cos(towards), np.sin(towards), 0.0])
    try:
        way = [FlangePose(rotation, place + share * away) for share in np.linspace(0.0, 1.0, 6)]
        q = follow(robot, way, upright, "the circle")[-1]
    except ParameterError:
        return None
    return tuple(np.round(q, DECIMALS).tolist())


def circle_remarks(asked: CircleSpec, made: CircleSpec, robot: Robot) -> Iterator[Remark]:
    """What was changed of a circle."""
    if made.start != asked.start:
        yield fact("start-adapted", robot=robot.name, start_rad=list(made.start))
    if made.radius != asked.radius:
        values = {"radius_m": made.radius, "asked_m": asked.radius}
        yield fact("radius-adapted", robot=robot.name, reach_m=reach_of(robot), **values)
    if made.period != asked.period:
        values = {"period_s": made.period, "asked_s": asked.period}
        yield fact("period-adapted", robot=robot.name, share_percent=100 * SHARE, **values)
