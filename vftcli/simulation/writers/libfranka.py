"""libfranka's `logToCSV`, the layout of 0.9.1 and later: commas, six significant digits."""

from pathlib import Path

import numpy as np

from vftcli.robots import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.experiment import Simulation
from vftcli.simulation.motion import Reference
from vftcli.simulation.servo import rigid_torque
from vftcli.simulation.writers.flange import flange_signals

GROUPS = (
    ("state.q", 7),
    ("state.q_d", 7),
    ("state.dq", 7),
    ("state.dq_d", 7),
    ("state.tau_J", 7),
    ("state.tau_ext_hat_filtered", 7),
    ("cmd.q_d", 7),
    ("cmd.dq_d", 7),
    ("cmd.O_T_EE_d", 16),
    ("cmd.O_dP_EE_d", 6),
    ("cmd.tau_J_d", 7),
)
"""Column groups after time and success rate, with their widths."""


def check_franka(robot: Robot) -> None:
    """Refuse an arm that cannot log as a Franka arm does.

    Raises:
        ParameterError: If it has not seven joints.
    """
    if robot.joints != 7:
        raise ParameterError(
            f"robot {robot.name!r} has {robot.joints} joints and cannot log as a Franka arm; "
            "choose rtde, rosbag2 or parquet with --as"
        )


def write_libfranka(path: Path, simulation: Simulation) -> None:
    """Write the log as `franka::logToCSV` does.

    tau_ext_hat_filtered is minus the torque ON the arm. The command of a row belongs to the state
    of the next one; the last command is repeated.

    Raises:
        ParameterError: If the robot has not seven joints.
    """
    check_franka(simulation.robot)
    names = [f"{name}[{i}]" for name, width in GROUPS for i in range(width)]
    rows = np.array(simulation.measured.rows)
    table = franka_table(simulation)[rows]
    start = simulation.scenario.sensing.start
    stamp = np.rint((simulation.measured.stamp[rows] + start) * 1e3).astype(int).tolist()
    form = ",".join(["%d", "1"] + ["%.6g"] * table.shape[1])
    lines = [",".join(["time", "success_rate", *names])]
    lines += [form % (t, *values) for t, values in zip(stamp, table.tolist(), strict=True)]
    path.write_bytes(("\n".join(lines) + "\n").encode("ascii"))


def franka_table(simulation: Simulation) -> Array:
    """The number columns of every sample, in the order of GROUPS. (M, 85)"""
    samples, measured = simulation.samples, simulation.measured
    target = flange_signals(simulation.nominal.model, samples.target_q, samples.target_dq)
    pose = np.zeros((len(samples.time), 4, 4))
    pose[:, :3, :3], pose[:, :3, 3], pose[:, 3, 3] = target.rotation, target.position, 1.0
    still = np.zeros_like(samples.target_q)
    resting = Reference(samples.target_q, still, still)
    weight = rigid_torque(simulation.nominal.model, resting)
    columns = [
        measured.q,
        samples.target_q,
        measured.dq,
        samples.target_dq,
        measured.torque,
        -simulation.vendor.tau_ext,
        next_rows(samples.target_q),
        next_rows(samples.target_dq),
        next_rows(pose.transpose(0, 2, 1).reshape(-1, 16)),
        next_rows(target.twist),
        next_rows(simulation.vendor.target_torque - weight),
    ]
    return np.hstack(columns) + 0.0


def next_rows(values: Array) -> Array:
    """Each row's successor, the last repeated: a command is executed one cycle later. (M, m)"""
    return np.vstack([values[1:], values[-1:]])
