"""The shape of a joint's friction: a sum of known terms times coefficients.

A term is evaluated on the recorded log and then filtered like the torque, so that both
sides of the equation round a reversal alike.
"""

import itertools
from typing import NamedTuple

import numpy as np

from vftcli.robots.friction import FRICTION_MODELS, SMOOTHING, friction_torque
from vftcli.robots.robot import JointFriction
from vftcli.signals.arrays import Array

#: Velocities over which the sign may be smoothed. [rad/s]
SMOOTHINGS = (0.003, 0.01, 0.03, 0.1)
#: Velocities over which a Stribeck term may fade. [rad/s]
STRIBECK_VELOCITIES = (0.02, 0.05, 0.1, 0.2)
#: Velocities at which a logarithm may flatten; UR's gears: .28 to 2.1. [rad/s]
LOGARITHMIC_VELOCITIES = (0.1, 0.2, 0.5, 1.0, 2.0)
#: Speeds of the points of the friction line of UR's controllers. [rad/s]
BENDS = (0.01, 0.5, 1.5, 3.2)
#: Least share of the way between two points that shows the faster one.
SPANNED = 0.3
#: Term → friction model in a robot file; the first that a joint has counts.
MODELS = {
    "logarithmic": "coulomb-logarithmic",
    "stribeck": "coulomb-viscous-stribeck",
    "load_coulomb": "coulomb-viscous-load",
    "quadratic": "coulomb-viscous-quadratic",
    "offset": "coulomb-viscous-offset",
}
SIMPLEST = "coulomb-viscous"  #: Model of a joint without them.
POINT = "point"  #: Head of a bent line's terms, as point1.


class Shape(NamedTuple):
    """The structure of one joint's friction: terms and nonlinear numbers."""

    #: Coefficients' keys in the robot file; with `POINT` a bent line's.
    terms: tuple[str, ...]
    smoothing: float = SMOOTHING  #: Velocity over which the sign is smoothed. [rad/s]
    stribeck_velocity: float = 0.05  #: Where the Stribeck term fades. [rad/s]
    #: Velocity from which the logarithmic term flattens. [rad/s]
    logarithmic_velocity: float = 1.0
    #: Way over which the gear's teeth give before they slide. [rad]
    presliding_length: float = 0.0
    speeds: tuple[float, ...] = ()  #: Speeds of the bent line's points. [rad/s]

    @property
    def model(self) -> str:
        """Name of the simplest friction model that has all terms."""
        if self.points:
            return "points"
        return next((name for term, name in MODELS.items() if term in self.terms), SIMPLEST)

    @property
    def points(self) -> tuple[str, ...]:
        """The terms of a bent line, in the order of its speeds."""
        return tuple(term for term in self.terms if term.startswith(POINT))

    @property
    def words(self) -> str:
        """The terms and the nonlinear numbers, for tables."""
        line = ["points at " + ", ".join(f"{v:g}" for v in self.speeds)] if self.points else []
        others = [term for term in self.terms if term not in self.points]
        text = f"{' + '.join([*line, *others])}, smoothing {self.smoothing:g} rad/s"
        if "presliding" in self.terms:
            text += f", presliding over {1e3 * self.presliding_length:g} mrad"
        if "stribeck" in self.terms:
            text += f", Stribeck velocity {self.stribeck_velocity:g} rad/s"
        if "logarithmic" in self.terms:
            text += f", flattening from {self.logarithmic_velocity:g} rad/s"
        return text

    def friction(self, values: Array, confidence: str = "") -> JointFriction:
        """The joint's friction with these coefficients, the first ones. (k,)"""
        parameters = {k: round_digits(v) for k, v in zip(self.terms, values, strict=False)}
        torques = tuple(parameters.pop(term) for term in self.points)
        parameters["smoothing"] = self.smoothing
        for name in ("stribeck_velocity", "logarithmic_velocity", "presliding_length"):
            if name.partition("_")[0] in self.terms:
                parameters[name] = getattr(self, name)
        # A dry torque that is all presliding's leaves none for sliding.
        required = FRICTION_MODELS[self.model].required
        parameters = {**dict.fromkeys(required, 0.0), **parameters}
        return JointFriction(
            model=self.model,
            parameters=parameters,
            speeds=self.speeds if torques else (),
            torques=torques,
            confidence=confidence,
        )


def bent(speed: float) -> Shape | None:
    """The bent line up to a speed [rad/s], None of fewer than two points.

    A motion well beyond a point shows the next one too; the last stretch continues.
    """
    reached = [speed >= low + SPANNED * (high - low) for low, high in itertools.pairwise(BENDS)]
    count = 1 + [*reached, False].index(False)
    if count < 2:
        return None
    points = tuple(f"{POINT}{k}" for k in range(1, count + 1))
    return Shape(points, speeds=BENDS[:count])


def round_digits(value: float, digits: int = 7) -> float:
    """A number with the digits of an identification."""
    return float(f"{value:.{digits}g}")


def term_values(term: str, shape: Shape, dq: Array, load: Array) -> Array:
    """One term at velocities [rad/s] and loads [N·m], its coefficient at 1."""
    alone = shape._replace(terms=shape.points if term in shape.points else (term,))
    friction = alone.friction(np.array([own == term for own in alone.terms], float))
    return friction_torque([friction], dq[:, None], load[:, None])[:, 0]
