"""A user's choice of observers: their names, gains and form."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from vftcli.observers.lead import estimate_from_rest
from vftcli.observers.observer import Observer
from vftcli.observers.table import (
    BEST,
    DEFAULT,
    NOT_SHOWN,
    OBSERVERS,
    PAPER,
    Gains,
    LogSpectra,
    Settings,
    Setup,
    build_observers,
    check_gains,
    load_gains,
    overlay_gains,
    parse_settings,
    read_as,
    sections,
)
from vftcli.robots.robot import Robot
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.parsing import check_known
from vftcli.signals.remarks import Remark, caution
from vftcli.signals.terms import DynamicsTerms

if TYPE_CHECKING:
    from vftcli.observers.tuning import Goal

PAPER_GAINS = "paper"  #: The word for the gains of the robot's file, the paper's where it has them.
LOG_GAINS = "auto"  #: The word for the gains that the spectra of the log call for.


@dataclass(frozen=True, kw_only=True)
class ObserverChoice:
    """Observers to run, and their gains.

    Raises:
        ParameterError: If there is no such observer, or none of those named could run online.
    """

    #: The observers, keys of `vftcli.observers.table.OBSERVERS`, "best" first. None given:
    #: `DEFAULT`, or the paper's four where their own formulas or one footing for all of them is
    #: asked for.
    names: tuple[str, ...] = ()
    #: Parameters the user sets, which go before every file's.
    settings: Settings = field(default_factory=dict)
    #: Whose gains the observers have that bring none of their own: `PAPER_GAINS` or `LOG_GAINS`.
    gains: str = PAPER_GAINS
    gains_file: Path | None = None  #: A file of gains that go before the robot's own, or None.
    #: What every observer is to have alike on every joint, or None.
    match: "Goal | None" = None
    as_printed: bool = False  #: Whether the paper's printed formulas run, and its numeric dynamics.
    causal: bool = False  #: Whether to leave out what could not run while the log is being written.
    #: Whether estimates start at the static residual of the first sample, not at zero.
    from_rest: bool = False

    def __post_init__(self) -> None:
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
        observer: Sequence[str] | None = None,
        assignments: Sequence[str] | None = None,
        gains: str | Path | None = None,
        gains_file: Path | None = None,
        match: str | None = None,
        as_printed: bool = False,
        causal: bool = False,
    ) -> "ObserverChoice":
        """The choice that the options of a command state.

        Args:
            observer: The names of every ``--observer``; the default if none.
            assignments: ``observer.parameter=VALUE`` of every ``--set``.
            gains: `PAPER_GAINS`, `LOG_GAINS`, or a file of gains.
            gains_file: The file under the old name of the option.
            match: ``delay=S`` or ``bandwidth=HZ``.
            as_printed: See the attribute.
            causal: See the attribute.

        Raises:
            ParameterError: If a name or parameter does not exist, or a value is malformed.
        """
        target = None
        if match is not None:
            from vftcli.observers.tuning import parse_target

            target = parse_target(match)
        if gains is not None and gains_file is not None:
            raise ParameterError("--set-file is the old name of --gains FILE; give one of them")
        word = str(gains) if gains is not None else PAPER_GAINS
        if word not in {PAPER_GAINS, LOG_GAINS}:
            word, gains_file = PAPER_GAINS, Path(word)
        return cls(
            names=tuple(observer or ()),
            settings=parse_settings(assignments or (), sections()),
            gains=word,
            gains_file=gains_file,
            match=target,
            as_printed=as_printed,
            causal=causal,
        )

    @property
    def from_spectra(self) -> bool:
        """Whether an observer takes its gains from what the complete log shows."""
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
        return replace(self, names=PAPER) if self.names == DEFAULT else self

    def build(
        self, robot: Robot, step: float, shown: LogSpectra = NOT_SHOWN
    ) -> tuple[tuple[Observer, ...], tuple[Remark, ...]]:
        """Observers for one robot and sample time, with remarks on unset gains.

        Args:
            robot: The arm; its file gives the gains that are not set here.
            step: Sample time. [s]
            shown: What the complete log shows of noise and contact, nothing where its free part is
                not known.

        Raises:
            ParameterError: If a gain is out of range, or a match cannot be reached.
        """
        check_gains(robot.gains, sections(), str(robot.path or robot.name))
        setup = Setup(
            gains=self.gains_over(robot.gains, shown),
            settings=self.settings,
            joints=robot.joints,
            step=step,
            as_printed=self.as_printed,
            shown=shown,
        )
        if self.gains_of_log:
            setup = read_as("density", setup)  # what a log tunes, and so what it falls back to
        observers, remarks = build_observers(self.names, setup)
        if self.gains_of_log and shown.gains is None:
            remarks = (*remarks, caution("gains-without-free-part"))
        if self.match is None:
            return observers, remarks
        from vftcli.observers.tuning import match_observers

        observers, on_match = match_observers(observers, self.match, setup)
        return observers, (*remarks, *on_match)

    def run(self, observer: Observer, terms: DynamicsTerms) -> ExternalTorque:
        """Run one of the observers over a log, from where it is to start."""
        return estimate_from_rest(observer, terms) if self.from_rest else observer.estimate(terms)

    def gains_over(self, gains: Gains, shown: LogSpectra = NOT_SHOWN) -> Gains:
        """A robot's gains with those of the log or of the gains file put over them."""
        if self.gains_of_log and shown.gains is not None:
            return overlay_gains(gains, shown.gains)
        if self.gains_file is None:
            return gains
        return overlay_gains(gains, load_gains(self.gains_file, sections()))
