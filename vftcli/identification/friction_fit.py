"""Friction, rotor inertia and drive constant per joint, links fixed."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vftcli.identification.shapes import (
    LOGARITHMIC_VELOCITIES,
    SMOOTHINGS,
    STRIBECK_VELOCITIES,
    Shape,
    bent,
)
from vftcli.identification.training import PreparedLog, Training
from vftcli.robots.friction import SMOOTHING, falling_speed
from vftcli.robots.robot import JointFriction
from vftcli.signals.arrays import Array, root_mean_square, root_mean_squares
from vftcli.signals.estimation import ColumnFit, cross_validated, fit_column, left_out
from vftcli.signals.filters import low_pass
from vftcli.signals.rest import MOVES

PLAIN = ("coulomb", "viscous", "offset")
CURVED = ("coulomb", "logarithmic", "offset")
RICHEST = (*PLAIN, "quadratic", "load_coulomb")
#: Sets of friction terms to compare, simplest first.
CANDIDATES: tuple[tuple[str, ...], ...] = (
    ("coulomb", "offset"),
    PLAIN,
    (*PLAIN, "quadratic"),
    (*PLAIN, "load_coulomb"),
    RICHEST,
    (*PLAIN, "stribeck"),
    CURVED,
    (*CURVED, "load_coulomb"),
    (*CURVED, "stribeck"),
    (*CURVED, "stribeck", "load_coulomb"),
)
#: Presliding lengths compared with none, one for the whole arm. [rad]
PRESLIDING_LENGTHS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
#: Terms allowed beside the points of a bent line.
BESIDE_POINTS = (("offset",), ("offset", "load_coulomb"))
#: Terms that push the joint if negative.
NEVER_NEGATIVE = ("coulomb", "presliding", "load_coulomb", "stribeck")
#: Terms bounded at zero if no candidate of a joint is friction.
BOUNDED = ("coulomb", "viscous")

#: Velocities are reversed if both terms push by so many times the power, and this share of
#: the largest torque: a right model's error is .7 % of it, friction 2 % (Panda) to 20 % (UR).
TURNED, PUSH = 2.0, 0.02

SLIDING = 3e-3  #: Smoothing of the sign beside presliding. [rad/s]
#: Observers of 3 … 10 1/s pass .5 … 1.6 Hz. [Hz]
LISTENING = 2.0
MARGIN = 1.01  #: A simpler model wins within this factor of the best error.
#: A shorter presliding length wins within this factor of the best.
LENGTH_MARGIN = 1.02
LIGHT = 1.0  #: Least spread of gravity torque that shows growth with load. [N·m]
#: Share of a fit's error below which the profile's friction stays.
KEPT = 0.85
#: Largest relative SD of a drive constant from free motion.
CONSTANT_KNOWN = 0.02


class PreslidingScore(NamedTuple):
    """The presliding length of an arm."""

    length: float  #: The chosen one, 0 for none. [rad]
    #: Every length's cross-validated error over that of none, rms.
    errors: dict[float, float]


class JointData(NamedTuple):
    """The equations of one joint, over all training logs."""

    joint: int  #: Joint, from 0.
    y: Array  #: Torque of friction and rotor. (M,) [N·m]
    #: q̈ for an unknown rotor inertia, rigid torque for an unknown drive constant. (M, f)
    fixed: Array
    weights: Array  #: 0 for empty samples, 1 elsewhere. (M,)
    logs: Sequence[PreparedLog]  #: The logs.
    load_spread: float  #: Spread of the gravity torque. [N·m]
    reverses: bool  #: Whether the joint moves both ways.
    speed_limit: float  #: Its friction may not fall up to this speed. [rad/s]
    torque_limit: float = 0.0  #: The joint's largest torque, or 0. [N·m]
    #: Torque of the profile's friction and rotor. (M,) [N·m]
    profile: Array | None = None

    @property
    def speeds(self) -> list[float]:
        """Speed that the joint exceeds in a hundredth of each log. [rad/s]"""
        each = (abs(log.dq[:, self.joint]) for log in self.logs)
        return [np.quantile(speed, 0.99) for speed in each]

    @property
    def parts(self) -> list[Array]:
        """The rows that cross-validation leaves out in turn."""
        moves = [speed > MOVES for speed in self.speeds]
        return left_out([log.samples for log in self.logs], moves)

    def slow(self, signals: Array) -> Array:
        """Signals in an observer's band, each log by itself. (M, k)"""
        cuts = np.cumsum([log.samples for log in self.logs])[:-1]
        return np.concatenate(
            [
                low_pass(log.t, part, LISTENING) if log.cutoff > LISTENING else part
                for log, part in zip(self.logs, np.split(signals, cuts), strict=True)
            ]
        )

    def columns(self, shape: Shape) -> Array:
        """Friction columns, then the fixed ones. (M, k + f)"""
        friction = np.concatenate([log.friction(self.joint, shape) for log in self.logs])
        return np.hstack([friction, self.fixed])

    def fit(self, shape: Shape) -> ColumnFit:
        """Robust least squares of a shape and the fixed columns."""
        return fit_column(self.columns(shape), self.y, self.weights)


