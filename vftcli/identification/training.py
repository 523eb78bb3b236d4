"""Training data: logs prepared, joints fitted one by one, contacts left out."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.identification.excitation import (
    Excitation,
    find_excitation,
)
from vftcli.identification.friction_fit import (
    BOUNDED,
    JointData,
    PreslidingChoice,
    ShapeChoice,
    choose_presliding,
    choose_shape,
)
from vftcli.identification.friction_shapes import FrictionColumns, Shape
from vftcli.identification.processing import (
    PreparedLog,
    Processing,
    friction_warmth,
    gravity_torque,
    prepare,
)
from vftcli.identification.scoring import predicted_torque, rigid_torque
from vftcli.robots.drive import drive_torque, uses_current
from vftcli.robots.robot import JointFriction, Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError
from vftcli.signals.least_squares import ColumnFit, fit_column
from vftcli.signals.recording import Recording

#: Share of a fit's cross-validated error from which down on the profile's friction is kept.
KEPT = 0.85
#: Relative standard deviation up to which a drive constant is taken from free motion.
CONSTANT_KNOWN = 0.02


@dataclass(frozen=True, kw_only=True)
class Training:
    """The training logs, prepared."""

    robot: Robot  #: The profile.
    recordings: tuple[Recording, ...]  #: The logs.
    motions: tuple[PreparedLog, ...]  #: Those that move, filtered and decimated.
    columns: tuple[FrictionColumns, ...]  #: Their friction columns.
    rigid: tuple[Array, ...]  #: Torque of the profile's rigid body. (M, n) each [N·m]
    rubbing: tuple[Array, ...]  #: Torque of its rotors and its friction. (M, n) each [N·m]
    excited: Excitation  #: Which joints move.
    source: str  #: The logs in words, for the robot file.
    fit_constants: bool = False  #: Whether drive constants are unknowns of the friction method.
    rubs: bool = True  #: Whether the joints have friction to be fitted.

    @property
    def rotor(self) -> bool:
        """Whether the torque is measured before the gear, so that it accelerates the rotor too."""
        return self.robot.torque_source != "link_torque"

    def top_speed(self, j: int) -> float:
        """Speed limit of joint j (from 0), its fastest motion where the robot has none. [rad/s]"""
        fastest = max(float(np.max(np.abs(m.dq[:, j]), initial=0.0)) for m in self.motions)
        return float(np.fmax(self.robot.limits.qd_max[j], fastest))


def prepare_training(
    recordings: Sequence[Recording],
    robot: Robot,
    processing: Processing,
    fit_constants: bool,
    rubs: bool = True,
) -> Training:
    """Prepare the training logs, of joints that rub or not."""
    for recording in recordings:
        drive_torque(recording, robot)
    motions = tuple(prepare(recording, robot, processing) for recording in recordings)
    if fit_constants and not all(uses_current(r, robot) for r in recordings):
        raise IdentificationError(
            "--fit-constants needs motor currents; the logs have torques. Leave it out"
        )
    excited = find_excitation(motions)
    moved = tuple(m for m in motions if m.samples > 1)
    columns = tuple(friction_columns(m, robot) for m in moved)
    digests = ", ".join(f"{r.name} (sha256 {r.source.sha256 or 'unknown'})" for r in recordings)
    rigid = tuple(rigid_torque(robot, m) for m in moved)
    return Training(
        robot=robot,
        recordings=tuple(recordings),
        motions=moved,
        columns=columns,
        rigid=rigid,
        rubbing=tuple(predicted_torque(robot, m) - r for m, r in zip(moved, rigid, strict=True)),
        excited=excited,
        source=digests,
        fit_constants=fit_constants,
        rubs=rubs,
    )


def friction_columns(motion: PreparedLog, robot: Robot) -> FrictionColumns:
    """A log's friction columns, by the robot's gravity and its joints' temperatures."""
    load = np.abs(gravity_torque(robot, motion.recording.q))
    return FrictionColumns(motion, load, friction_warmth(motion.recording, robot))


