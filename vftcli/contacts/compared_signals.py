"""What is compared with thresholds: the robot's own estimate, or the one that stands for it.

A robot compares its own estimate with the thresholds it is given, so that one is taken where the
log has it. Where it has none, a momentum observer of 10 1/s runs: causal, as a robot needs it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vftcli.observers.paper import MomentumObserver
from vftcli.robots.drive import check_joints
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array, seal
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import POINTS
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor

GAIN = 10.0  #: Of the momentum observer. [1/s]


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedSignals:
    """Joint torques and wrench of one log, as they are compared with thresholds."""

    recording: Recording  #: The log.
    torque: Array  #: Estimated external torque. (T, n) [N·m]
    #: Force, then moment, NaN where the pose cannot tell them; no column for an arm of fewer than
    #: six joints. (T, 6) [N, N·m]
    wrench: Array
    of_vendor: bool  #: Whether the torque is the robot's own estimate, not the observer's.
    logged_wrench: bool  #: Whether the wrench is the robot's own, not that of the torque.
    frame: str  #: Axes of the wrench and the point of its moment, in words; "" without a wrench.

    def __post_init__(self) -> None:
        seal(self, "torque", "wrench")

    @property
    def t(self) -> Array:
        """The log's time. (T,) [s]"""
        return self.recording.t

    @property
    def force(self) -> Array:
        """Size of the force, no column without a wrench. (T, 1) [N]"""
        size: Array = np.linalg.norm(self.wrench[:, :3], axis=1, keepdims=True)
        return size[:, : self.wrench.shape[1]]


def compared_signals(run: Run) -> ComparedSignals:
    """What a robot would compare along a log.

    The wrench is the log's own where the robot made it; one in sensor axes is an instrument's,
    which no threshold of the robot sees. Else it is that of the torque, by least squares in base
    axes about the flange point.
    """
    # The robot's own estimate asks for no model, which else would check.
    check_joints(run.recording, run.robot)
    recording, vendor = run.recording, run.recording.tau_ext
    of_vendor = vendor is not None and bool(np.any(vendor))
    if vendor is not None and of_vendor:
        torque = ExternalTorque(name="tau_ext", t=recording.t, tau=vendor)
    else:
        torque = MomentumObserver(gain=GAIN).estimate(run.terms)
    stated, own = recording.wrench_frame, recording.wrench
    logged = own is not None and bool(np.any(own)) and stated is not None
    if own is not None and stated is not None and logged and stated.axes != "sensor":
        wrench, frame = own, f"{stated.axes} axes at {POINTS.get(stated.point, stated.point)}"
    elif recording.joints >= 6:
        solved = VirtualSensor(frame="base").wrench(torque, recording.q, run.robot.chain)
        wrench, frame, logged = solved.known, "base axes at the flange point", False
    else:
        wrench, frame, logged = np.zeros((recording.samples, 0)), "", False
    return ComparedSignals(
        recording=recording,
        torque=torque.tau,
        wrench=wrench,
        of_vendor=of_vendor,
        logged_wrench=logged,
        frame=frame,
    )


def check_alike(signals: Sequence[ComparedSignals]) -> None:
    """Raise unless all logs hold the same estimates of the same arm."""
    first = signals[0]
    for other in signals[1:]:
        for what in ("of_vendor", "logged_wrench", "frame"):
            if getattr(other, what) != getattr(first, what):
                raise ParameterError(
                    f"{other.recording.name} and {first.recording.name} do not hold the same "
                    "estimates of the robot's own, and one set of thresholds serves one of them; "
                    "give logs recorded alike"
                )
        if other.torque.shape[1] != first.torque.shape[1]:
            raise ParameterError(
                f"{other.recording.name} has {other.torque.shape[1]} joints and "
                f"{first.recording.name} {first.torque.shape[1]}; give logs of one arm"
            )
