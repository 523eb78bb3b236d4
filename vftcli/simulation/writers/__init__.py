"""Simulated logs in the vendors' formats, flat Parquet tables, the truth file.

UR's two RTDE recorders: the official client writes one header row, single spaces, CR LF;
SDU's ur_rtde commas, LF, six decimals. libfranka's `logToCSV` since 0.9.1: commas, six
significant digits.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.robots.robot import Robot
from vftcli.robots.terms import gravity_torque
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import check_known
from vftcli.signals.pose import log_matrix
from vftcli.signals.recording import units_of
from vftcli.signals.shown import per_joint
from vftcli.signals.wrench import per_axis
from vftcli.simulation.experiment import FlangeMotion, Simulation, Truth
from vftcli.simulation.scenario import Scenario
from vftcli.simulation.sensing import drive_constants
from vftcli.simulation.writers.rosbag2 import ROBOT_STATE, write_rosbag2
from vftcli.wrench.solvers import LEAST_SIGMA, wrench_of

#: Column → its signal ("-NAME" minus it, "next NAME" a row later: commands), or constants.
Columns = Mapping[str, str | tuple[float, ...]]
#: The official client's default recipe; constants: robot and joint RUNNING, safety NORMAL.
CLIENT: Columns = {
    "timestamp": "time",
    "target_q": "target_q",
    "target_qd": "target_dq",
    "target_qdd": "target_ddq",
    "target_current": "target_current",
    "target_moment": "target_torque",
    "actual_q": "q",
    "actual_qd": "dq",
    "actual_current": "current",
    "joint_control_output": "target_current",
    "actual_TCP_pose": "pose",
    "actual_TCP_speed": "twist",
    "actual_TCP_force": "force",
    "target_TCP_pose": "target_pose",
    "target_TCP_speed": "target_twist",
    "actual_digital_input_bits": (0,),
    "joint_temperatures": "temperature",
    "actual_execution_time": (0.0,),
    "robot_mode": (7,),
    "joint_mode": (253,) * 6,
    "safety_status": (1,),
    "actual_tool_accelerometer": "accelerometer",
    "speed_scaling": (1.0,),
    "target_speed_fraction": (1.0,),
    "actual_momentum": "momentum",
    "actual_main_voltage": (48.0,),
    "actual_robot_voltage": (48.0,),
    "actual_robot_current": (0.0,),
    "actual_joint_voltage": (48.0,) * 6,
    "actual_digital_output_bits": (0,),
    "runtime_state": (2,),
    "joint_position_deviation_ratio": (0.0,),
}
#: What ur_rtde's `startFileRecording` writes.
RECORDER: Columns = {
    "safety_mode" if name == "safety_status" else name: content
    for name, content in CLIENT.items()
    if name != "joint_position_deviation_ratio"
}
#: What `franka::logToCSV` writes; tau_ext_hat_filtered is minus the torque ON the arm.
FRANKA: Columns = {
    "time": "milliseconds",
    "success_rate": (1,),
    "state.q": "q",
    "state.q_d": "target_q",
    "state.dq": "dq",
    "state.dq_d": "target_dq",
    "state.tau_J": "torque",
    "state.tau_ext_hat_filtered": "-tau_ext",
    "cmd.q_d": "next target_q",
    "cmd.dq_d": "next target_dq",
    "cmd.O_T_EE_d": "next target_matrix",
    "cmd.O_dP_EE_d": "next target_twist",
    "cmd.tau_J_d": "next torque_command",
}
#: The short recipe of a UR log: joint motion, currents and the target moment alone.
SHORT = ("timestamp", "target_q", "target_qd", "target_current", "target_moment", "actual_q",
         "actual_qd", "actual_current")  # fmt: skip
#: Units, signs and frames of the truth's columns.
TRUTH_COLUMNS = {
    "t": "s",
    "tau_ext": "N·m, on the robot",
    "wrench": "N and N·m, on the robot, base axes, moment about the flange point",
    "contact": "N and N·m, on the robot, base axes, moment about the point that is touched",
}


def vendor_signals(simulation: Simulation) -> dict[str, NDArray[Any]]:
    """Signals of vendors' tables by name, the TCP at the flange. (M, …) each"""
    import pinocchio as pin

    samples, signals = simulation.samples, simulation.measured.signals
    model = simulation.nominal.model
    actual, target = simulation.flanges()
    time = simulation.measured.stamp + simulation.scenario.sensing.start
    weightless = np.gradient(samples.target_dq, samples.time, axis=0)
    felt = np.einsum("kij,kj->ki", target.jacobian[:, :3], weightless) - model.gravity.linear
    weight = gravity_torque(simulation.nominal, samples.target_q)
    data, states = model.createData(), zip(signals["q"], signals["dq"], strict=True)
    linear = [pin.computeCentroidalMomentum(model, data, *state).linear for state in states]
    matrix = np.zeros((len(time), 4, 4))
    matrix[:, :3, :3], matrix[:, :3, 3], matrix[:, 3, 3] = target.rotation, target.position, 1.0
    # Bounded, as a controller's: blind directions read nothing.
    force, _ = wrench_of(signals["tau_ext"], actual.jacobian, left_out=LEAST_SIGMA)
    return {
        **signals,
        "time": time,
        "milliseconds": np.rint(time * 1e3).astype(int),
        "target_ddq": samples.target_ddq,
        "pose": pose_of(actual),
        "twist": actual.twist,
        "force": force,
        "target_pose": pose_of(target),
        "target_matrix": matrix.transpose(0, 2, 1).reshape(-1, 16),
        "target_twist": target.twist,
        "accelerometer": np.einsum("kji,kj->ki", target.rotation, felt),
        "momentum": np.linalg.norm(linear, axis=1),
        "torque_command": signals["target_torque"] - weight,
    }


