"""The columns of UR's real-time data exchange by name, whatever file they come in."""

CLOCK = "timestamp"  #: The controller's clock. [s]
#: Field of Recording → RTDE's name; all have six elements, name_0 to name_5.
JOINT_COLUMNS = {
    "q": "actual_q",
    "dq": "actual_qd",
    "current": "actual_current",
    "torque_without_gravity": "actual_current_as_torque",
    "target_q": "target_q",
    "target_dq": "target_qd",
    "target_current": "target_current",
    "target_torque": "target_moment",
    "temperature": "joint_temperatures",
    "wrench": "actual_TCP_force",
}
#: The payload that the controller was told of; its last value counts.
PAYLOAD = ("payload", "payload_cog_0", "payload_cog_1", "payload_cog_2")
