"""What a user may choose of an admittance replay: its controllers, and a release from rest."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from vftcli.robots import PROFILES
from vftcli.robots.choice import RobotChoice
from vftcli.signals import parsing
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.option import Choice, Option

if TYPE_CHECKING:
    from vftcli.admittance.law import Controller
    from vftcli.admittance.parameters import Admittance
    from vftcli.robots.robot import Robot
    from vftcli.signals.arrays import Array

FROM_DAMPING = "from-B"  #: The word for a damping ratio ξ that is that of the drag phase.


def listed(text: str, option: str) -> tuple[float, ...]:
    """The numbers of ``A,B,C``."""
    numbers = parsing.numbers(text)
    if numbers is None:
        raise ParameterError(f"{option} {text!r} is not a list of numbers")
    return numbers


@dataclass(frozen=True, kw_only=True)
class ControlChoice(Choice):
    """Which controllers are compared, and with which parameters."""

    GROUP = "The controller"

    #: One variable controller for each; the parameters' own α if empty.
    alphas: Annotated[
        tuple[float, ...],
        Option(
            "--alpha",
            "A,B,…",
            "One variable controller each. Default the profile's.",
            lambda text: listed(text, "--alpha"),
        ),
    ] = ()
    #: Keys of `vftcli.admittance.law.KINDS`; all if empty.
    kinds: Annotated[
        tuple[str, ...],
        Option("--controller", "variable|traditional", "Repeatable; default both.", several=True),
    ] = ()
    #: The damping ratio ξ, or `FROM_DAMPING`; None for the parameters' own.
    xi: Annotated[
        str | None,
        Option(
            "--xi",
            "NUMBER|from-B",
            "Damping ratio of the recovery; default from B_d, M_d, K_d.",
            seldom=True,
        ),
    ] = None
    threshold_mode: Annotated[
        str | None,
        Option(
            "--threshold-mode",
            "hard|soft|literal",
            "The whole force above it, the excess, or all of it always (--as-printed).",
            seldom=True,
        ),
    ] = None
    #: A file whose ``[admittance]`` is taken instead of the robot's, or None.
    file: Annotated[
        Path | None,
        Option(
            "--parameters",
            "FILE.toml",
            "Take [admittance] from this file, not the profile.",
            seldom=True,
        ),
    ] = None
    #: Whether unstable settings run too.
    force_unstable: Annotated[
        bool,
        Option("--force-unstable", "", "Run settings that are unstable, for study.", seldom=True),
    ] = False
    #: Parameters the user sets, which go before every file's, each ``AXIS.PARAMETER=VALUE``.
    assignments: tuple[str, ...] = ()
    as_printed: bool = False  #: Whether the paper's printed formulas run.

    def __post_init__(self) -> None:
        from vftcli.admittance.law import check_kinds

        check_kinds(self.kinds)
        _ = self.settings  # malformed ones are refused before a log is read

    @property
    def settings(self) -> Mapping[str, Mapping[str, Any]]:
        """The parameters that the user sets, by axis.

        Raises:
            ParameterError: If there is no such parameter, or a value is malformed.
        """
        from vftcli.admittance.parameters import parse_settings

        # What is named comes later, and so goes before it.
        given = ["admittance.threshold_mode=literal"] if self.as_printed else []
        given += self.assignments
        if self.xi is not None and self.xi != FROM_DAMPING:
            given.append(f"admittance.xi={self.xi}")
        if self.threshold_mode is not None:
            given.append(f"admittance.threshold_mode={self.threshold_mode}")
        return parse_settings(given)

    def parameters(self, robot: "Robot") -> "Admittance":
        """The admittance parameters: the file's or the robot's, then those that are set."""
        from vftcli.admittance.parameters import from_table
        from vftcli.robots.profile import checked_admittance
        from vftcli.robots.robot_file import RobotFile

        table = robot.admittance
        if self.file is not None:
            table = checked_admittance(RobotFile(self.file).root.section("admittance"))
        return from_table(table, robot.name, self.settings)

    def controllers(self, parameters: "Admittance") -> "tuple[Controller, ...]":
        """The controllers that are compared, the traditional one first."""
        from vftcli.admittance.law import controllers

        return controllers(parameters, self.kinds, self.alphas)


def split_settings(assignments: Sequence[str]) -> tuple[list[str], list[str]]:
    """The assignments of ``--set`` that are of the admittance, and those of the observers."""
    from vftcli.admittance.parameters import is_admittance_setting

    own = [text for text in assignments if is_admittance_setting(text)]
    return own, [text for text in assignments if text not in own]


def start_pose(robot: "Robot", text: str | None) -> "Array":
    """Joint positions of a release's target pose: ``--start``, else the robot file's. (n,) [rad]"""
    import numpy as np

    start = robot.admittance.get("start") if text is None else listed(text, "--start")
    if start is None:
        raise ParameterError(
            f"{robot.name} has no admittance.start; give the start pose with --start q1,…,"
            f"q{robot.joints} [rad]"
        )
    return np.array(start, dtype=np.float64)


def released_robot(choice: RobotChoice) -> "Robot":
    """The arm of a release, which no log settles."""
    if choice.name is None:
        raise RobotError(f"a release needs an arm: --robot {'|'.join(PROFILES)}, or a file")
    return choice.named()
