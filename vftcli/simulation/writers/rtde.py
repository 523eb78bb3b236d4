"""UR's two RTDE recorders.

The official client writes one header row, single spaces and CR LF; SDU's ur_rtde commas, LF, every
double with six decimals, and `safety_mode` in place of `safety_status`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.robots import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.packages import needed
from vftcli.signals.pose import log_matrix
from vftcli.simulation.experiment import Simulation
from vftcli.simulation.writers.flange import flange_signals
from vftcli.virtual_sensor.solvers import LEAST_SIGMA, wrench_of

UR_JOINTS = 6
DIGITS = 9
"""Decimals kept; the client prints all seventeen digits, noise included."""

FULL = (
    "timestamp",
    "target_q",
    "target_qd",
    "target_qdd",
    "target_current",
    "target_moment",
    "actual_q",
    "actual_qd",
    "actual_current",
    "joint_control_output",
    "actual_TCP_pose",
    "actual_TCP_speed",
    "actual_TCP_force",
    "target_TCP_pose",
    "target_TCP_speed",
    "actual_digital_input_bits",
    "joint_temperatures",
    "actual_execution_time",
    "robot_mode",
    "joint_mode",
    "safety_status",
    "actual_tool_accelerometer",
    "speed_scaling",
    "target_speed_fraction",
    "actual_momentum",
    "actual_main_voltage",
    "actual_robot_voltage",
    "actual_robot_current",
    "actual_joint_voltage",
    "actual_digital_output_bits",
    "runtime_state",
    "joint_position_deviation_ratio",
)
SHORT = (*FULL[:3], *FULL[4:9])
"""Joint motion, currents and the target moment alone: up to actual_current, no acceleration."""
RECIPES: dict[str, Sequence[str]] = {"full": FULL, "short": SHORT}
"""Name of a recipe → its fields. "full" is the default record_configuration.xml of the client."""

CONSTANTS: dict[str, tuple[Any, ...]] = {
    "actual_digital_input_bits": (0,),
    "actual_execution_time": (0.0,),
    "robot_mode": (7,),
    "joint_mode": (253,) * 6,
    "safety_status": (1,),
    "safety_mode": (1,),
    "speed_scaling": (1.0,),
    "target_speed_fraction": (1.0,),
    "actual_main_voltage": (48.0,),
    "actual_robot_voltage": (48.0,),
    "actual_robot_current": (0.0,),
    "actual_joint_voltage": (48.0,) * 6,
    "actual_digital_output_bits": (0,),
    "runtime_state": (2,),
    "joint_position_deviation_ratio": (0.0,),
}
"""Fields the simulation knows nothing of: robot mode RUNNING, joint mode RUNNING, safety NORMAL."""


def write_rtde(path: Path, simulation: Simulation) -> None:
    """Write the log as the official client's text CSV, each number in its shortest form."""
    columns = ur_columns(simulation, recipe(simulation))
    texts = [list(map(repr, values)) for values in columns.values()]
    write_table(path, [*columns], texts, separator=" ", end="\r\n")


def write_ur_rtde(path: Path, simulation: Simulation) -> None:
    """Write the log as `startFileRecording` of ur_rtde does."""
    names = ["safety_mode" if n == "safety_status" else n for n in recipe(simulation)]
    names = [n for n in names if n != "joint_position_deviation_ratio"]
    columns = ur_columns(simulation, names)
    texts = [
        [f"{v:.6f}" if isinstance(v, float) else str(v) for v in values]
        for values in columns.values()
    ]
    write_table(path, [*columns], texts, separator=",", end="\n")


def recipe(simulation: Simulation) -> list[str]:
    """The fields of the scenario's recipe, with the raw wrench where a sensor is mounted.

    Raises:
        ParameterError: If there is no such recipe, or the robot is no six-joint current-driven arm.
    """
    name = simulation.scenario.columns
    if name not in RECIPES:
        raise ParameterError(f"columns is {name!r}; there is {', '.join(RECIPES)}")
    extra = [] if simulation.force_sensor is None else ["ft_raw_wrench"]
    return [*RECIPES[name], *extra]


