"""What every method hands back, and the words it has for its numbers."""

from typing import NamedTuple

import numpy as np

from vftcli.identification.base_parameters import BaseParameters
from vftcli.identification.friction_fit import ShapeChoice
from vftcli.identification.friction_shapes import Shape
from vftcli.identification.least_squares import robust_sd
from vftcli.identification.result import Number
from vftcli.identification.training import Training
from vftcli.robots.robot import JointFriction, Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError


class MethodResult(NamedTuple):
    """What a method found.

    Attributes:
        robot: The identified robot.
        numbers: Its identified numbers.
        contests: Friction candidates.
        base: Base parameters, if the method has them.
        notes: Remarks.
    """

    robot: Robot
    numbers: list[Number]
    contests: list[ShapeChoice]
    base: BaseParameters | None
    notes: list[str]


def friction_numbers(
    j: int, shape: Shape, values: Array, sd: Array, before: JointFriction
) -> list[Number]:
    """Friction coefficients as numbers."""
    return [
        Number(
            j + 1,
            term,
            float(value),
            float(error),
            float(before.parameters.get(term, np.nan)),
            bool(error < 0.3 * abs(value)),
        )
        for term, value, error in zip(shape.terms, values, sd, strict=False)
    ]


def odd_friction(j: int, friction: JointFriction, data: Training) -> list[str]:
    """A remark where friction would push at some speed of the log.

    Raises:
        IdentificationError: If it pushes at all speeds: sign or unit are wrong.
    """
    values = friction.parameters
    speed = max(float(np.max(np.abs(m.dq[:, j]))) for m in data.motions)
    v = np.linspace(0.1 * speed, speed, 10)
    torque = values["coulomb"] + values["viscous"] * v + values.get("quadratic", 0.0) * v**2
    noise = max(robust_sd(m.tau[:, j]) for m in data.motions)
    if np.all(torque < -0.01 * noise):
        raise IdentificationError(
            f"{data.recordings[0].name}: friction of joint {j + 1} comes out as {torque[0]:.2g} to "
            f"{torque[-1]:.2g} N·m: it would push. Velocity and effort differ in sign, or this "
            "is another robot; check --columns and --robot"
        )
    if np.any(torque < 0):
        return [
            f"joint {j + 1}: friction is below zero at some speeds ({torque.min():.2g} N·m); "
            "it is small against the model's error there"
        ]
    return []


def held(data: Training) -> list[str]:
    """Remarks on joints that do not move or never reverse."""
    notes = []
    for j in range(data.robot.joints):
        if not data.excited.moves[j]:
            notes.append(f"joint {j + 1} does not move: the profile's numbers stay")
        elif not data.excited.reverses[j]:
            notes.append(
                f"joint {j + 1} never reverses: Coulomb friction and an offset cannot be told "
                "apart; no offset is fitted, so that gravity errors may hide in the Coulomb torque"
            )
    return notes


def confidence(data: Training, method: str, sd: Array) -> str:
    """Where a joint's friction comes from, in words."""
    errors = ", ".join(f"{value:.2g}" for value in sd)
    return f"identified ({method}) from {data.source}; standard deviations {errors}"


def profile_friction(robot: Robot) -> tuple[JointFriction, ...]:
    """The profile's friction, one a joint even where it has none."""
    return robot.friction or tuple(JointFriction() for _ in range(robot.joints))