class JointFit(NamedTuple):
    """Friction of one joint and the numbers fitted beside it."""

    shape: Shape  #: The chosen structure.
    fit: ColumnFit  #: Coefficients of friction, q̈, rigid torque.
    #: Candidate → RMS missed of stretches left out. [N·m]
    scores: dict[Shape, float]
    constant: bool  #: Whether the drive constant was fitted too.
    presliding: PreslidingScore  #: The presliding length of all joints.
    #: RMS missed by the model and by the profile in stretches left out, or NaN. [N·m]
    errors: tuple[float, float] = (np.nan, np.nan)

    @property
    def friction(self) -> JointFriction:
        """The joint's friction by this fit."""
        return self.shape.friction(self.fit.values)

    @property
    def is_kept(self) -> bool:
        """Whether the profile's friction and rotor predict clearly better."""
        return self.errors[1] < KEPT * self.errors[0]


def fit_frictions(data: Training) -> dict[int, JointFit]:
    """Joint, from 0 → its fit, links from the profile; none at rest."""
    moving = np.flatnonzero(data.moves).tolist()
    joints = [data_of_joint(data, j, data.fit_constants) for j in moving if data.rubs]
    presliding, fits = choose_presliding(joints), dict[int, JointFit]()
    for j in moving:
        fit = fit_joint(data, j, presliding, data.fit_constants)
        # A light joint cannot tell its constant, the last value, from friction.
        if data.fit_constants and fit.fit.sd[-1] >= CONSTANT_KNOWN * abs(fit.fit.values[-1]):
            fit = fit_joint(data, j, presliding, False)
        fits[j] = fit
    return fits


def fit_joint(data: Training, j: int, presliding: PreslidingScore, constant: bool) -> JointFit:
    """Fit of joint j (from 0), with its drive constant or without."""
    given, shape, scores = data_of_joint(data, j, constant), Shape(()), dict[Shape, float]()
    if data.rubs:
        shape, scores = choose_shape(given, presliding.length)
    fit, errors = given.fit(shape), (np.nan, np.nan)
    if given.profile is not None and scores:
        miss = np.sum(fit.weights * (given.y - given.profile) ** 2) / fit.weights.sum()
        errors = scores[shape], np.sqrt(miss)
    return JointFit(shape, fit, scores, constant, presliding, errors)


