"""The options of the commands, each declared once, in one bundle a choice.

The fields of a bundle are the parameters of its choice's `parsed`, which checks them: a room says
what its words mean, here stands how they are typed and what `--help` says of them.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from vftcli.evaluation.reference_choice import ReferenceChoice
    from vftcli.observers.choice import ObserverChoice
    from vftcli.pipeline import AnalysisChoice
    from vftcli.readers.library import Library
    from vftcli.readers.reader import ReadChoice
    from vftcli.refinement.choice import RefinementChoice
    from vftcli.repetition.choice import FreeChoice
    from vftcli.robots.choice import RobotChoice
    from vftcli.virtual_sensor.choice import WrenchChoice

Log = Annotated[
    Path,
    typer.Argument(metavar="LOG", help="A log file or a bag directory; recognised by content."),
]
Logs = Annotated[
    list[Path],
    typer.Argument(metavar="LOG...", help="Log files or bag directories; recognised by content."),
]
Folder = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", help="Folder to write into.")
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite what exists.")]
Json = Annotated[
    bool,
    typer.Option(
        "--json",
        help="What the command makes as JSON on stdout: rows of a table, a run record, a summary.",
    ),
]
ROBOT = typer.Option("--robot", metavar="NAME|FILE", help="Profile, FILE.toml or FILE.urdf.")
FREE = typer.Option(
    "--free",
    metavar="LOG|A:B",
    help="Motion that nobody touched: a free run of the same trajectory, or a span of the log "
    "itself. Repeatable: two free runs measure the floor.",
)
REFERENCE = typer.Option(
    "--reference", metavar="REF", help="two-cycle, sensor, vendor, zero, or file:PATH."
)


class Bundle:
    """Options that belong together."""

    def words(self) -> dict[str, Any]:
        """The options as the keyword arguments of their choice's `parsed`."""
        own: Any = self
        return {field.name: getattr(self, field.name) for field in fields(own)}


@dataclass(frozen=True, kw_only=True)
class ReadOptions(Bundle):
    """How a log is read, and which part of it."""

    format: Annotated[
        str | None,
        typer.Option(
            "--format", metavar="NAME", help="Skip recognition; `vftcli formats` lists the names."
        ),
    ] = None
    columns: Annotated[
        str | None,
        typer.Option(
            "--columns",
            metavar="SPEC",
            help="Columns of a table: 't,q:6,dq:6,current:6' in file order, or "
            "'q=joint_pos_{i},tau=eff_{i}' by header.",
        ),
    ] = None
    interval: Annotated[
        str | None,
        typer.Option(
            "--interval",
            metavar="A:B",
            help="Use only this time span, in seconds from the first sample.",
        ),
    ] = None

    def choice(self) -> "ReadChoice":
        """The choice that the options state.

        Raises:
            ParameterError: If the interval is malformed.
        """
        from vftcli.readers.reader import ReadChoice

        return ReadChoice.parsed(**self.words())


@dataclass(frozen=True, kw_only=True)
class RobotOptions(Bundle):
    """Which arm, and how it is modelled."""

    robot: Annotated[str | None, ROBOT] = None
    friction: Annotated[
        str | None,
        typer.Option(
            "--friction",
            metavar="profile|none",
            help="The robot's friction model (default), or none.",
        ),
    ] = None
    payload: Annotated[
        str | None,
        typer.Option("--payload", metavar="NAME", help="Mount a [payload.NAME] of the robot file."),
    ] = None

    def choice(self) -> "RobotChoice":
        """The choice that the options state.

        Raises:
            ParameterError: If the friction is neither of its words.
        """
        from vftcli.robots.choice import RobotChoice

        return RobotChoice.parsed(**self.words())


