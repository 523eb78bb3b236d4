"""The virtual force/torque sensor: wrenches from torques, frames, zero drift.

Here are the user's choices of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from vftcli.signals.errors import ParameterError
from vftcli.signals.option import WRENCH, Choice, Option, interval, names_at

if TYPE_CHECKING:
    from vftcli.robots.robot import Robot
    from vftcli.wrench.solvers import Mounting

FIT = "fit"  #: The word for a sensor pose that is to be estimated from the log.
START = "start"  #: The word for the unloaded start of the log.
#: The solver of the whole log at once, without an observer.
SMOOTHER = "smoother"
SMOOTHED = ("best",)  #: Observers with the smoother's wrench where no other solver is named.


@dataclass(frozen=True, kw_only=True)
class ZeroChoice:
    """The zero of a wrench; empty by default."""

    #: Unloaded spans of the log: the first is the zero, further ones show its drift. [s]
    spans: tuple[tuple[float, float], ...] = ()
    start: bool = False  #: Whether it is the unloaded start, to be found.

    def __post_init__(self) -> None:
        if self.spans and self.start:
            raise ParameterError("--zero takes either start or spans A:B")

    @classmethod
    def parsed(cls, words: Sequence[str]) -> "ZeroChoice":
        """The choice stated by ``--zero A:B|start``, which may be repeated."""
        spans = []
        for text in words:
            if text == START:
                continue
            try:
                spans.append(interval(text))
            except ParameterError:
                raise ParameterError(
                    f"--zero {text!r} is neither A:B with A < B, in seconds, nor start; name a log "
                    "of free motion by --free LOG"
                ) from None
        return cls(spans=tuple(spans), start=START in words)


class AlsoWrench(Choice):
    """Whether a wrench is asked for, with default choices."""

    GROUP = WRENCH

    wrench: Annotated[bool, Option("--wrench", "", "Add the wrench of every observer.")]


class WrenchChoice(Choice):
    """A user's choice of the virtual sensor."""

    GROUP = WRENCH

    #: Frame of the answer, a key of `vftcli.wrench.solvers.FRAMES`.
    frame: Annotated[
        str,
        Option(
            "--frame",
            "FRAME",
            "Give the wrench in flange, base, tool or sensor.",
            completes=names_at("wrench.solvers:FRAMES"),
        ),
    ] = "flange"
    #: A key of `vftcli.wrench.solvers.SOLVERS` or `SMOOTHER`; None for the observer's own
    #: smoother, else least squares.
    solver: Annotated[
        str | None,
        Option(
            "virtual-sensor.solver",
            "smoother|pinv|map",
            "How torques become a wrench: smoothed over the whole log (best), least squares (the "
            "others), or with a prior of 50 N and 10 N·m.",
        ),
    ] = None
    #: The tool's pose as text or a name in the robot file, None for the file's own.
    tool: Annotated[
        str | None,
        Option(
            "virtual-sensor.tool",
            "POSE|NAME",
            "Tool on the flange: x,y,z[,roll,pitch,yaw] [m, rad], or the name of a [tool.NAME].",
        ),
    ] = None
    #: A pose as text or by name, "fit", or None for the file's own.
    sensor_pose: Annotated[
        str | None,
        Option(
            "virtual-sensor.sensor",
            "POSE|NAME|fit",
            "Pose of the force/torque sensor on the flange; fit: estimated from the log.",
        ),
    ] = None
    #: The zero.
    zero: Annotated[
        ZeroChoice,
        Option(
            "--zero",
            "A:B|start",
            "Subtract the wrench of this unloaded span. Repeatable.",
            ZeroChoice.parsed,
            several=True,
        ),
    ] = field(default_factory=ZeroChoice)
    #: Torque error behind the covariance: "own", one number or one a joint as text, None for
    #: the best that is known. [N·m]
    torque_sd: Annotated[
        str | None,
        Option(
            "virtual-sensor.torque-sd",
            "own|NUMBER(S)",
            "Joint torque error behind the wrench's band [N·m]; own: the observer's covariance.",
        ),
    ] = None

    def __post_init__(self) -> None:
        from vftcli.wrench.solvers import check_frame

        check_frame(self.frame)

    @property
    def by_pose(self) -> str:
        """The solver of single poses: the one asked for, else least squares."""
        from vftcli.wrench.solvers import LEAST_SQUARES

        return LEAST_SQUARES if self.solver in {None, SMOOTHER} else str(self.solver)

    @property
    def looks_back(self) -> bool:
        """Whether the solver asked for needs the complete log, whichever observers run."""
        return self.solver == SMOOTHER

    def smooths(self, name: str) -> bool:
        """Whether the wrench of the observer of this name is the smoother's."""
        return self.solver == SMOOTHER or (self.solver is None and name in SMOOTHED)

    def mounting(self, robot: "Robot") -> "Mounting":
        """Poses of tool and sensor: as asked, else as in the robot file."""
        from vftcli.wrench.solvers import Mounting, read_pose

        tool, sensor = robot.tools.get(""), robot.sensors.get("")
        if self.tool is not None:
            tool = read_pose(self.tool, robot, "tool", "virtual-sensor.tool")
        if self.sensor_pose is not None and self.sensor_pose != FIT:
            sensor = read_pose(self.sensor_pose, robot, "sensor", "virtual-sensor.sensor")
        return Mounting(tool, sensor)
