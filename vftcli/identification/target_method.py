"""Method "targets": the controller's own K, rotor inertia and friction, written as a robot."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vftcli.identification.friction_shapes import round_digits
from vftcli.identification.method_result import (
    MethodResult,
    friction_numbers,
    friction_source,
    identified_friction,
    profile_constant,
    profile_friction,
    temperature_remarks,
)
from vftcli.identification.result import Number, number
from vftcli.identification.targets import ControllerModel, controller_models
from vftcli.identification.training import Training
from vftcli.robots.robot import Robot
from vftcli.signals.remarks import Remark, Where, caution, fact

#: Relative difference of gravity that is not remarked on: a third of that of 9.82 to 9.81 m/s².
SAME_GRAVITY = 3e-4


def targets_method(data: Training) -> MethodResult:
    """K, rotor inertia and friction as the controller itself uses them."""
    models = controller_models(data.recordings, data.robot)
    robot = data.robot
    rotor, frictions = robot.chain.rotor_inertia.copy(), list(profile_friction(robot))
    constants = np.array(robot.torque_constant, dtype=float)
    numbers: list[Number] = []
    remarks: list[Remark] = []
    for j, model in enumerate(models):
        numbers += target_numbers(j, model, robot)
        remarks += target_remarks(j, model, robot)
        if model.constant.known:
            constants[j] = round_digits(model.constant.value)
        if model.rotor.known:
            rotor[j] = round_digits(model.rotor.value)
        if model.friction is not None:
            shape, values, sd = model.friction
            source = friction_source(data, "targets", sd)
            frictions[j] = identified_friction(data, j, shape, values, source)
    remarks += [*gravity_remarks(models), *temperature_remarks(data)]
    chain = replace(robot.chain, rotor_inertia=rotor)
    new = replace(robot, chain=chain, friction=tuple(frictions), torque_constant=constants)
    return MethodResult(new, numbers, [], None, remarks)


def target_numbers(j: int, model: ControllerModel, robot: Robot) -> list[Number]:
    """What the controller believes of joint j (from 0), as numbers."""
    K, J = profile_constant(robot, j), float(robot.chain.rotor_inertia[j])
    numbers = [
        number(j, "torque_constant", *model.constant[:2], K, model.constant.known),
        number(j, "rotor_inertia", *model.rotor[:2], J, model.rotor.known),
    ]
    if model.friction is not None:
        numbers += friction_numbers(j, *model.friction, profile_friction(robot)[j])
    return numbers


def target_remarks(j: int, model: ControllerModel, robot: Robot) -> list[Remark]:
    """What the targets leave open in joint j (from 0), so that the profile's numbers stay."""
    remarks, where = [], Where(joints=(j + 1,))
    if not model.constant.known:
        found = {"profile_NmA": profile_constant(robot, j)}
        if np.isfinite(model.constant.sd):
            found |= {"found_NmA": model.constant.value, "sd_NmA": model.constant.sd}
            remarks.append(caution("undetermined-drive-constant", where, **found))
        else:
            remarks.append(caution("unexcited-drive-constant", where, **found))
    if not model.rotor.known:
        J = float(robot.chain.rotor_inertia[j])
        remarks.append(caution("unaccelerated-joint", where, profile_kgm2=J))
    if model.friction is None:
        remarks.append(caution("unexcited-friction", where))
    return remarks


def gravity_remarks(models: Sequence[ControllerModel]) -> list[Remark]:
    """A remark if the controller computes with another gravity than the profile."""
    scales = [m.gravity for m in models if m.gravity.known]
    if not scales:
        return []
    # All joints feel one gravity: their ratios are averaged by the inverse of their variances.
    weights = np.array([1.0 / max(s.sd, 1e-9) ** 2 for s in scales])
    ratio = float(weights @ np.array([s.value for s in scales]) / weights.sum())
    least = max(SAME_GRAVITY, 2.0 / float(np.sqrt(weights.sum())))
    return [fact("controller-gravity", ratio=ratio)] if abs(ratio - 1.0) >= least else []
