"""Robots: the built-in profiles, and the loaders of users' own TOML and URDF files."""

from pathlib import Path

from vftcli.robots.chain import Chain, Payload
from vftcli.robots.robot import JointFriction, Limits, Robot, SensorNoise
from vftcli.signals.errors import RobotError
from vftcli.signals.parsing import did_you_mean

PROFILES: dict[str, Path] = {
    name: Path(__file__).parent / f"{name}.toml"
    for name in ("ur5", "ur5e", "ur10e", "panda", "fr3")
}
"""Built-in profile name → its file."""


def same_model(name: str) -> list[str]:
    """The profiles that a misspelt name can mean: never another arm, as ur5e for ur5.

    What tells arms of one maker apart are the digits and what follows them.
    """

    def model(text: str) -> str:
        letters = "".join(letter for letter in text.lower() if letter.isalnum())
        return letters.lstrip("abcdefghijklmnopqrstuvwxyz")

    return [profile for profile in PROFILES if model(profile) == model(name)]


def load_robot(robot: str | Path) -> Robot:
    """Load a robot by profile name, TOML file or URDF file.

    Raises:
        RobotError: If there is no such profile or file, or it is not a valid description.
    """
    if str(robot) in PROFILES:
        from vftcli.robots.profile import load_profile

        return load_profile(PROFILES[str(robot)])
    path = Path(robot)
    if path.suffix.lower() in {".urdf", ".xml"}:
        from vftcli.robots.urdf import load_urdf

        return load_urdf(path)
    if path.suffix.lower() == ".toml":
        from vftcli.robots.profile import load_profile

        return load_profile(path)
    raise RobotError(
        f"no robot {str(robot)!r}.{did_you_mean(str(robot), same_model(str(robot)))} "
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
