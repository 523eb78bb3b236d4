"""What a user may choose of the robot: which arm, its friction model, what it carries."""

from dataclasses import dataclass

import numpy as np

from vftcli.robots import PROFILES, Payload, Robot, load_robot
from vftcli.signals.errors import RobotError
from vftcli.signals.parsing import check_known
from vftcli.signals.recording import Recording

FRICTION = ("profile", "none")
"""Values of ``--friction``: the model of the robot file, or none at all."""
DECLARED = "log"
"""Value of ``--payload``: what the log says that the controller was told of."""


@dataclass(frozen=True, kw_only=True)
class RobotChoice:
    """Which arm made a log, and how it is modelled.

    Attributes:
        name: Profile name, TOML or URDF file, None to take what the log settles.
        friction: "profile" or "none".
        payload: Name of a ``[payload.NAME]`` of the robot file to mount, "log" for the payload that
            the log says the controller was told of, or None.

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

    def load(self, recording: Recording, otherwise: str | None = None) -> Robot:
        """Load the robot that is chosen, or the one that the log says.

        Args:
            recording: The log.
            otherwise: The robot's name where neither is so.

        Raises:
            RobotError: If none of these names one, or there is no such robot.
        """
        name = self.name or recording.robot_hint or otherwise
        if name is None:
            raise RobotError(
                f"{recording.name} does not say which arm it is; {choices_for(recording)}"
            )
        robot = load_robot(name)
        if self.payload == DECLARED:
            robot = robot.with_payload(declared_payload(recording))
        elif self.payload is not None:
            robot = robot.with_payload(self.payload)
        return robot.without_friction() if self.friction == "none" else robot


def choices_for(recording: Recording) -> str:
    """What may be given with ``--robot`` for a log, in words."""
    fitting = [p for p in PROFILES if load_robot(p).joints == recording.joints]
    return (
        f"choose one with --robot: {', '.join(fitting) or ', '.join(PROFILES)}, or a FILE.toml or "
        f"FILE.urdf of {recording.joints} joints"
    )


def declared_payload(recording: Recording) -> Payload:
    """The payload that the controller was told of; nobody tells it an inertia.

    Raises:
        RobotError: If the log does not say one.
    """
    mass, com = recording.payload_mass, recording.payload_com
    if mass is None:
        raise RobotError(
            f"{recording.name}: the log does not say which payload the controller was told of; "
            "describe it in a [payload.NAME] section of the robot file and give --payload NAME"
        )
    centre = np.zeros(3) if com is None else np.asarray(com, dtype=np.float64)
    return Payload(mass=mass, com=centre, inertia=np.zeros((3, 3)))
