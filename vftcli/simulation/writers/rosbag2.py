"""rosbag2 (MCAP storage): FrankaRobotState for the Franka arms, JointState for the others."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.bags.ros_messages import (
    FRANKA,
    Value,
    in_parts,
    known_types,
    long_name,
    serialised,
    stamped,
)
from vftcli.signals.arrays import Array
from vftcli.signals.packages import needed
from vftcli.simulation.experiment import Simulation
from vftcli.simulation.writers.flange import flange_signals
from vftcli.virtual_sensor.solvers import wrench_of

RECEIVED_LATER_NS = 400_000
"""How long after its stamp a message reaches the recorder. [ns]"""
MODE_MOVE = 2
"""ROBOT_MODE_MOVE of FrankaRobotState."""

JOINT_STATE = "sensor_msgs/JointState"
WRENCH_STAMPED = "geometry_msgs/WrenchStamped"
ROBOT_STATE = "franka_msgs/FrankaRobotState"

WRENCH, TWIST = ("force", "torque"), ("linear", "angular")
"""Names of a message's two vectors."""

UPRIGHT = np.array([[0.0, 0.0, 0.0, 1.0]])
"""The quaternion of no rotation, x, y, z, w."""

Rows = NDArray[np.int64]
Nanoseconds = NDArray[np.int64]


class WrittenTopic(NamedTuple):
    """Messages of one topic.

    Attributes:
        name: The topic.
        type: The message type, as package/Name.
        messages: One serialised message a row. (R, size) uint8
    """

    name: str
    type: str
    messages: Any


def write_rosbag2(path: Path, simulation: Simulation) -> None:
    """Write the log as a bag folder.

    Effort is the motor current for a UR arm, in ampere, as its driver has it. A flange sensor is a
    second topic, WrenchStamped in the sensor's frame.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer

    rows = np.array(simulation.measured.rows)
    clock = simulation.measured.stamp[rows] + simulation.scenario.sensing.start
    stamps = np.array([round(float(t) * 1e9) for t in clock], dtype=np.int64)
    make = robot_states if simulation.robot.ros_state == ROBOT_STATE else joint_states
    topics = [make(simulation, rows, stamps)]
    if simulation.force_sensor is not None:
        topics.append(wrenches(simulation.force_sensor[rows], stamps))
    store = typestore()
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        ends = [
            (bag.add_connection(t.name, long_name(t.type), typestore=store), t.messages)
            for t in topics
        ]
        for k, stamp in enumerate(stamps.tolist()):
            for connection, messages in ends:
                bag.write(connection, stamp + RECEIVED_LATER_NS, messages[k].tobytes())


def typestore() -> Any:  # noqa: ANN401 - rosbags builds its types at run time
    """The message types a bag declares: those of ROS 2 Humble, and Franka's."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types: dict[str, Any] = {}
    for name, text in FRANKA.items():
        types |= get_types_from_msg(text, long_name(name))
    store.register(types)
    return store


def joint_states(simulation: Simulation, rows: Rows, stamps: Nanoseconds) -> WrittenTopic:
    """`/joint_states`, effort in ampere for a current-driven arm, in N·m for the others."""
    names = [f"{name.removesuffix('_joint')}_joint" for name in simulation.robot.chain.names]
    seen = simulation.measured
    effort = seen.torque if seen.current is None else seen.current
    values: dict[str, Value] = {
        **stamped(stamps),
        "name": names,
        "position": seen.q[rows],
        "velocity": seen.dq[rows],
        "effort": effort[rows],
    }
    return WrittenTopic("/joint_states", JOINT_STATE, serialised(JOINT_STATE, values, len(rows)))


def wrenches(readings: Array, stamps: Nanoseconds) -> WrittenTopic:
    """`/force_torque_sensor_broadcaster/wrench` in the sensor's frame, force ON the robot."""
    values = {**stamped(stamps), "header.frame_id": "ft_sensor", **six("wrench", WRENCH, readings)}
    messages = serialised(WRENCH_STAMPED, values, len(readings))
    return WrittenTopic("/force_torque_sensor_broadcaster/wrench", WRENCH_STAMPED, messages)


def robot_states(simulation: Simulation, rows: Rows, stamps: Nanoseconds) -> WrittenTopic:
    """`/franka_robot_state_broadcaster/robot_state`; external estimates have libfranka's sign."""
    columns = {name: column[rows] for name, column in franka_values(simulation).items()}
    values = {**stamped(stamps), **robot_state(simulation.robot.name, columns)}
    messages = serialised(ROBOT_STATE, values, len(rows), known_types())
    return WrittenTopic("/franka_robot_state_broadcaster/robot_state", ROBOT_STATE, messages)