def data_of_joint(data: Training, j: int, constant: bool) -> JointData:
    """The equations of joint j (from 0) over all logs.

    For an unknown drive constant the rigid body's torque is a column, else subtracted.
    """
    names = ("tau", "rigid", "ddq", "weights", "load", "predicted")
    torque, rigid, ddq, weights, load, predicted = (data.joined(name)[:, j] for name in names)
    return JointData(
        joint=j,
        y=torque if constant else torque - rigid,
        fixed=np.reshape([ddq] * data.rotor + [rigid] * constant, (-1, len(torque))).T,
        weights=weights,
        logs=data.logs,
        load_spread=load.std(),
        reverses=data.reverses[j],
        speed_limit=data.top_speed(j),
        torque_limit=np.nan_to_num(data.robot.limits.tau_max[j], posinf=0.0),
        profile=None if constant else predicted - rigid,
    )


def all_residuals(data: Training, fits: Mapping[int, JointFit]) -> list[Array]:
    """Residuals of the fits, log by log; zero for held joints. (M, n) each"""
    ends = np.cumsum([log.samples for log in data.logs])
    whole = np.zeros((ends[-1], data.robot.joints))
    for j, fit in fits.items():
        whole[:, j] = fit.fit.residual
    return np.split(whole, ends[:-1])


def choose_presliding(joints: Sequence[JointData]) -> PreslidingScore:
    """One presliding length for the whole arm by cross-validation, or none.

    An observer's band decides; the shortest of the nearly best wins: it forgets soonest.
    """
    lengths = (0.0, *PRESLIDING_LENGTHS)
    # One way only, the play operator is constant.
    turning = [data for data in joints if data.reverses]
    if not turning:
        return PreslidingScore(0.0, {0.0: 1.0})
    ratios = np.empty((len(turning), len(lengths)))
    for i, data in enumerate(turning):
        terms, parts = tellable_terms(RICHEST, data), data.parts
        y = data.slow(data.y[:, None])[:, 0]
        plain = data.slow(data.columns(Shape(terms, SLIDING)))
        # Outliers' weights are fixed: all lengths have one set of samples.
        weights = fit_column(plain, y, data.weights).weights
        # A smoother sign that explains as much wins over presliding.
        shapes = [Shape(terms, SLIDING), Shape(terms, SMOOTHING)]
        play = Shape((*terms, "presliding"), SLIDING)
        shapes += [play._replace(presliding_length=length) for length in PRESLIDING_LENGTHS]
        columns = (data.slow(data.columns(shape)) for shape in shapes)
        first, *errors = [cross_validated(A, y, weights, parts) for A in columns]
        errors[0] = none = min(first, errors[0])
        ratios[i] = np.array(errors) / max(none, 1e-300)
    whole = root_mean_squares(ratios)
    near = np.flatnonzero(whole <= LENGTH_MARGIN * whole.min())
    return PreslidingScore(lengths[near[0]], dict(zip(lengths, whole, strict=True)))


def choose_shape(data: JointData, length: float = 0.0) -> tuple[Shape, dict[Shape, float]]:
    """The simplest of a joint's nearly best models, and all errors. [N·m]

    First the richest plain model decides the smoothing, then the logarithm's bend, then the
    terms. A parabola competes only if it rises up to the joint's own speed.
    """
    length = length if data.reverses else 0.0
    rich, plain = tellable_terms(RICHEST, data), Shape(tellable_terms(PLAIN, data))
    bounded, is_turned = bounded_shape(plain, data)
    if is_turned:
        return plain, {}  # positions may still rub correctly
    if bounded.terms in {(), ("offset",)}:
        return bounded, {}
    # Outliers' weights are fixed: candidates have one set of samples.
    weights, parts = data.fit(Shape(rich)).weights, data.parts

    def error(shape: Shape) -> float:
        return cross_validated(data.columns(shape), data.y, weights, parts)

    widths = (SLIDING,) if length else SMOOTHINGS
    smoothing = min((Shape(rich, s) for s in widths), key=error).smoothing
    terms = tellable_terms((*CURVED, "load_coulomb"), data)
    curved = Shape(terms, smoothing, presliding_length=length)
    bends = (curved._replace(logarithmic_velocity=v) for v in LOGARITHMIC_VELOCITIES)
    best = min(bends, key=error)
    scores: dict[Shape, float] = {}
    for candidate in candidate_shapes(best, data, max(data.speeds)):
        shape, values = non_negative_fit(candidate, data)
        if shape not in scores and is_dissipative(shape, values, data.speed_limit):
            scores[shape] = error(shape)
    if not scores:
        return bounded_shape(plain._replace(smoothing=smoothing), data)[0], {}
    limit = MARGIN * min(scores.values())
    near = [shape for shape in scores if scores[shape] <= limit]
    return min(near, key=lambda shape: (len(shape.terms), scores[shape])), scores


