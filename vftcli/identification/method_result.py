"""What every method of identification hands back, and the remarks that several of them make."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.identification.base_parameters import BaseParameters
from vftcli.identification.friction_fit import ShapeChoice
from vftcli.identification.friction_shapes import Shape
from vftcli.identification.result import Number, number
from vftcli.identification.training import JointFit, Training
from vftcli.robots.friction import falling_speed, steady_torque
from vftcli.robots.robot import JointFriction, Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError
from vftcli.signals.least_squares import robust_sd
from vftcli.signals.remarks import Remark, Where, caution, fact, warning

#: Standard deviation over value up to which a number counts as determined by the logs.
DETERMINED = 0.3
#: Standard deviations from the profile's rotor inertia from which on what was found is taken.
REFUTED = 3.0


class MethodResult(NamedTuple):
    """What a method found."""

    robot: Robot  #: The identified robot.
    numbers: list[Number]  #: Its identified numbers.
    shape_choices: list[ShapeChoice]  #: Friction candidates.
    base: BaseParameters | None  #: Base parameters, if the method has them.
    remarks: list[Remark]  #: What the reader of the numbers should know.
    is_narrow: bool = False  #: Whether the motion tells the links too little.


def friction_numbers(
    j: int, shape: Shape, values: Array, sd: Array, before: JointFriction
) -> list[Number]:
    """Friction coefficients of joint j (from 0) beside those of the profile, one a term."""
    known = dict(before.parameters)
    if before.speeds[: len(shape.speeds)] == shape.speeds:
        known |= dict(zip(shape.points, before.torques, strict=False))
    return [
        number(
            j, term, value, error, known.get(term, np.nan), bool(error < DETERMINED * abs(value))
        )
        for term, value, error in zip(shape.terms, values, sd, strict=False)
    ]


def rotor_number(j: int, value: float, sd: float, before: float) -> Number:
    """The rotor inertia of joint j (from 0) as a number, determined or not. [kg·m²]

    It counts as determined too where it is `REFUTED` standard deviations from the profile's: then
    that one is wrong, and what was found, zero at least, is nearer to the truth.
    """
    if refuted := abs(value - before) >= REFUTED * sd:
        value = max(value, 0.0)
    known = refuted or (value > 0 and sd < DETERMINED * value)
    return number(j, "rotor_inertia", value, sd, before, bool(known))


def check_friction(j: int, friction: JointFriction, data: Training) -> list[Remark]:
    """A remark if the friction found would push joint j (from 0) at some speed, or falls."""
    speed = max(float(np.max(np.abs(m.dq[:, j]))) for m in data.motions)
    torque = steady_torque(friction, np.linspace(0.1 * speed, speed, 10))
    noise = max(robust_sd(m.tau)[j] for m in data.motions)
    # A hundredth of the torque's spread: friction of nothing comes out on either side of zero.
    if np.all(torque < -0.01 * noise):
        raise IdentificationError(
            f"{data.recordings[0].name}: friction of joint {j + 1} comes out as {torque[0]:.2g} to "
            f"{torque[-1]:.2g} N·m: it would push. Velocity and effort differ in sign, or this "
            "is another robot; check --columns and --robot"
        )
    if np.any(torque < 0):
        return [caution("negative-friction", Where(joints=(j + 1,)), least_Nm=float(torque.min()))]
    limit = data.top_speed(j)
    if np.isfinite(falls := falling_speed(friction, limit)):
        values = {"speeds_rad_s": [falls], "limits_rad_s": [limit]}
        return [warning("falling-friction", Where(joints=(j + 1,)), **values)]
    return []


def bound_remarks(fits: Sequence[JointFit | None]) -> list[Remark]:
    """Remarks on joints whose friction sits at its bound of zero."""
    return [
        caution("friction-at-bound", Where(joints=(j,)), terms=" and ".join(fit.at_bound))
        for j, fit in enumerate(fits, start=1)
        if fit is not None and fit.at_bound
    ]


def presliding_remark(fits: Sequence[JointFit | None]) -> list[Remark]:
    """Which presliding length the arm got, and what every length left of the error without."""
    for fit in fits:
        if fit is not None and len(fit.presliding.errors) > 1:
            lengths = [1e3 * length for length in fit.presliding.errors]
            return [
                fact(
                    "presliding-length",
                    length_mrad=1e3 * fit.presliding.length,
                    lengths_mrad=lengths,
                    errors=list(fit.presliding.errors.values()),
                )
            ]
    return []


def held_joints(data: Training) -> list[Remark]:
    """Remarks on joints that do not move, or never both ways."""
    remarks = []
    for j in range(data.robot.joints):
        where = Where(joints=(j + 1,))
        if not data.excited.moves[j]:
            remarks.append(fact("static-joint", where))
        elif not data.excited.reverses[j]:
            remarks.append(caution("one-way-joint", where))
    return remarks


def friction_source(data: Training, method: str, sd: Array) -> str:
    """Where a joint's friction comes from, in words for the robot file."""
    errors = ", ".join(f"{value:.2g}" for value in sd)
    return f"identified ({method}) from {data.source}; standard deviations {errors}"


def identified_friction(
    data: Training, j: int, shape: Shape, values: Array, source: str
) -> JointFriction:
    """Friction of joint j (from 0) by its fit, at the temperature for which the profile's holds."""
    before = profile_friction(data.robot)[j]
    return replace(
        shape.friction(values, source),
        temperature=before.temperature,
        temperature_at=before.temperature_at,
    )


def temperature_remarks(data: Training) -> list[Remark]:
    """By what the joints' temperatures scaled friction, of each log that has them."""
    remarks = []
    for motion, columns in zip(data.motions, data.columns, strict=True):
        if columns.warmth is not None:
            factors = [float(columns.warmth.min()), float(columns.warmth.max())]
            where = Where(motion.recording.name)
            remarks.append(fact("friction-by-temperature", where, factors=factors))
    return remarks


def profile_friction(robot: Robot) -> tuple[JointFriction, ...]:
    """The profile's friction, one a joint even where it has none."""
    return robot.friction or tuple(JointFriction() for _ in range(robot.joints))


def profile_constant(robot: Robot, j: int) -> float:
    """The profile's drive constant of joint j (from 0), nan if it has none. [N·m/A]"""
    return float(robot.torque_constant[j]) if robot.torque_constant is not None else float("nan")