def robot_state(robot: str, columns: dict[str, Array]) -> dict[str, Value]:
    """The fields of FrankaRobotState that are not zero, from the columns of `franka_values`."""
    names = [f"{robot}_joint{j}" for j in range(1, 8)]
    measured, desired, motor, external = (
        "measured_joint_state",
        "desired_joint_state",
        "measured_joint_motor_state",
        "tau_ext_hat_filtered",
    )
    return {
        **{f"{joints}.name": names for joints in (measured, desired, motor, external)},
        f"{measured}.position": columns["q"],
        f"{measured}.velocity": columns["dq"],
        f"{measured}.effort": columns["tau"],
        f"{desired}.position": columns["q_d"],
        f"{desired}.velocity": columns["dq_d"],
        f"{desired}.effort": columns["tau_d"],
        f"{motor}.position": columns["q"],
        f"{motor}.velocity": columns["dq"],
        f"{external}.effort": columns["tau_ext"],
        "ddq_d": columns["ddq_d"],
        "dtau_j": columns["dtau"],
        **six("k_f_ext_hat_k.wrench", WRENCH, columns["k_force"]),
        **six("o_f_ext_hat_k.wrench", WRENCH, columns["o_force"]),
        **pose("o_t_ee", columns["position"], columns["turn"]),
        **pose("o_t_ee_d", columns["target_position"], columns["target_turn"]),
        **pose("o_t_ee_c", columns["target_position"], columns["target_turn"]),
        **pose("f_t_ee", np.zeros((1, 3)), UPRIGHT),
        **pose("ee_t_k", np.zeros((1, 3)), UPRIGHT),
        **six("o_dp_ee_d.twist", TWIST, columns["twist"]),
        **six("o_dp_ee_c.twist", TWIST, columns["twist"]),
        "time": columns["time"],
        "control_command_success_rate": 1.0,
        "robot_mode": MODE_MOVE,
    }


def six(path: str, names: tuple[str, str], columns: Array) -> dict[str, Value]:
    """Six numbers as two vectors: a wrench's force and torque, a twist's linear and angular."""
    first, second = (f"{path}.{name}" for name in names)
    return {**in_parts(first, "xyz", columns[:, :3]), **in_parts(second, "xyz", columns[:, 3:])}


def pose(path: str, position: Array, quaternion: Array) -> dict[str, Value]:
    """A PoseStamped: position (M, 3) [m] and orientation (M, 4) as x, y, z, w."""
    turn = in_parts(f"{path}.pose.orientation", "xyzw", quaternion)
    return {**in_parts(f"{path}.pose.position", "xyz", position), **turn}


def franka_values(simulation: Simulation) -> dict[str, Array]:
    """Numbers of every sample by their mark. (M, count)"""
    pin = needed("pinocchio", "a simulation")

    samples, seen, model = simulation.samples, simulation.measured, simulation.nominal.model
    actual = flange_signals(model, seen.q, seen.dq)
    target = flange_signals(model, samples.target_q, samples.target_dq)
    force, regular = wrench_of(-simulation.vendor.tau_ext, actual.jacobian)
    force[~regular] = 0.0
    in_flange = [np.einsum("kji,kj->ki", actual.rotation, part) for part in np.hsplit(force, 2)]
    turn = np.array([pin.Quaternion(R).coeffs() for R in actual.rotation])
    target_turn = np.array([pin.Quaternion(R).coeffs() for R in target.rotation])
    rate = np.gradient(seen.torque, samples.time, axis=0)
    return {
        "q": seen.q,
        "dq": seen.dq,
        "tau": seen.torque,
        "q_d": samples.target_q,
        "dq_d": samples.target_dq,
        "tau_d": simulation.vendor.target_torque,
        "ddq_d": samples.target_ddq,
        "dtau": rate,
        "tau_ext": -simulation.vendor.tau_ext,
        "k_force": np.hstack(in_flange),
        # Its moment is about the base's origin.
        "o_force": np.hstack(
            [force[:, :3], force[:, 3:] + np.cross(actual.position, force[:, :3])]
        ),
        "position": actual.position,
        "turn": turn,
        "target_position": target.position,
        "target_turn": target_turn,
        "twist": target.twist,
        "time": (seen.stamp + simulation.scenario.sensing.start)[:, None],
    }
