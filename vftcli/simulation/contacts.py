"""Contacts mounted on the arm: their places, wrenches and joint torques.

A contact acts ON the robot at `point` of a `link` (0: the flange), in base axes.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from vftcli.robots.chain import Chain
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import check_known
from vftcli.signals.pose import cross
from vftcli.simulation.scenario import ContactSpec, HandSpec, PushesSpec, StopSpec
from vftcli.simulation.trajectories import minimum_jerk


class Place(NamedTuple):
    """Where a contact's point is and how it moves, in base axes."""

    rotation: Array  #: Orientation of the link (the flange for link 0). (3, 3)
    position: Array  #: The point. (3,) [m]
    velocity: Array  #: Its velocity. (3,) [m/s]
    spin: Array  #: Angular velocity of the link. (3,) [rad/s]


class Push(NamedTuple):
    """One application of a wrench, a rounded trapezoid in time."""

    start: float  #: Where it begins. [s]
    stop: float  #: Where it ends. [s]
    rise: float  #: Time to the full wrench. [s]
    fall: float  #: Time of the release. [s]
    wrench: Array  #: At its full size. (6,) [N, N·m]

    def at(self, t: float) -> Array:
        """The wrench at a time between start and stop. (6,) [N, N·m]"""
        up = 1.0 if self.rise <= 0 else min((t - self.start) / self.rise, 1.0)
        down = 1.0 if self.fall <= 0 else min((self.stop - t) / self.fall, 1.0)
        size = 0.25 * (1.0 - math.cos(math.pi * up)) * (1.0 - math.cos(math.pi * down))
        return size * self.wrench


class SimulatedContact(NamedTuple):
    """A contact during a run: when it acts, and its wrench then."""

    spans: Sequence[tuple[float, float]]  #: Start and end of each application. [s]
    #: Wrench of the k-th application at a time [s] and a place, base axes. (6,) [N, N·m]
    wrench: Callable[[int, float, Place], Array]

    def index_at(self, t: float) -> int | None:
        """Index of the application going on at `t` [s], or None."""
        return next((k for k, (a, b) in enumerate(self.spans) if a <= t < b), None)


class PushStyle(NamedTuple):
    """Ranges from which pushes are drawn evenly."""

    length: tuple[float, float]  #: Shortest and longest push. [s]
    pause: tuple[float, float]  #: Shortest and longest pause between pushes. [s]
    force: tuple[float, float]  #: Smallest and largest peak force. [N]
    torque: tuple[float, float]  #: Smallest and largest peak moment. [N·m]


#: Name of a style of pushing → what it draws from.
STYLES: dict[str, PushStyle] = {
    "slow": PushStyle((0.8, 2.0), (0.3, 1.0), (20.0, 60.0), (0.0, 3.0)),
    "taps": PushStyle((0.14, 0.40), (0.3, 0.9), (30.0, 136.0), (0.0, 4.0)),
    "mixed": PushStyle((0.1, 1.5), (0.3, 1.0), (20.0, 90.0), (1.0, 6.0)),
}


def direction(rng: np.random.Generator, vertical: float) -> Array:
    """A random direction with its vertical part scaled by `vertical`. (3,)"""
    vector = rng.standard_normal(3) * np.array([1.0, 1.0, vertical])
    return np.asarray(vector / np.linalg.norm(vector))


def drawn(spec: PushesSpec, rng: np.random.Generator, duration: float) -> Iterator[Push]:
    """The pushes of a run of `duration` [s], one after another until none fits."""
    check_known(spec.style, STYLES, f"no style {spec.style!r}")
    given = {k: v for k in PushStyle._fields if (v := getattr(spec, k)) is not None}
    style = STYLES[spec.style]._replace(**given)
    if min(style.length[0], style.pause[0]) <= 0:
        raise ParameterError(f"contacts.{spec.name}: length and pause must be positive")
    stop, t = spec.end or duration, spec.begin
    while True:
        t += rng.uniform(*style.pause)
        length = rng.uniform(*style.length)
        force = rng.uniform(*style.force) * direction(rng, spec.vertical)
        torque = rng.uniform(*style.torque) * direction(rng, 1.0)
        if t + length > stop:
            return
        yield Push(t, t + length, 0.5 * length, 0.5 * length, np.concatenate([force, torque]))
        t += length


def hand_of(spec: HandSpec) -> SimulatedContact:
    """A hand: spring and damper between the handle and a moving anchor."""
    for name, rows in (("moves", spec.moves), ("turns", spec.turns)):
        if rows and len(rows) != len(spec.spans):
            raise ParameterError(
                f"contacts.{spec.name}.{name} has {len(rows)} rows; it must have one for each of "
                f"the {len(spec.spans)} spans"
            )
    grips = dict[int, Place]()

    def wrench(k: int, t: float, place: Place) -> Array:
        # A hand takes hold where the handle is at that moment.
        held = grips.setdefault(k, place)
        u = min((t - spec.spans[k][0]) / spec.reach, 1.0) if spec.reach > 0 else 1.0
        way = minimum_jerk(u)
        move, turn = (
            np.array(rows[k]) if rows else np.zeros(3) for rows in (spec.moves, spec.turns)
        )
        gap = held.position + way * move - place.position
        force = spec.stiffness * gap - spec.damping * place.velocity
        torque = -spec.twist_damping * place.spin
        if spec.twist_stiffness:
            import pinocchio as pin

            goal = pin.exp3(way * turn) @ held.rotation
            torque += spec.twist_stiffness * pin.log3(goal @ place.rotation.T)
        left = spec.spans[k][1] - t
        hold = min(left / spec.release, 1.0) if spec.release > 0 else 1.0
        return hold * np.concatenate([force, torque])

    return SimulatedContact(spec.spans, wrench)


