"""What a user may choose of the virtual sensor, read from the command line and checked once."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from vftcli.robots.robot import Robot
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import check_known, interval
from vftcli.virtual_sensor.frames import Mounting, check_frame, read_pose
from vftcli.virtual_sensor.solvers import LEAST_SQUARES, SOLVERS

FIT = "fit"  #: The word for a sensor pose that is to be estimated from the log.
START = "start"  #: The word for the unloaded start of the log.
#: The word for the solver that takes the whole log at once, and needs no observer before it.
SMOOTHER = "smoother"
SMOOTHED = ("best",)  #: Observers whose wrench is the smoother's where no other solver is named.


@dataclass(frozen=True, kw_only=True)
class ZeroChoice:
    """What is taken as the zero of a wrench; nothing where all is left at its default.

    Raises:
        ParameterError: If both spans and the start are chosen.
    """

    #: Unloaded spans of the log: the first is the zero, further ones show its drift. [s]
    spans: tuple[tuple[float, float], ...] = ()
    start: bool = False  #: Whether the unloaded start is to be found and taken.

    def __post_init__(self) -> None:
        if self.spans and self.start:
            raise ParameterError("--zero takes either start or spans A:B")

    @classmethod
    def parsed(cls, words: Sequence[str]) -> "ZeroChoice":
        """The choice that ``--zero A:B|start``, which may be repeated, states.

        Raises:
            ParameterError: If a word is neither, or they exclude each other.
        """
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


@dataclass(frozen=True, kw_only=True)
class WrenchChoice:
    """What a user asks of the virtual sensor.

    Raises:
        ParameterError: If there is no such frame or solver.
    """

    frame: str = "flange"  #: Frame of the answer, a key of `vftcli.virtual_sensor.frames.FRAMES`.
    #: A key of `vftcli.virtual_sensor.solvers.SOLVERS`, or `SMOOTHER`; None for the smoother where
    #: it is the observer's own, and least squares for the others.
    solver: str | None = None
    #: The tool's pose as text or a name in the robot file, None for the file's own.
    tool: str | None = None
    sensor_pose: str | None = None  #: The sensor's pose likewise, or "fit".
    zero: ZeroChoice = field(default_factory=ZeroChoice)  #: What is taken as the zero.
    #: Torque error the covariance starts from: "own", a number or one a joint as text, or None for
    #: the best that is known. [N·m]
    torque_sd: str | None = None

    def __post_init__(self) -> None:
        check_frame(self.frame)
        if self.solver is not None:
            there = (SMOOTHER, *SOLVERS)
            check_known(self.solver, there, f"no solver {self.solver!r} for a wrench")

    @property
    def by_pose(self) -> str:
        """The solver that takes each pose by itself: the one asked for, else least squares."""
        return LEAST_SQUARES if self.solver in {None, SMOOTHER} else str(self.solver)

    @property
    def looks_back(self) -> bool:
        """Whether the solver asked for needs the complete log, whichever observers run."""
        return self.solver == SMOOTHER

    def smooths(self, name: str) -> bool:
        """Whether the wrench of the observer of this name is the smoother's."""
        return self.solver == SMOOTHER or (self.solver is None and name in SMOOTHED)

    def mounting(self, robot: Robot) -> Mounting:
        """Where tool and sensor sit: as asked, else as the robot file says.

        Raises:
            ParameterError: If a pose is malformed or names nothing there is.
        """
        tool, sensor = robot.tools.get(""), robot.sensors.get("")
        if self.tool is not None:
            tool = read_pose(self.tool, robot, "tool", "--tool")
        if self.sensor_pose is not None and self.sensor_pose != FIT:
            sensor = read_pose(self.sensor_pose, robot, "sensor", "--sensor-pose")
        return Mounting(tool, sensor)

    @classmethod
    def parsed(
        cls,
        *,
        wrench: bool = False,
        frame: str | None = None,
        solver: str | None = None,
        tool: str | None = None,
        sensor_pose: str | None = None,
        zero: Sequence[str] | None = None,
        torque_sd: str | None = None,
    ) -> "WrenchChoice | None":
        """The choice that the options of a command state, None where none of them asks for one.

        `wrench` says whether ``--wrench`` was given, `zero` holds the words of every ``--zero``;
        the others are fields. Any of them asks for a wrench.

        Raises:
            ParameterError: If a frame or solver does not exist, or a zero is malformed.
        """
        options = (frame, solver, tool, sensor_pose, zero or None, torque_sd)
        if not wrench and all(option is None for option in options):
            return None
        return cls(
            frame=frame or "flange",
            solver=solver,
            tool=tool,
            sensor_pose=sensor_pose,
            zero=ZeroChoice.parsed(zero or ()),
            torque_sd=torque_sd,
        )
