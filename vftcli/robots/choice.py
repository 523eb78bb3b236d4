"""What a user may choose of the robot: which arm, its friction model, what it carries."""

from dataclasses import dataclass

from vftcli.robots import PROFILES, Robot, load_robot
from vftcli.signals.errors import RobotError
from vftcli.signals.parsing import check_known
from vftcli.signals.recording import Recording

FRICTION = ("profile", "none")
"""Values of ``--friction``: the model of the robot file, or none at all."""


@dataclass(frozen=True, kw_only=True)
class RobotChoice:
    """Which arm made a log, and how it is modelled.

    Attributes:
        name: Profile name, TOML or URDF file, None to take what the log settles.
        friction: "profile" or "none".
        payload: Name of a ``[payload.NAME]`` of the robot file to mount, or None.

    Raises:
        ParameterError: If friction is neither of the two.
    """

    name: str | None = None
    friction: str = "profile"
    payload: str | None = None

    def __post_init__(self) -> None:
        check_known(self.friction, FRICTION, f"--friction {self.friction!r}")

    @classmethod
    def parsed(
        cls, *, robot: str | None = None, friction: str | None = None, payload: str | None = None
    ) -> "RobotChoice":
        """The choice that ``--robot``, ``--friction`` and ``--payload`` state."""
        return cls(name=robot, friction=friction or "profile", payload=payload)

    def load(self, recording: Recording) -> Robot:
        """Load the robot that is chosen, or the one that the log settles.

        Raises:
            RobotError: If none is chosen and the log does not settle it, or there is no such robot.
        """
        name = self.name or recording.robot_hint
        if name is None:
            fitting = [p for p in PROFILES if load_robot(p).joints == recording.joints]
            raise RobotError(
                f"{recording.name} does not say which arm it is; choose one with --robot: "
                f"{', '.join(fitting) or ', '.join(PROFILES)}, or a FILE.toml or FILE.urdf of "
                f"{recording.joints} joints"
            )
        robot = load_robot(name)
        if self.payload is not None:
            robot = robot.with_payload(self.payload)
        return robot.without_friction() if self.friction == "none" else robot
