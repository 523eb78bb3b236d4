"""Robots: the built-in profiles, and the loaders of users' own TOML and URDF files."""

from pathlib import Path

from vftcli.robots.chain import Chain, Payload
from vftcli.robots.robot import JointFriction, Limits, Robot, SensorNoise
from vftcli.signals.errors import RobotError

MAKERS = {
    "Universal Robots": (
        *("ur3", "ur5", "ur10"),
        *("ur3e", "ur5e", "ur10e", "ur16e", "ur20", "ur30"),
    ),
    "Franka Robotics": ("panda", "fr3"),
    "KUKA": ("iiwa7", "iiwa14"),
    "Kinova": ("gen3",),
    "UFACTORY": ("xarm6", "xarm7"),
    "Doosan Robotics": ("m1013",),
}
"""Maker → its built-in profiles."""

PROFILES: dict[str, Path] = {
    name: Path(__file__).parent / "profiles" / f"{name}.toml"
    for names in MAKERS.values()
    for name in names
}
"""Built-in profile name → its file."""


def load_robot(robot: str | Path) -> Robot:
    """Load a robot by profile name, TOML file or URDF file.

    Raises:
        RobotError: If there is no such profile or file, or it is not a valid description.
    """
    if (name := plain_name(str(robot))) in PROFILES:
        from vftcli.robots.profile import load_profile

        return load_profile(PROFILES[name])
    path = Path(robot)
    if path.suffix.lower() in {".urdf", ".xml"}:
        from vftcli.robots.urdf import load_urdf

        return load_urdf(path)
    if path.suffix.lower() == ".toml":
        from vftcli.robots.profile import load_profile

        return load_profile(path)
    raise RobotError(
        f"no robot {str(robot)!r}. Built in: {', '.join(PROFILES)}; "
        "or give a FILE.toml or FILE.urdf"
    )


def plain_name(word: str) -> str:
    """How a robot's name is written here: ``UR-5e``, ``ur_5e`` and ``UR 5e`` are ``ur5e``."""
    return "".join(letter for letter in word.lower() if letter not in "-_ ")


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