@dataclass(frozen=True, kw_only=True)
class ObserverOptions(Bundle):
    """Which observers run, and with which gains."""

    observer: Annotated[
        list[str] | None,
        typer.Option(
            "--observer", metavar="NAME", help="Repeatable. Default: fdo gmo kfo-fe kfo-zoh."
        ),
    ] = None
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="OBSERVER.PARAMETER=VALUE",
            help="Repeatable: gmo.gain=30, gmo.gain=5,3,4,10,10,10, kfo.noise_convention=discrete.",
        ),
    ] = None
    gains_file: Annotated[
        Path | None,
        typer.Option(
            "--set-file",
            metavar="FILE",
            help="Gains that `vftcli tune` wrote; --set goes before them.",
        ),
    ] = None
    match: Annotated[
        str | None,
        typer.Option(
            "--match",
            metavar="delay=S|bandwidth=HZ",
            help="Gains that give every observer the same delay or −3 dB bandwidth on every joint.",
        ),
    ] = None
    as_printed: Annotated[
        bool,
        typer.Option("--as-printed", help="The paper's printed formulas, errata and all."),
    ] = False

    def choice(self) -> "ObserverChoice":
        """The choice that the options state.

        Raises:
            ParameterError: If an observer or parameter does not exist, or a value is malformed.
        """
        from vftcli.observers.choice import ObserverChoice

        return ObserverChoice.parsed(**self.words())


@dataclass(frozen=True, kw_only=True)
class FreeOptions(Bundle):
    """What nobody touched, and how it is laid under the log."""

    free: Annotated[list[str] | None, FREE] = None
    free_part: Annotated[
        str | None,
        typer.Option(
            "--free-part",
            metavar="A:B",
            help="The same as --free A:B; without either, the log's own free cycles are found.",
        ),
    ] = None
    period: Annotated[
        float | None,
        typer.Option(
            "--period",
            metavar="S",
            help="Commanded period of a repeated motion; found if not given.",
        ),
    ] = None
    free_cycles: Annotated[
        str | None,
        typer.Option(
            "--free-cycles",
            metavar="1|1,2|1-3",
            help="Cycles free of contact; found if not given.",
        ),
    ] = None
    alignment: Annotated[
        str,
        typer.Option(
            "--alignment",
            metavar="auto|commanded|period|phase|model",
            help="How the two-cycle difference lays free and loaded motion over one another; auto "
            "takes what has the smallest error on this log.",
        ),
    ] = "auto"
    low_pass: Annotated[
        str,
        typer.Option(
            "--low-pass", metavar="auto|none|HZ", help="Zero-phase low-pass of that difference."
        ),
    ] = "auto"

    def choice(self) -> "FreeChoice":
        """The choice that the options state.

        Raises:
            ParameterError: If a span is malformed.
            ReferenceTorqueError: If cycles, alignment or cutoff are not what there is.
        """
        from vftcli.repetition.choice import FreeChoice

        return FreeChoice.parsed(**self.words())


@dataclass(frozen=True, kw_only=True)
class BiasOptions(Bundle):
    """What is taken off the estimates once the whole log is known."""

    remove_bias: Annotated[
        str | None,
        typer.Option(
            "--remove-bias",
            metavar="free-cycle|model|none",
            help="Subtract what the observers read in free motion at the same phase, or a model of "
            "it over position and velocity. Default: none.",
        ),
    ] = None

    def choice(self) -> "RefinementChoice":
        """The choice that the options state.

        Raises:
            ParameterError: If there is no such way to remove a bias.
        """
        from vftcli.refinement.choice import RefinementChoice

        return RefinementChoice.parsed(**self.words())


@dataclass(frozen=True, kw_only=True)
class RefinementOptions(BiasOptions):
    """What only a complete log allows."""

    bands: Annotated[
        bool,
        typer.Option("--bands", help="Measure on the free part how far the estimates may be off."),
    ] = False


