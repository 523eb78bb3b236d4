"""The kinds of ``[[contacts]]`` a scenario can have, told apart by their `kind`.

A contact acts at `point` of a link (`link` 0: the flange, else the link of that joint) with a
wrench ON the robot in base axes; a random walk acts on the joints themselves.
"""

from dataclasses import dataclass
from typing import ClassVar

from vftcli.simulation.hand import HandSpec
from vftcli.simulation.hard_stop import StopSpec
from vftcli.simulation.pushes import LoadSpec, ProfileSpec, PushesSpec


@dataclass(frozen=True, kw_only=True)
class RandomWalkSpec:
    """Joint torques that walk at random, the disturbance model of the Kalman observers.

    Attributes:
        name: Name of the contact.
        intensity: Variance gained a second: Q_τ; one number or one a joint. [(N·m)²/s]
        initial: Standard deviation at the start. [N·m]
        begin: The walk is zero before this. [s]
    """

    KIND: ClassVar[str] = "random-walk"
    name: str
    intensity: tuple[float, ...]
    initial: float = 0.0
    begin: float = 0.0


WrenchSpec = ProfileSpec | PushesSpec | HandSpec | LoadSpec | StopSpec
ContactSpec = WrenchSpec | RandomWalkSpec

__all__ = [
    "ContactSpec",
    "HandSpec",
    "LoadSpec",
    "ProfileSpec",
    "PushesSpec",
    "RandomWalkSpec",
    "StopSpec",
    "WrenchSpec",
]
