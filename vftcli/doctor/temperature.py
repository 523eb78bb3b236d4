"""Findings about the joints' temperature, which friction follows."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from vftcli.doctor.findings import on_joints
from vftcli.robots import Robot
from vftcli.robots.friction import friction_factor, steady_torque
from vftcli.robots.running_friction import measured_temperature
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution, fact, warning
from vftcli.signals.rest import MOVES

#: Share less that a joint rubs for each kelvin: UR's five sizes .011–.022 between 28 and 45 °C.
PER_KELVIN = 0.015
#: Distance from the temperature of the model from which a joint rubs 8–15 % otherwise. [K]
FAR = 7.0
ASSUMED = 10.0  #: `FAR` where the robot file does not state that temperature. [K]
#: Range of the law: measured from 28 to 46 °C, and 15 to 20 K beyond. [°C]
HOLDS = (15.0, 65.0)
NOTICED = 0.2  #: Friction that is worth a finding. [N·m]


def temperature_findings(recording: Recording, robot: Robot) -> Iterator[Remark]:
    """Whether the log's joints are as warm as the model's, and the log says so."""
    if not robot.friction or recording.joints != robot.joints or recording.dq is None:
        return
    temperature = measured_temperature(recording)
    lawful = np.array([j for j, joint in enumerate(robot.friction) if joint.temperature], dtype=int)
    reference = [robot.friction[j].reference_temperature for j in lawful]
    values: dict[str, Any] = {"reference_C": sorted(set(reference)), "robot": robot.name}
    if temperature is not None:
        unknown = np.isnan(temperature[:, lawful])
        if unknown.any():
            gaps = unknown.any(axis=0)
            values["share_percent"] = 100.0 * float(unknown[:, gaps].mean())
            yield fact("temperature-gaps", on_joints(lawful[gaps]), **values)
        yield from far_temperature(recording, robot, temperature)
    elif lawful.size:
        colder = np.full((1, robot.joints), np.nan)
        colder[0, lawful] = np.array(reference) - 10.0
        factor = friction_factor(robot.friction, colder)
        if factor is not None:
            more = 100.0 * (factor[0, lawful] - 1.0)
            values |= {"least_percent": float(more.min()), "most_percent": float(more.max())}
            yield fact("no-temperature", **values)


def far_temperature(recording: Recording, robot: Robot, temperature: Array) -> Iterator[Remark]:
    """Joints far from their model's temperature, without a friction law there.

    Args:
        recording: The log.
        robot: The arm.
        temperature: Its joint temperatures, NaN where not measured. (T, n) [°C]
    """
    far: dict[str, list[tuple[int, float, float, float]]] = {}
    speeds = np.abs(recording.require("dq"))
    for j, joint in enumerate(robot.friction):
        used = (speeds[:, j] > MOVES) & ~np.isnan(temperature[:, j])
        if joint.model == "none" or not used.any():
            continue
        reference = joint.reference_temperature
        code, (low, high), least = "far-temperature", (reference, reference), FAR
        if joint.temperature:
            code, (low, high), least = "temperature-beyond-law", HOLDS, 0.0
        elif joint.temperature_at is None:
            code, least = "far-temperature-assumed", ASSUMED
        coldest, warmest = np.percentile(temperature[used, j], [5.0, 95.0])
        below, above = low - coldest, warmest - high
        seen, colder = (coldest, below) if below > above else (warmest, -above)
        torque = steady_torque(joint, np.median(speeds[used, j], keepdims=True))[0]
        wrong = abs(float(torque) * float(np.expm1(PER_KELVIN * colder)))
        if max(below, above) > least and wrong >= NOTICED:
            far.setdefault(code, []).append((j, float(seen), reference, wrong))
    for code, rows in far.items():
        joints, ends, references, torques = zip(*rows, strict=True)
        level = caution if code == "far-temperature-assumed" else warning
        yield level(
            code,
            on_joints(joints),
            robot=robot.name,
            seen_C=list(ends),
            reference_C=sorted(set(references)),
            wrong_Nm=list(torques),
            range_C=list(HOLDS),
        )
