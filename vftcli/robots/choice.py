"""A user's choice of robot: the arm, its friction model and its load."""

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from vftcli.robots import PROFILES, load_robot
from vftcli.signals.errors import RobotError
from vftcli.signals.option import LOG, Choice, Option
from vftcli.signals.parsing import check_known

if TYPE_CHECKING:
    from vftcli.robots.chain import Payload
    from vftcli.robots.robot import Robot
    from vftcli.signals.recording import Recording

#: Values of ``model.friction``: the robot file's, none at all, or that of a simulator.
FRICTION = ("profile", "none", "model")
DECLARED = "log"  #: Value of ``--payload``: what the controller knows of, as the log says.


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
            "Friction of the robot file, none, or what an MJCF gives for simulation.",
        ),
    ] = "profile"
    payload: Annotated[
        str | None,
        Option("--payload", "NAME", "Mount this payload of the robot file."),
    ] = None
    tip: Annotated[str, Option("--tip", "FRAME", "End the arm at this link or joint.")] = ""

    def __post_init__(self) -> None:
        check_known(self.friction, FRICTION, f"--set model.friction={self.friction}")

    def load(self, recording: "Recording", otherwise: str | None = None) -> "Robot":
        """Load the robot chosen, or that the log says, or `otherwise`."""
        name = self.name or recording.robot_hint or otherwise
        if name is None:
            raise RobotError(
                f"{recording.name} does not say which arm it is; {choices_for(recording)}"
            )
        robot = load_robot(name, tip=self.tip)
        if self.payload == DECLARED:
            robot = robot.with_payload(declared_payload(recording))
        elif self.payload is not None:
            robot = robot.with_payload(self.payload)
        if self.friction == "model":
            if not robot.simulated_friction:
                raise RobotError(
                    f"{robot.name}: model.friction=model is what an MJCF gives its joints "
                    "(damping, frictionloss); this robot's description gives none"
                )
            return replace(robot, friction=robot.simulated_friction)
        return robot.without_friction() if self.friction == "none" else robot

    def check(self) -> None:
        """Load the robot that is named, if one is, with its payload."""
        if self.name is not None:
            named = load_robot(self.name, tip=self.tip)
            named.with_payload(None if self.payload == DECLARED else self.payload)


def choices_for(recording: "Recording") -> str:
    """Robots for ``--robot`` that fit a log, in words."""
    fitting = [p for p in PROFILES if load_robot(p).joints == recording.joints]
    return (
        f"choose one with --robot: {', '.join(fitting) or ', '.join(PROFILES)}, or a FILE.toml or "
        f"FILE.urdf of {recording.joints} joints"
    )


def declared_payload(recording: "Recording") -> "Payload":
    """The payload known to the controller; it never has an inertia."""
    import numpy as np

    from vftcli.robots.chain import Payload

    mass, com = recording.payload_mass, recording.payload_com
    if mass is None:
        raise RobotError(
            f"{recording.name}: the log does not say which payload was set at the controller; "
            "describe it in a [payload.NAME] section of the robot file and give --payload NAME"
        )
    centre = np.zeros(3) if com is None else np.asarray(com, float)
    return Payload(mass=mass, com=centre, inertia=np.zeros((3, 3)))
