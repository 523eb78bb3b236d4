"""The kinds of contact that act with a wrench: given, hung, drawn, hand, hard stop.

It acts ON the robot at `point` of a `link` (0: the flange), in base axes.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import check_known
from vftcli.simulation.motion import minimum_jerk

Vector = tuple[float, float, float]
ORIGIN = (0.0, 0.0, 0.0)


class Place(NamedTuple):
    """Where a contact's point is and how it moves, in base axes."""

    rotation: Array  #: Orientation of the link (the flange for link 0). (3, 3)
    position: Array  #: The point. (3,) [m]
    velocity: Array  #: Its velocity. (3,) [m/s]
    spin: Array  #: Angular velocity of the link. (3,) [rad/s]


def ramp(t: float, start: float, rise: float, stop: float, fall: float) -> float:
    """A rounded trapezoid: 0, up from `start` within `rise`, down by `stop` within `fall`."""
    if t <= start or t >= stop:
        return 0.0
    up = 1.0 if rise <= 0 else min((t - start) / rise, 1.0)
    down = 1.0 if fall <= 0 else min((stop - t) / fall, 1.0)
    return 0.25 * (1.0 - math.cos(math.pi * up)) * (1.0 - math.cos(math.pi * down))


class Push(NamedTuple):
    """One application of a wrench (6,) [N, N·m] from `start` to `stop` [s]."""

    start: float
    stop: float
    rise: float
    fall: float
    wrench: Array


class Segments:
    """Pushes that follow one another, asked at times that never go back."""

    def __init__(self, pushes: list[Push], in_link: bool = False) -> None:
        self.pushes = sorted(pushes, key=lambda p: p.start)
        self.in_link = in_link
        self.next = 0

    def current(self, t: float) -> Push | None:
        """The push going on at time `t` [s], or None between two."""
        while self.next < len(self.pushes) and self.pushes[self.next].stop <= t:
            self.next += 1
        if self.next < len(self.pushes) and self.pushes[self.next].start < t:
            return self.pushes[self.next]
        return None

    def active(self, t: float) -> bool:
        """Whether a push is going on at time `t` [s]."""
        return self.current(t) is not None

    def wrench(self, t: float, place: Place) -> Array:
        """The push's wrench in base axes. (6,) [N, N·m]"""
        push = self.current(t)
        if push is None:
            return np.zeros(6)
        size = ramp(t, push.start, push.rise, push.stop, push.fall)
        wrench = size * push.wrench
        if self.in_link:
            return np.concatenate([place.rotation @ wrench[:3], place.rotation @ wrench[3:]])
        return wrench


@dataclass(frozen=True, kw_only=True)
class ProfileSpec:
    """A stated wrench, switched on and off smoothly at stated times."""

    KIND: ClassVar[str] = "profile"
    name: str  #: Name of the contact.
    spans: tuple[tuple[float, float], ...]  #: Start and end of each application. (K, 2) [s]
    force: Vector = ORIGIN  #: Force ON the robot. (3,) [N]
    torque: Vector = ORIGIN  #: Moment ON the robot about the point. (3,) [N·m]
    rise: float = 0.2  #: Time to the full wrench. [s]
    fall: float = 0.2  #: Time of the release. [s]
    axes: str = "base"  #: "base" or "link": what the components refer to.
    link: int = 0  #: The link it acts on; 0 for the flange.
    point: Vector = ORIGIN  #: The point in the link's frame. (3,) [m]

    def start(self, rng: np.random.Generator, duration: float) -> Segments:
        """Make the contact ready to act; nothing is drawn."""
        del rng, duration
        check_known(self.axes, ("base", "link"), f"no axes {self.axes!r}")
        wrench = np.concatenate([self.force, self.torque])
        rows = [Push(a, b, self.rise, self.fall, wrench) for a, b in self.spans]
        return Segments(rows, in_link=self.axes == "link")


