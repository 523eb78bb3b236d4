"""Pushes planted on real free logs, so that the external torque of a real arm is known.

The recipe, which is fixed so that figures of different days compare: a force at the flange point,
in world axes and without moment, pushes about 45 % of the time from 8 s on; what it does to the
joints, Jᵀ F with the maker's kinematics, is taken off the measured torque. A planted push changes
no friction; a real one does.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import flange_jacobian

QUIET = 8.0
"""Nobody pushes before this time. [s]"""


class Planted(NamedTuple):
    """A log with pushes in it.

    Attributes:
        recording: The log, from its first to its last moving sample, its time from 0.
        torque: The external torque that was planted. (T, n) [N·m]
        force: The force at the flange point, in world axes. (T, 3) [N]
    """

    recording: object
    torque: np.ndarray
    force: np.ndarray


def moving_window(recording):
    """The log from its first to its last sample with any |dq| > 1e-3 rad/s, its time from 0."""
    moves = np.flatnonzero(np.any(np.abs(recording.dq) > 1e-3, axis=1))
    cut = recording.between(recording.t[moves[0]], recording.t[moves[-1]])
    return replace(cut, t=cut.t - cut.t[0])


def pushes(t, seed):
    """Random pushes: 15–60 N, .2–3 s long, in random directions. (T, 3) [N]"""
    rng = np.random.default_rng(seed)
    force = np.zeros((len(t), 3))
    x = QUIET
    while x < t[-1] - 1.0:
        short, long = rng.uniform(0.2, 0.5), rng.uniform(0.8, 3.0)
        duration = rng.choice([short, long])
        size = rng.uniform(15.0, 60.0)
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        rise = min(0.3, duration / 2) * rng.uniform(0.4, 1.0)
        s = np.clip(np.minimum((t - x) / rise, (x + duration - t) / rise), 0.0, 1.0)
        force += size * direction * (0.5 - 0.5 * np.cos(np.pi * s))[:, None]
        x += duration + 0.8 * rng.exponential(duration * (1 / 0.45 - 1)) + 0.3
    return force


def joint_torque(force, recording, robot):
    """What a force at the flange point does to the joints, Jᵀ F. (T, n) [N·m]"""
    return np.einsum("tji,tj->ti", flange_jacobian(robot.chain, recording.q)[:, :3], force)


def with_torque(recording, robot, torque):
    """The log as it were had an external torque acted: its currents carry what the drives hold."""
    return replace(recording, current=recording.current - torque / robot.torque_constant)


def planted(recording, robot, seed):
    """A log of a free motion with random pushes in it, by the recipe."""
    window = moving_window(recording)
    force = pushes(window.t, seed)
    torque = joint_torque(force, window, robot)
    return Planted(with_torque(window, robot, torque), torque, force)
