"""Training data: filtered logs, friction as columns, the profile's torques, joints that move.

Friction is a sum of known shapes times coefficients. The shapes are evaluated on the log as it was
recorded and then filtered like the torque, so that a reversal is rounded alike on both sides of the
equation.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.identification.processing import (
    CUTOFF,
    PreparedLog,
    gravity_torque,
    predicted_torque,
    prepare,
    rigid_torque,
)
from vftcli.robots.friction import (
    FRICTION_MODELS,
    SMOOTHING,
    bent_line,
    coulomb_logarithmic,
    friction_factor,
)
from vftcli.robots.robot import JointFriction, Robot
from vftcli.robots.running_friction import measured_temperature, play
from vftcli.robots.terms import uses_current
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import IdentificationError
from vftcli.signals.recording import Recording
from vftcli.signals.rest import MOVES
from vftcli.signals.series import median_step

SMOOTHINGS = (0.003, 0.01, 0.03, 0.1)  #: Velocities over which the sign may be smoothed. [rad/s]
#: Velocities over which a Stribeck term may fade. [rad/s]
STRIBECK_VELOCITIES = (0.02, 0.05, 0.1, 0.2)
#: Velocities from which a logarithmic rise may flatten; UR's gears have .28 to 2.1. [rad/s]
LOGARITHMIC_VELOCITIES = (0.1, 0.2, 0.5, 1.0, 2.0)
#: Speeds of the points between which UR's controllers draw friction as a line. [rad/s]
BENDS = (0.01, 0.5, 1.5, 3.2)
#: Share of the way between two points that a motion must cover to tell the faster one.
SPANNED = 0.3
#: Term → friction model in a robot file; the first that a joint has counts.
MODELS = {
    "logarithmic": "coulomb-logarithmic",
    "stribeck": "coulomb-viscous-stribeck",
    "load_coulomb": "coulomb-viscous-load",
    "quadratic": "coulomb-viscous-quadratic",
    "offset": "coulomb-viscous-offset",
}
SIMPLEST = "coulomb-viscous"  #: Model of a joint that has none of them.
POINT = "point"  #: Head of a bent line's terms: point1 is the torque at its first speed.
ENOUGH = 1.0  #: Time a joint must move, and for both ways to count a tenth of it each way. [s]


class Shape(NamedTuple):
    """The structure of one joint's friction: which terms, and its nonlinear numbers."""

    #: Keys of the robot file that hold coefficients, in order; those that begin with `POINT`
    #: are the torques of a bent line.
    terms: tuple[str, ...]
    smoothing: float = SMOOTHING  #: Velocity over which the sign is smoothed. [rad/s]
    stribeck_velocity: float = 0.05  #: Velocity over which the Stribeck term fades. [rad/s]
    logarithmic_velocity: float = 1.0  #: Velocity from which the logarithmic term flattens. [rad/s]
    #: Way over which the teeth of the gear give before they slide. [rad]
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
        """The terms that are torques of a bent line, in the order of its speeds."""
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
        """The joint's friction with these coefficients, one a term."""
        parameters = {k: round_digits(float(v)) for k, v in zip(self.terms, values, strict=True)}
        torques = tuple(parameters.pop(term) for term in self.points)
        parameters["smoothing"] = self.smoothing
        for term in ("stribeck", "logarithmic"):
            if term in self.terms:
                parameters[f"{term}_velocity"] = float(getattr(self, f"{term}_velocity"))
        if "presliding" in self.terms:
            parameters["presliding_length"] = self.presliding_length
        # A dry torque that is all presliding's leaves none to what slides.
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
    """The bent line for a motion up to a speed [rad/s], None of fewer than two points.

    Between its points the line is straight, so that a motion well beyond one of them tells the
    next one too; behind its last point it goes on as it came.
    """
    reached = [speed >= low + SPANNED * (high - low) for low, high in itertools.pairwise(BENDS)]
    count = 1 + int(np.argmin([*reached, False]))
    if count < 2:
        return None
    points = tuple(f"{POINT}{k}" for k in range(1, count + 1))
    return Shape(points, speeds=BENDS[:count])


def round_digits(value: float, digits: int = 7) -> float:
    """A number with as many digits as an identification can possibly mean."""
    return float(f"{value:.{digits}g}")


def term_values(term: str, shape: Shape, dq: Array, load: Array) -> Array:
    """One term at recorded velocities [rad/s] and loads [N·m], its coefficient at 1."""
    if term in shape.points:
        torques = np.eye(len(shape.speeds))[shape.points.index(term)].tolist()
        return bent_line(dq, shape.speeds, torques, smoothing=shape.smoothing)
    own = ("smoothing", "stribeck_velocity", "logarithmic_velocity")
    numbers = {name: getattr(shape, name) for name in own}
    return coulomb_logarithmic(
        dq, **{"coulomb": 0.0, "logarithmic": 0.0, term: 1.0}, **numbers, load=load
    )