def stop_of(spec: StopSpec) -> SimulatedContact:
    """A hard stop: it pushes along its normal and never pulls."""
    if not any(spec.normal):
        raise ParameterError(f"contacts.{spec.name}.normal has no length")
    normal = np.array(spec.normal) / np.linalg.norm(spec.normal)

    def wrench(_k: int, _t: float, place: Place) -> Array:
        depth = normal @ (spec.through - place.position)
        size = max(spec.stiffness * depth - spec.damping * (normal @ place.velocity), 0.0)
        return np.concatenate([size * (depth > 0.0) * normal, np.zeros(3)])

    return SimulatedContact([(-math.inf, math.inf)], wrench)


def pushes_of(pushes: Sequence[Push]) -> SimulatedContact:
    """Pushes that follow one another, in base axes."""
    spans = [(push.start, push.stop) for push in pushes]
    return SimulatedContact(spans, lambda k, t, _place: pushes[k].at(t))


def started(spec: ContactSpec, rng: np.random.Generator, duration: float) -> SimulatedContact:
    """A contact ready to act in a run of `duration` [s]; only pushes are drawn."""
    if isinstance(spec, PushesSpec):
        return pushes_of(list(drawn(spec, rng, duration)))
    if isinstance(spec, StopSpec):
        return stop_of(spec)
    if isinstance(spec, HandSpec):
        return hand_of(spec)
    wrench = np.concatenate([spec.force, spec.torque])
    spans = sorted(spec.spans, key=lambda span: span[0])
    return pushes_of([Push(a, b, spec.rise, spec.fall, wrench) for a, b in spans])


class Mounted(NamedTuple):
    """A contact and the body it acts on."""

    name: str  #: The contact's name.
    contact: SimulatedContact  #: When it acts, and how.
    joint: int  #: The joint that carries the body, from 1.
    turn: Array  #: Orientation of the link's frame in the joint's frame. (3, 3)
    point: Array  #: The contact's point in the joint's frame. (3,) [m]
    lever: Array | None  #: The point in flange axes, of the flange. (3,) [m]


class Touching:
    """All contacts of a run, evaluated at the middle of each step.

    `wrenches` are the last ones of each mounted contact about its point, base axes. (C, 6)
    """

    def __init__(
        self,
        specs: Sequence[ContactSpec],
        chain: Chain,
        duration: float,
        seed: np.random.SeedSequence,
    ) -> None:
        names = [spec.name for spec in specs]
        if doubled := {name for name in names if names.count(name) > 1}:
            raise ParameterError(
                f"two contacts are named {doubled.pop()!r}; name each its own way"
            )
        # A generator a contact: a further one changes no other.
        rngs = [np.random.default_rng(s) for s in seed.spawn(len(specs))]
        self.mounted: list[Mounted] = []
        for spec, rng in zip(specs, rngs, strict=True):
            if not 0 <= spec.link <= chain.joints:
                raise ParameterError(
                    f"contacts.{spec.name}.link is {spec.link}; it is 0 (flange) to {chain.joints}"
                )
            contact, point = started(spec, rng, duration), np.array(spec.point)
            joint, turn, lever = spec.link, np.eye(3), None
            if joint == 0:
                joint, turn, lever = chain.joints, chain.flange_rotation, point
                point = turn @ lever + chain.flange_translation
            self.mounted.append(Mounted(spec.name, contact, joint, turn, point, lever))
        self.wrenches = np.zeros((len(self.mounted), 6))

    def torque(self, t: float, model: Any, data: Any, v: Array) -> Array:  # noqa: ANN401
        """Joint torque of all contacts; the data's joint Jacobians are current. (n,) [N·m]"""
        import pinocchio as pin

        tau = np.zeros_like(v)
        for k, mounted in enumerate(self.mounted):
            self.wrenches[k] = 0.0
            if (number := mounted.contact.index_at(t)) is None:
                continue
            J = pin.getJointJacobian(model, data, mounted.joint, pin.LOCAL_WORLD_ALIGNED)
            pose = data.oMi[mounted.joint]
            R, arm, twist = pose.rotation, pose.rotation @ mounted.point, J @ v
            velocity = twist[:3] + cross(twist[3:], arm)
            place = Place(R @ mounted.turn, pose.translation + arm, velocity, twist[3:])
            self.wrenches[k] = wrench = mounted.contact.wrench(number, t, place)
            tau += J[:3].T @ wrench[:3] + J[3:].T @ (wrench[3:] + cross(arm, wrench[:3]))
        return tau
