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
    bent,
)
from vftcli.identification.result import root_mean_square
from vftcli.robots.friction import SMOOTHING, falling_speed
from vftcli.signals.arrays import Array
from vftcli.signals.filters import low_pass
from vftcli.signals.least_squares import cross_validated, fit_column, left_out
from vftcli.signals.rest import MOVES

PLAIN = ("coulomb", "viscous", "offset")
CURVED = ("coulomb", "logarithmic", "offset")
RICHEST = (*PLAIN, "quadratic", "load_coulomb")
#: Sets of friction terms that compete, simplest first.
CANDIDATES: tuple[tuple[str, ...], ...] = (
    ("coulomb", "offset"),
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
#: Presliding lengths that compete with none, one for the whole arm. [rad]
PRESLIDING_LENGTHS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
#: What may stand beside the points of a bent line.
BESIDE_POINTS = (("offset",), ("offset", "load_coulomb"))
#: Terms whose negative value would push the joint along.
NEVER_NEGATIVE = ("coulomb", "presliding", "load_coulomb", "stribeck")
#: Terms that are bounded at zero in the fit of a joint for which no candidate is friction.
BOUNDED = ("coulomb", "viscous")

#: Velocities are turned where both terms push, so that the bound leaves this many times the power,
#: by more than this share of the joint's largest torque: of right ones a model's error pushes by up
#: to .7 % of it, while friction is 2 % (a Panda's wrist) to 20 % (a UR's).
TURNED, PUSH = 2.0, 0.02

SLIDING = 3e-3  #: Smoothing of the sign where presliding says what happens around rest. [rad/s]
#: Band in which the presliding length is judged: observers of 3 … 10 1/s pass .5 … 1.6 Hz. [Hz]
LISTENING = 2.0
MARGIN = 1.01  #: A simpler model within this factor of the best cross-validated error is preferred.
#: A shorter presliding length within this factor of the best is preferred, and none to all.
LENGTH_MARGIN = 1.02
LIGHT = 1.0  #: Spread of the gravity torque below which growth with load cannot be told. [N·m]


class ShapeChoice(NamedTuple):
    """One candidate's cross-validated error."""

    joint: int  #: Joint, from 1.
    shape: Shape  #: The candidate.
    error: float  #: RMS on the stretches left out. [N·m]
    chosen: bool = False  #: Whether it was taken.


class PreslidingChoice(NamedTuple):
    """The presliding length of an arm."""

    length: float  #: The chosen one, 0 for none. [rad]
    #: Cross-validated error of every length over that of none, root of the mean square over the
    #: joints.
    errors: dict[float, float]


class JointData(NamedTuple):
    """What one joint's fit is made from, over all training logs."""

    y: Array  #: Torque that friction and rotor shall explain. (M,) [N·m]
    #: Columns beside friction: q̈ where the rotor inertia is sought, the rigid-body torque where
    #: the drive constant is. (M, f)
    fixed: Array
    weights: Array  #: 0 where nothing is told, 1 elsewhere. (M,)
    sources: Sequence[FrictionColumns]  #: Friction columns of each log.
    load_spread: float  #: Spread of the gravity torque. [N·m]
    reverses: bool  #: Whether the joint moves both ways.
    speed_limit: float  #: Speed up to which its friction may not fall. [rad/s]
    torque_limit: float = 0.0  #: The joint's largest torque, 0 where that is not known. [N·m]
    #: Torque of the profile's friction and rotor; None where they do not compete. (M,) [N·m]
    profile: Array | None = None

    @property
    def lengths(self) -> tuple[int, ...]:
        """Rows of each log."""
        return tuple(source.motion.samples for source in self.sources)

    def speeds(self, j: int) -> list[float]:
        """Speed that joint j (from 0) exceeds in a hundredth of each log. [rad/s]"""
        return [float(np.quantile(np.abs(source.motion.dq[:, j]), 0.99)) for source in self.sources]

    def parts(self, j: int) -> list[Array]:
        """The rows that cross-validation of joint j (from 0) leaves out in turn."""
        return left_out(self.lengths, [speed > MOVES for speed in self.speeds(j)])

    def slow(self, signals: Array) -> Array:
        """Signals in the band in which an observer listens, each log by itself. (M, k)"""
        parts, start = [], 0
        for source, length in zip(self.sources, self.lengths, strict=True):
            part, start = signals[start : start + length], start + length
            wide = source.motion.processing.cutoff > LISTENING
            parts.append(low_pass(source.motion.t, part, LISTENING) if wide else part)
        return np.concatenate(parts)

    def columns(self, j: int, shape: Shape) -> Array:
        """Friction columns, then the fixed ones. (M, k + f)"""
        friction = np.concatenate([source.joint(j, shape) for source in self.sources])
        return np.hstack([friction, self.fixed])


def choose_presliding(joints: Sequence[tuple[int, JointData]]) -> PreslidingChoice:
    """Choose one presliding length for the whole arm by cross-validation, or none.

    It is chosen in the band in which an observer listens: what the play operator leaves at a
    reversal is a slow step, which a wider band drowns in noise. Of the nearly best the shortest is
    taken, which forgets soonest that it started undeflected.
    """
    lengths = (0.0, *PRESLIDING_LENGTHS)
    # Of a joint that goes one way the play operator is a constant.
    turning = [(j, data) for j, data in joints if data.reverses]
    if not turning:
        return PreslidingChoice(0.0, {0.0: 1.0})
    ratios = np.empty((len(turning), len(lengths)))
    for i, (j, data) in enumerate(turning):
        terms, parts = tellable_terms(RICHEST, data), data.parts(j)
        y = data.slow(data.y[:, None])[:, 0]
        plain = data.slow(data.columns(j, Shape(terms, SLIDING)))
        # Weights of outliers are held: all lengths must answer for the same samples.
        weights = fit_column(plain, y, data.weights).weights
        # What a smoother sign explains as well is not presliding's; one smoother than that is
        # presliding in the velocity's guise.
        rivals = [Shape(terms, smoothing) for smoothing in (SLIDING, SMOOTHING)]
        sliding = [
            Shape((*terms, "presliding"), SLIDING, presliding_length=length)
            for length in PRESLIDING_LENGTHS
        ]
        found = [
            cross_validated(data.slow(data.columns(j, shape)), y, weights, parts)
            for shape in (*rivals, *sliding)
        ]
        none = min(found[: len(rivals)])
        ratios[i] = np.array([none, *found[len(rivals) :]]) / max(none, 1e-300)
    errors = root_mean_square(ratios)
    near = np.flatnonzero(errors <= LENGTH_MARGIN * errors.min())
    return PreslidingChoice(lengths[near[0]], dict(zip(lengths, errors.tolist(), strict=True)))


def choose_shape(j: int, data: JointData, length: float = 0.0) -> tuple[Shape, list[ShapeChoice]]:
    """Choose a joint's friction model by cross-validation, simplest of the nearly best.

    First the smoothing is chosen with the richest plain model, then the bend of the logarithm,
    then the terms. A parabola is in the race only where it rises up to the joint's own speed.

    Args:
        j: Joint, from 0.
        data: Its equations.
        length: Presliding length of the arm, 0 for none. [rad]
    """
    length = length if data.reverses else 0.0
    rich, plain = tellable_terms(RICHEST, data), Shape(tellable_terms(PLAIN, data))
    bounded, is_turned = bounded_shape(j, plain, data)
    if is_turned:
        return plain, []  # the positions may still rub the right way
    if not bounded.terms or bounded.terms == ("offset",):
        return bounded, []
    start = fit_column(data.columns(j, Shape(rich)), data.y, data.weights)
    parts = data.parts(j)

    # Weights of outliers are held: candidates must answer for the same samples.
    def error(shape: Shape) -> float:
        return cross_validated(data.columns(j, shape), data.y, start.weights, parts)

    widths = (SLIDING,) if length else SMOOTHINGS
    smoothing = min((Shape(rich, s) for s in widths), key=error).smoothing
    terms = tellable_terms((*CURVED, "load_coulomb"), data)
    curved = Shape(terms, smoothing, presliding_length=length)
    bends = (curved._replace(logarithmic_velocity=v) for v in LOGARITHMIC_VELOCITIES)
    best = min(bends, key=error)
    choices: dict[Shape, ShapeChoice] = {}
    for candidate in candidate_shapes(best, data, max(data.speeds(j))):
        shape, values = non_negative_fit(j, candidate, data)
        if shape not in choices and is_dissipative(shape, values, data.speed_limit):
            choices[shape] = ShapeChoice(j + 1, shape, error(shape))
    if not choices:
        return bounded_shape(j, plain._replace(smoothing=smoothing), data)[0], []
    limit = MARGIN * min(c.error for c in choices.values())
    near = [c for c in choices.values() if c.error <= limit]
    chosen = min(near, key=lambda c: (len(c.shape.terms), c.error))
    return chosen.shape, [c._replace(chosen=c is chosen) for c in choices.values()]


def candidate_shapes(best: Shape, data: JointData, speed: float = 0.0) -> Iterator[Shape]:
    """The friction shapes that compete for a joint, with the smoothing and bend of `best`.

    Args:
        best: Its smoothing, its bend and its presliding length stay.
        data: The joint's equations.
        speed: The joint's highest speed, by which the points of a bent line are told. [rad/s]
    """
    shapes: dict[Shape, None] = {}
    line = bent(speed)
    for terms in (*CANDIDATES, *((*line.terms, *more) for more in BESIDE_POINTS if line)):
        shape = best._replace(terms=tellable_terms(terms, data))
        if line and terms[0] in line.terms:
            shape = shape._replace(speeds=line.speeds)
        if "stribeck" not in terms:
            shapes[shape] = None
            if best.presliding_length:
                shapes[shape._replace(terms=(*shape.terms, "presliding"))] = None
            continue
        for velocity in STRIBECK_VELOCITIES:
            if velocity > 2 * best.smoothing:  # else the sign's own rounding hides it
                shapes[shape._replace(stribeck_velocity=velocity)] = None
    yield from shapes


def tellable_terms(terms: tuple[str, ...], data: JointData) -> tuple[str, ...]:
    """Drop what the motion cannot tell: growth with a load there is none of, offset one-way."""
    out = tuple(t for t in terms if t != "load_coulomb" or data.load_spread >= LIGHT)
    return out if data.reverses else tuple(t for t in out if t != "offset")


def pushing_terms(shape: Shape, values: Array) -> tuple[str, ...]:
    """The dry terms that come out negative; others may follow the coefficients. (k,)"""
    own = dict(zip(shape.terms, values, strict=False))
    return tuple(term for term in NEVER_NEGATIVE if own.get(term, 0.0) < 0.0)


def bounded_shape(j: int, shape: Shape, data: JointData) -> tuple[Shape, bool]:
    """A shape less the terms at zero, Coulomb and viscous friction bounded there in the fit.

    Also whether velocities seem turned, see `TURNED`.
    """
    powers: dict[Shape, float] = {}
    for without in ((), *((term,) for term in BOUNDED), BOUNDED):
        one = shape._replace(terms=tuple(t for t in shape.terms if t not in without))
        A = data.columns(j, one)
        fit = fit_column(A, data.y, data.weights)
        power = float(np.sum(data.weights * fit.residual**2))
        own = [k for k, term in enumerate(one.terms) if term in BOUNDED]
        if not without:
            push = float(np.sqrt(np.mean((A[:, own] @ fit.values[own]) ** 2)))
            both, free = bool(np.all(fit.values[own] < 0.0)), power
        if np.all(fit.values[own] >= 0.0):
            powers[one] = power
        if shape in powers:
            return shape, False
    best = min(powers, key=lambda one: powers[one])
    return best, both and powers[best] > TURNED * free and push > PUSH * data.torque_limit


def non_negative_fit(j: int, shape: Shape, data: JointData) -> tuple[Shape, Array]:
    """A shape's fit; with presliding, without the dry terms that come out negative.

    Presliding and the smoothed sign share one dry torque: where one of them takes more than all of
    it, the other is left out.
    """
    fit = fit_column(data.columns(j, shape), data.y, data.weights)
    pushing = pushing_terms(shape, fit.values)
    if "presliding" in shape.terms and pushing:
        shape = shape._replace(terms=tuple(t for t in shape.terms if t not in pushing))
        fit = fit_column(data.columns(j, shape), data.y, data.weights)
    return shape, fit.values


def is_dissipative(shape: Shape, values: Array, speed_limit: float) -> bool:
    """Whether no dry term is negative and the friction rises all the way to `speed_limit`.

    Args:
        shape: The structure.
        values: Its coefficients, others may follow. (k,)
        speed_limit: Speed up to which it may not fall. [rad/s]
    """
    friction = shape.friction(values[: len(shape.terms)])
    return not pushing_terms(shape, values) and bool(np.isnan(falling_speed(friction, speed_limit)))
