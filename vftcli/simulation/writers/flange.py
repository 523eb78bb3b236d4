"""Cartesian quantities that vendors log: poses, speeds and force estimates of the flange."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.packages import needed


@dataclass(frozen=True, kw_only=True)
class FlangeSignals:
    """The flange along a motion.

    Attributes:
        rotation: Orientation in the base. (M, 3, 3)
        position: Origin in the base. (M, 3) [m]
        twist: Linear and angular velocity in base axes. (M, 6) [m/s, rad/s]
        jacobian: Jacobian in base axes about the flange. (M, 6, n)
    """

    rotation: Array
    position: Array
    twist: Array
    jacobian: Array


def flange_signals(model: Any, q: Array, dq: Array) -> FlangeSignals:  # noqa: ANN401
    """Evaluate the flange at positions and velocities (M, n) [rad, rad/s]."""
    pin = needed("pinocchio", "a simulation")

    data, frame, count = model.createData(), model.getFrameId("flange"), len(q)
    rotation, position = np.empty((count, 3, 3)), np.empty((count, 3))
    jacobian = np.empty((count, 6, q.shape[1]))
    for k, row in enumerate(q):
        pin.computeJointJacobians(model, data, row)
        pose = pin.updateFramePlacement(model, data, frame)
        rotation[k], position[k] = pose.rotation, pose.translation
        jacobian[k] = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
    twist = np.einsum("kij,kj->ki", jacobian, dq)
    return FlangeSignals(rotation=rotation, position=position, twist=twist, jacobian=jacobian)
