"""Findings about payload and drive constants, from what the controller itself expects."""

from collections.abc import Iterator

import numpy as np

from vftcli.doctor.findings import on_joints
from vftcli.robots import Robot
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, warning

REST = 2e-3
"""Speed below which a joint counts as resting. [rad/s]"""
MISMATCH = 4.0
"""Difference at rest, on two joints, that stiction hardly explains. [N·m]"""
USUAL_CONSTANT = 10.0
"""Torque per current near which every UR's large drives lie. [N·m/A]"""
RATIO = 0.05
"""Relative difference between the log's own drive constants and the profile's that is reported."""


def drive_constants(recording: Recording) -> Array | None:
    """The controller's own torque per current, target_torque over target_current. (n,) [N·m/A]

    The controller adds friction to its current while it moves, so only resting samples count; NaN
    where they carry too little current. None if the log lacks either.
    """
    current, torque = recording.target_current, recording.target_torque
    if current is None or torque is None:
        return None
    rest = resting(recording)
    constants = np.full(recording.joints, np.nan)
    for j in range(recording.joints):
        use = rest & (np.abs(current[:, j]) > 0.02)
        if use.sum() >= 10:
            i, tau = current[use, j], torque[use, j]
            # Through the origin: no current, no torque.
            slope = float(i @ tau / (i @ i))
            misfit = float(np.std(tau - slope * i)) / max(
                float(np.std(tau)), float(np.abs(tau).mean())
            )
            constants[j] = slope if misfit < 0.05 else np.nan
    return constants


def resting(recording: Recording) -> Mask:
    """Samples in which no joint moves. (T,)"""
    if recording.dq is None:
        return np.zeros(recording.samples, dtype=bool)
    speed = recording.dq if recording.target_dq is None else recording.target_dq
    still = (np.abs(speed) < REST).all(axis=1)
    return np.asarray(still & (np.abs(recording.dq) < 5 * REST).all(axis=1))


def load_findings(recording: Recording, robot: Robot | None) -> Iterator[Remark]:
    """Payload mismatch at rest, and drive constants against the profile that fits best."""
    constants = drive_constants(recording)
    yield from payload_mismatch(recording, constants)
    if robot is not None and robot.torque_constant is not None and constants is not None:
        ratio = constants / robot.torque_constant - 1
        wrong = np.flatnonzero(np.abs(ratio) > RATIO)
        if wrong.size:
            yield warning(
                "drive-constants",
                on_joints(wrong),
                robot=robot.name,
                found_Nm_A=constants[wrong].tolist(),
                profile_Nm_A=np.asarray(robot.torque_constant)[wrong].tolist(),
                worst_percent=100 * float(np.nanmax(np.abs(ratio))),
            )


def payload_mismatch(recording: Recording, constants: Array | None) -> Iterator[Remark]:
    """Drives that carry another current at rest than the controller expects.

    Args:
        recording: The log.
        constants: Its own drive constants, NaN where not known. (n,) [N·m/A]
    """
    rest = resting(recording)
    current, expected = recording.current, recording.target_current
    if current is None or expected is None or rest.sum() < 20:
        return
    carried, wanted = np.mean(current[rest], axis=0), np.mean(expected[rest], axis=0)
    known = constants if constants is not None else np.full(recording.joints, np.nan)
    torque = (carried - wanted) * np.where(np.isfinite(known), known, USUAL_CONSTANT)
    # Of the base no load shows, of the wrist little: shoulder, elbow and the next joint tell.
    heavy = np.flatnonzero(np.abs(torque[1:4]) > MISMATCH) + 1
    if heavy.size < 2:
        return
    untold = recording.payload_mass is None
    yield warning(
        "payload-mismatch-untold" if untold else "payload-mismatch",
        on_joints(heavy),
        carried_A=carried[heavy].tolist(),
        expected_A=wanted[heavy].tolist(),
        extra_Nm=torque[heavy].tolist(),
        payload_kg=recording.payload_mass,
    )
