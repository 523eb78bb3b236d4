"""The options of the commands, each declared once, in one bundle a choice.

A room says what its words mean and checks them, in the `parsed` of its choice; here stands how
they are typed and what `--help` says of them.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.cli.bundles import REQUIRED, Bundle, ChoiceBundle, flag, option

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
ANYWAY = (
    "--anyway",
    "Go on where a finding about the log makes every result meaningless; the outputs say so.",
)
Anyway = Annotated[bool, typer.Option(ANYWAY[0], help=ANYWAY[1])]
Words = list[str] | None
"""The values of an option that may be repeated."""

ROBOT = ("--robot", "NAME|FILE", "Profile, FILE.toml or FILE.urdf.")
FREE = (
    "--free",
    "LOG|A:B",
    "Motion that nobody touched: a free run of the same trajectory, or a span of the log itself. "
    "Repeatable: two free runs measure the floor.",
)
SEED = ("--seed", "N", "Seed of everything drawn; the scenario's own if not given.")
REFERENCE = ("--reference", "REF", "two-cycle, sensor, vendor, zero, or file:PATH.")
REFERENCE_COLUMNS = (
    "--reference-columns",
    "SPEC",
    "Columns of a reference file, as --columns: 't,tau_ext:6'.",
)


class ReadOptions(ChoiceBundle["ReadChoice"]):
    """How a log is read, and which part of it."""

    HOME = "readers.reader:ReadChoice"

    format: str | None = option(
        "--format", "NAME", "Skip recognition; `vftcli formats` lists the names."
    )
    columns: str | None = option(
        "--columns",
        "SPEC",
        "Columns of a table: 't,q:6,dq:6,current:6' in file order, or "
        "'q=joint_pos_{i},tau=eff_{i}' by header.",
    )
    interval: str | None = option(
        "--interval", "A:B", "Use only this time span, in seconds from the first sample."
    )
    effort: str | None = option(
        "--effort",
        "auto|current|torque|torque-without-gravity",
        "What the log's effort is, whatever it is called; auto takes what the robot's model "
        "explains best, and says so.",
    )


class RobotOptions(ChoiceBundle["RobotChoice"]):
    """Which arm, and how it is modelled."""

    HOME = "robots.choice:RobotChoice"

    robot: str | None = option(*ROBOT)
    friction: str | None = option(
        "--friction", "profile|none", "The robot's friction model (default), or none."
    )
    payload: str | None = option(
        "--payload",
        "NAME",
        "Mount a [payload.NAME] of the robot file; log: the one that the log declares.",
    )


class ObserverOptions(ChoiceBundle["ObserverChoice"]):
    """Which observers run, and with which gains."""

    HOME = "observers.choice:ObserverChoice"

    observer: Words = option(
        "--observer", "NAME", "Repeatable. Default: best fdo gmo kfo-fe kfo-zoh; of admit: kfo-fe."
    )
    causal: bool = flag(
        "--causal", "Leave out what could not run while the log is written: best, and smoothers."
    )
    assignments: Words = option(
        "--set",
        "OBSERVER.PARAMETER=VALUE",
        "Repeatable: gmo.gain=30, gmo.gain=5,3,4,10,10,10, kfo.noise_convention=discrete.",
    )
    gains: str | None = option(
        "--gains",
        "auto|paper|FILE",
        "Gains of the other observers: those the log's spectra call for, the robot file's "
        "(default), or those that `vftcli tune` wrote; --set goes before them.",
    )
    gains_file: Path | None = option("--set-file", "FILE", "The old name of --gains FILE.")
    match: str | None = option(
        "--match",
        "delay=S|bandwidth=HZ",
        "Gains that give every observer the same delay or −3 dB bandwidth on every joint.",
    )
    as_printed: bool = flag("--as-printed", "The paper's printed formulas, errata and all.")


class FreeOptions(ChoiceBundle["FreeChoice"]):
    """What nobody touched, and how it is laid under the log."""

    HOME = "repetition.choice:FreeChoice"

    free: Words = option(*FREE)
    free_part: str | None = option(
        "--free-part",
        "A:B",
        "The same as --free A:B; without either, the log's own free cycles are found.",
    )
    period: float | None = option(
        "--period", "S", "Commanded period of a repeated motion; found if not given."
    )
    free_cycles: str | None = option(
        "--free-cycles", "1|1,2|1-3", "Cycles free of contact; found if not given."
    )
    alignment: str = option(
        "--alignment",
        "auto|commanded|period|phase|model",
        "How the two-cycle difference lays free and loaded motion over one another; auto takes "
        "what has the smallest error on this log.",
        "auto",
    )
    low_pass: str = option(
        "--low-pass", "auto|none|HZ", "Zero-phase low-pass of that difference.", "auto"
    )


class BiasOptions(ChoiceBundle["RefinementChoice"]):
    """What is taken off the estimates once the whole log is known."""

    HOME = "refinement.choice:RefinementChoice"

    remove_bias: str | None = option(
        "--remove-bias",
        "auto|whole-log|free-cycle|model|none",
        "What comes off: the bias fitted to the whole log, what the observers read in free motion "
        "at the same phase, or a model of it over position and velocity. auto: the whole log's for "
        "best, none for the others.",
    )


class WrenchOptions(ChoiceBundle["WrenchChoice | None"]):
    """The Cartesian wrench."""

    HOME = "virtual_sensor.choice:WrenchChoice"

    wrench: bool = flag("--wrench", "Also the Cartesian wrench, as force on the robot.")
    frame: str | None = option(
        "--frame",
        "flange|base|tool|sensor",
        "Frame of the wrench (default flange; base: base axes, moment about the flange point). "
        "Implies --wrench.",
    )
    solver: str | None = option(
        "--solver",
        "smoother|pinv|damped|map",
        "How torques become a wrench: smoothed over the whole log with a band in every pose "
        "(default for best: zero outside of the listed contacts), least squares (default for the "
        "others), damped, or with a prior of "
        "50 N and 10 N·m. Implies --wrench.",
    )
    tool: str | None = option(
        "--tool",
        "POSE|NAME",
        "The tool on the flange: x,y,z[,roll,pitch,yaw] [m, rad], or [tool.NAME] of the robot "
        "file.",
    )
    sensor_pose: str | None = option(
        "--sensor-pose",
        "POSE|NAME|fit",
        "The force/torque sensor on the flange, likewise; fit estimates it from the log.",
    )
    zero: Words = option(
        "--zero",
        "A:B|start|LOG",
        "Unloaded span whose mean wrench is removed, the unloaded start, or a free run. Repeat A:B "
        "to see the drift between spans. Implies --wrench.",
    )
    sensor_weight: bool = flag(
        "--sensor-weight",
        "Weigh the sensor's own tool in the unloaded spans and remove it from its reading.",
    )
    torque_sd: str | None = option(
        "--torque-sd",
        "own|NUMBER(S)",
        "Joint torque error behind the wrench's band [N·m]; own: the observer's covariance.",
    )

    @property
    def asks(self) -> bool:
        """Whether any of the options is given: each asks for a wrench."""
        return any(self.words().values())

    def choice(self) -> "WrenchChoice | None":
        """The choice that the options state, None where none of them asks for a wrench."""
        # What nobody asks for is not even imported.
        return super().choice() if self.asks else None


class ReferenceOptions(ChoiceBundle["ReferenceChoice | None"]):
    """What the estimates are compared with."""

    HOME = "evaluation.reference_choice:ReferenceChoice"

    reference: str | None = option(*REFERENCE)
    reference_columns: str | None = option(*REFERENCE_COLUMNS)
    contacts: bool = flag(
        "--contacts",
        "Also detection delay, false alarms per hour and missed contacts against the reference.",
    )

    def choice(self) -> "ReferenceChoice | None":
        """The choice that the options state, None where no reference is named."""
        return super().choice() if self.reference is not None else None


class NamedReferenceOptions(Bundle):
    """What is taken for true where nothing else is asked of it."""

    reference: str | None = option(*REFERENCE)
    reference_columns: str | None = option(*REFERENCE_COLUMNS)

    def choice(self) -> "ReferenceChoice | None":
        """The choice that the options state, None where no reference is named."""
        return ReferenceOptions(**self.words(), contacts=False).choice()


class RequiredReferenceOptions(ReferenceOptions):
    """The same where nothing can be shown without a reference."""

    reference: str = option(*REFERENCE, REQUIRED)


class AnalysisOptions(Bundle):
    """All that can be asked of a log but what it is compared with."""

    reading: ReadOptions
    robot: RobotOptions
    observers: ObserverOptions
    free: FreeOptions
    refinement: BiasOptions
    wrench: WrenchOptions
    no_contacts: bool = flag("--no-contacts", "Leave the list of contacts out.")
    anyway: bool = flag(*ANYWAY)

    def choice(
        self, library: "Library", reference: ReferenceOptions | None = None
    ) -> "AnalysisChoice":
        """The choice that the options state, and those of a reference where the command has them.

        Args:
            library: Where the command's logs are read.
            reference: What the estimates are compared with.

        Raises:
            VftError: If a word is not what its room takes.
        """
        from vftcli.cli.console import health_of
        from vftcli.pipeline import AnalysisChoice

        return AnalysisChoice(
            read=self.reading.choice(),
            robot=self.robot.choice(),
            observers=self.observers.choice(),
            free=self.free.choice(),
            refinement=self.refinement.choice(),
            wrench=self.wrench.choice(),
            reference=reference.choice() if reference is not None else None,
            contacts=not self.no_contacts,
            library=library,
            examiner=health_of(library, anyway=self.anyway),
        )
