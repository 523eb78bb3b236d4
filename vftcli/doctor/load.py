"""Findings about payload and drive constants, from what the controller itself expects."""

from collections.abc import Iterator

import numpy as np

from vftcli.doctor.findings import Finding
from vftcli.robots import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

REST = 2e-3
"""Speed below which a joint counts as resting. [rad/s]"""
MISMATCH = 4.0
"""Difference at rest, on two joints, that stiction hardly explains. [N·m]"""
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
            slope = float(i @ tau / (i @ i))
            misfit = float(np.std(tau - slope * i)) / max(
                float(np.std(tau)), float(np.abs(tau).mean())
            )
            constants[j] = slope if misfit < 0.05 else np.nan
    return constants


def resting(recording: Recording) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Samples in which no joint moves. (T,)"""
    if recording.dq is None:
        return np.zeros(recording.samples, dtype=bool)
    speed = recording.dq if recording.target_dq is None else recording.target_dq
    return np.asarray(
        (np.abs(speed) < REST).all(axis=1) & (np.abs(recording.dq) < 5 * REST).all(axis=1)
    )


def load_findings(recording: Recording, robot: Robot | None) -> Iterator[Finding]:
    """Payload mismatch at rest, and drive constants against the profile that fits best."""
    constants = drive_constants(recording)
    yield from _payload(recording, constants)
    if robot is not None and robot.torque_constant is not None and constants is not None:
        yield from _constants(constants, robot)


def _payload(recording: Recording, constants: Array | None) -> Iterator[Finding]:
    rest = resting(recording)
    current, expected = recording.current, recording.target_current
    if current is None or expected is None or rest.sum() < 20:
        return
    gap = np.mean(current[rest] - expected[rest], axis=0)
    known = constants if constants is not None else np.full(recording.joints, np.nan)
    torque = gap * np.where(np.isfinite(known), known, 10.0)  # near 10 N·m/A on every UR
    heavy = np.flatnonzero(np.abs(torque[1:4]) > MISMATCH) + 1
    if heavy.size < 2:
        return
    told = ", ".join(
        f"J{j + 1} {np.mean(current[rest, j]):.3g} A for {np.mean(expected[rest, j]):.3g} A "
        f"expected ({torque[j]:+.3g} N·m)"
        for j in heavy
    )
    stated = (
        f"the controller was told of {recording.payload_mass:.3g} kg"
        if recording.payload_mass is not None
        else "the log does not say which payload the controller was told of"
    )
    yield Finding(
        name="payload-mismatch",
        severity="warning",
        evidence=f"at rest the drives carry {told}; {stated}",
        consequence="A constant external torque of that size appears in every estimate",
        remedy="Mount the real load: a [payload] section in the robot file, or --payload NAME",
    )


def _constants(constants: Array, robot: Robot) -> Iterator[Finding]:
    profile = np.asarray(robot.torque_constant)
    ratio = constants / profile - 1
    wrong = np.flatnonzero(np.abs(ratio) > RATIO)
    if wrong.size:
        told = ", ".join(f"J{j + 1} {constants[j]:.2f} against {profile[j]:.2f}" for j in wrong)
        yield Finding(
            name="drive-constants",
            severity="warning",
            evidence=f"target_torque over target_current at rest is {told} N·m/A in {robot.name}",
            consequence=f"Torques are off by up to {100 * np.nanmax(np.abs(ratio)):.0f} %",
            remedy="Put the log's own constants into a copy of the profile (torque_constant)",
        )