class JointFit(NamedTuple):
    """Friction of one joint, with what was fitted beside it."""

    shape: Shape  #: The chosen structure.
    fit: ColumnFit  #: Friction coefficients, then q̈'s, then the rigid torque's.
    choices: list[ShapeChoice]  #: The candidates and their errors.
    constant: bool  #: Whether the drive constant was fitted too.
    presliding: PreslidingChoice  #: The arm's presliding length, which all joints share.
    #: RMS of what the model misses of stretches left out, and what the profile's friction and rotor
    #: miss there; NaN where they were not compared. [N·m]
    errors: tuple[float, float] = (np.nan, np.nan)

    @property
    def friction(self) -> JointFriction:
        """The joint's friction by this fit."""
        return self.shape.friction(self.fit.values[: len(self.shape.terms)])

    @property
    def at_bound(self) -> tuple[str, ...]:
        """The friction terms that sit at their bound of zero."""
        rubs = not self.choices and self.shape.terms
        return tuple(t for t in BOUNDED if rubs and t not in self.shape.terms)

    @property
    def is_kept(self) -> bool:
        """Whether the profile's friction and rotor predict clearly better."""
        return self.errors[1] < KEPT * self.errors[0]


def fit_frictions(data: Training, weights: Sequence[Array]) -> list[JointFit | None]:
    """Fit every joint that moves, the links held at the profile; None for the others."""
    moving = [j for j in range(data.robot.joints) if data.excited.moves[j]]
    presliding = choose_presliding(
        [(j, data_of_joint(data, j, weights, data.fit_constants)) for j in moving if data.rubs]
    )
    fits: list[JointFit | None] = [None] * data.robot.joints
    for j in moving:
        found = fit_joint(data, j, weights, presliding, data.fit_constants)
        # A joint that carries little cannot tell its constant, the last coefficient, from friction.
        if data.fit_constants and found.fit.sd[-1] >= CONSTANT_KNOWN * abs(found.fit.values[-1]):
            found = fit_joint(data, j, weights, presliding, False)
        fits[j] = found
    return fits


def fit_joint(
    data: Training, j: int, weights: Sequence[Array], presliding: PreslidingChoice, constant: bool
) -> JointFit:
    """Choose and fit one joint's model, with its drive constant or without."""
    given = data_of_joint(data, j, weights, constant)
    if not data.rubs:
        fit = fit_column(given.fixed, given.y, given.weights)
        return JointFit(Shape(()), fit, [], constant, presliding)
    shape, choices = choose_shape(j, given, presliding.length)
    fit = fit_column(given.columns(j, shape), given.y, given.weights)
    errors = (np.nan, np.nan)
    if given.profile is not None and choices:
        miss = float(np.sum(fit.weights * (given.y - given.profile) ** 2) / np.sum(fit.weights))
        errors = (next(c.error for c in choices if c.chosen), float(np.sqrt(miss)))
    return JointFit(shape, fit, choices, constant, presliding, errors)


def data_of_joint(data: Training, j: int, weights: Sequence[Array], constant: bool) -> JointData:
    """The equations of joint j (from 0) over all logs.

    With a drive constant to be found the rigid body's torque is a column whose coefficient would
    be 1 if the profile's constant were right; without, it is subtracted.
    """
    motions = data.motions
    torque = np.concatenate([m.tau[:, j] for m in motions])
    rigid = np.concatenate([r[:, j] for r in data.rigid])
    fixed = []
    if data.rotor:
        fixed.append(np.concatenate([m.ddq[:, j] for m in motions]))
    if constant:
        fixed.append(rigid)
    load = np.concatenate([c.load[:, j] for c in data.columns])
    return JointData(
        y=torque if constant else torque - rigid,
        fixed=np.stack(fixed, axis=1) if fixed else np.zeros((len(torque), 0)),
        weights=np.concatenate([w[:, j] for w in weights]),
        sources=data.columns,
        load_spread=float(np.std(load)),
        reverses=bool(data.excited.reverses[j]),
        speed_limit=data.top_speed(j),
        torque_limit=float(np.nan_to_num(data.robot.limits.tau_max[j], posinf=0.0)),
        profile=None if constant else np.concatenate([r[:, j] for r in data.rubbing]),
    )


def all_residuals(data: Training, fits: Sequence[JointFit | None]) -> list[Array]:
    """What the friction fits leave of each log; zero for joints that are held. (M, n) each"""
    edges = np.cumsum([0, *(m.samples for m in data.motions)])
    whole = np.zeros((edges[-1], data.robot.joints))
    for j, fit in enumerate(fits):
        if fit is not None:
            whole[:, j] = fit.fit.residual
    return [whole[a:b] for a, b in itertools.pairwise(edges)]
