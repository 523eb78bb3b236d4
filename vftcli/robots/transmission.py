r"""Joints driven through each other: a constant matrix T between joints and motors.

Motors whose gears sit before other joints turn with them: motor speeds, reflected to the joint
side, are :math:`\dot\theta = T \dot q`, and by the power, joint torques are
:math:`\tau = T^T \tau_m`. So friction and rotor inertia of motor 6 act on joints 5 and 6 of an arm
whose motor 6 turns with joint 5 (M. Gautier, A. Janot, P.-O. Vandanjon, "A new closed-loop output
error method for parameter identification of robot dynamics", IEEE T-CST 21(2), 2013, a TX40).
None stands for an arm without coupling, T = 1; nothing is then computed.
"""

import numpy as np

from vftcli.signals.arrays import Array


def at_motors(transmission: Array | None, motion: Array) -> Array:
    """Positions, velocities or accelerations of joints (…, n) as the motors'. (…, n)"""
    return motion if transmission is None else np.asarray(motion @ transmission.T)


def motor_torque(transmission: Array | None, torque: Array) -> Array:
    """Torques at joints (…, n) as those of motors that make them, T⁻ᵀ τ. (…, n) [N·m]"""
    if transmission is None:
        return torque
    return np.asarray(torque @ np.linalg.inv(transmission))


def joint_torque(transmission: Array | None, torque: Array) -> Array:
    """Torques of motors (…, n) at the joints, Tᵀ τ_m. (…, n) [N·m]"""
    return torque if transmission is None else np.asarray(torque @ transmission)


def motor_rows(transmission: Array | None, regressor: Array) -> Array:
    """A regressor of joint torques (N, n, k) as one of motor torques. (N, n, k)"""
    if transmission is None:
        return regressor
    return np.asarray(np.linalg.inv(transmission).T @ regressor)
