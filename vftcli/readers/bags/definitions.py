"""Message definitions that a bag may lack: bags of ROS 2 Humble and older store none."""

from functools import cache

from vftcli.errors import LogError
from vftcli.readers.bags.container import Channel
from vftcli.readers.bags.layout import Field, LayoutError, fields_of, short, types_of

ERRORS_36 = "\n".join(f"bool error_{k}" for k in range(36))

STAMPED = "std_msgs/Header header\n"

FRANKA_ROBOT_STATE = f"""{STAMPED}franka_msgs/CollisionIndicators collision_indicators
sensor_msgs/JointState measured_joint_state
sensor_msgs/JointState desired_joint_state
sensor_msgs/JointState measured_joint_motor_state
float64[7] ddq_d
float64[7] dtau_j
sensor_msgs/JointState tau_ext_hat_filtered
franka_msgs/Elbow elbow
geometry_msgs/WrenchStamped k_f_ext_hat_k
geometry_msgs/WrenchStamped o_f_ext_hat_k
geometry_msgs/InertiaStamped inertia_ee
geometry_msgs/InertiaStamped inertia_load
geometry_msgs/InertiaStamped inertia_total
geometry_msgs/PoseStamped o_t_ee
geometry_msgs/PoseStamped o_t_ee_d
geometry_msgs/PoseStamped o_t_ee_c
geometry_msgs/PoseStamped f_t_ee
geometry_msgs/PoseStamped ee_t_k
geometry_msgs/TwistStamped o_dp_ee_d
geometry_msgs/TwistStamped o_dp_ee_c
geometry_msgs/AccelStamped o_ddp_ee_c
float64 time
float64 control_command_success_rate
uint8 robot_mode
franka_msgs/Errors current_errors
franka_msgs/Errors last_motion_errors
{"=" * 80}
MSG: franka_msgs/CollisionIndicators
geometry_msgs/Vector3 is_cartesian_linear_collision
geometry_msgs/Vector3 is_cartesian_angular_collision
geometry_msgs/Vector3 is_cartesian_linear_contact
geometry_msgs/Vector3 is_cartesian_angular_contact
float64[7] is_joint_collision
float64[7] is_joint_contact
{"=" * 80}
MSG: franka_msgs/Elbow
float64[2] position
float64[2] desired_position
float64[2] commanded_position
float64[2] commanded_velocity
float64[2] commanded_acceleration
{"=" * 80}
MSG: franka_msgs/Errors
{ERRORS_36}
"""
"""Fields of franka_msgs/FrankaRobotState in order, as franka_ros2 has sent them since 0.1.10.

Source: the interface published in frankarobotics/franka_ros2; only names, types and order matter.
"""

EMBEDDED = {"franka_msgs/FrankaRobotState": FRANKA_ROBOT_STATE}
"""Message type outside ROS's own packages → its definition."""


def types_for(channel: Channel) -> dict[str, tuple[Field, ...]]:
    """All types that a channel's messages are made of: the container's own first.

    Raises:
        LogError: If neither the container nor this package knows the type.
        LayoutError: If the container's definition cannot be parsed.
    """
    known = dict(_humble())
    if channel.definition:
        known |= types_of(channel.definition, _long(channel.type), idl=channel.idl)
    elif channel.type in EMBEDDED:
        known |= types_of(EMBEDDED[channel.type], _long(channel.type), idl=False)
    if channel.encoding == "ros1":
        known["builtin_interfaces/Time"] = TIME
        known["builtin_interfaces/Duration"] = TIME
    if channel.type not in known:
        raise LogError(
            f"topic {channel.topic}: the bag holds no definition of {channel.type}. Convert it "
            "with ros2 bag convert on a machine that has the package."
        )
    return known


TIME = (Field("sec", "int32", None), Field("nanosec", "uint32", None))


@cache
def _humble() -> dict[str, tuple[Field, ...]]:
    """The messages of ROS 2 Humble, from rosbags' store."""
    from rosbags.typesys import Stores, get_typestore

    found = {}
    for name, (_, fields) in get_typestore(Stores.ROS2_HUMBLE).fielddefs.items():
        try:
            found[short(name)] = fields_of(fields)
        except LayoutError:
            continue
    return found


def _long(name: str) -> str:
    package, _, kind = name.partition("/")
    return f"{package}/msg/{kind}"
