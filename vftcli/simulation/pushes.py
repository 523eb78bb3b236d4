"""What every contact is, and those that do not depend on the arm.

A contact acts at `point` of a link (`link` 0: the flange, else the link of that joint) with a
wrench ON the robot in base axes. Given profiles, hung loads and pushes drawn at random are here;
those of `springs` answer the arm's motion.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.schema import unknown_name

Vector = tuple[float, float, float]
ORIGIN = (0.0, 0.0, 0.0)


class Place(NamedTuple):
    """Where a contact's point is and how it moves, in base axes."""

    rotation: Array  #: Orientation of the link (the flange for link 0). (3, 3)
    position: Array  #: The point. (3,) [m]
    velocity: Array  #: Its velocity. (3,) [m/s]
    spin: Array  #: Angular velocity of the link. (3,) [rad/s]


class Touch(Protocol):
    """A contact during a run; it may remember where it took hold."""

    def active(self, t: float) -> bool:
        """Whether it may exert anything at time `t` [s]."""
        ...

    def wrench(self, t: float, place: Place) -> Array:
        """Force and moment about the point ON the robot, in base axes. (6,) [N, N·m]"""
        ...


def ramp(t: float, start: float, rise: float, stop: float, fall: float) -> float:
    """A rounded trapezoid: 0, up from `start` within `rise`, down by `stop` within `fall`."""
    if t <= start or t >= stop:
        return 0.0
    up = 1.0 if rise <= 0 else min((t - start) / rise, 1.0)
    down = 1.0 if fall <= 0 else min((stop - t) / fall, 1.0)
    return 0.25 * (1.0 - math.cos(math.pi * up)) * (1.0 - math.cos(math.pi * down))


def check_choice(key: str, value: str, options: Iterable[str]) -> None:
    """Raise unless `value` is one of the words a key takes."""
    words = list(options)
    if value not in words:
        raise ParameterError(unknown_name(f"{key} {value!r}", value, words))


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
        check_choice("axes", self.axes, ("base", "link"))
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
        check_choice("style", self.style, STYLES)
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
    unit: Array = vector / np.linalg.norm(vector)
    return unit