class FrictionColumns:
    """Filtered friction columns of one prepared log, each made once.

    `load` is the absolute gravity torque along the whole log (T, n) [N·m], `warmth` the factor on
    each joint's friction by its temperature (T, n), None where that is not known.
    """

    def __init__(self, motion: PreparedLog, load: Array, warmth: Array | None = None) -> None:
        self.motion = motion
        self.load = load
        self.warmth = warmth
        self.cache: dict[tuple[str, int, tuple[float, ...]], Array] = {}

    def column(self, term: str, j: int, shape: Shape) -> Array:
        """One term of joint j (from 0), filtered like the torque, made once. (M,)"""
        # The key holds only what the term depends on, so that shapes share their columns.
        numbers = {
            **dict.fromkeys(("coulomb", "load_coulomb"), (shape.smoothing,)),
            "stribeck": (shape.smoothing, shape.stribeck_velocity),
            "logarithmic": (shape.logarithmic_velocity,),
            "presliding": (shape.presliding_length,),
            **dict.fromkeys(shape.points, (shape.smoothing, *shape.speeds)),
        }
        key = (term, j, numbers.get(term, ()))
        if key not in self.cache:
            log = self.motion.recording
            if term == "presliding":
                values = play(log.q[:, j : j + 1], shape.presliding_length).state[:, 0]
            else:
                values = term_values(term, shape, log.require("dq")[:, j], self.load[:, j])
            if self.warmth is not None and term != "offset":
                values = values * self.warmth[:, j]
            self.cache[key] = self.motion.filtered(values[:, None])[:, 0]
        return self.cache[key]

    def joint(self, j: int, shape: Shape) -> Array:
        """All terms of a shape for joint j (from 0), one column a term. (M, k)"""
        columns = [self.column(term, j, shape) for term in shape.terms]
        return np.stack(columns, axis=1) if columns else np.zeros((self.motion.samples, 0))


def friction_columns(motion: PreparedLog, robot: Robot) -> FrictionColumns:
    """A log's friction columns, by a robot's gravity and temperature law."""
    temperature = measured_temperature(motion.recording)
    warmth = None if temperature is None else friction_factor(robot.friction, temperature)
    return FrictionColumns(motion, np.abs(gravity_torque(robot, motion.recording.q)), warmth)


class TrainingLog(NamedTuple):
    """One log to be fitted: M samples in motion."""

    motion: PreparedLog  #: The prepared log.
    columns: FrictionColumns  #: Its friction columns.
    weights: Array  #: Weight of every sample and joint, 0 where it tells nothing. (M, n)
    rigid: Array  #: Torque of the profile's rigid body. (M, n) [N·m]
    losses: Array  #: Torque of the profile's rotors and friction. (M, n) [N·m]


@dataclass(frozen=True, kw_only=True)
class Training:
    """The training logs, prepared."""

    robot: Robot  #: The profile.
    recordings: tuple[Recording, ...]  #: The logs.
    logs: tuple[TrainingLog, ...]  #: Those that move, filtered and decimated.
    moves: Mask  #: Joints that move at all. (n,)
    reverses: Mask  #: Joints that move both ways. (n,)
    fit_constants: bool = False  #: Whether drive constants are unknowns of the friction method.
    rubs: bool = True  #: Whether the joints have friction to be fitted.

    @property
    def rotor(self) -> bool:
        """Whether torque is measured before the gear and accelerates the rotor too."""
        return self.robot.torque_source != "link_torque"

    def top_speed(self, j: int) -> float:
        """Speed limit of joint j (from 0), else its fastest motion. [rad/s]"""
        fastest = max(float(np.max(np.abs(log.motion.dq[:, j]))) for log in self.logs)
        return float(np.fmax(self.robot.limits.qd_max[j], fastest))


def prepare_training(
    recordings: Sequence[Recording],
    robot: Robot,
    cutoff: float = CUTOFF,
    fit_constants: bool = False,
    rubs: bool = True,
) -> Training:
    """Training data of a profile's logs, of joints that rub or not."""
    motions = [prepare(recording, robot, cutoff) for recording in recordings]
    if fit_constants and not all(uses_current(r, robot) for r in recordings):
        raise IdentificationError(
            "--set identify.constants=yes needs motor currents; the logs have torques. Leave it out"
        )
    moves, reverses = moving_joints(motions)
    logs = []
    for motion in motions:
        if motion.samples > 1:
            rigid, columns = rigid_torque(robot, motion), friction_columns(motion, robot)
            losses = predicted_torque(robot, motion) - rigid
            logs.append(TrainingLog(motion, columns, motion.usable.astype(float), rigid, losses))
    return Training(
        robot=robot,
        recordings=tuple(recordings),
        logs=tuple(logs),
        moves=moves,
        reverses=reverses,
        fit_constants=fit_constants,
        rubs=rubs,
    )


def moving_joints(motions: Sequence[PreparedLog]) -> tuple[Mask, Mask]:
    """Joints that the logs move at all, and those that they move both ways. (n,), (n,)"""
    times = np.zeros((2, motions[0].dq.shape[1]))
    for motion in motions:
        if motion.samples > 1:
            ways = np.count_nonzero([motion.dq > MOVES, motion.dq < -MOVES], axis=1)
            times += median_step(motion.t) * ways
    moves = times.sum(axis=0) >= ENOUGH
    if not np.any(moves):
        names = ", ".join(m.recording.name for m in motions)
        raise IdentificationError(
            f"{names}: no joint moves faster than {MOVES:g} rad/s for {ENOUGH:g} s; a log at rest "
            "identifies no friction and no inertia. Record free motion, or use --method "
            "payload on static poses"
        )
    # A tenth of a second back is enough to tell the sign of friction from an offset.
    return moves, np.min(times, axis=0) >= 0.1 * ENOUGH
