"""The signals of a log by name: what each is, and which of them belong together."""

#: Fields of a Recording that hold a signal → what that is.
MEANINGS = {
    "q": "joint positions",
    "dq": "joint velocities",
    "current": "motor currents",
    "torque": "joint torques",
    "torque_without_gravity": "joint torques without gravity's",
    "target_q": "target positions",
    "target_dq": "target velocities",
    "target_current": "target currents",
    "target_torque": "target torques",
    "tau_ext": "vendor estimates of the external torque",
    "temperature": "joint temperatures",
    "wrench": "wrenches",
}
#: Those of them that hold one column a joint.
JOINT_SIGNALS = tuple(name for name in MEANINGS if name != "wrench")
#: Signals whose columns in tables are called otherwise than the field of a Recording.
COLUMN_NAMES = {"torque": "tau"}
#: Those that say what the drives do; a log has one of them or several.
EFFORTS = ("current", "torque", "torque_without_gravity")
#: Signals that an examination looks at beside time and positions.
EXAMINED = frozenset(
    ("dq", *EFFORTS, "target_dq", "target_current", "target_torque", "tau_ext", "temperature")
)
