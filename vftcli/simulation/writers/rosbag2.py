"""rosbag2 (MCAP storage): FrankaRobotState for Franka arms, else JointState."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.bags.container import Bytes, type_name
from vftcli.readers.bags.decode import SIZES, MessageLayout, element_of, long_name, type_store
from vftcli.signals.arrays import Array, Indices
from vftcli.signals.errors import OutputError
from vftcli.signals.pose import matrix_quaternion
from vftcli.simulation.experiment import FlangeMotion, Simulation
from vftcli.wrench.solvers import wrench_of

RECEIVED_LATER_NS = 400_000  #: From a message's stamp to its recording. [ns]
MODE_MOVE = 2  #: ROBOT_MODE_MOVE of FrankaRobotState.

JOINT_STATE = "sensor_msgs/JointState"
WRENCH_STAMPED = "geometry_msgs/WrenchStamped"
SENSOR = "/force_torque_sensor_broadcaster/wrench"  #: Topic of a flange sensor.
ROBOT_STATE = "franka_msgs/FrankaRobotState"

#: Names of a message's two vectors.
WRENCH, TWIST = ("force", "torque"), ("linear", "angular")
SAME = np.zeros((1, 3)), np.eye(3)[None]  #: The pose of a frame in itself.

#: Text, names, a number, or numbers: one row a message, or one row for all.
Value = str | Sequence[str] | float | NDArray[Any]
#: A topic's name, type as package/Name, and values but for the stamps.
Topic = tuple[str, str, dict[str, Value]]


def write_rosbag2(path: Path, simulation: Simulation) -> None:
    """Write the log as a bag folder."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    rows, signals = simulation.measured.rows, simulation.measured.signals
    clock = simulation.measured.stamp[rows] + simulation.scenario.sensing.start
    stamps = np.array([round(float(t) * 1e9) for t in clock], np.int64)
    make = robot_states if simulation.robot.ros_state == ROBOT_STATE else joint_states
    topics = [make(simulation, rows)]
    if "wrench" in signals:
        # In the sensor's frame, the force ON the robot.
        values = six("wrench", WRENCH, signals["wrench"][rows])
        values["header.frame_id"] = "ft_sensor"
        topics.append((SENSOR, WRENCH_STAMPED, values))
    times = stamped(stamps)
    made = [serialised(kind, {**times, **values}, len(rows)) for _, kind, values in topics]
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        ends = [
            bag.add_connection(name, long_name(kind), typestore=type_store())
            for name, kind, _ in topics
        ]
        for k, stamp in enumerate(stamps.tolist()):
            for connection, messages in zip(ends, made, strict=True):
                bag.write(connection, stamp + RECEIVED_LATER_NS, messages[k].tobytes())


def joint_states(simulation: Simulation, rows: Indices) -> Topic:
    """`/joint_states`; effort in A for a current-driven arm, in N·m for the others."""
    names = [f"{name.removesuffix('_joint')}_joint" for name in simulation.robot.chain.names]
    seen = simulation.measured.signals
    values: dict[str, Value] = {
        "name": names,
        "position": seen["q"][rows],
        "velocity": seen["dq"][rows],
        "effort": seen["current" if "current" in seen else "torque"][rows],
    }
    return "/joint_states", JOINT_STATE, values


