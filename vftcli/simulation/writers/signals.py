"""What vendors log of a run, by our own names; the Cartesian ones are computed when asked for."""

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.pose import log_matrix
from vftcli.simulation.arm import rigid_torque
from vftcli.simulation.experiment import Simulation
from vftcli.simulation.trajectories import Reference
from vftcli.virtual_sensor.solvers import LEAST_SIGMA, wrench_of


class FlangeSignals(NamedTuple):
    """The flange along a motion, base axes."""

    rotation: Array  # (M, 3, 3)
    position: Array  # (M, 3) [m]
    twist: Array  # linear, angular (M, 6) [m/s, rad/s]
    jacobian: Array  # about the flange (M, 6, n)


def flange_signals(model: Any, q: Array, dq: Array) -> FlangeSignals:  # noqa: ANN401
    """The flange at positions and velocities (M, n) [rad, rad/s]."""
    import pinocchio as pin

    data, frame, count = model.createData(), model.getFrameId("flange"), len(q)
    rotation, position = np.empty((count, 3, 3)), np.empty((count, 3))
    jacobian = np.empty((count, 6, q.shape[1]))
    for k, row in enumerate(q):
        pin.computeJointJacobians(model, data, row)
        pose = pin.updateFramePlacement(model, data, frame)
        rotation[k], position[k] = pose.rotation, pose.translation
        jacobian[k] = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
    return FlangeSignals(rotation, position, np.einsum("kij,kj->ki", jacobian, dq), jacobian)


def joint_signals(simulation: Simulation) -> dict[str, Array]:
    """Signals by name, one column a joint; those that the robot has. (M, n) each"""
    samples, measured, vendor = simulation.samples, simulation.measured, simulation.vendor
    table = {"q": measured.q, "dq": measured.dq}
    if measured.current is not None and vendor.target_current is not None:
        table |= {"current": measured.current, "target_current": vendor.target_current}
    else:
        table["tau"] = measured.torque
    table |= {
        "target_q": samples.target_q,
        "target_dq": samples.target_dq,
        "target_torque": vendor.target_torque,
        "tau_ext": vendor.tau_ext,
        "temperature": measured.temperature,
    }
    if simulation.force_sensor is not None:
        table["wrench"] = simulation.force_sensor
    return table


def vendor_signals(simulation: Simulation) -> dict[str, Callable[[], Array]]:
    """Signals of vendors' tables by name, to be called. (M, …) each

    With no tool set the TCP is the flange.
    """
    import pinocchio as pin

    samples, measured, model = simulation.samples, simulation.measured, simulation.nominal.model
    time = measured.stamp + simulation.scenario.sensing.start
    still = np.zeros_like(samples.target_q)
    resting = Reference(samples.target_q, still, still)

    @cache
    def actual() -> FlangeSignals:
        return flange_signals(model, measured.q, measured.dq)

    @cache
    def target() -> FlangeSignals:
        return flange_signals(model, samples.target_q, samples.target_dq)

    def accelerometer() -> Array:
        weightless = np.gradient(samples.target_dq, samples.time, axis=0)
        felt = np.einsum("kij,kj->ki", target().jacobian[:, :3], weightless) - model.gravity.linear
        return np.asarray(np.einsum("kji,kj->ki", target().rotation, felt))

    def momentum() -> Array:
        data, states = model.createData(), zip(measured.q, measured.dq, strict=True)
        linear = [pin.computeCentroidalMomentum(model, data, *state).linear for state in states]
        return np.array([np.linalg.norm(vector) for vector in linear])

    def matrix() -> Array:
        pose = np.zeros((len(samples.time), 4, 4))
        pose[:, :3, :3], pose[:, :3, 3], pose[:, 3, 3] = target().rotation, target().position, 1.0
        return pose.transpose(0, 2, 1).reshape(-1, 16)

    joints = joint_signals(simulation)
    return {
        **{name: partial(joints.__getitem__, name) for name in joints},
        "time": lambda: time,
        "milliseconds": lambda: np.rint(time * 1e3).astype(int),
        "target_ddq": lambda: samples.target_ddq,
        "pose": lambda: pose_of(actual()),
        "twist": lambda: actual().twist,
        # A controller's estimate stays bounded: directions that the pose cannot tell read nothing.
        "force": lambda: (
            wrench_of(simulation.vendor.tau_ext, actual().jacobian, left_out=LEAST_SIGMA).values
        ),
        "target_pose": lambda: pose_of(target()),
        "target_matrix": matrix,
        "target_twist": lambda: target().twist,
        "accelerometer": accelerometer,
        "momentum": momentum,
        "torque_command": lambda: simulation.vendor.target_torque - rigid_torque(model, resting),
    }


def pose_of(flange: FlangeSignals) -> Array:
    """Positions and rotation vectors. (M, 6) [m, rad]"""
    return np.hstack([flange.position, log_matrix(flange.rotation)])
