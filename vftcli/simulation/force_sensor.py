"""The simulated force/torque sensor on the flange: what the handle exerts, and what it weighs."""

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.packages import needed
from vftcli.signals.pose import rpy_matrix
from vftcli.simulation.arm import Arm
from vftcli.simulation.scenario import ForceSensorSpec
from vftcli.simulation.sensing import Samples
from vftcli.simulation.truth import Truth


def read_force_sensor(arm: Arm, samples: Samples, truth: Truth) -> Array | None:
    """Wrench in sensor axes about the sensor's origin, as force ON the robot. (M, 6) [N, N·m]

    It feels every contact on the flange, and weight and inertia of what is mounted beyond it; then
    zero offset, drift and noise are added. None without a sensor.
    """
    spec = arm.scenario.force_sensor
    if spec is None:
        return None
    # Its own generator: mounting a sensor leaves the noise of all other signals as it was.
    rng = np.random.default_rng(arm.seeds["sensing"].spawn(1)[0])
    clean = np.zeros((len(samples.time), 6))
    turn = rpy_matrix(spec.rpy)
    rotations, specific = tool_motion(arm, samples, spec, turn)
    for k, R in enumerate(rotations):
        force = R.T @ truth.wrench[k, :3]
        lever = turn.T @ np.array(spec.position)
        moment = R.T @ truth.wrench[k, 3:] - np.cross(lever, force)
        weight = spec.tool_mass * (R.T @ specific[k])
        clean[k, :3] = force + weight
        clean[k, 3:] = moment + np.cross(spec.tool_com, weight)
    noise = np.repeat([spec.noise_force, spec.noise_torque], 3)
    drift = np.repeat([spec.drift_force, spec.drift_torque], 3)
    reading: Array = clean + np.array(spec.bias) + np.outer(samples.time, drift)
    return reading + noise * rng.standard_normal(clean.shape)


def tool_motion(
    arm: Arm, samples: Samples, spec: ForceSensorSpec, turn: Array
) -> tuple[Array, Array]:
    """Orientation of the sensor in the base (M, 3, 3), and g − a of the tool's centre. (M, 3)"""
    pin = needed("pinocchio", "a simulation")

    model, data = arm.plant.model, arm.plant.model.createData()
    frame = model.getFrameId("flange")
    rotations = np.empty((len(samples.time), 3, 3))
    specific = np.empty((len(samples.time), 3))
    for k, (q, v, a) in enumerate(zip(samples.q, samples.v, samples.a, strict=True)):
        pin.forwardKinematics(model, data, q, v, a)
        pose = pin.updateFramePlacement(model, data, frame)
        axes = pin.LOCAL_WORLD_ALIGNED
        moving = pin.getFrameClassicalAcceleration(model, data, frame, axes)
        spin = pin.getFrameVelocity(model, data, frame, axes).angular
        rotations[k] = pose.rotation @ turn
        lever = pose.rotation @ np.array(spec.position) + rotations[k] @ np.array(spec.tool_com)
        swing = np.cross(moving.angular, lever) + np.cross(spin, np.cross(spin, lever))
        specific[k] = model.gravity.linear - (moving.linear + swing)
    return rotations, specific
