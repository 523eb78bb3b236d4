"""Robots: the built-in profiles, and the loaders of users' own files."""

from collections.abc import Sequence
from pathlib import Path

from vftcli.robots.chain import Chain, Payload
from vftcli.robots.robot import JointFriction, Limits, Robot, SensorNoise
from vftcli.robots.robot_file import DESCRIPTIONS
from vftcli.signals.errors import RobotError
from vftcli.signals.parsing import did_you_mean

PROFILES: dict[str, Path] = {
    name: Path(__file__).parent / f"{name}.toml"
    for name in ("ur5", "ur5e", "ur10e", "panda", "fr3")
}
"""Built-in profile name → its file."""


def load_robot(robot: str | Path, *, tip: str = "", arguments: Sequence[str] = ()) -> Robot:
    """Load a robot by profile name, from a robot file (TOML) or a description (URDF, xacro, MJCF).

    Args:
        robot: The name, or the file.
        tip: The link or joint at the arm's end in a description with hands or several arms.
        arguments: Arguments of a xacro, each ``NAME=VALUE``.

    Raises:
        RobotError: If there is no such profile or file, or it is not a valid description.
    """
    path = PROFILES.get(str(robot), Path(robot))
    ending = path.suffix.lower()
    if ending == ".toml":
        from vftcli.robots.profile import load_profile

        for option, given in (("--tip", tip), ("--robot-arg", arguments)):
            if given:
                raise RobotError(f"{option} is for a URDF, xacro or MJCF; {robot} is a robot file")
        return load_profile(path)
    if ending in DESCRIPTIONS:
        from vftcli.robots.described import load_described

        return load_described(path, tip, arguments)
    raise RobotError(
        f"no robot {str(robot)!r}.{did_you_mean(str(robot).lower(), PROFILES)} "
        f"Built in: {', '.join(PROFILES)}; or give a FILE.toml or FILE.urdf."
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
