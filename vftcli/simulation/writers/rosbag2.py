"""rosbag2 (MCAP storage): FrankaRobotState for the Franka arms, JointState for the others."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vftcli.readers.bags.franka_interface import DEFINITIONS
from vftcli.signals.arrays import Array
from vftcli.simulation.experiment import Simulation
from vftcli.simulation.writers.flange import flange_signals, force_estimate
from vftcli.simulation.writers.stamping import Marks, fill

RECEIVED_LATER_NS = 400_000
"""How long after its stamp a message reaches the recorder. [ns]"""
MODE_MOVE = 2


class WrittenTopic(NamedTuple):
    """Messages of one topic.

    Attributes:
        name: The topic.
        type: The message type.
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
    stamps = [round(float(t) * 1e9) for t in clock]
    store = typestore()
    franka = simulation.robot.joints == 7 and simulation.robot.torque_source == "link_torque"
    make = robot_states if franka else joint_states
    topics = [make(store, simulation, rows, stamps)]
    if simulation.force_sensor is not None:
        topics.append(wrenches(store, simulation.force_sensor[rows], stamps))
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        ends = [(bag.add_connection(t.name, t.type, typestore=store), t.messages) for t in topics]
        for k, stamp in enumerate(stamps):
            for connection, messages in ends:
                bag.write(connection, stamp + RECEIVED_LATER_NS, messages[k].tobytes())


def typestore() -> Any:  # noqa: ANN401 - rosbags builds its types at run time
    """ROS 2's messages and Franka's."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types: dict[str, Any] = {}
    for name, text in DEFINITIONS.items():
        types |= get_types_from_msg(text, name)
    store.register(types)
    return store


class Messages:
    """Makes messages of a type store with every field that is not given at its zero."""

    def __init__(self, store: Any) -> None:  # noqa: ANN401
        self.types = store.types

    def header(self, frame: str = "") -> Any:  # noqa: ANN401
        """A header without stamp."""
        time = self.types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
        return self.types["std_msgs/msg/Header"](stamp=time, frame_id=frame)

    def joints(self, names: list[str], **columns: Array) -> Any:  # noqa: ANN401
        """A JointState."""
        nothing = np.zeros(0)
        values = {k: columns.get(k, nothing) for k in ("position", "velocity", "effort")}
        return self.types["sensor_msgs/msg/JointState"](header=self.header(), name=names, **values)

    def vector(self, values: Array) -> Any:  # noqa: ANN401
        """A Vector3."""
        x, y, z = (float(v) for v in values)
        return self.types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)

    def pair(self, kind: str, first: str, second: str, values: Array) -> Any:  # noqa: ANN401
        """A Wrench, Twist or Accel of six numbers."""
        parts = {first: self.vector(values[:3]), second: self.vector(values[3:])}
        return self.types[f"geometry_msgs/msg/{kind}"](**parts)

    def stamped(self, kind: str, field: str, value: Any, frame: str = "") -> Any:  # noqa: ANN401
        """The stamped variant of a geometry message."""
        parts = {"header": self.header(frame), field: value}
        return self.types[f"geometry_msgs/msg/{kind}Stamped"](**parts)

    def pose(self, position: Array, quaternion: Array) -> Any:  # noqa: ANN401
        """A PoseStamped."""
        x, y, z = (float(v) for v in position)
        place = self.types["geometry_msgs/msg/Point"](x=x, y=y, z=z)
        qx, qy, qz, qw = (float(v) for v in quaternion)
        turn = self.types["geometry_msgs/msg/Quaternion"](x=qx, y=qy, z=qz, w=qw)
        pose = self.types["geometry_msgs/msg/Pose"](position=place, orientation=turn)
        return self.stamped("Pose", "pose", pose)

    def inertia(self) -> Any:  # noqa: ANN401
        """No load."""
        moments = dict.fromkeys(("m", "ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 0.0)
        body = self.types["geometry_msgs/msg/Inertia"](com=self.vector(np.zeros(3)), **moments)
        return self.stamped("Inertia", "inertia", body)

    def errors(self) -> Any:  # noqa: ANN401
        """No error."""
        kind = self.types["franka_msgs/msg/Errors"]
        return kind(**{n: False for n in kind.__dataclass_fields__ if not n.startswith("__")})


def joint_states(
    store: Any,  # noqa: ANN401
    simulation: Simulation,
    rows: Array,
    stamps: list[int],
) -> WrittenTopic:
    """`/joint_states`, effort in ampere for a current-driven arm, in N·m for the others."""
    marks, n, kind = Marks(), simulation.robot.joints, "sensor_msgs/msg/JointState"
    names = [f"{name.removesuffix('_joint')}_joint" for name in simulation.robot.chain.names]
    columns = {name: marks.take(name, n) for name in ("position", "velocity", "effort")}
    template = bytes(store.serialize_cdr(Messages(store).joints(names, **columns), kind))
    seen = simulation.measured
    effort = seen.torque if seen.current is None else seen.current
    values = {"position": seen.q, "velocity": seen.dq, "effort": effort}
    filled = fill(template, marks, {k: v[rows] for k, v in values.items()}, stamps)
    return WrittenTopic("/joint_states", kind, filled)


def wrenches(store: Any, readings: Array, stamps: list[int]) -> WrittenTopic:  # noqa: ANN401
    """`/force_torque_sensor_broadcaster/wrench` in the sensor's frame, force ON the robot."""
    marks, kind = Marks(), "geometry_msgs/msg/WrenchStamped"
    make = Messages(store)
    wrench = make.pair("Wrench", "force", "torque", marks.take("wrench", 6))
    message = make.stamped("Wrench", "wrench", wrench, "ft_sensor")
    template = bytes(store.serialize_cdr(message, kind))
    filled = fill(template, marks, {"wrench": readings}, stamps)
    return WrittenTopic("/force_torque_sensor_broadcaster/wrench", kind, filled)


