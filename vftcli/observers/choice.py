"""A user's choice of observers: their names, gains and form."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

from vftcli.signals.errors import ParameterError
from vftcli.signals.option import ESTIMATE, Choice, Option
from vftcli.signals.parsing import check_known

if TYPE_CHECKING:
    from vftcli.observers.observer import Observer
    from vftcli.observers.table import Gains, LogSpectra, Settings
    from vftcli.observers.tuning import Goal
    from vftcli.robots.robot import Robot
    from vftcli.signals.external_torque import ExternalTorque
    from vftcli.signals.remarks import Remark
    from vftcli.signals.terms import DynamicsTerms

PAPER_GAINS = "paper"  #: The word for the gains of the robot's file, the paper's where it has them.
LOG_GAINS = "auto"  #: The word for the gains that the spectra of the log call for.


def settings_of(words: Sequence[str]) -> "Settings":
    """The parameters of ``OBSERVER.PARAMETER=VALUE`` words.

    Raises:
        ParameterError: If there is no such parameter, or a value is malformed.
    """
    from vftcli.observers.table import parse_settings, sections

    return parse_settings(words, sections())


def goal_of(text: str) -> "Goal":
    """What ``delay=S`` or ``bandwidth=HZ`` asks of every observer alike."""
    from vftcli.observers.tuning import parse_target

    return parse_target(text)


@dataclass(frozen=True, kw_only=True)
class ObserverChoice(Choice):
    """Observers to run, and their gains.

    Raises:
        ParameterError: If there is no such observer, or none of those named could run online.
    """

    GROUP = ESTIMATE

    #: The observers, keys of `vftcli.observers.table.OBSERVERS`, "best" first. None given:
    #: `DEFAULT`, or the paper's four where their own formulas or one footing for all of them is
    #: asked for.
    names: Annotated[
        tuple[str, ...],
        Option(
            "--observer",
            "NAME",
            "Which observers, repeatable. Default: best fdo gmo kfo-fe kfo-zoh; of admit: "
            "kfo-fe; of annotate: kfo-zoh.",
            several=True,
        ),
    ] = ()
    #: Whether to leave out what could not run while the log is being written.
    causal: Annotated[
        bool,
        Option("--causal", "", "Only what could run online. It leaves out best, and smoothers."),
    ] = False
    #: Parameters the user sets, which go before every file's.
    settings: Annotated[
        "Settings",
        Option(
            "--set",
            "OBSERVER.PARAMETER=VALUE",
            "Repeatable: gmo.gain=30, gmo.gain=5,3,4,10,10,10, kfo.noise_convention=density.",
            settings_of,
            several=True,
            seldom=True,
        ),
    ] = field(default_factory=dict)
    #: Which gains the observers have that bring none of their own: `PAPER_GAINS` or `LOG_GAINS`.
    gains: Annotated[
        str,
        Option(
            "--gains",
            "auto|paper|FILE",
            "Gains of all but best (vftcli help gains). Those the log's spectra call for, the "
            "robot file's (default), or those that `vftcli tune` wrote; --set goes before them.",
        ),
    ] = PAPER_GAINS
    #: A file of gains that go before the robot's own, or None.
    gains_file: Annotated[
        Path | None,
        Option("--set-file", "FILE", "The old name of --gains FILE.", seldom=True),
    ] = None
    #: What every observer is to have alike on every joint, or None.
    match: Annotated[
        "Goal | None",
        Option(
            "--match",
            "delay=S|bandwidth=HZ",
            "Gains that give every observer the same delay or −3 dB bandwidth on every joint.",
            goal_of,
            seldom=True,
        ),
    ] = None
    #: Whether the paper's printed formulas run, and its numeric dynamics.
    as_printed: Annotated[
        bool,
        Option("--as-printed", "", "The paper's printed formulas, errata and all.", seldom=True),
    ] = False
    #: Whether estimates start at the static residual of the first sample, not at zero.
    from_rest: bool = False

    def __post_init__(self) -> None:
        from vftcli.observers.table import BEST, DEFAULT, OBSERVERS, PAPER

        alike = self.as_printed or self.match is not None
        names = tuple(dict.fromkeys(self.names)) or (PAPER if alike else DEFAULT)
        for name in names:
            check_known(name, OBSERVERS, f"no observer {name!r}")
        if self.causal:
            online = tuple(name for name in names if OBSERVERS[name].online)
            if not online:
                needs = "needs" if len(names) == 1 else "need"
                raise ParameterError(
                    f"--causal leaves out {', '.join(names)}, which {needs} the complete log; "
                    f"choose of {', '.join(PAPER)} with --observer"
                )
            names = online
        leads = (BEST,) if BEST in names else ()
        object.__setattr__(self, "names", tuple(dict.fromkeys((*leads, *names))))

    @classmethod
    def parsed(
        cls,
        *,
        gains: str | Path | None = None,
        set_file: Path | None = None,
        **words: Any,  # noqa: ANN401 - texts and lists of them
    ) -> Self:
        """The choice that the options of a command state, each the word after its option.

        `gains` is `PAPER_GAINS`, `LOG_GAINS`, or a file of gains; `set_file` is that file under the
        old name of the option.

        Raises:
            ParameterError: If a name or parameter does not exist, or a value is malformed.
        """
        if gains is not None and set_file is not None:
            raise ParameterError("--set-file is the old name of --gains FILE; give one of them")
        if gains in {None, PAPER_GAINS, LOG_GAINS}:
            return super().parsed(gains=gains, set_file=set_file, **words)
        return super().parsed(set_file=Path(str(gains)), **words)

    @property
    def from_spectra(self) -> bool:
        """Whether an observer takes its gains from what the complete log shows."""
        from vftcli.observers.table import OBSERVERS

        return self.gains_of_log or any(OBSERVERS[name].from_spectra for name in self.names)

    @property
    def gains_of_log(self) -> bool:
        """Whether observers without gains of their own have those that the log calls for."""
        return self.gains == LOG_GAINS

    @property
    def of_robot_file(self) -> bool:
        """Whether all observers run with unchanged gains of the robot's file."""
        changed = self.settings or self.gains_file is not None or self.match is not None
        return self.gains == PAPER_GAINS and not changed

    def beside_print(self) -> "ObserverChoice":
        """The choice beside a printed table: without a default `best`."""
        from vftcli.observers.table import DEFAULT, PAPER

        return replace(self, names=PAPER) if self.names == DEFAULT else self

    def build(
        self, robot: "Robot", step: float, shown: "LogSpectra | None" = None
    ) -> "tuple[tuple[Observer, ...], tuple[Remark, ...]]":
        """Observers for one robot and sample time, with remarks on unset gains.

        Args:
            robot: The arm; its file gives the gains that are not set here.
            step: Sample time. [s]
            shown: What the complete log shows of noise and contact, None where its free part is
                not known.

        Raises:
            ParameterError: If a gain is out of range, or a match cannot be reached.
        """
        from vftcli.observers import table
        from vftcli.signals.remarks import caution

        shown = shown or table.NOT_SHOWN
        table.check_gains(robot.gains, table.sections(), str(robot.path or robot.name))
        setup = table.Setup(
            gains=self.gains_over(robot.gains, shown),
            settings=self.settings,
            joints=robot.joints,
            step=step,
            as_printed=self.as_printed,
            shown=shown,
        )
        if self.gains_of_log:
            setup = table.read_as(
                "density", setup
            )  # what a log tunes, and so what it falls back to
        observers, remarks = table.build_observers(self.names, setup)
        if self.gains_of_log and shown.gains is None:
            remarks = (*remarks, caution("gains-without-free-part"))
        if self.match is None:
            return observers, remarks
        from vftcli.observers.tuning import match_observers

        observers, on_match = match_observers(observers, self.match, setup)
        return observers, (*remarks, *on_match)

    def run(self, observer: "Observer", terms: "DynamicsTerms") -> "ExternalTorque":
        """Run one of the observers over a log, from where it is to start."""
        from vftcli.observers.lead import estimate_from_rest

        return estimate_from_rest(observer, terms) if self.from_rest else observer.estimate(terms)

    def gains_over(self, gains: "Gains", shown: "LogSpectra | None" = None) -> "Gains":
        """A robot's gains with those of the log or of the gains file put over them."""
        from vftcli.observers.table import load_gains, overlay_gains, sections

        if self.gains_of_log and shown is not None and shown.gains is not None:
            return overlay_gains(gains, shown.gains)
        if self.gains_file is None:
            return gains
        return overlay_gains(gains, load_gains(self.gains_file, sections()))
