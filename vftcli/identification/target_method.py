"""Method "targets": the controller's own K, rotor inertia and friction, written as a robot."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vftcli.identification.friction_shapes import rounded
from vftcli.identification.method_result import (
    MethodResult,
    confidence,
    friction_numbers,
    profile_friction,
)
from vftcli.identification.result import Number
from vftcli.identification.targets import SHAPES, ControllerModel, controller_models
from vftcli.identification.training import Training
from vftcli.robots.robot import Robot


def targets_method(data: Training) -> MethodResult:
    """K, rotor inertia and friction as the controller itself uses them."""
    models = controller_models(data.recordings, data.robot)
    robot = data.robot
    rotor, frictions = robot.chain.rotor_inertia.copy(), list(profile_friction(robot))
    constants = np.array(robot.torque_constant, dtype=float)
    numbers: list[Number] = []
    notes: list[str] = []
    for j, model in enumerate(models):
        numbers += target_numbers(j, model, robot)
        notes += target_notes(j, model, robot)
        if model.constant.known:
            constants[j] = rounded(model.constant.value)
        if model.rotor.known:
            rotor[j] = rounded(model.rotor.value)
        if model.friction is not None and model.friction_sd is not None:
            words = confidence(data, "targets", model.friction_sd)
            frictions[j] = SHAPES[0].friction(model.friction, words)
    notes += gravity_note(models)
    chain = replace(robot.chain, rotor_inertia=rotor)
    new = replace(robot, chain=chain, friction=tuple(frictions), torque_constant=constants)
    return MethodResult(new, numbers, [], None, notes)


def target_numbers(j: int, model: ControllerModel, robot: Robot) -> list[Number]:
    """What the controller believes of one joint, as numbers."""
    constants = robot.torque_constant
    K = float(constants[j]) if constants is not None else float("nan")
    J = float(robot.chain.rotor_inertia[j])
    numbers = [
        Number(j + 1, "torque_constant", *model.constant[:2], K, model.constant.known),
        Number(j + 1, "rotor_inertia", *model.rotor[:2], J, model.rotor.known),
    ]
    if model.friction is not None and model.friction_sd is not None:
        before = profile_friction(robot)[j]
        numbers += friction_numbers(j, SHAPES[0], model.friction, model.friction_sd, before)
    return numbers


def target_notes(j: int, model: ControllerModel, robot: Robot) -> list[str]:
    """What the targets leave open in one joint."""
    notes = []
    K = float(robot.torque_constant[j]) if robot.torque_constant is not None else float("nan")
    if not model.constant.known:
        found = (
            f"{model.constant.value:.4g} ± {model.constant.sd:.2g} N·m/A"
            if np.isfinite(model.constant.sd)
            else "no load and no motion"
        )
        notes.append(
            f"joint {j + 1}: the drive constant is not determined ({found}); "
            f"the profile's {K:g} stays"
        )
    if not model.rotor.known:
        notes.append(
            f"joint {j + 1} is not accelerated enough: rotor inertia "
            f"{robot.chain.rotor_inertia[j]:g} kg·m² stays"
        )
    if model.friction is None:
        notes.append(f"joint {j + 1} is not excited: the profile's friction stays")
    return notes


def gravity_note(models: Sequence[ControllerModel]) -> list[str]:
    """A remark if the controller computes with another gravity than the profile."""
    scales = [m.gravity for m in models if m.gravity.known]
    if not scales:
        return []
    weights = np.array([1.0 / max(s.sd, 1e-9) ** 2 for s in scales])
    scale = float(weights @ np.array([s.value for s in scales]) / weights.sum())
    if abs(scale - 1.0) < 3e-4:
        return []
    return [f"the controller's gravity torque is {scale:.4f} × the profile's (9.82 m/s² is 1.0010)"]