def robot_states(
    store: Any,  # noqa: ANN401
    simulation: Simulation,
    rows: Array,
    stamps: list[int],
) -> WrittenTopic:
    """`/franka_robot_state_broadcaster/robot_state`; external estimates have libfranka's sign."""
    kind = "franka_msgs/msg/FrankaRobotState"
    marks = Marks()
    message = robot_state(store, simulation, marks)
    template = bytes(store.serialize_cdr(message, kind))
    values = {name: v[rows] for name, v in franka_values(simulation).items()}
    filled = fill(template, marks, values, stamps)
    return WrittenTopic("/franka_robot_state_broadcaster/robot_state", kind, filled)


def robot_state(store: Any, simulation: Simulation, marks: Marks) -> Any:  # noqa: ANN401
    """One FrankaRobotState with marks where the numbers go."""
    make, take = Messages(store), marks.take
    names = [f"{simulation.robot.name}_joint{j}" for j in range(1, 8)]
    zero3, one, zero6 = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(6)
    two, seven = np.zeros(2), np.zeros(7)
    elbow = ("position", "desired_position", "commanded_position", "commanded_velocity")
    touched = ("linear_collision", "angular_collision", "linear_contact", "angular_contact")
    still = {f"is_cartesian_{name}": make.vector(zero3) for name in touched}
    state = {"position": take("q", 7), "velocity": take("dq", 7), "effort": take("tau", 7)}
    desired = {"position": take("q_d", 7), "velocity": take("dq_d", 7), "effort": take("tau_d", 7)}
    motor = {"position": take("theta", 7), "velocity": take("dtheta", 7)}
    target = make.pose(take("target_position", 3), take("target_turn", 4))
    twist = make.pair("Twist", "linear", "angular", take("twist_d", 6))
    return store.types["franka_msgs/msg/FrankaRobotState"](
        header=make.header(),
        collision_indicators=store.types["franka_msgs/msg/CollisionIndicators"](
            **still, is_joint_collision=seven, is_joint_contact=seven
        ),
        measured_joint_state=make.joints(names, **state),
        desired_joint_state=make.joints(names, **desired),
        measured_joint_motor_state=make.joints(names, **motor),
        ddq_d=take("ddq_d", 7),
        dtau_j=take("dtau", 7),
        tau_ext_hat_filtered=make.joints(names, effort=take("tau_ext", 7)),
        elbow=store.types["franka_msgs/msg/Elbow"](
            **dict.fromkeys(elbow, two), commanded_acceleration=two
        ),
        k_f_ext_hat_k=make.stamped(
            "Wrench", "wrench", make.pair("Wrench", "force", "torque", take("k_force", 6))
        ),
        o_f_ext_hat_k=make.stamped(
            "Wrench", "wrench", make.pair("Wrench", "force", "torque", take("o_force", 6))
        ),
        inertia_ee=make.inertia(),
        inertia_load=make.inertia(),
        inertia_total=make.inertia(),
        o_t_ee=make.pose(take("position", 3), take("turn", 4)),
        o_t_ee_d=target,
        o_t_ee_c=make.pose(take("command_position", 3), take("command_turn", 4)),
        f_t_ee=make.pose(zero3, one),
        ee_t_k=make.pose(zero3, one),
        o_dp_ee_d=make.stamped("Twist", "twist", twist),
        o_dp_ee_c=make.stamped(
            "Twist", "twist", make.pair("Twist", "linear", "angular", take("twist_c", 6))
        ),
        o_ddp_ee_c=make.stamped("Accel", "accel", make.pair("Accel", "linear", "angular", zero6)),
        time=float(take("time", 1)[0]),
        control_command_success_rate=1.0,
        robot_mode=MODE_MOVE,
        current_errors=make.errors(),
        last_motion_errors=make.errors(),
    )


def franka_values(simulation: Simulation) -> dict[str, Array]:
    """Numbers of every sample by their mark. (M, count)"""
    import pinocchio as pin

    samples, seen, model = simulation.samples, simulation.measured, simulation.nominal.model
    actual = flange_signals(model, seen.q, seen.dq)
    target = flange_signals(model, samples.target_q, samples.target_dq)
    force, regular = force_estimate(actual.jacobian, -simulation.vendor.tau_ext)
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
        "theta": seen.q,
        "dtheta": seen.dq,
        "ddq_d": samples.target_ddq,
        "dtau": rate,
        "tau_ext": -simulation.vendor.tau_ext,
        "k_force": np.hstack(in_flange),
        "o_force": force,
        "position": actual.position,
        "turn": turn,
        "target_position": target.position,
        "target_turn": target_turn,
        "command_position": target.position,
        "command_turn": target_turn,
        "twist_d": target.twist,
        "twist_c": target.twist,
        "time": (seen.stamp + simulation.scenario.sensing.start)[:, None],
    }
