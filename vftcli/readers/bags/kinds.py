"""Message types that carry what a Recording holds, and where in them it is."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from vftcli.signals.wrench import FRANKA_FRAME, WrenchFrame

VECTORS = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One message type."""

    #: Signal → dotted paths to try in turn; a path that ends in `.wrench` means its six numbers.
    #: `effort` is decided later, by the joints' names.
    signals: Mapping[str, tuple[str, ...]]
    names: tuple[str, ...] = ()  #: Path of the joints' names.
    robot_time: str = "time"  #: Path of the robot's own clock. [s]
    frame: str = ""  #: Path of the frame's name.
    #: Name → path of a number of which the last value counts.
    constants: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    rank: int = 0  #: Which type is preferred as the clock when two run at one rate; the larger.
    turned: frozenset[str] = frozenset()  #: Signals whose sign has to be turned.
    wrench_frame: WrenchFrame | None = None  #: What is known of its wrench.


#: Message type → what is taken from it.
KINDS: dict[str, Kind] = {
    "sensor_msgs/JointState": Kind(
        signals={"q": ("position",), "dq": ("velocity",), "effort": ("effort",)},
        names=("name",),
        rank=1,
    ),
    "franka_msgs/FrankaState": Kind(
        signals={
            "q": ("q",),
            "dq": ("dq",),
            "torque": ("tau_J",),
            "target_q": ("q_d",),
            "target_dq": ("dq_d",),
            "tau_ext": ("tau_ext_hat_filtered",),
            "wrench": ("O_F_ext_hat_K",),
        },
        constants={
            "mass": ("m_load",),
            "com": ("F_x_Cload",),
        },
        rank=2,
        turned=frozenset({"tau_ext"}),
        wrench_frame=FRANKA_FRAME,
    ),
    "franka_msgs/FrankaRobotState": Kind(
        signals={
            "q": ("measured_joint_state.position", "q"),
            "dq": ("measured_joint_state.velocity", "dq"),
            "torque": ("measured_joint_state.effort", "tau_j"),
            "target_q": ("desired_joint_state.position", "q_d"),
            "target_dq": ("desired_joint_state.velocity", "dq_d"),
            "tau_ext": ("tau_ext_hat_filtered.effort", "tau_ext_hat_filtered"),
            "wrench": ("o_f_ext_hat_k.wrench", "o_f_ext_hat_k"),
        },
        names=("measured_joint_state.name",),
        constants={"mass": ("inertia_load.inertia.m", "m_load"), "com": ("f_x_cload",)},
        rank=2,
        turned=frozenset({"tau_ext"}),
        wrench_frame=FRANKA_FRAME,
    ),
    "geometry_msgs/WrenchStamped": Kind(signals={"wrench": ("wrench",)}, frame="header.frame_id"),
}


def paths_in(kind: Kind, signal: str, leaves: Mapping[str, object]) -> tuple[str, ...]:
    """The paths of a signal that a message has: one, or the six of a wrench; () if none."""
    for path in kind.signals[signal]:
        if path in leaves:
            return (path,)
        if all(f"{path}.{part}" in leaves for part in VECTORS):
            return tuple(f"{path}.{part}" for part in VECTORS)
    return ()
