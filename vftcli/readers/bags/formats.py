"""The bag formats: ROS 1 bags, ROS 2 bags as folder or bare file, and other MCAP files."""

from vftcli.readers.bags.storage import MCAP as MCAP_MAGIC
from vftcli.readers.bags.storage import ROSBAG1, SQLITE, storage_files
from vftcli.readers.reader import LogFile, RawLog, ReadChoice, Reader


def read_bag(file: LogFile, request: ReadChoice) -> RawLog:
    """Read any container of messages; the decoders are loaded only when there is one."""
    from vftcli.readers.bags import reading

    return reading.read_bag(file, request)


def is_bag_folder(file: LogFile) -> bool:
    """Whether a folder holds ROS 2 storage files."""
    return file.is_folder and bool(storage_files(file))


_TAKES = (
    "JointState by joint name (UR: effort is motor current), FrankaState and FrankaRobotState in "
    "all variants, WrenchStamped; other topics are left out and named."
)

ROS1 = Reader(
    name="rosbag1",
    title="ROS 1 bag (.bag, .bag.active)",
    recording="rosbag record /joint_states /wrench, or /franka_state_controller/franka_states.",
    takes=_TAKES,
    pitfalls=(
        "franka_states comes at 30 Hz unless publish_rate is raised. A cut bag is read up to its "
        "last whole chunk."
    ),
    recognises=lambda file: file.head.startswith(ROSBAG1),
    read=read_bag,
    columns=True,
)

ROS2 = Reader(
    name="rosbag2",
    title="ROS 2 bag folder (mcap or db3, compressed or not)",
    recording="ros2 bag record /joint_states /force_torque_sensor_broadcaster/wrench …",
    takes=_TAKES,
    pitfalls="effort of UR joints is current [A]; in simulation torque: --columns tau=effort.",
    recognises=is_bag_folder,
    read=read_bag,
    columns=True,
)

DB3 = Reader(
    name="db3",
    title="ROS 2 bag file, SQLite (.db3)",
    recording="ros2 bag record --storage sqlite3; the file inside the folder.",
    takes=_TAKES,
    pitfalls=(
        "Humble and older store no message definitions: ROS's own types and FrankaRobotState are "
        "known, others are left out."
    ),
    recognises=lambda file: file.head.startswith(SQLITE),
    read=read_bag,
    columns=True,
)

MCAP = Reader(
    name="mcap",
    title="MCAP file: ROS 2, ROS 1, JSON or Foxglove JointStates",
    recording="ros2 bag record --storage mcap; foxglove-sdk; any MCAP writer.",
    takes=_TAKES + " JSON documents by alias, arrays as joints; foxglove.JointStates by name.",
    pitfalls="A cut file is read up to its last whole chunk; one cut chunk holds nothing.",
    recognises=lambda file: file.head.startswith(MCAP_MAGIC),
    read=read_bag,
    columns=True,
)
