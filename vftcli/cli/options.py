"""The options of the commands, each declared once, in one bundle a choice.

A room says what its words mean and checks them, in the `parsed` of its choice; here stands how
they are typed and what `--help` says of them.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.cli import help as headings
from vftcli.cli.bundles import REQUIRED, Bundle, ChoiceBundle, flag, option
from vftcli.cli.log_options import ReadOptions, RobotOptions, Words

if TYPE_CHECKING:
    from vftcli.evaluation.reference_choice import ReferenceChoice
    from vftcli.observers.choice import ObserverChoice
    from vftcli.outputs.log.choice import OutputChoice
    from vftcli.pipeline import AnalysisChoice
    from vftcli.readers.library import Library
    from vftcli.refinement.choice import RefinementChoice
    from vftcli.repetition.choice import FreeChoice
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
    Path,
    typer.Option(
        "-o",
        "--output",
        metavar="DIR",
        help="Folder to write into.",
        rich_help_panel=headings.WRITE,
    ),
]
Force = Annotated[
    bool,
    typer.Option("--force", help="Overwrite what exists.", rich_help_panel=headings.WRITE),
]
Json = Annotated[
    bool,
    typer.Option(
        "--json",
        help="JSON on stdout. It is what the command makes: rows, a run record, a summary.",
        rich_help_panel=headings.OUTPUT,
    ),
]
Open = Annotated[
    bool,
    typer.Option(
        "--open",
        help="Open what was made. The page in the browser, else the recording (--rrd).",
        rich_help_panel=headings.OUTPUT,
    ),
]
ANYWAY = (
    "--anyway",
    "Go on where a finding makes results meaningless. The outputs say so.",
)
FREE = (
    "--free",
    "LOG|A:B",
    "Motion that nobody touched: another log, or a span. Repeatable: two free runs of the same "
    "trajectory measure the floor.",
)
SEED = ("--seed", "N", "Seed of everything drawn; the scenario's own if not given.")
REFERENCE = ("--reference", "REF", "two-cycle, sensor, vendor, zero, or file:PATH.")
REFERENCE_COLUMNS = (
    "--reference-columns",
    "SPEC",
    "Columns of a reference file, as --columns: 't,tau_ext:6'.",
)


class ObserverOptions(ChoiceBundle["ObserverChoice"]):
    """Which observers run, and with which gains."""

    GROUP = headings.ESTIMATE
    HOME = "observers.choice:ObserverChoice"

    observer: Words = option(
        "--observer",
        "NAME",
        "Which observers, repeatable. Default: best fdo gmo kfo-fe kfo-zoh; of admit: "
        "kfo-fe; of annotate: kfo-zoh.",
    )
    causal: bool = flag(
        "--causal", "Only what could run online. It leaves out best, and smoothers."
    )
    assignments: Words = option(
        "--set",
        "OBSERVER.PARAMETER=VALUE",
        "Repeatable: gmo.gain=30, gmo.gain=5,3,4,10,10,10, kfo.noise_convention=density.",
        seldom=True,
    )
    gains: str | None = option(
        "--gains",
        "auto|paper|FILE",
        "Gains of all but best (vftcli help gains). Those the log's spectra call for, the robot "
        "file's (default), or those that `vftcli tune` wrote; --set goes before them.",
    )
    gains_file: Path | None = option(
        "--set-file", "FILE", "The old name of --gains FILE.", seldom=True
    )
    match: str | None = option(
        "--match",
        "delay=S|bandwidth=HZ",
        "Gains that give every observer the same delay or −3 dB bandwidth on every joint.",
        seldom=True,
    )
    as_printed: bool = flag(
        "--as-printed", "The paper's printed formulas, errata and all.", seldom=True
    )


class FreeOptions(ChoiceBundle["FreeChoice"]):
    """What nobody touched, and how it is laid under the log."""

    GROUP = headings.LOG
    HOME = "repetition.choice:FreeChoice"

    free: Words = option(*FREE)
    free_part: str | None = option(
        "--free-part",
        "A:B",
        "The same as --free A:B; without either, the log's own free cycles are found.",
        seldom=True,
    )
    period: float | None = option(
        "--period", "S", "Commanded period of a repeated motion; found if not given.", seldom=True
    )
    free_cycles: str | None = option(
        "--free-cycles", "1|1,2|1-3", "Cycles free of contact; found if not given.", seldom=True
    )
    alignment: str = option(
        "--alignment",
        "auto|commanded|period|phase|model",
        "How the two-cycle difference lays free and loaded motion over one another; auto takes "
        "what has the smallest error on this log.",
        "auto",
        seldom=True,
    )
    low_pass: str = option(
        "--low-pass", "auto|none|HZ", "Zero-phase low-pass of that difference.", "auto", seldom=True
    )


class BiasOptions(ChoiceBundle["RefinementChoice"]):
    """What is taken off the estimates once the whole log is known."""

    GROUP = headings.ESTIMATE
    HOME = "refinement.choice:RefinementChoice"

    remove_bias: str | None = option(
        "--remove-bias",
        "auto|whole-log|none",
        "Whether the bias fitted to the whole log comes off; auto: for best alone.",
        seldom=True,
    )


class WrenchOptions(ChoiceBundle["WrenchChoice | None"]):
    """The Cartesian wrench."""

    GROUP = headings.WRENCH
    HOME = "virtual_sensor.choice:WrenchChoice"

    wrench: bool = flag("--wrench", "Also the wrench, as force on the robot.")
    frame: str | None = option(
        "--frame",
        "flange|base|tool|sensor",
        "Its frame; default flange. See vftcli help frames. base: base axes, moment about the "
        "flange point. Implies --wrench.",
    )
    solver: str | None = option(
        "--solver",
        "smoother|pinv|map",
        "How torques become a wrench: smoothed over the whole log with a band in every pose "
        "(default for best: zero outside of the listed contacts), least squares (default for the "
        "others), or with a prior of 50 N and 10 N·m. Implies --wrench.",
        seldom=True,
    )
    tool: str | None = option(
        "--tool",
        "POSE|NAME",
        "The tool on the flange: x,y,z[,roll,pitch,yaw] [m, rad], or [tool.NAME] of the robot "
        "file.",
        seldom=True,
    )
    sensor_pose: str | None = option(
        "--sensor-pose",
        "POSE|NAME|fit",
        "The force/torque sensor on the flange, likewise; fit estimates it from the log.",
        seldom=True,
    )
    zero: Words = option(
        "--zero",
        "A:B|start",
        "Unloaded span whose mean comes off. Also the unloaded start. Repeat A:B to see the "
        "drift between spans. Implies --wrench.",
    )
    torque_sd: str | None = option(
        "--torque-sd",
        "own|NUMBER(S)",
        "Joint torque error behind the wrench's band [N·m]; own: the observer's covariance.",
        seldom=True,
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

    GROUP = headings.COMPARE
    HOME = "evaluation.reference_choice:ReferenceChoice"

    reference: str | None = option(*REFERENCE)
    reference_columns: str | None = option(*REFERENCE_COLUMNS, seldom=True)
    contacts: bool = flag(
        "--contacts",
        "Judge the listed contacts. Also detection delay, false alarms per hour and missed "
        "contacts of the observers against the reference, with the free part of --free.",
    )

    def choice(self) -> "ReferenceChoice | None":
        """The choice that the options state, None where no reference is named."""
        return super().choice() if self.reference is not None else None


class ExtraOptions(Bundle):
    """What else is written for other programs."""

    GROUP = headings.WRITE

    mcap: bool = flag("--mcap", "Also write estimates.mcap. For ROS 2, Foxglove and PlotJuggler.")
    rrd_detail: str = option(
        "--rrd-detail",
        "full|levels|none",
        "How much of a long log recording.rrd holds. Levels, unless another is given: the lowest "
        "and highest samples of 5000 stretches, every sample where the strongest contacts begin.",
        "levels",
        seldom=True,
    )

    def choice(self, **others: bool) -> "OutputChoice":
        """What is written, with what the command's own options ask for."""
        from vftcli.outputs.log.choice import OutputChoice

        extras = [name for name, wanted in {**others, "mcap": self.mcap}.items() if wanted]
        return OutputChoice.parsed(extras=extras, rrd_detail=self.rrd_detail)