def robot_states(simulation: Simulation, rows: Indices) -> Topic:
    """Franka's state topic, signs as libfranka's; other fields are zero."""
    samples, seen = simulation.samples, simulation.measured.signals
    names = [f"{simulation.robot.name}_joint{j}" for j in range(1, 8)]
    measured, desired = "measured_joint_state", "desired_joint_state"
    motor, external = "measured_joint_motor_state", "tau_ext_hat_filtered"
    q, dq, target_q, target_dq = (
        seen[name][rows] for name in ("q", "dq", "target_q", "target_dq")
    )
    actual, target = (
        FlangeMotion(*(part[rows] for part in flange)) for flange in simulation.flanges()
    )
    tau_ext = -seen["tau_ext"][rows]
    force, regular = wrench_of(tau_ext, actual.jacobian)
    force[~regular] = 0.0
    in_flange = [np.einsum("kji,kj->ki", actual.rotation, part) for part in np.hsplit(force, 2)]
    about_base = force[:, 3:] + np.cross(actual.position, force[:, :3])
    values: dict[str, Value] = {
        **{f"{joints}.name": names for joints in (measured, desired, motor, external)},
        f"{measured}.position": q,
        f"{measured}.velocity": dq,
        f"{measured}.effort": seen["torque"][rows],
        f"{desired}.position": target_q,
        f"{desired}.velocity": target_dq,
        f"{desired}.effort": seen["target_torque"][rows],
        f"{motor}.position": q,
        f"{motor}.velocity": dq,
        f"{external}.effort": tau_ext,
        "ddq_d": samples.target_ddq[rows],
        "dtau_j": np.gradient(seen["torque"], samples.time, axis=0)[rows],
        **six("k_f_ext_hat_k.wrench", WRENCH, np.hstack(in_flange)),
        **six("o_f_ext_hat_k.wrench", WRENCH, np.hstack([force[:, :3], about_base])),
        **pose("o_t_ee", actual.position, actual.rotation),
        **pose("o_t_ee_d", target.position, target.rotation),
        **pose("o_t_ee_c", target.position, target.rotation),
        **pose("f_t_ee", *SAME),
        **pose("ee_t_k", *SAME),
        **six("o_dp_ee_d.twist", TWIST, target.twist),
        **six("o_dp_ee_c.twist", TWIST, target.twist),
        "time": (simulation.measured.stamp + simulation.scenario.sensing.start)[rows, None],
        "control_command_success_rate": 1.0,
        "robot_mode": MODE_MOVE,
    }
    return "/franka_robot_state_broadcaster/robot_state", ROBOT_STATE, values


def serialised(kind: str, values: Mapping[str, Value], rows: int) -> Bytes:
    """Many messages of one type and one layout in CDR, little-endian. (T, size)

    One message is laid out; all have its bytes, but for numbers put in column by column.
    """
    template = bytes(type_store().serialize_cdr(template_of(kind, values), long_name(kind)))
    layout = MessageLayout(type_store().fielddefs, template, kind, cdr=True)
    if unknown := sorted({*values} - {*layout.paths, *layout.texts}):
        raise OutputError(f"{kind} has no field {unknown[0]}")
    out = np.tile(np.frombuffer(template, np.uint8), (rows, 1))
    messages = out.view(layout.kind)[:, 0]
    for path in values.keys() & layout.paths.keys():
        if messages[path].size:
            messages[path] = np.reshape(np.asarray(values[path]), (-1, messages[path].shape[1]))
    return out


def template_of(kind: str, values: Mapping[str, Value], path: str = "") -> Any:  # noqa: ANN401
    """A message with the texts of values, and as many zeros as they have numbers."""
    made: dict[str, Any] = {}
    for name, described in type_store().fielddefs[long_name(kind)][1]:
        inner, (part, many) = f"{path}.{name}" if path else name, element_of(described)
        given: Any = values.get(inner)
        # A sequence is as long as the rows that it is given.
        if many == -1:
            many = 0 if given is None else np.shape(given)[-1]
        if part in SIZES:
            made[name] = 0 if many is None else np.zeros(many, SIZES[part])
        elif part == "string":
            made[name] = str(given or "") if many is None else [*map(str, given or ())]
        else:  # sequences of messages stay empty
            made[name] = template_of(type_name(part), values, inner) if many is None else []
    return type_store().types[long_name(kind)](**made)


def stamped(times: NDArray[np.int64]) -> dict[str, Value]:
    """The values of a header's stamp, of times since 1970. (T,) [ns]"""
    return {"header.stamp.sec": times // 10**9, "header.stamp.nanosec": times % 10**9}


def in_parts(path: str, names: str, columns: NDArray[Any]) -> dict[str, Value]:
    """A vector's parts: ``in_parts("force", "xyz", …)`` gives force.x and so on."""
    return {f"{path}.{name}": column for name, column in zip(names, columns.T, strict=True)}


def schema_text(kind: str) -> str:
    """A type's definition and those inside it, as bags embed them."""
    text: str = type_store().generate_msgdef(long_name(kind), ros_version=2)[0]
    return text


def six(path: str, names: tuple[str, str], columns: Array) -> dict[str, Value]:
    """Six numbers as two vectors: a wrench, or a twist."""
    first, second = (f"{path}.{name}" for name in names)
    return {**in_parts(first, "xyz", columns[:, :3]), **in_parts(second, "xyz", columns[:, 3:])}


def pose(path: str, position: Array, rotation: Array) -> dict[str, Value]:
    """A PoseStamped: position (M, 3) [m] and orientation (M, 3, 3)."""
    turn = in_parts(f"{path}.pose.orientation", "wxyz", matrix_quaternion(rotation))
    return {**in_parts(f"{path}.pose.position", "xyz", position), **turn}
