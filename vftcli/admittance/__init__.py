"""The paper's variable-parameter admittance law, replayed and in closed loop.

Here is the user's choice of it.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from vftcli.robots import PROFILES, RobotChoice, load_robot
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.option import FILE, NUMBERS, Choice, Option, names_at, numbers

if TYPE_CHECKING:
    from vftcli.admittance.law import Controller
    from vftcli.robots.robot import Robot
    from vftcli.signals.arrays import Array


def listed(text: str, option: str) -> tuple[float, ...]:
    """The numbers of ``A,B,C``."""
    found = numbers(text)
    if found is None:
        raise ParameterError(f"{option} {text!r} is not a list of numbers")
    return found


class ControlChoice(Choice):
    """The controllers of a comparison, and their parameters."""

    GROUP = "The controller"

    #: One variable controller for each; the parameters' own α if empty.
    alphas: Annotated[
        tuple[float, ...],
        Option(
            "--alpha",
            "A,B,...",
            "Try these alphas; default: the profile's.",
            lambda text: listed(text, "--alpha"),
        ),
    ] = ()
    #: None for both.
    kind: Annotated[
        str | None, Option("admittance.controller", "variable|traditional", "Run one only.")
    ] = None
    #: ``sensor`` or ``file:PATH``; None for an observer's wrench.
    force: Annotated[
        str | None,
        Option("admittance.force", "sensor|file:PATH", "Replay this force, no observer's."),
    ] = None
    #: Joints at a release's start; None for the robot file's. (n,) [rad]
    start: Annotated[
        tuple[float, ...] | None,
        Option(
            "admittance.start",
            "Q1,Q2,…",
            "Start a release at these joint positions [rad].",
            lambda text: listed(text, "admittance.start"),
        ),
    ] = None
    #: Length of a release, None until it is over. [s]
    duration: Annotated[
        float | None, Option("admittance.duration", "S", "Length of a release.")
    ] = None
    loop_torque: Annotated[
        str,
        Option("admittance.loop-torque", "average|instant", "Reading of closed-loop sensors."),
    ] = "average"
    #: The user's parameters, each ``AXIS.PARAMETER=VALUE``.
    assignments: Annotated[
        tuple[str, ...],
        Option(
            NUMBERS,
            "AXIS.NUMBER",
            "As position.stiffness=12, rz.threshold=4, admittance.xi=1, "
            "admittance.threshold_mode=soft.",
            several=True,
            completes=names_at("admittance.law:NUMBERS"),
        ),
    ] = ()
    as_printed: bool = False  #: Whether the paper's printed formulas run.

    def __post_init__(self) -> None:
        if self.force is not None and self.force != "sensor" and not self.force.startswith(FILE):
            raise ParameterError(
                f"admittance.force={self.force} is neither sensor nor {FILE}PATH"
            )
        _ = self.settings  # malformed ones are refused before a log is read

    @property
    def settings(self) -> Mapping[str, Mapping[str, Any]]:
        """The user's parameters, by axis."""
        from vftcli.admittance.law import parse_settings

        # The user's own settings come later, and win.
        given = ["admittance.threshold_mode=literal"] if self.as_printed else []
        given += self.assignments
        return parse_settings(given)

    @classmethod
    def takes(cls, name: str) -> bool:
        """Whether a name is a setting or a parameter, as ``rz.threshold``."""
        from vftcli.admittance.law import GROUPS

        section, dot, _ = name.rpartition(".")
        return super().takes(name) or not dot or section in GROUPS

    def start_pose(self, robot: "Robot") -> "Array":
        """Joints at a release's target pose, as set or the robot's. (n,) [rad]"""
        import numpy as np

        start = self.start or robot.admittance.get("start")
        if start is None:
            raise ParameterError(
                f"{robot.name} has no admittance.start; give the start pose with "
                f"--set admittance.start=q1,…,q{robot.joints} [rad]"
            )
        return np.array(start, float)

    def controllers(self, robot: "Robot") -> "tuple[Controller, ...]":
        """The compared controllers, by the robot's parameters and the set ones."""
        from vftcli.admittance.law import controllers, from_table

        parameters = from_table(robot.admittance, robot.name, self.settings)
        return controllers(parameters, self.kind, self.alphas)


def released_robot(choice: RobotChoice) -> "Robot":
    """The arm of a release, from the options alone."""
    if choice.name is None:
        raise RobotError(f"a release needs an arm: --robot {'|'.join(PROFILES)}, or a file")
    return load_robot(choice.name, tip=choice.tip)
