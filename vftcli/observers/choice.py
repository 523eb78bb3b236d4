"""What a user may choose of the observers: which run, with which gains, in which form."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from vftcli.observers.observer import Observer
from vftcli.observers.settings import Gains, Settings, check_gains, load_gains, overlay_gains
from vftcli.observers.table import (
    DEFAULT,
    OBSERVERS,
    Setup,
    build_observers,
    observer_settings,
    sections,
)
from vftcli.robots.robot import Robot
from vftcli.signals.parsing import check_known
from vftcli.signals.remarks import Remark

if TYPE_CHECKING:
    from vftcli.observers.matching import MatchTarget
    from vftcli.observers.spectra import Spectra


@dataclass(frozen=True, kw_only=True)
class ObserverChoice:
    """Which observers run, and what their gains are.

    Attributes:
        names: The observers, keys of `vftcli.observers.table.OBSERVERS`.
        settings: Parameters the user sets, which go before every file's.
        gains_file: A file of gains that go before the robot's own, or None.
        match: What every observer is to have alike on every joint, or None.
        as_printed: Whether the paper's printed formulas run, and its numeric dynamics.

    Raises:
        ParameterError: If there is no such observer.
    """

    names: tuple[str, ...] = DEFAULT
    settings: Settings = field(default_factory=dict)
    gains_file: Path | None = None
    match: "MatchTarget | None" = None
    as_printed: bool = False

    def __post_init__(self) -> None:
        for name in self.names:
            check_known(name, OBSERVERS, f"no observer {name!r}")

    @classmethod
    def parsed(
        cls,
        *,
        observer: Sequence[str] | None = None,
        assignments: Sequence[str] | None = None,
        gains_file: Path | None = None,
        match: str | None = None,
        as_printed: bool = False,
    ) -> "ObserverChoice":
        """The choice that the options of a command state.

        Args:
            observer: The names of every ``--observer``; `DEFAULT` if none.
            assignments: ``observer.parameter=VALUE`` of every ``--set``.
            gains_file: See the attribute.
            match: ``delay=S`` or ``bandwidth=HZ``.
            as_printed: See the attribute.

        Raises:
            ParameterError: If a name or parameter does not exist, or a value is malformed.
        """
        target = None
        if match is not None:
            from vftcli.observers.matching import parse_target

            target = parse_target(match)
        return cls(
            names=tuple(observer or DEFAULT),
            settings=observer_settings(assignments or ()),
            gains_file=gains_file,
            match=target,
            as_printed=as_printed,
        )

    @property
    def from_spectra(self) -> bool:
        """Whether an observer takes its gains from what the complete log shows."""
        return any(OBSERVERS[name].from_spectra for name in self.names)

    def build(
        self, robot: Robot, step: float, spectra: "Spectra | None" = None
    ) -> tuple[tuple[Observer, ...], tuple[Remark, ...]]:
        """Build the observers for one robot and sample time, with remarks on gains nobody gave.

        Args:
            robot: The arm, whose file gives the gains that are not set here.
            step: Sample time. [s]
            spectra: What the log shows of noise and contact, None where its free part is not known.

        Raises:
            ParameterError: If a gain is out of range, or a match cannot be reached.
        """
        check_gains(robot.gains, sections(), str(robot.path or robot.name))
        setup = Setup(
            gains=self.gains_over(robot.gains),
            settings=self.settings,
            joints=robot.joints,
            step=step,
            as_printed=self.as_printed,
            spectra=spectra,
        )
        observers, remarks = build_observers(self.names, setup)
        if self.match is None:
            return observers, remarks
        from vftcli.observers.matching import match_observers

        observers, on_match = match_observers(observers, self.match, setup)
        return observers, (*remarks, *on_match)

    def gains_over(self, gains: Gains) -> Gains:
        """A robot's gains with those of the gains file put over them."""
        if self.gains_file is None:
            return gains
        return overlay_gains(gains, load_gains(self.gains_file, sections()))
