"""Contacts mounted on the arm: where they act, what they exert, and the joint torque of it."""

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from vftcli.robots.chain import Chain
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.pose import cross
from vftcli.simulation.contacts import (
    Hand,
    HandSpec,
    LoadSpec,
    Place,
    ProfileSpec,
    PushesSpec,
    Segments,
    StopSpec,
)


@dataclass(frozen=True, kw_only=True)
class RandomWalkSpec:
    """Joint torques that walk at random, the disturbance model of the Kalman observers."""

    KIND: ClassVar[str] = "random-walk"
    name: str  #: Name of the contact.
    #: Variance gained a second: Q_τ; one number or one a joint. [(N·m)²/s]
    intensity: tuple[float, ...]
    initial: float = 0.0  #: Standard deviation at the start. [N·m]
    begin: float = 0.0  #: The walk is zero before this. [s]


#: Contacts that act with a wrench on a link, told apart by their `kind`.
WrenchSpec = ProfileSpec | PushesSpec | HandSpec | LoadSpec | StopSpec
ContactSpec = WrenchSpec | RandomWalkSpec  #: Every kind of ``[[contacts]]`` a scenario can have.


class Mounted(NamedTuple):
    """A contact and the body it acts on."""

    name: str  #: The contact's name.
    contact: Segments | Hand | StopSpec  #: What it exerts.
    joint: int  #: The joint that carries the body, from 1.
    turn: Array  #: Orientation of the link's frame in the joint's frame. (3, 3)
    point: Array  #: The contact's point in the joint's frame. (3,) [m]
    on_flange: bool  #: Whether it acts on the flange.
    lever: Array  #: The point in flange axes from the flange origin, for contacts there. (3,) [m]


def mount(
    spec: WrenchSpec,
    chain: Chain,
    rng: np.random.Generator,
    duration: float,
) -> Mounted:
    """Put a contact on its link."""
    if not 0 <= spec.link <= chain.joints:
        raise ParameterError(
            f"contacts.{spec.name}.link is {spec.link}; it is 0 (flange) to {chain.joints}"
        )
    contact, lever = spec.start(rng, duration), np.array(spec.point)
    if spec.link == 0:
        point = chain.flange_rotation @ lever + chain.flange_translation
        return Mounted(spec.name, contact, chain.joints, chain.flange_rotation, point, True, lever)
    return Mounted(spec.name, contact, spec.link, np.eye(3), lever, False, lever)


def draw_walk(
    spec: RandomWalkSpec,
    joints: int,
    steps: int,
    step: float,
    rng: np.random.Generator,
) -> Array:
    """A random walk of joint torques over `steps` inner steps of `step` [s]. (N, n) [N·m]"""
    if len(spec.intensity) not in {1, joints} or min(spec.intensity) < 0:
        raise ParameterError(
            f"contacts.{spec.name}.intensity has {len(spec.intensity)} numbers; it must have one "
            f"or {joints}, none negative"
        )
    sizes = np.sqrt(np.broadcast_to(spec.intensity, joints) * step)
    walk = np.cumsum(rng.standard_normal((steps, joints)) * sizes, axis=0)
    walk += spec.initial * rng.standard_normal(joints)
    late = np.arange(steps) * step >= spec.begin
    begun = walk - (walk[np.argmax(late)] if spec.begin > 0 else 0.0)
    return np.asarray(begun * late[:, None])


class Touching:
    """Everything that touches the arm during a run, evaluated at the middle of each step.

    Attributes:
        mounted: Contacts that exert wrenches.
        walks: Name → joint torque of each random walk at each inner step. (N, n) [N·m]
        wrenches: The last wrench of each mounted contact about its point, base axes. (C, 6)
    """

    def __init__(
        self,
        specs: tuple[ContactSpec, ...],
        chain: Chain,
        steps: int,
        step: float,
        seed: np.random.SeedSequence,
    ) -> None:
        names = [spec.name for spec in specs]
        if doubled := {name for name in names if names.count(name) > 1}:
            raise ParameterError(f"two contacts are named {doubled.pop()!r}; name each its own way")
        # A generator a contact: adding one leaves what the others draw as it was.
        rngs = [np.random.default_rng(s) for s in seed.spawn(len(specs))]
        self.mounted: list[Mounted] = []
        self.walks: dict[str, Array] = {}
        for spec, rng in zip(specs, rngs, strict=True):
            if isinstance(spec, RandomWalkSpec):
                self.walks[spec.name] = draw_walk(spec, chain.joints, steps, step, rng)
            else:
                self.mounted.append(mount(spec, chain, rng, steps * step))
        self.wrenches = np.zeros((len(self.mounted), 6))
        self.step = step

    def anything(self, t: float) -> bool:
        """Whether any contact may exert something at `t` [s]."""
        return bool(self.walks) or any(m.contact.active(t) for m in self.mounted)

    def torque(self, t: float, model: Any, data: Any, v: Array) -> Array:  # noqa: ANN401
        """Joint torque of all contacts; the data's joint Jacobians are current. (n,) [N·m]"""
        tau = np.zeros_like(v)
        for walk in self.walks.values():
            tau += walk[min(int(t / self.step), len(walk) - 1)]
        for k, mounted in enumerate(self.mounted):
            self.wrenches[k] = 0.0
            if not mounted.contact.active(t):
                continue
            J, pose = joint_jacobian(model, data, mounted.joint), data.oMi[mounted.joint]
            R, arm, twist = pose.rotation, pose.rotation @ mounted.point, J @ v
            velocity = twist[:3] + cross(twist[3:], arm)
            place = Place(R @ mounted.turn, pose.translation + arm, velocity, twist[3:])
            self.wrenches[k] = wrench = mounted.contact.wrench(t, place)
            tau += J[:3].T @ wrench[:3] + J[3:].T @ (wrench[3:] + cross(arm, wrench[:3]))
        return tau


def joint_jacobian(model: Any, data: Any, joint: int) -> Array:  # noqa: ANN401
    """Jacobian of a joint's origin in base axes; the data's own are current. (6, n)"""
    import pinocchio as pin

    return np.asarray(pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED))
