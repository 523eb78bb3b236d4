"""Findings about the joints' temperature, which friction follows."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from vftcli.doctor.findings import on_joints
from vftcli.robots import Robot
from vftcli.robots.friction import steady_torque
from vftcli.robots.robot import JointFriction
from vftcli.robots.temperature import friction_factor, measured_temperature
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution, fact, warning
from vftcli.signals.rest import MOVES

#: What a joint rubs less for each kelvin: UR's five joint sizes .011–.022 between 28 and 45 °C.
PER_KELVIN = 0.015
#: Distance from the temperature of the model from which a joint rubs 8–15 % otherwise. [K]
FAR = 7.0
ASSUMED = 10.0  #: The same where the robot file does not say the temperature of its friction. [K]
#: Where the law stands on measurements (28 to 46 °C), and 15 to 20 K beyond. [°C]
HOLDS = (15.0, 65.0)
NOTICED = 0.2  #: Friction that is worth a finding. [N·m]


def temperature_findings(recording: Recording, robot: Robot) -> Iterator[Remark]:
    """Whether the log's joints are as warm as those of the model, and whether the log says."""
    if not robot.friction or recording.joints != robot.joints or recording.dq is None:
        return
    temperature = measured_temperature(recording)
    lawful = [j for j, joint in enumerate(robot.friction) if joint.temperature]
    if lawful:
        yield from untold_temperature(robot, lawful, temperature)
    if temperature is None:
        return
    yield from far_temperature(recording, robot, temperature)


def untold_temperature(
    robot: Robot, lawful: list[int], temperature: Array | None
) -> Iterator[Remark]:
    """That friction is taken at the model's own temperature where the log tells none.

    Args:
        robot: The arm.
        lawful: Joints, from zero, whose friction follows a law.
        temperature: What the log tells, NaN where nothing; None for nothing at all. (T, n) [°C]
    """
    reference = [robot.friction[j].reference_temperature for j in lawful]
    values: dict[str, Any] = {"reference_C": sorted(set(reference)), "robot": robot.name}
    if temperature is None:
        colder = np.full((1, robot.joints), np.nan)
        colder[0, lawful] = np.array(reference) - 10.0
        factor = friction_factor(robot.friction, colder)
        if factor is not None:
            more = 100.0 * (factor[0, lawful] - 1.0)
            values |= {"least_percent": float(more.min()), "most_percent": float(more.max())}
            yield fact("no-temperature", **values)
        return
    untold = np.isnan(temperature[:, lawful])
    if untold.any():
        joints = np.array(lawful)[untold.any(axis=0)]
        share = 100.0 * float(untold[:, untold.any(axis=0)].mean())
        yield fact("temperature-gaps", on_joints(joints), **values, share_percent=share)


class Distance(NamedTuple):
    """A joint that was not as warm as its friction was taken for."""

    joint: int  #: The joint, from zero.
    code: str  #: The finding it is.
    seen: float  #: Its temperature in motion, the end that is farther away. [°C]
    reference: float  #: That of the model. [°C]
    wrong: float  #: What its friction is off by, at its median speed. [N·m]


def far_temperature(recording: Recording, robot: Robot, temperature: Array) -> Iterator[Remark]:
    """Joints whose temperature is far from the model's, and whose friction follows no law there.

    Args:
        recording: The log.
        robot: The arm.
        temperature: Its joint temperatures, NaN where not measured. (T, n) [°C]
    """
    speeds = np.abs(recording.require("dq"))
    pairs = zip(robot.friction, speeds.T, temperature.T, strict=True)
    far = [found for j, pair in enumerate(pairs) if (found := distance_of(j, *pair)) is not None]
    for code in dict.fromkeys(found.code for found in far):
        same = [found for found in far if found.code == code]
        level = caution if code == "far-temperature-assumed" else warning
        yield level(
            code,
            on_joints(found.joint for found in same),
            robot=robot.name,
            seen_C=[found.seen for found in same],
            reference_C=sorted({found.reference for found in same}),
            wrong_Nm=[found.wrong for found in same],
            range_C=list(HOLDS),
        )


def distance_of(j: int, joint: JointFriction, speed: Array, temperature: Array) -> Distance | None:
    """How far one joint was from the temperature of its model while it moved, None where near.

    Args:
        j: The joint, from zero.
        joint: Its friction.
        speed: Its speed. (T,) [rad/s]
        temperature: Its temperature, NaN where not measured. (T,) [°C]
    """
    used = (speed > MOVES) & ~np.isnan(temperature)
    if joint.model == "none" or not used.any():
        return None
    if joint.temperature:
        code, (low, high), least = "temperature-beyond-law", HOLDS, 0.0
    else:
        stated, low = joint.temperature_at is not None, joint.reference_temperature
        code, least = ("far-temperature", FAR) if stated else ("far-temperature-assumed", ASSUMED)
        high = low
    coldest, warmest = np.percentile(temperature[used], [5.0, 95.0])
    below, above = low - coldest, warmest - high
    seen, away = (coldest, below) if below > above else (warmest, above)
    torque = abs(float(steady_torque(joint, np.median(speed[used], keepdims=True))[0]))
    wrong = torque * abs(float(np.expm1(PER_KELVIN * (away if below > above else -away))))
    if away <= least or wrong < NOTICED:
        return None
    return Distance(j, code, float(seen), joint.reference_temperature, wrong)
