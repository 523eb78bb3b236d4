"""A force/torque sensor as the reference: the log's wrench, through Jᵀ to the joints."""

import numpy as np

from vftcli.evaluation.reference import ReferenceLoad
from vftcli.robots.drive import check_joints
from vftcli.robots.kinematics import flange_jacobian
from vftcli.robots.robot import Robot
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.frames import NOTHING, Mounting
from vftcli.virtual_sensor.log_wrench import logged_wrench


def sensor_reference(
    recording: Recording, robot: Robot, mounting: Mounting = NOTHING
) -> ReferenceLoad:
    """τ_ext = J_Fᵀ w of the wrench that the log holds.

    Args:
        recording: The log.
        robot: The arm.
        mounting: Where tool and sensor sit on the flange.

    Raises:
        MissingSignalError: If the log has no wrench, or one that is all zeros.
        ParameterError: If the wrench's frame is not one there is.
    """
    check_joints(recording, robot)
    wrench = logged_wrench(recording, robot.chain, mounting)
    remarks = (caution("reference-sensor"), *wrench.remarks)
    return ReferenceLoad(
        torque=torque_of(wrench, recording, robot, "sensor", remarks), wrench=wrench
    )


def torque_of(
    wrench: Wrench, recording: Recording, robot: Robot, name: str, remarks: tuple[Remark, ...]
) -> ExternalTorque:
    """Joint torque of a wrench in base axes about the flange point."""
    J = flange_jacobian(robot.chain, recording.q)
    tau = np.einsum("tij,ti->tj", J, wrench.values)
    return ExternalTorque(name=name, t=recording.t, tau=tau, remarks=remarks)
