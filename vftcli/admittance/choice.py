"""What a user may choose of an admittance replay: its controllers, and a release from rest."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.admittance.law import Controller, check_kinds, controllers
from vftcli.admittance.parameters import (
    Admittance,
    from_table,
    is_admittance_setting,
    parse_settings,
)
from vftcli.robots import PROFILES, Robot
from vftcli.robots.choice import RobotChoice
from vftcli.robots.profile import checked_admittance
from vftcli.robots.robot_file import RobotFile
from vftcli.signals import parsing
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError, RobotError

FROM_DAMPING = "from-B"  #: The word for a damping ratio ξ that is that of the drag phase.


@dataclass(frozen=True, kw_only=True)
class ControlChoice:
    """Which controllers are compared, and with which parameters."""

    kinds: tuple[str, ...] = ()  #: Keys of `vftcli.admittance.law.KINDS`; all if empty.
    #: One variable controller for each; the parameters' own α if empty.
    alphas: tuple[float, ...] = ()
    #: Parameters the user sets, which go before every file's.
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    #: A file whose ``[admittance]`` is taken instead of the robot's, or None.
    file: Path | None = None
    force_unstable: bool = False  #: Whether unstable settings run too.

    def __post_init__(self) -> None:
        check_kinds(self.kinds)

    @classmethod
    def parsed(
        cls,
        *,
        assignments: Sequence[str] = (),
        alpha: str | None = None,
        controller: Sequence[str] | None = None,
        xi: str | None = None,
        threshold_mode: str | None = None,
        parameters: Path | None = None,
        force_unstable: bool = False,
        as_printed: bool = False,
    ) -> "ControlChoice":
        """The choice that the options of a command state."""
        # What is named comes later, and so goes before it.
        given = ["admittance.threshold_mode=literal"] if as_printed else []
        given += assignments
        if xi is not None and xi != FROM_DAMPING:
            given.append(f"admittance.xi={xi}")
        if threshold_mode is not None:
            given.append(f"admittance.threshold_mode={threshold_mode}")
        return cls(
            kinds=tuple(controller or ()),
            alphas=listed(alpha, "--alpha") if alpha is not None else (),
            settings=parse_settings(given),
            file=parameters,
            force_unstable=force_unstable,
        )

    def parameters(self, robot: Robot) -> Admittance:
        """The admittance parameters: the file's or the robot's, then those that are set."""
        table = robot.admittance
        if self.file is not None:
            table = checked_admittance(RobotFile(self.file).root.section("admittance"))
        return from_table(table, robot.name, self.settings)

    def controllers(self, parameters: Admittance) -> tuple[Controller, ...]:
        """The controllers that are compared, the traditional one first."""
        return controllers(parameters, self.kinds, self.alphas)


def split_settings(assignments: Sequence[str]) -> tuple[list[str], list[str]]:
    """The assignments of ``--set`` that are of the admittance, and those of the observers."""
    own = [text for text in assignments if is_admittance_setting(text)]
    return own, [text for text in assignments if text not in own]


def start_pose(robot: Robot, text: str | None) -> Array:
    """Joint positions of a release's target pose: ``--start``, else the robot file's. (n,) [rad]"""
    start = robot.admittance.get("start") if text is None else listed(text, "--start")
    if start is None:
        raise ParameterError(
            f"{robot.name} has no admittance.start; give the start pose with --start q1,…,"
            f"q{robot.joints} [rad]"
        )
    return np.array(start, dtype=np.float64)


def released_robot(choice: RobotChoice) -> Robot:
    """The arm of a release, which no log settles."""
    if choice.name is None:
        raise RobotError(f"a release needs an arm: --robot {'|'.join(PROFILES)}, or a file")
    return choice.named()


def listed(text: str, option: str) -> tuple[float, ...]:
    """The numbers of ``A,B,C``."""
    numbers = parsing.numbers(text)
    if numbers is None:
        raise ParameterError(f"{option} {text!r} is not a list of numbers")
    return numbers
