"""Robots: built-in profiles, loaders of users' files, the user's choice."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from vftcli.signals.errors import RobotError
from vftcli.signals.option import LOG, Choice, Option
from vftcli.signals.packages import door
from vftcli.signals.parsing import did_you_mean

if TYPE_CHECKING:
    from vftcli.robots.chain import Chain, Payload
    from vftcli.robots.robot import JointFriction, Limits, Robot, SensorNoise
    from vftcli.signals.recording import Recording
else:
    __getattr__ = door(__name__, "chain", "robot")

#: The built-in profiles, maker by maker, with their number of joints.
NAMES = {
    **dict.fromkeys(("ur3", "ur5", "ur10", "ur3e", "ur5e", "ur10e", "ur16e", "ur20", "ur30"), 6),
    **dict.fromkeys(("panda", "fr3", "iiwa7", "iiwa14", "gen3"), 7),
    "xarm6": 6,
    "xarm7": 7,
    "m1013": 6,
}
#: Built-in profile name → its file.
PROFILES = {name: Path(__file__).parent / "profiles" / f"{name}.toml" for name in NAMES}


def plain_name(word: str) -> str:
    """A robot's name as written here: ``UR-5e`` and ``UR 5e`` are ``ur5e``."""
    return "".join(letter for letter in word.lower() if letter not in "-_ ")


def model_of(name: str) -> str:
    """The mark of an arm among its maker's: from the first digit of a name on."""
    return plain_name(name).lstrip("abcdefghijklmnopqrstuvwxyz")


@cache
def built_in(path: Path) -> "Robot":
    """The robot of a built-in profile, made once."""
    from vftcli.robots.profile import load_profile

    return load_profile(path)


def profiles_of(joints: int) -> list[str]:
    """The built-in profiles of arms with so many joints."""
    return [name for name in PROFILES if NAMES[name] == joints]


#: Between a xacro and its arguments, as ROS has them: ``ur.xacro ur_type:=ur5e``.
ARGUMENT = re.compile(r"\s+(?=[^\s:=]+:=)")


def load_robot(robot: "str | Path | Robot", *, tip: str = "") -> "Robot":
    """Load a robot by profile name, robot file (TOML) or description.

    Args:
        robot: The name, or the file, with a xacro's arguments as ``NAME:=VALUE``; a Robot
            stays as it is.
        tip: The link or joint at the arm's end in a description with hands or several arms.

    Raises:
        RobotError: If there is no such profile or file, or it is not a valid description.
    """
    if not isinstance(robot, str | Path):
        from vftcli.robots.robot import Robot

        if isinstance(robot, Robot):
            return robot
        raise RobotError(
            f"the robot is {robot!r}; expected a profile's name, as 'ur5', or a file"
        )
    from vftcli.robots.profile import load_profile
    from vftcli.robots.robot_file import DESCRIPTIONS

    name, *arguments = ARGUMENT.split(str(robot))
    path = PROFILES.get(plain_name(name), Path(name))
    ending = path.suffix.lower()
    if ending == ".toml":
        if tip or arguments:
            given = arguments[0] if arguments else "--tip"
            raise RobotError(f"{given} is for a URDF, xacro or MJCF; {name} is a robot file")
        return built_in(path) if path in PROFILES.values() else load_profile(path)
    if ending in DESCRIPTIONS:
        from vftcli.robots.described import load_described

        return load_described(path, tip, arguments)
    # A misspelt name never means another arm, as ur5e for ur5.
    alike = [profile for profile in PROFILES if model_of(profile) == model_of(str(robot))]
    raise RobotError(
        f"no robot {str(robot)!r}.{did_you_mean(str(robot), alike)} "
        f"Built in: {', '.join(PROFILES)}; or give a .toml, .urdf, .xacro or .xml (MJCF) file"
    )


DECLARED = "log"  #: Value of ``--payload``: the controller's, as the log says.


class RobotChoice(Choice):
    """The robot of a log, and its model."""

    GROUP = LOG

    #: Profile, robot file or description; None: the log's own.
    name: Annotated[
        "str | Robot | None",
        Option(
            "--robot",
            "NAME|FILE",
            "Name the arm: profile, TOML, URDF, xacro, MJCF.",
            completes=lambda: PROFILES,
        ),
    ] = None
    friction: Annotated[
        str,
        Option(
            "model.friction",
            "profile|none|model",
            "Friction of the robot file, none, or that of an MJCF's simulation.",
        ),
    ] = "profile"
    payload: Annotated[
        str | None, Option("--payload", "NAME", "Mount this payload of the robot file.")
    ] = None
    tip: Annotated[str, Option("--tip", "FRAME", "End the arm at this link or joint.")] = ""

    def load(self, recording: "Recording", otherwise: str | None = None) -> "Robot":
        """Load the robot chosen, or that the log says, or `otherwise`."""
        name = self.name or recording.robot_hint or otherwise
        if name is None:
            raise RobotError(
                f"{recording.name} does not say which arm it is; {choices_for(recording)}"
            )
        robot = load_robot(name, tip=self.tip)
        if self.payload == DECLARED:
            import numpy as np

            from vftcli.robots.chain import Payload

            if recording.payload_mass is None:
                raise RobotError(
                    f"{recording.name}: the log does not say which payload was set at the "
                    "controller; describe it in a [payload.NAME] section of the robot file and "
                    "give --payload NAME"
                )
            # The controller never knows an inertia.
            com = np.array(recording.payload_com or (0.0, 0.0, 0.0))
            robot = robot.with_payload(Payload(mass=recording.payload_mass, com=com))
        elif self.payload is not None:
            robot = robot.with_payload(self.payload)
        if self.friction == "model":
            if not robot.simulated_friction:
                raise RobotError(
                    f"{robot.name}: model.friction=model is what an MJCF gives its joints "
                    "(damping, frictionloss); this robot's description gives none"
                )
            return replace(robot, friction=robot.simulated_friction)
        return replace(robot, friction=()) if self.friction == "none" else robot

    def check(self) -> None:
        """Load the robot that is named, if one is, with its payload."""
        if self.name is not None:
            named = load_robot(self.name, tip=self.tip)
            named.with_payload(None if self.payload == DECLARED else self.payload)


def choices_for(recording: "Recording") -> str:
    """Robots for ``--robot`` that fit a log, in words."""
    fitting = profiles_of(recording.joints) or PROFILES
    return (
        f"choose one with --robot: {', '.join(fitting)}, or a FILE.toml or "
        f"FILE.urdf of {recording.joints} joints"
    )


__all__ = [
    "PROFILES",
    "Chain",
    "JointFriction",
    "Limits",
    "Payload",
    "Robot",
    "SensorNoise",
    "load_robot",
]