def candidate_shapes(best: Shape, data: JointData, speed: float = 0.0) -> list[Shape]:
    """A joint's competing shapes up to a speed [rad/s], else as `best`."""
    shapes, line = list[Shape](), bent(speed)
    points = [(*line.terms, *more) for more in BESIDE_POINTS] if line else []
    for terms in (*CANDIDATES, *points):
        shape = best._replace(terms=tellable_terms(terms, data))
        if line and terms in points:
            shape = shape._replace(speeds=line.speeds)
        if "stribeck" in terms:
            # In slower ones the sign's rounding hides the fading.
            seen = [v for v in STRIBECK_VELOCITIES if v > 2 * best.smoothing]
            shapes += [shape._replace(stribeck_velocity=velocity) for velocity in seen]
        else:
            shapes.append(shape)
            if best.presliding_length:
                shapes.append(shape._replace(terms=(*shape.terms, "presliding")))
    return list(dict.fromkeys(shapes))


def tellable_terms(terms: tuple[str, ...], data: JointData) -> tuple[str, ...]:
    """Terms that the motion shows: by load, and both ways."""
    out = tuple(t for t in terms if t != "load_coulomb" or data.load_spread >= LIGHT)
    return out if data.reverses else tuple(t for t in out if t != "offset")


def pushing_terms(shape: Shape, values: Array) -> tuple[str, ...]:
    """Dry terms with a negative coefficient. (k,)"""
    own = dict(zip(shape.terms, values, strict=False))
    return tuple(term for term in NEVER_NEGATIVE if own.get(term, 0.0) < 0.0)


def bounded_shape(shape: Shape, data: JointData) -> tuple[Shape, bool]:
    """A shape less its terms at zero; whether velocities seem reversed."""
    powers: dict[Shape, float] = {}
    for without in ((), BOUNDED[:1], BOUNDED[1:], BOUNDED):
        one = shape._replace(terms=tuple(t for t in shape.terms if t not in without))
        fit = data.fit(one)
        power = np.sum(data.weights * fit.residual**2)
        own = [k for k, term in enumerate(one.terms) if term in BOUNDED]
        values = fit.values[own]
        if not without:
            push = root_mean_square(data.columns(one)[:, own] @ values)
            both, free = (values < 0.0).all(), power
        if (values >= 0.0).all():
            powers[one] = power
        if shape in powers:
            return shape, False
    best = min(powers, key=lambda one: powers[one])
    turned = both and powers[best] > TURNED * free and push > PUSH * data.torque_limit
    return best, bool(turned)


def non_negative_fit(shape: Shape, data: JointData) -> tuple[Shape, Array]:
    """A shape's fit; with presliding, without negative dry terms."""
    fit = data.fit(shape)
    pushing = pushing_terms(shape, fit.values)
    # The two share one dry torque: too much of one excludes the other.
    if "presliding" in shape.terms and pushing:
        shape = shape._replace(terms=tuple(t for t in shape.terms if t not in pushing))
        fit = data.fit(shape)
    return shape, fit.values


def is_dissipative(shape: Shape, values: Array, speed_limit: float) -> bool:
    """Whether friction never pushes and rises up to a speed. [rad/s]"""
    falls = falling_speed(shape.friction(values), speed_limit)
    return not pushing_terms(shape, values) and np.isnan(falls)