def pose_of(flange: FlangeMotion) -> Array:
    """Positions and rotation vectors. (M, 6) [m, rad]"""
    return np.hstack([flange.position, log_matrix(flange.rotation)])


class VendorTable(NamedTuple):
    """A format: columns, an element's mark, rows and numbers."""

    columns: Columns
    element: str
    separator: str
    end: str
    number: str  # of a double
    decimals: int | None = None  # to which it is rounded before

    def write(self, path: Path, simulation: Simulation) -> None:
        """Write the recipe's columns; a UR log also has its flange sensor's."""
        recipe = simulation.scenario.columns
        if recipe not in {"full", "short"}:
            raise ParameterError(f"columns is {recipe!r}; there is full, short")
        own = dict(self.columns)
        if self.columns is not FRANKA:
            if recipe == "short":
                own = {name: own[name] for name in SHORT}
            if "wrench" in simulation.measured.signals:
                own["ft_raw_wrench"] = "wrench"
        known, rows = vendor_signals(simulation), simulation.measured.rows
        names, texts = [], []
        for name, content in own.items():
            if isinstance(content, str):
                values = known[content.removeprefix("-").removeprefix("next ")]
                if content.startswith("next "):
                    values = np.concatenate([values[1:], values[-1:]])
                values = (-values if content.startswith("-") else values)[rows]
                if self.decimals is not None:
                    values = values.round(self.decimals)
                columns = (values + values.dtype.type(0)).reshape(len(rows), -1).T.tolist()
            else:
                columns = [[value] * len(rows) for value in content]
            several = len(columns) > 1
            names += [name + self.element.format(i) * several for i in range(len(columns))]
            texts += [
                [
                    str(value) if isinstance(value, int) else self.number % value
                    for value in column
                ]
                for column in columns
            ]
        lines = [self.separator.join(names), *map(self.separator.join, zip(*texts, strict=True))]
        path.write_bytes((self.end.join(lines) + self.end).encode("ascii"))


RTDE = VendorTable(CLIENT, "_{}", " ", "\r\n", "%r", 9)  # all seventeen digits
UR_RTDE = VendorTable(RECORDER, "_{}", ",", "\n", "%.6f", 9)
LIBFRANKA = VendorTable(FRANKA, "[{}]", ",", "\n", "%.6g")


def write_parquet(path: Path, simulation: Simulation) -> None:
    """Write the log as one flat table, `t`, `q/1`, `dq/1` and so on."""
    stamp, rows, signals = simulation.measured
    columns: dict[str, Array] = {"t": stamp + simulation.scenario.sensing.start}
    for name, values in signals.items():
        if name != "target_current" or "current" in signals:
            label = "tau" if name == "torque" else name
            columns |= (per_axis if name == "wrench" else per_joint)(label, values)
    units = units_of(signals)
    write_columns(path, {name: values[rows] for name, values in columns.items()}, units)


def write_truth(path: Path, truth: Truth, start: float) -> None:
    """Write the truth of a log that begins at `start` [s]."""
    columns = truth.columns()
    write_columns(path, columns | {"t": columns["t"] + start}, TRUTH_COLUMNS)


def write_columns(path: Path, columns: dict[str, Array], units: Mapping[str, str]) -> None:
    """Write named columns (M,) as a Parquet table that states their units."""
    import polars as pl

    about = {"vftcli": json.dumps({"columns": units})}
    pl.DataFrame(columns).write_parquet(path, compression="zstd", metadata=about)


#: Name at ``--as`` → the function that writes it.
WRITERS: dict[str, Callable[[Path, Simulation], None]] = {
    "rtde": RTDE.write,
    "ur-rtde": UR_RTDE.write,
    "libfranka": LIBFRANKA.write,
    "rosbag2": write_rosbag2,
    "parquet": write_parquet,
}

UR_JOINTS, FRANKA_JOINTS = 6, 7


def usual_format(scenario: Scenario, robot: Robot, wanted: str = "") -> str:
    """The format asked for, the scenario's, or the vendor's: RTDE, libfranka's, a table.

    Raises:
        ParameterError: If there is no such format, or the arm cannot log in it.
    """
    is_ur = drive_constants(robot) is not None and robot.joints == UR_JOINTS
    usual = "libfranka" if robot.ros_state == ROBOT_STATE else "parquet"
    name = wanted or scenario.format or ("rtde" if is_ur else usual)
    check_known(name, WRITERS, f"no log format {name!r}")
    if name in {"rtde", "ur-rtde"} and not is_ur:
        raise ParameterError(
            f"robot {robot.name!r} has no motor currents or not six joints and cannot log in a UR "
            "format; choose libfranka, rosbag2 or parquet with --as"
        )
    if name == "libfranka" and robot.joints != FRANKA_JOINTS:
        raise ParameterError(
            f"robot {robot.name!r} has {robot.joints} joints and cannot log as a Franka arm; "
            "choose rtde, rosbag2 or parquet with --as"
        )
    return name