@dataclass(frozen=True, kw_only=True)
class WrenchOptions(Bundle):
    """The Cartesian wrench."""

    wrench: Annotated[
        bool, typer.Option("--wrench", help="Also the Cartesian wrench, as force on the robot.")
    ] = False
    frame: Annotated[
        str | None,
        typer.Option(
            "--frame",
            metavar="flange|base|tool|sensor",
            help="Frame of the wrench (default flange; base: base axes, moment about the flange "
            "point). Implies --wrench.",
        ),
    ] = None
    solver: Annotated[
        str | None,
        typer.Option(
            "--solver",
            metavar="pinv|damped|map",
            help="How torques become a wrench: least squares (default), damped, or with a prior of "
            "50 N and 10 N·m. Implies --wrench.",
        ),
    ] = None
    tool: Annotated[
        str | None,
        typer.Option(
            "--tool",
            metavar="POSE|NAME",
            help="The tool on the flange: x,y,z[,roll,pitch,yaw] [m, rad], or [tool.NAME] of the "
            "robot file.",
        ),
    ] = None
    sensor_pose: Annotated[
        str | None,
        typer.Option(
            "--sensor-pose",
            metavar="POSE|NAME|fit",
            help="The force/torque sensor on the flange, likewise; fit estimates it from the log.",
        ),
    ] = None
    zero: Annotated[
        list[str] | None,
        typer.Option(
            "--zero",
            metavar="A:B|start|LOG",
            help="Unloaded span whose mean wrench is removed, the unloaded start, or a free run. "
            "Repeat A:B to see the drift between spans. Implies --wrench.",
        ),
    ] = None
    sensor_weight: Annotated[
        bool,
        typer.Option(
            "--sensor-weight",
            help="Weigh the sensor's own tool in the unloaded spans and remove it from its "
            "reading.",
        ),
    ] = False
    torque_sd: Annotated[
        str | None,
        typer.Option(
            "--torque-sd",
            metavar="own|NUMBER(S)",
            help="Joint torque error behind the wrench's band [N·m]; own: the observer's "
            "covariance.",
        ),
    ] = None

    @property
    def asks(self) -> bool:
        """Whether any of the options is given: each asks for a wrench."""
        return any(self.words().values())

    def choice(self) -> "WrenchChoice | None":
        """The choice that the options state, None where none of them asks for a wrench.

        Raises:
            ParameterError: If a frame or solver does not exist, or a zero is malformed.
        """
        if not self.asks:
            return None
        from vftcli.virtual_sensor.choice import WrenchChoice

        return WrenchChoice.parsed(**self.words())


@dataclass(frozen=True, kw_only=True)
class ReferenceOptions(Bundle):
    """What the estimates are compared with."""

    reference: Annotated[str | None, REFERENCE] = None
    reference_columns: Annotated[
        str | None,
        typer.Option(
            "--reference-columns",
            metavar="SPEC",
            help="Columns of a reference file, as --columns: 't,tau_ext:6'.",
        ),
    ] = None
    contacts: Annotated[
        bool,
        typer.Option(
            "--contacts",
            help="Also detection delay, false alarms per hour and missed contacts against the "
            "reference.",
        ),
    ] = False

    def choice(self) -> "ReferenceChoice | None":
        """The choice that the options state, None where no reference is named.

        Raises:
            ReferenceTorqueError: If there is no such reference.
        """
        if self.reference is None:
            return None
        from vftcli.evaluation.reference_choice import ReferenceChoice

        return ReferenceChoice.parsed(**self.words())


@dataclass(frozen=True, kw_only=True)
class RequiredReferenceOptions(ReferenceOptions):
    """The same where nothing can be shown without a reference."""

    reference: Annotated[str, REFERENCE]


@dataclass(frozen=True, kw_only=True)
class AnalysisOptions(Bundle):
    """All that can be asked of a log but what it is compared with."""

    reading: ReadOptions
    robot: RobotOptions
    observers: ObserverOptions
    free: FreeOptions
    refinement: RefinementOptions
    wrench: WrenchOptions

    def choice(
        self, library: "Library", reference: ReferenceOptions | None = None
    ) -> "AnalysisChoice":
        """The choice that the options state, and those of a reference where the command has them.

        Args:
            library: Where the command's logs are read.
            reference: What the estimates are compared with.

        Raises:
            VftError: If a choice cannot be made.
        """
        from vftcli.pipeline import AnalysisChoice

        return AnalysisChoice(
            read=self.reading.choice(),
            robot=self.robot.choice(),
            observers=self.observers.choice(),
            free=self.free.choice(),
            refinement=self.refinement.choice(),
            wrench=self.wrench.choice(),
            reference=reference.choice() if reference is not None else None,
            library=library,
        )