@dataclass(frozen=True, kw_only=True)
class LoadSpec:
    """A load hung on a string: its weight, pulling straight down at the point."""

    KIND: ClassVar[str] = "load"
    name: str  #: Name of the contact.
    weight: float  #: Weight. [N]
    spans: tuple[tuple[float, float], ...]  #: When it hangs. (K, 2) [s]
    rise: float = 0.5  #: Time in which the string takes the load. [s]
    fall: float = 0.3  #: Time in which it comes off. [s]
    link: int = 0  #: The link it hangs on; 0 for the flange.
    point: Vector = ORIGIN  #: The point in the link's frame. (3,) [m]

    def start(self, rng: np.random.Generator, duration: float) -> Segments:
        """Make the load ready to hang; nothing is drawn."""
        del rng, duration
        if self.weight < 0:
            raise ParameterError(f"contacts.{self.name}.weight is negative")
        down = np.array([0.0, 0.0, -self.weight, 0.0, 0.0, 0.0])
        return Segments([Push(a, b, self.rise, self.fall, down) for a, b in self.spans])


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


@dataclass(frozen=True, kw_only=True)
class PushesSpec:
    """Pushes of random strength and direction, as a hand gives them, drawn from the seed."""

    KIND: ClassVar[str] = "pushes"
    name: str  #: Name of the contact.
    style: str = "slow"  #: "slow", "taps" or "mixed"; the ranges below override its own.
    begin: float = 0.0  #: No push before this. [s]
    end: float = 0.0  #: No push after this; 0 for the end of the log. [s]
    length: tuple[float, float] | None = None  #: Shortest and longest push. [s]
    pause: tuple[float, float] | None = None  #: Shortest and longest pause. [s]
    force: tuple[float, float] | None = None  #: Smallest and largest peak force. [N]
    torque: tuple[float, float] | None = None  #: Smallest and largest peak moment. [N·m]
    vertical: float = 0.5  #: Share of the force that may point along base z.
    link: int = 0  #: The link it acts on; 0 for the flange.
    point: Vector = ORIGIN  #: The point in the link's frame. (3,) [m]

    def ranges(self) -> PushStyle:
        """The style's ranges, with those that are stated in their place."""
        check_known(self.style, STYLES, f"no style {self.style!r}")
        given = {k: v for k in PushStyle._fields if (v := getattr(self, k)) is not None}
        return STYLES[self.style]._replace(**given)

    def start(self, rng: np.random.Generator, duration: float) -> Segments:
        """Draw the pushes of a run of `duration` [s], one after another until none fits."""
        style = self.ranges()
        if min(style.length[0], style.pause[0]) <= 0:
            raise ParameterError(f"contacts.{self.name}: length and pause must be positive")
        stop, t = self.end or duration, self.begin
        pushes: list[Push] = []
        while True:
            t += rng.uniform(*style.pause)
            length = rng.uniform(*style.length)
            force = rng.uniform(*style.force) * direction(rng, self.vertical)
            torque = rng.uniform(*style.torque) * direction(rng, 1.0)
            if t + length > stop:
                return Segments(pushes)
            wrench = np.concatenate([force, torque])
            pushes.append(Push(t, t + length, 0.5 * length, 0.5 * length, wrench))
            t += length


def direction(rng: np.random.Generator, vertical: float) -> Array:
    """A random direction whose vertical part is scaled by `vertical`. (3,)"""
    vector = rng.standard_normal(3) * np.array([1.0, 1.0, vertical])
    return np.asarray(vector / np.linalg.norm(vector))


@dataclass(frozen=True, kw_only=True)
class HandSpec:
    """A hand that grabs the handle, moves, and lets go: a spring and damper to a moving anchor."""

    KIND: ClassVar[str] = "hand"
    name: str  #: Name of the contact.
    #: When it grabs and when it lets go, one pair a grab. (K, 2) [s]
    spans: tuple[tuple[float, float], ...]
    #: Displacement of the hand's anchor in each grab, in base axes. (K, 3) [m]
    moves: tuple[Vector, ...] = ()
    #: Rotation vector of the anchor in each grab, in base axes. (K, 3) [rad]
    turns: tuple[Vector, ...] = ()
    reach: float = 0.6  #: Time in which the hand makes its move. [s]
    release: float = 0.08  #: Time in which the hand lets go, before the end of each span. [s]
    stiffness: float = 200.0  #: Spring to the hand's position. [N/m]
    damping: float = 15.0  #: Damper. [N·s/m]
    twist_stiffness: float = 0.0  #: Spring to the hand's orientation. [N·m/rad]
    twist_damping: float = 0.0  #: Damper. [N·m·s/rad]
    link: int = 0  #: The link it holds; 0 for the flange.
    point: Vector = ORIGIN  #: The point in the link's frame. (3,) [m]

    def start(self, rng: np.random.Generator, duration: float) -> "Hand":
        """Make the hand ready to grab; nothing is drawn."""
        del rng, duration
        for name in ("moves", "turns"):
            if getattr(self, name) and len(getattr(self, name)) != len(self.spans):
                raise ParameterError(
                    f"contacts.{self.name}.{name} has {len(getattr(self, name))} rows; it must "
                    f"have one for each of the {len(self.spans)} spans"
                )
        return Hand(self)


