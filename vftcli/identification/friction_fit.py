"""Friction, rotor inertia and optionally the drive constant of each joint, the links held."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vftcli.identification.friction_shapes import (
    LOGARITHMIC_VELOCITIES,
    SMOOTHINGS,
    STRIBECK_VELOCITIES,
    FrictionColumns,
    Shape,
)
from vftcli.identification.least_squares import cross_validated, fit_column
from vftcli.robots.friction import falling_speed
from vftcli.signals.arrays import Array

PLAIN = ("coulomb", "viscous", "offset")
CURVED = ("coulomb", "logarithmic", "offset")
RICHEST = (*PLAIN, "quadratic", "load_coulomb")
CANDIDATES: tuple[tuple[str, ...], ...] = (
    PLAIN,
    (*PLAIN, "quadratic"),
    (*PLAIN, "load_coulomb"),
    (*PLAIN, "quadratic", "load_coulomb"),
    (*PLAIN, "stribeck"),
    CURVED,
    (*CURVED, "load_coulomb"),
    (*CURVED, "stribeck"),
    (*CURVED, "stribeck", "load_coulomb"),
)
"""Sets of friction terms that compete, simplest first."""

NEVER_NEGATIVE = ("coulomb", "load_coulomb", "stribeck")
"""Terms whose negative value would push the joint along."""

MARGIN = 1.01
"""A simpler model within this factor of the best cross-validated error is preferred."""

LIGHT = 1.0
"""Spread of the gravity torque below which growth with load cannot be told. [N·m]"""


class ShapeChoice(NamedTuple):
    """One candidate's cross-validated error.

    Attributes:
        joint: Joint, from 1.
        shape: The candidate.
        error: RMS on the stretches left out. [N·m]
        chosen: Whether it was taken.
    """

    joint: int
    shape: Shape
    error: float
    chosen: bool = False


class JointData(NamedTuple):
    """What one joint's fit is made from, over all training logs.

    Attributes:
        y: Torque that friction and rotor shall explain. (M,) [N·m]
        fixed: Columns beside friction: q̈ where the rotor inertia is sought, the rigid-body torque
            where the drive constant is. (M, f)
        weights: 0 where nothing is told, 1 elsewhere. (M,)
        sources: Friction columns of each log.
        load_spread: Spread of the gravity torque. [N·m]
        reverses: Whether the joint moves both ways.
        speed_limit: Speed up to which its friction may not fall. [rad/s]
    """

    y: Array
    fixed: Array
    weights: Array
    sources: Sequence[FrictionColumns]
    load_spread: float
    reverses: bool
    speed_limit: float

    @property
    def lengths(self) -> tuple[int, ...]:
        """Rows of each log."""
        return tuple(source.motion.samples for source in self.sources)

    def columns(self, j: int, shape: Shape) -> Array:
        """Friction columns, then the fixed ones. (M, k + f)"""
        friction = np.concatenate([source.joint(j, shape) for source in self.sources])
        return np.hstack([friction, self.fixed])


def choose_shape(j: int, data: JointData) -> tuple[Shape, list[ShapeChoice]]:
    """Choose a joint's friction model by cross-validation, simplest of the nearly best.

    First the smoothing is chosen with the richest plain model, then the bend of the logarithm,
    then the terms. A parabola is in the race only where it rises up to the joint's own speed.

    Args:
        j: Joint, from 0.
        data: Its equations.
    """
    rich = tellable_terms(RICHEST, data)
    start = fit_column(data.columns(j, Shape(rich)), data.y, data.weights)

    # Weights of outliers are held: candidates must answer for the same samples.
    def error(shape: Shape) -> float:
        return cross_validated(data.columns(j, shape), data.y, start.weights, data.lengths)

    smoothing = min((Shape(rich, s) for s in SMOOTHINGS), key=error).smoothing
    curved = Shape(tellable_terms((*CURVED, "load_coulomb"), data), smoothing)
    bends = (curved._replace(logarithmic_velocity=v) for v in LOGARITHMIC_VELOCITIES)
    best = min(bends, key=error)
    choices = []
    for shape in candidate_shapes(best, data):
        fit = fit_column(data.columns(j, shape), data.y, data.weights)
        if is_dissipative(shape, fit.values, data.speed_limit):
            choices.append(ShapeChoice(j + 1, shape, error(shape)))
    if not choices:
        return Shape(tellable_terms(PLAIN, data), smoothing), []
    limit = MARGIN * min(c.error for c in choices)
    near = [c for c in choices if c.error <= limit]
    chosen = min(near, key=lambda c: (len(c.shape.terms), c.error))
    return chosen.shape, [c._replace(chosen=c is chosen) for c in choices]


def candidate_shapes(best: Shape, data: JointData) -> Iterator[Shape]:
    """The friction shapes that compete for a joint, with the smoothing and bend of `best`."""
    shapes: dict[Shape, None] = {}
    for terms in CANDIDATES:
        shape = best._replace(terms=tellable_terms(terms, data))
        if "stribeck" not in terms:
            shapes[shape] = None
            continue
        for velocity in STRIBECK_VELOCITIES:
            if velocity > 2 * best.smoothing:  # else the sign's own rounding hides it
                shapes[shape._replace(stribeck_velocity=velocity)] = None
    yield from shapes


def tellable_terms(terms: tuple[str, ...], data: JointData) -> tuple[str, ...]:
    """Drop what the motion cannot tell: growth with a load there is none of, offset one-way."""
    out = tuple(t for t in terms if t != "load_coulomb" or data.load_spread >= LIGHT)
    return out if data.reverses else tuple(t for t in out if t != "offset")


def is_dissipative(shape: Shape, values: Array, speed_limit: float) -> bool:
    """Whether no dry term is negative and the friction rises all the way to `speed_limit`.

    Args:
        shape: The structure.
        values: Its coefficients, others may follow. (k,)
        speed_limit: Speed up to which it may not fall. [rad/s]
    """
    own = dict(zip(shape.terms, values, strict=False))
    pushes = any(own.get(term, 0.0) < 0.0 for term in NEVER_NEGATIVE)
    friction = shape.friction(values[: len(shape.terms)])
    return not pushes and bool(np.isnan(falling_speed(friction, speed_limit)))
