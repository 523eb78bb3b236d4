"""What touches the arm, seen from the arm: where, how it moves, and the wrench it exerts."""

import math
from collections.abc import Iterable
from typing import NamedTuple, Protocol

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.schema import unknown

Vector = tuple[float, float, float]
ORIGIN = (0.0, 0.0, 0.0)


class Place(NamedTuple):
    """Where a contact's point is and how it moves, in base axes.

    Attributes:
        rotation: Orientation of the link (the flange for link 0). (3, 3)
        position: The point. (3,) [m]
        velocity: Its velocity. (3,) [m/s]
        spin: Angular velocity of the link. (3,) [rad/s]
    """

    rotation: Array
    position: Array
    velocity: Array
    spin: Array


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
        raise ParameterError(unknown(f"{key} {value!r}", value, words))