class Hand:
    """A hand during a run: it remembers where it took hold."""

    def __init__(self, spec: HandSpec) -> None:
        self.spec = spec
        self.grip: int | None = None
        self.held_at, self.held_as = np.zeros(3), np.eye(3)

    def span(self, t: float) -> int | None:
        """Index of the grab going on at `t` [s], or None."""
        return next((k for k, (a, b) in enumerate(self.spec.spans) if a <= t < b), None)

    def active(self, t: float) -> bool:
        """Whether the hand holds the arm at time `t` [s]."""
        return self.span(t) is not None

    def wrench(self, t: float, place: Place) -> Array:
        """Spring and damper between the handle and the hand. (6,) [N, N·m]"""
        k = self.span(t)
        if k is None:
            return np.zeros(6)
        if k != self.grip:
            # A hand takes hold where the handle is at that moment, wherever that may be.
            self.grip, self.held_at, self.held_as = k, place.position, place.rotation
        spec = self.spec
        u = min((t - spec.spans[k][0]) / spec.reach, 1.0) if spec.reach > 0 else 1.0
        way = minimum_jerk(u)
        move = np.array(spec.moves[k]) if spec.moves else np.zeros(3)
        turn = np.array(spec.turns[k]) if spec.turns else np.zeros(3)
        gap = self.held_at + way * move - place.position
        force = spec.stiffness * gap - spec.damping * place.velocity
        torque = -spec.twist_damping * place.spin
        if spec.twist_stiffness:
            import pinocchio as pin

            goal = pin.exp3(way * turn) @ self.held_as
            torque = torque + spec.twist_stiffness * pin.log3(goal @ place.rotation.T)
        left = spec.spans[k][1] - t
        hold = min(left / spec.release, 1.0) if spec.release > 0 else 1.0
        return hold * np.concatenate([force, torque])


@dataclass(frozen=True, kw_only=True)
class StopSpec:
    """A hard stop: a plane that pushes back when the point goes beyond it."""

    KIND: ClassVar[str] = "stop"
    name: str  #: Name of the contact.
    through: Vector  #: A point of the plane in the base frame. (3,) [m]
    normal: Vector = (0.0, 0.0, 1.0)  #: Its normal, pointing to the free side. (3,)
    stiffness: float = 2e4  #: Stiffness of the plane. [N/m]
    damping: float = 200.0  #: Damping while pressed. [N·s/m]
    link: int = 0  #: The link that meets it; 0 for the flange.
    point: Vector = ORIGIN  #: The point in the link's frame. (3,) [m]

    def start(self, rng: np.random.Generator, duration: float) -> "StopSpec":
        """The stop itself: nothing is drawn, and it remembers nothing."""
        del rng, duration
        if not any(self.normal):
            raise ParameterError(f"contacts.{self.name}.normal has no length")
        return self

    def active(self, t: float) -> bool:
        """A stop is always there; whether it is met shows in its wrench."""
        del t
        return True

    def wrench(self, t: float, place: Place) -> Array:
        """Push along the normal, never a pull. (6,) [N, N·m]"""
        del t
        normal = np.array(self.normal) / float(np.linalg.norm(self.normal))
        depth = float(normal @ (np.array(self.through) - place.position))
        if depth <= 0.0:
            return np.zeros(6)
        size = max(self.stiffness * depth - self.damping * float(normal @ place.velocity), 0.0)
        return np.concatenate([size * normal, np.zeros(3)])