class FigureOptions(Bundle):
    """Figures for a paper."""

    GROUP = headings.WRITE
    figures: str | None = option(
        "--figures", "pdf|svg|png", "Also figures for a paper, one and two columns wide."
    )

    def form(self) -> str | None:
        """What they are written as, checked; None where none are asked for."""
        from vftcli.outputs.figures.paper import checked_form

        return checked_form(self.figures)


class MadeOptions(FigureOptions):
    """What is made: figures too, JSON in place of words, over what is there."""

    json: Json = False
    force: Force = False


class NamedReferenceOptions(Bundle):
    """What is taken for true where nothing else is asked of it."""

    GROUP = headings.COMPARE
    reference: str | None = option(*REFERENCE)
    reference_columns: str | None = option(*REFERENCE_COLUMNS, seldom=True)

    def choice(self) -> "ReferenceChoice | None":
        """The choice that the options state, None where no reference is named."""
        return ReferenceOptions(**self.words(), contacts=False).choice()


class RequiredReferenceOptions(ReferenceOptions):
    """The same where nothing can be shown without a reference."""

    reference: str = option(*REFERENCE, REQUIRED)


class ListingOptions(Bundle):
    """Whether contacts are listed."""

    GROUP = headings.WRITE

    no_contacts: bool = flag("--no-contacts", "Leave the list of contacts out.")


class AnywayOptions(Bundle):
    """Whether results are wanted that mean little."""

    GROUP = headings.LOG
    anyway: bool = flag(*ANYWAY, seldom=True)


class TalkOptions(Bundle):
    """How much a command says."""

    GROUP = headings.OUTPUT

    details: bool = flag("-v/--details", "Everything that is known.")
    quiet: bool = flag("-q/--quiet", "Errors only, and the table or JSON that is asked for.")


class AnalysisOptions(Bundle):
    """All that can be asked of a log but what it is compared with."""

    reading: ReadOptions
    robot: RobotOptions
    observers: ObserverOptions
    free: FreeOptions
    refinement: BiasOptions
    wrench: WrenchOptions
    contacts: ListingOptions
    anyway: AnywayOptions
    talk: TalkOptions

    def choice(
        self,
        library: "Library",
        reference: ReferenceOptions | None = None,
        *,
        on_screen: bool = False,
    ) -> "AnalysisChoice":
        """The choice that the options state, a reference's with it where there is one."""
        from vftcli.cli.console import health_of, stages
        from vftcli.cli.memory import give_back
        from vftcli.pipeline import AnalysisChoice

        give_back()
        return AnalysisChoice(
            read=self.reading.choice(),
            robot=self.robot.choice(),
            observers=self.observers.choice(),
            free=self.free.choice(),
            refinement=self.refinement.choice(),
            wrench=self.wrench.choice(),
            reference=reference.choice() if reference is not None else None,
            contacts=not self.contacts.no_contacts,
            library=library,
            progress=stages(),
            examiner=health_of(library, anyway=self.anyway.anyway, on_screen=on_screen),
        )
