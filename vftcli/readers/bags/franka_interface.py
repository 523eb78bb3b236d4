"""The interface of franka_msgs/FrankaRobotState, as franka_ros2 sends it since 0.1.10.

Bags of ROS 2 Humble and older hold no definitions, and a bag that is written needs them.

Names, types and order of the fields are those published in frankarobotics/franka_ros2.
"""

ERRORS = (
    "joint_position_limits_violation cartesian_position_limits_violation "
    "self_collision_avoidance_violation joint_velocity_violation cartesian_velocity_violation "
    "force_control_safety_violation joint_reflex cartesian_reflex "
    "max_goal_pose_deviation_violation max_path_pose_deviation_violation "
    "cartesian_velocity_profile_safety_violation "
    "joint_position_motion_generator_start_pose_invalid "
    "joint_motion_generator_position_limits_violation "
    "joint_motion_generator_velocity_limits_violation "
    "joint_motion_generator_velocity_discontinuity "
    "joint_motion_generator_acceleration_discontinuity "
    "cartesian_position_motion_generator_start_pose_invalid "
    "cartesian_motion_generator_elbow_limit_violation "
    "cartesian_motion_generator_velocity_limits_violation "
    "cartesian_motion_generator_velocity_discontinuity "
    "cartesian_motion_generator_acceleration_discontinuity "
    "cartesian_motion_generator_elbow_sign_inconsistent "
    "cartesian_motion_generator_start_elbow_invalid "
    "cartesian_motion_generator_joint_position_limits_violation "
    "cartesian_motion_generator_joint_velocity_limits_violation "
    "cartesian_motion_generator_joint_velocity_discontinuity "
    "cartesian_motion_generator_joint_acceleration_discontinuity "
    "cartesian_position_motion_generator_invalid_frame "
    "force_controller_desired_force_tolerance_violation controller_torque_discontinuity "
    "start_elbow_sign_inconsistent communication_constraints_violation power_limit_violation "
    "joint_p2p_insufficient_torque_for_planning tau_j_range_violation instability_detected"
)

DEFINITIONS: dict[str, str] = {
    "franka_msgs/msg/Errors": "\n".join(f"bool {name}" for name in ERRORS.split()),
    "franka_msgs/msg/Elbow": """float64[2] position
float64[2] desired_position
float64[2] commanded_position
float64[2] commanded_velocity
float64[2] commanded_acceleration
""",
    "franka_msgs/msg/CollisionIndicators": """geometry_msgs/Vector3 is_cartesian_linear_collision
geometry_msgs/Vector3 is_cartesian_angular_collision
geometry_msgs/Vector3 is_cartesian_linear_contact
geometry_msgs/Vector3 is_cartesian_angular_contact
float64[7] is_joint_collision
float64[7] is_joint_contact
""",
    "franka_msgs/msg/FrankaRobotState": """uint8 ROBOT_MODE_OTHER=0
uint8 ROBOT_MODE_IDLE=1
uint8 ROBOT_MODE_MOVE=2
uint8 ROBOT_MODE_GUIDING=3
uint8 ROBOT_MODE_REFLEX=4
uint8 ROBOT_MODE_USER_STOPPED=5
uint8 ROBOT_MODE_AUTOMATIC_ERROR_RECOVERY=6
std_msgs/Header header
franka_msgs/CollisionIndicators collision_indicators
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
""",
}
"""Message type → its definition."""
