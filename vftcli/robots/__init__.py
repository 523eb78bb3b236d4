"""Robots: the built-in profiles, and the loaders of users' own files."""

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from vftcli.signals.errors import RobotError
from vftcli.signals.packages import door
from vftcli.signals.parsing import did_you_mean

if TYPE_CHECKING:
    from vftcli.robots.chain import Chain, Payload
    from vftcli.robots.robot import JointFriction, Limits, Robot, SensorNoise
else:
    __getattr__ = door(__name__, "chain", "robot")

#: The built-in profiles, maker by maker.
NAMES = (
    *("ur3", "ur5", "ur10", "ur3e", "ur5e", "ur10e", "ur16e", "ur20", "ur30"),
    *("panda", "fr3", "iiwa7", "iiwa14", "gen3", "xarm6", "xarm7", "m1013"),
)
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
    """The robot of a built-in profile, made once: it does not change."""
    from vftcli.robots.profile import load_profile

    return load_profile(path)


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
        f"Built in: {', '.join(PROFILES)}; or give a FILE.toml or FILE.urdf"
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
