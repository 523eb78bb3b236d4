"""ReferenceLoad: what estimates are judged by, and the two that need nothing but the log."""

from dataclasses import dataclass

import numpy as np

from vftcli.evaluation.touches import touched_remarks
from vftcli.repetition.free_run import ModelledRun
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import caution
from vftcli.signals.wrench import Wrench


@dataclass(frozen=True, kw_only=True)
class ReferenceLoad:
    """What estimates are judged by, on the log's clock.

    Attributes:
        torque: The reference torque of every joint.
        wrench: The wrench it was made from, in base axes about the flange point, as force on the
            robot; None where the reference is a torque to begin with.
    """

    torque: ExternalTorque
    wrench: Wrench | None = None


def zero_reference(log: ModelledRun) -> ReferenceLoad:
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
    """The vendor's own estimate in the log, torque on the robot; its error is not known.

    Raises:
        MissingSignalError: If the log has no external torque.
    """
    tau = recording.require("tau_ext")
    remarks = (caution("reference-vendor"),)
    return ReferenceLoad(
        torque=ExternalTorque(name="vendor", t=recording.t, tau=tau, remarks=remarks)
    )
