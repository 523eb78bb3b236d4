"""Contacts that answer the arm's motion by spring and damper: a hand, and a hard stop."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.packages import needed
from vftcli.simulation.motion import minimum_jerk
from vftcli.simulation.pushes import ORIGIN, Place, Vector


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
        for k, (start, stop) in enumerate(self.spec.spans):
            if start <= t < stop:
                return k
        return None

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
            torque = torque + spec.twist_stiffness * self.twist(way * turn, place.rotation)
        left = spec.spans[k][1] - t
        hold = min(left / spec.release, 1.0) if spec.release > 0 else 1.0
        return hold * np.concatenate([force, torque])

    def twist(self, turn: Array, rotation: Array) -> Array:
        """Rotation vector from the handle's orientation to the hand's, in base axes. (3,) [rad]"""
        pin = needed("pinocchio", "a simulation")

        goal = pin.exp3(turn) @ self.held_as
        error: Array = pin.log3(goal @ rotation.T)
        return error


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
