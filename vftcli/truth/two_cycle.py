"""The two-cycle difference: the paper's ground truth, here between a log and a free run of it."""

from collections.abc import Sequence

import numpy as np

from vftcli.arrays import Array
from vftcli.dynamics.drive import drive_torque
from vftcli.recording import Recording
from vftcli.robots.robot import Robot
from vftcli.torque import ExternalTorque
from vftcli.truth.alignment import Alignment, align


def two_cycle_difference(
    recording: Recording, free: Recording, robot: Robot, alignment: Alignment | None = None
) -> ExternalTorque:
    """τ_gt = K·(i_free(phase) − i), from a free run of the same trajectory in another log.

    Where position and velocity repeat, gravity, inertia and friction cancel and what is left is the
    torque the environment exerts (science of Sec. IV-A of the paper; sign of (18)). Samples beyond
    the free run are NaN. Joints at rest may rest on another stiction; nothing here mends that.

    Args:
        recording: The log with contact.
        free: A log of the same motion without.
        robot: For the drive constants.
        alignment: Where the free run lies, found if not given.

    Raises:
        ReferenceTorqueError: If the two logs are not the same trajectory.
        MissingSignalError: If either has neither currents nor torques.
    """
    where = alignment if alignment is not None else align(recording, free)
    loaded, unloaded = drive_torque(recording, robot), drive_torque(free, robot)
    t = recording.t + where.shift
    there = np.column_stack([np.interp(t, free.t, torque) for torque in unloaded.T])
    tau = np.where(np.asarray(where.overlap, dtype=bool)[:, None], there - loaded, np.nan)
    floor = np.hypot(noise_of(loaded), noise_of(unloaded))
    note = (
        f"two-cycle difference against {free.name}: shift {where.shift:+.4f} s, joint positions agree "
        f"to {where.deviation * 1e3:.3g} mrad rms over "
        f"{float(np.count_nonzero(where.overlap)) * recording.step:.1f} s; floor from the noise of the "
        "two logs' torques (√2·K·σ_i for equal noise)"
    )
    return ExternalTorque(
        name="two-cycle", t=recording.t, tau=tau, floor=floor, notes=(note,)
    )


def noise_of(signal: Array) -> Array:
    """Standard deviation of the white part of a signal, from its second differences. (n,)

    For white noise of deviation σ on a smooth signal, x_{k−1} − 2x_k + x_{k+1} has √6·σ.
    """
    if len(signal) < 3:
        return np.full(signal.shape[1], np.nan)
    curvature = signal[:-2] - 2.0 * signal[1:-1] + signal[2:]
    noise: Array = np.sqrt(np.mean(curvature**2, axis=0) / 6.0)
    return noise


def paired_floor(first: Recording, second: Recording, robot: Robot) -> ExternalTorque:
    """The two-cycle difference between two free runs: what it shows where the truth is zero."""
    return two_cycle_difference(first, second, robot)


def two_cycle_reference(
    recording: Recording, free: Sequence[Recording], robot: Robot
) -> ExternalTorque:
    """The reference from one free run, or from two, which then measure its floor.

    With two, the floor is the root mean square of their own difference, all of it error: noise,
    imperfect repetition and stiction.
    """
    reference = two_cycle_difference(recording, free[0], robot)
    if len(free) == 1:
        return reference
    spread = paired_floor(free[0], free[1], robot)
    floor = np.sqrt(np.nanmean(spread.tau**2, axis=0))
    note = f"floor measured between the free runs {free[0].name} and {free[1].name}"
    return ExternalTorque(
        name="two-cycle",
        t=reference.t,
        tau=reference.tau,
        floor=floor,
        notes=(*reference.notes, note),
    )
