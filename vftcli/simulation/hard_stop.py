"""A hard stop in the arm's way."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.pushes import ORIGIN, Place, Vector


@dataclass(frozen=True, kw_only=True)
class StopSpec:
    """A hard stop: a plane that pushes back when the point goes beyond it.

    Attributes:
        name: Name of the contact.
        through: A point of the plane in the base frame. (3,) [m]
        normal: Its normal, pointing to the free side. (3,)
        stiffness: Stiffness of the plane. [N/m]
        damping: Damping while pressed. [N·s/m]
        link: The link that meets it; 0 for the flange.
        point: The point in the link's frame. (3,) [m]
    """

    KIND: ClassVar[str] = "stop"
    name: str
    through: Vector
    normal: Vector = (0.0, 0.0, 1.0)
    stiffness: float = 2e4
    damping: float = 200.0
    link: int = 0
    point: Vector = ORIGIN

    def start(self, rng: np.random.Generator, duration: float) -> "Stop":
        """The stop during a run; nothing of it is drawn at random."""
        del rng, duration
        return Stop(self)


class Stop:
    """A hard stop during a run: a one-sided spring and damper along its normal."""

    def __init__(self, spec: StopSpec) -> None:
        self.spec = spec
        length = float(np.linalg.norm(spec.normal))
        if length == 0.0:
            raise ParameterError(f"contacts.{spec.name}.normal has no length")
        self.normal = np.array(spec.normal) / length

    def active(self, t: float) -> bool:
        """A stop is always there; whether it is met shows in its wrench."""
        del t
        return True

    def wrench(self, t: float, place: Place) -> Array:
        """Push along the normal, never a pull. (6,) [N, N·m]"""
        del t
        depth = float(self.normal @ (np.array(self.spec.through) - place.position))
        if depth <= 0.0:
            return np.zeros(6)
        speed = float(self.normal @ place.velocity)
        size = max(self.spec.stiffness * depth - self.spec.damping * speed, 0.0)
        return np.concatenate([size * self.normal, np.zeros(3)])
