"""Logs whose external torque is known, and what the harness needs to know of each.

Real logs of a UR10e with planted pushes, cut into pieces too, and the same under steady pushes.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from planted_pushes import joint_torque, moving_window, planted, pushes, with_torque

from vftcli.free_motion import FreeChoice
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import Library
from vftcli.robots import load_robot
from vftcli.robots.chain import link_poses

UR10E = ("free_12harm.csv", "free_12harm_40s.csv.gz", "free_10harm.csv.gz")
COLUMNS = "t,q:6,dq:6,current:6,target_current:6,target_torque:6"

STEADY = (
    ((0, 0, -20), 0.0, None),
    ((15, -10, 0), 0.0, None),
    ((0, 0, 60), 0.0, None),
    ((20, 0, -20), 12.0, None),
    ((0, 0, -30), 0.0, 3),
    ((20, -20, 0), 0.0, 3),
)
"""Steady pushes: force in world axes [N], from when on [s], at the flange or at a joint's origin,
from 0, on the link before it."""


class Case(NamedTuple):
    """One log whose external torque is known.

    Attributes:
        group: What it is averaged with.
        name: What tells it from the others of its group.
        recording: The log.
        robot: The arm as the estimators know it.
        free: What is said to be free of contact.
        truth: The external torque. (T, n) [N·m]
    """

    group: str
    name: str
    recording: object
    robot: object
    free: FreeChoice
    truth: np.ndarray


def read(path, columns):
    """A log by a column description."""
    return Library([path]).open(path, ReadChoice.parsed(columns=columns))


def planted_cases(logs, robot=None, seeds=(1, 2, 3)) -> Iterator[Case]:
    """The three free logs with random pushes; the robot of the estimators may be another."""
    profile, arm = load_robot("ur10e"), load_robot(robot or "ur10e")
    for log in UR10E:
        recording = read(logs / "ur10e" / log, COLUMNS)
        for seed in seeds:
            made = planted(recording, profile, seed)
            free = FreeChoice.parsed(free=["0:8"])
            name = f"{log.split('.')[0]} {seed}"
            yield Case("planted", name, made.recording, arm, free, made.torque)


def piece_cases(logs, robot=None, length=10.0) -> Iterator[Case]:
    """Pieces of the planted logs, pushes from 1 s on."""
    profile, arm = load_robot("ur10e"), load_robot(robot or "ur10e")
    for log in UR10E:
        window = moving_window(read(logs / "ur10e" / log, COLUMNS))
        for number in range(int(window.t[-1] / length)):
            cut = window.between(number * length, (number + 1) * length)
            # the recipe leaves the first 8 s alone: the piece is laid at 7 s
            late = replace(cut, t=cut.t - cut.t[0] + 7.0)
            torque = joint_torque(pushes(late.t, number + 1), late, profile)
            piece = with_torque(replace(cut, t=cut.t - cut.t[0]), profile, torque)
            free = FreeChoice.parsed(free=["0:1"])
            yield Case("pieces", f"{log.split('.')[0]} {number}", piece, arm, free, torque)


def steady_cases(logs, robot=None) -> Iterator[Case]:
    """The three free logs under pushes that last, each alone."""
    profile, arm = load_robot("ur10e"), load_robot(robot or "ur10e")
    for log in UR10E:
        window = moving_window(read(logs / "ur10e" / log, COLUMNS))
        for force, begin, joint in STEADY:
            levels = np.where(window.t[:, None] >= begin, np.array(force, dtype=float), 0.0)
            if joint is None:
                torque = joint_torque(levels, window, profile)
            else:
                torque = torque_at_joint(levels, window, profile, joint)
            name = f"{force} {'flange' if joint is None else 'wrist'} {log.split('.')[0]}"
            pushed = with_torque(window, profile, torque)
            yield Case("steady", name, pushed, arm, FreeChoice(), torque)


def torque_at_joint(force, recording, robot, joint):
    """Joint torques of a force at a joint's origin on the link before it. (T, n) [N·m]"""
    poses = link_poses(robot.chain, recording.q)
    torque = np.zeros(recording.q.shape)
    for j in range(joint):
        lever = poses.translation[:, joint] - poses.translation[:, j]
        torque[:, j] = np.sum(poses.rotation[:, j, :, 2] * np.cross(lever, force), axis=1)
    return torque
