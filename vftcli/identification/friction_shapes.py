"""Friction as a sum of known shapes times coefficients: what is linear in it, and what is not.

The shapes are evaluated on the log as it was recorded and then filtered like the torque, so that a
reversal is rounded alike on both sides of the equation.
"""

from typing import NamedTuple

import numpy as np

from vftcli.identification.processing import PreparedLog
from vftcli.robots.friction import SMOOTHING, coulomb_logarithmic
from vftcli.robots.presliding import play
from vftcli.robots.robot import JointFriction
from vftcli.signals.arrays import Array

SMOOTHINGS = (0.003, 0.01, 0.03, 0.1)
"""Velocities over which the sign may be smoothed. [rad/s]"""

STRIBECK_VELOCITIES = (0.02, 0.05, 0.1, 0.2)
"""Velocities over which a Stribeck term may fade. [rad/s]"""


LOGARITHMIC_VELOCITIES = (0.1, 0.2, 0.5, 1.0, 2.0)
"""Velocities from which a logarithmic rise may flatten; UR's gears have .28 to 2.1. [rad/s]"""


class Shape(NamedTuple):
    """The structure of one joint's friction: which terms, and its four nonlinear numbers.

    Attributes:
        terms: Keys of the robot file whose values are coefficients, in order.
        smoothing: Velocity over which the sign is smoothed. [rad/s]
        stribeck_velocity: Velocity over which the Stribeck term fades. [rad/s]
        logarithmic_velocity: Velocity from which the logarithmic term flattens. [rad/s]
        presliding_length: Way over which the teeth of the gear give before they slide. [rad]
    """

    terms: tuple[str, ...]
    smoothing: float = SMOOTHING
    stribeck_velocity: float = 0.05
    logarithmic_velocity: float = 1.0
    presliding_length: float = 3e-4

    @property
    def model(self) -> str:
        """Name of the friction model that the robot file gets: the simplest that has all terms."""
        if "logarithmic" in self.terms:
            return "coulomb-logarithmic"
        if "stribeck" in self.terms:
            return "coulomb-viscous-stribeck"
        if "load_coulomb" in self.terms:
            return "coulomb-viscous-load"
        if "quadratic" in self.terms:
            return "coulomb-viscous-quadratic"
        return "coulomb-viscous-offset" if "offset" in self.terms else "coulomb-viscous"

    @property
    def words(self) -> str:
        """The terms and the nonlinear numbers, for tables."""
        text = f"{' + '.join(self.terms)}, smoothing {self.smoothing:g} rad/s"
        if "presliding" in self.terms:
            text += f", presliding over {1e3 * self.presliding_length:g} mrad"
        if "stribeck" in self.terms:
            text += f", Stribeck velocity {self.stribeck_velocity:g} rad/s"
        if "logarithmic" in self.terms:
            text += f", flattening from {self.logarithmic_velocity:g} rad/s"
        return text

    def friction(self, values: Array, confidence: str = "") -> JointFriction:
        """The joint's friction with these coefficients, one a term."""
        parameters = {k: round_digits(float(v)) for k, v in zip(self.terms, values, strict=True)}
        parameters.setdefault("coulomb", 0.0)  # what slides may be all presliding's
        parameters["smoothing"] = self.smoothing
        if "stribeck" in self.terms:
            parameters["stribeck_velocity"] = self.stribeck_velocity
        if "logarithmic" in self.terms:
            parameters["logarithmic_velocity"] = self.logarithmic_velocity
        if "presliding" in self.terms:
            parameters["presliding_length"] = self.presliding_length
        return JointFriction(model=self.model, parameters=parameters, confidence=confidence)


def round_digits(value: float, digits: int = 7) -> float:
    """A number with as many digits as an identification can possibly mean."""
    return float(f"{value:.{digits}g}")


def term_values(term: str, shape: Shape, dq: Array, load: Array) -> Array:
    """One term of a friction shape at every sample: the friction law with its coefficient 1.

    Args:
        term: Its key.
        shape: The structure.
        dq: Velocities as recorded. [rad/s]
        load: Absolute gravity torque. [N·m]
    """
    numbers = {k: v for k, v in shape._asdict().items() if k not in ("terms", "presliding_length")}
    return coulomb_logarithmic(
        dq, **{"coulomb": 0.0, "logarithmic": 0.0, term: 1.0}, **numbers, load=load
    )


class FrictionColumns:
    """Filtered friction columns of one prepared log, each made once.

    Args:
        motion: The prepared log.
        load: Absolute gravity torques along the whole log. (T, n) [N·m]
    """

    def __init__(self, motion: PreparedLog, load: Array) -> None:
        self.motion = motion
        self.load = load
        self.cache: dict[tuple[str, int, tuple[float, ...]], Array] = {}

    def column(self, term: str, j: int, shape: Shape) -> Array:
        """One term of joint j (from 0), filtered like the torque and kept for later calls. (M,)"""
        # The key holds only what the term depends on, so that shapes share their columns.
        numbers = {
            **dict.fromkeys(("coulomb", "load_coulomb"), (shape.smoothing,)),
            "stribeck": (shape.smoothing, shape.stribeck_velocity),
            "logarithmic": (shape.logarithmic_velocity,),
            "presliding": (shape.presliding_length,),
        }
        key = (term, j, numbers.get(term, ()))
        if key not in self.cache:
            log = self.motion.recording
            if term == "presliding":
                values = play(log.q[:, j : j + 1], shape.presliding_length).state[:, 0]
            else:
                values = term_values(term, shape, log.require("dq")[:, j], self.load[:, j])
            self.cache[key] = self.motion.filtered(values[:, None])[:, 0]
        return self.cache[key]

    def joint(self, j: int, shape: Shape) -> Array:
        """All terms of a shape for joint j (from 0), one column a term. (M, k)"""
        columns = [self.column(term, j, shape) for term in shape.terms]
        return np.stack(columns, axis=1) if columns else np.zeros((self.motion.samples, 0))
