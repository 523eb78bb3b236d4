"""ReferenceLoad: what estimates are judged by, and those that need nothing but the log."""

from dataclasses import dataclass

import numpy as np

from vftcli.evaluation.touches import touched_remarks
from vftcli.robots.drive import check_joints
from vftcli.robots.kinematics import flange_jacobian
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.frames import Mounting
from vftcli.virtual_sensor.log_wrench import logged_wrench


@dataclass(frozen=True, kw_only=True)
class ReferenceLoad:
    """What estimates are judged by, on the log's clock."""

    torque: ExternalTorque  #: The reference torque of every joint.
    #: The wrench it was made from, in base axes about the flange point, as force on the robot; None
    #: where the reference is a torque to begin with.
    wrench: Wrench | None = None


def zero_reference(log: Run) -> ReferenceLoad:
    """No contact at all: the reference of a free motion.

    How free it was cannot be known from the log alone, so neither can its error; where the log
    shows contact a warning says so.
    """
    recording = log.recording
    return ReferenceLoad(
        torque=ExternalTorque(
            name="zero",
            t=recording.t,
            tau=np.zeros(recording.q.shape),
            remarks=(caution("reference-zero"), *touched_remarks(log)),
        )
    )


def vendor_reference(recording: Recording) -> ReferenceLoad:
    """The vendor's own estimate in the log, torque on the robot; its error is not known."""
    tau = recording.require("tau_ext")
    remarks = (caution("reference-vendor"),)
    return ReferenceLoad(
        torque=ExternalTorque(name="vendor", t=recording.t, tau=tau, remarks=remarks)
    )


def sensor_reference(recording: Recording, robot: Robot, mounting: Mounting) -> ReferenceLoad:
    """τ_ext = J_Fᵀ w of the wrench that the log holds."""
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