def check_ur(robot: Robot) -> None:
    """Refuse an arm that cannot log as a UR does.

    Raises:
        ParameterError: If it measures no motor currents, or has not six joints.
    """
    in_current = robot.torque_source == "current" and robot.torque_constant is not None
    if not in_current or robot.joints != UR_JOINTS:
        raise ParameterError(
            f"robot {robot.name!r} has no motor currents or not six joints and cannot log in a UR "
            "format; choose libfranka, rosbag2 or parquet with --as"
        )


def ur_columns(simulation: Simulation, names: Sequence[str]) -> dict[str, list[Any]]:
    """Columns of a UR log by name, every row of the log in it."""
    current, target_current = simulation.measured.current, simulation.vendor.target_current
    check_ur(simulation.robot)
    assert current is not None
    assert target_current is not None
    known = joint_fields(simulation, current, target_current)
    if any("TCP" in name or "tool" in name or "momentum" in name for name in names):
        known |= tool_fields(simulation)
    rows = np.array(simulation.measured.rows)
    columns: dict[str, list[Any]] = {}
    for name in names:
        if name in CONSTANTS:
            values = [[value] * len(rows) for value in CONSTANTS[name]]
        else:
            array = np.round(known[name][rows], DIGITS) + 0.0
            values = array.reshape(len(rows), -1).T.tolist()
        single = len(values) == 1
        columns |= {name if single else f"{name}_{i}": v for i, v in enumerate(values)}
    return columns


def joint_fields(simulation: Simulation, current: Array, target_current: Array) -> dict[str, Array]:
    """Fields of the client that hold one number a joint, by name. (M, n) each"""
    samples, measured = simulation.samples, simulation.measured
    fields = {
        "timestamp": measured.stamp + simulation.scenario.sensing.start,
        "target_q": samples.target_q,
        "target_qd": samples.target_dq,
        "target_qdd": samples.target_ddq,
        "target_current": target_current,
        "target_moment": simulation.vendor.target_torque,
        "actual_q": measured.q,
        "actual_qd": measured.dq,
        "actual_current": current,
        "joint_control_output": target_current,
        "joint_temperatures": measured.temperature,
    }
    if simulation.force_sensor is not None:
        fields["ft_raw_wrench"] = simulation.force_sensor
    return fields


def tool_fields(simulation: Simulation) -> dict[str, Array]:
    """Cartesian fields, with no tool set: the TCP is the flange."""
    samples, measured, model = simulation.samples, simulation.measured, simulation.nominal.model
    actual = flange_signals(model, measured.q, measured.dq)
    target = flange_signals(model, samples.target_q, samples.target_dq)
    # A controller's estimate stays bounded: directions that the pose cannot tell read nothing.
    force = wrench_of(simulation.vendor.tau_ext, actual.jacobian, left_out=LEAST_SIGMA).values
    pose = np.hstack([actual.position, log_matrix(actual.rotation)])
    target_pose = np.hstack([target.position, log_matrix(target.rotation)])
    weightless = np.gradient(samples.target_dq, samples.time, axis=0)
    felt = np.einsum("kij,kj->ki", target.jacobian[:, :3], weightless) - model.gravity.linear
    return {
        "actual_TCP_pose": pose,
        "actual_TCP_speed": actual.twist,
        "actual_TCP_force": force,
        "target_TCP_pose": target_pose,
        "target_TCP_speed": target.twist,
        "actual_tool_accelerometer": np.einsum("kji,kj->ki", target.rotation, felt),
        "actual_momentum": linear_momentum(simulation),
    }


def linear_momentum(simulation: Simulation) -> Array:
    """Magnitude of the arm's linear momentum. (M,) [kg·m/s]"""
    pin = needed("pinocchio", "a simulation")

    model, measured = simulation.nominal.model, simulation.measured
    data = model.createData()
    return np.array(
        [
            np.linalg.norm(pin.computeCentroidalMomentum(model, data, q, dq).linear)
            for q, dq in zip(measured.q, measured.dq, strict=True)
        ]
    )


def write_table(
    path: Path, names: list[str], columns: list[list[str]], separator: str, end: str
) -> None:
    """Write columns of text under a row of their names."""
    lines = [separator.join(names), *map(separator.join, zip(*columns, strict=True))]
    path.write_bytes((end.join(lines) + end).encode("ascii"))
