"""A scenario's motion suited to another arm than the one it was written for, every change said.

A circle keeps what the arm can do: first the whole of it, then its place and size with a longer
period, then another start, then a smaller radius. An excitation without an optimised series is made
for the arm. Hands push no harder than the arm can hold. What the user states stays as it is.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vftcli.robots import Robot
from vftcli.robots.kinematics import flange_jacobian, link_poses
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.packages import needed
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.simulation.calibration_motions import TABLE, ExcitationSpec, is_optimised
from vftcli.simulation.fourier_excitation import (
    ACCELERATION,
    SHARE,
    SPEED,
    ends_of,
    make_excitation,
    torque_share,
)
from vftcli.simulation.kinematics import HOMES, FlangePose, check_limits, follow, reach
from vftcli.simulation.motion import Reference
from vftcli.simulation.pushes import PushesSpec
from vftcli.simulation.scenario import Scenario
from vftcli.simulation.servo import STIFFNESS
from vftcli.simulation.touch import ContactSpec
from vftcli.simulation.trajectories import CircleSpec

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
GIVING = 0.1
"""How far a push may move a joint. [rad]"""
UNITS = {"force": "N", "torque": "Nm"}
"""What a hand pushes with → its unit."""
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


def adapt(scenario: Scenario, robot: Robot, stated: Collection[str]) -> Scenario:
    """Suit a scenario's motion to a robot, and say what was changed; what fits stays as it is.

    Args:
        scenario: The scenario.
        robot: Its arm.
        stated: Keys that the user has set, as ``trajectory.radius``; they are not changed.
    """
    spec = scenario.trajectory
    remarks: list[Remark] = []
    if isinstance(spec, CircleSpec):
        circle = adapt_circle(spec, robot, stated)
        remarks += circle_remarks(spec, circle, robot)
        contacts, weaker = adapt_contacts(scenario.contacts, circle, robot, stated)
        scenario = replace(scenario, trajectory=circle, contacts=contacts)
        remarks += weaker
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
        values = {"robot": robot.name, "condition": made.condition, "columns": made.rank}
        remarks.append(Remark("excitation-made", "fact", values | {"period_s": series.period}))
        remarks += open_limits(robot)
        scenario = replace(scenario, trajectory=excitation)
    return replace(scenario, adapted=tuple(map(str, remarks))) if remarks else scenario


def open_limits(robot: Robot) -> Iterator[Remark]:
    """What was assumed of an excitation where the robot's limits leave it open."""
    limits = robot.limits
    endless = ~(np.isfinite(limits.q_min) & np.isfinite(limits.q_max))
    assumed: tuple[tuple[str, Mask, dict[str, float]], ...] = (
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
    if "trajectory.start" not in stated and len(start) != robot.joints:
        start = HOMES.get(robot.joints, (0.0,) * robot.joints)
    same = replace(spec, start=start)
    found = suit(same, robot)
    if found is not None and found.growth == 1.0:
        return found.circle
    free_period = "trajectory.period" not in stated
    if not free_period and found is not None:
        found = None
    if "trajectory.start" not in stated and (found is None or found.growth > LONGER):
        others = other_circles(
            same, robot, longer=free_period, smaller="trajectory.radius" not in stated
        )
        found = min([*others, *([found] if found else [])], key=lambda s: s.growth, default=None)
    return spec if found is None else found.circle


def suit(circle: CircleSpec, robot: Robot) -> Suited | None:
    """The circle with a period that speeds and torques allow, None if it cannot be run at all."""
    try:
        once = one_round(circle, robot)
        check_limits(robot, once.q, np.zeros_like(once.q), "the circle")
    except ParameterError:
        return None
    fastest = np.where(np.isfinite(robot.limits.qd_max), robot.limits.qd_max, np.inf)
    growth = 1.0
    for _ in range(20):
        # The same places, passed more slowly.
        reference = Reference(once.q, once.dq / growth, once.ddq / growth**2)
        speed = float(np.max(np.max(np.abs(reference.dq), axis=0) / fastest))
        torque = float(np.max(torque_share(robot, reference)))
        most = 1.0 if growth == 1.0 else SHARE
        if speed <= most and torque <= most:
            period = circle.period if growth == 1.0 else round(circle.period * growth, 1)
            return Suited(replace(circle, period=period), growth)
        growth *= max(speed / SHARE, 1.1)
    return None


def one_round(circle: CircleSpec, robot: Robot) -> Reference:
    """One round of the circle. (INSTANTS, n) each

    Raises:
        ParameterError: If it is out of reach, or winds a joint up.
    """
    t = np.linspace(0.0, circle.period, INSTANTS, endpoint=False)
    return circle.motion(robot).at(t)


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
    """The start of a circle about the flange of a pose, or None where it cannot be reached."""
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
        values = {"radius_m": made.radius, "asked_m": asked.radius, "reach_m": reach_of(robot)}
        yield Remark("radius-adapted", "fact", {"robot": robot.name, **values})
    if made.period != asked.period:
        values = {"period_s": made.period, "asked_s": asked.period, "share_percent": 100 * SHARE}
        yield Remark("period-adapted", "fact", {"robot": robot.name, **values})


def adapt_contacts(
    contacts: tuple[ContactSpec, ...], circle: CircleSpec, robot: Robot, stated: Collection[str]
) -> tuple[tuple[ContactSpec, ...], list[Remark]]:
    """Hands that push no harder than the arm can hold along the circle, and what that changed.

    An arm without rotors, whose position loop is as soft as its links are light, would be pushed
    round; one with weak drives would give way.
    """
    pushing = [c for c in contacts if isinstance(c, PushesSpec) and c.link == 0]
    try:
        most = bearable(robot, one_round(circle, robot)) if pushing else {}
    except ParameterError:  # it is refused where it is planned
        return contacts, []
    made, remarks = list(contacts), []
    for contact in pushing:
        style = contact.ranges()
        weaker: dict[str, Any] = {}
        for key, largest in most.items():
            low, high = getattr(style, key)
            if high > largest and f"contacts.{contact.name}.{key}" not in stated:
                digits = [float(f"{v * largest / high:.2g}") for v in (low, high)]
                weaker[key] = (digits[0], digits[1])
        if not weaker:
            continue
        made[contacts.index(contact)] = replace(contact, **weaker)
        ranges = {"force_N": style.force, "torque_Nm": style.torque}
        ranges |= {f"{key}_{UNITS[key]}": pair for key, pair in weaker.items()}
        values = {"robot": robot.name, **ranges}
        remarks.append(Remark("pushes-weakened", "caution", values, Where(contact.name)))
    return tuple(made), remarks


def bearable(robot: Robot, motion: Reference) -> dict[str, float]:
    """Largest force [N] and moment [N·m] on the flange that an arm holds along a motion.

    What it holds leaves every drive within its limit and, without friction, no joint farther from
    its place than `GIVING` under a stiff position loop, whose stiffness is M(q) ω².
    """
    pin = needed("pinocchio", "a simulation")

    q = motion.q[:: INSTANTS // 24]
    data = robot.model.createData()
    inertia = np.array([pin.crba(robot.model, data, row) for row in q])
    pull = flange_jacobian(robot.loaded_chain, q).transpose(0, 2, 1)
    giving = np.linalg.solve(inertia, pull) / STIFFNESS["stiff"] ** 2
    limit = np.where(np.isfinite(robot.limits.tau_max), robot.limits.tau_max, np.inf)
    room = np.maximum(1.0 - torque_share(robot, motion), 0.0) * limit
    most = {}
    for key, part in (("force", slice(0, 3)), ("torque", slice(3, 6))):
        # The wrench of unit length that is worst for a joint lies along its row.
        worst = np.max(np.linalg.norm(giving[:, :, part], axis=2))
        lever = np.max(np.linalg.norm(pull[:, :, part], axis=2), axis=0)
        # A joint whose axis passes through the flange point feels no force there.
        held = np.min(room / np.maximum(lever, 1e-6))
        most[key] = float(min(GIVING / worst, held))
    return most
