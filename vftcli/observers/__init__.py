"""Disturbance observers: p and μ of a log in, external torque out.

Here is the user's choice of them: their names, gains and form.
"""

from collections.abc import Sequence
from dataclasses import field, replace
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from vftcli.signals.errors import ParameterError
from vftcli.signals.option import ESTIMATE, NUMBERS, Choice, Option, names_at
from vftcli.signals.packages import door
from vftcli.signals.parsing import check_known

if TYPE_CHECKING:
    from vftcli.observers.observer import Observer, Tuning
    from vftcli.observers.paper import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
    from vftcli.observers.table import LogSpectra, Settings
    from vftcli.observers.tuning import Goal
    from vftcli.robots.robot import Robot
    from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque
    from vftcli.signals.remarks import Remark
else:
    __getattr__ = door(__name__, "observer", "paper")

__all__ = ["FilteredDynamicsObserver", "KalmanObserver", "MomentumObserver", "Observer", "Tuning"]

#: The word for the gains of the robot's file, the paper's if it has them.
PAPER_GAINS = "paper"
LOG_GAINS = "auto"  #: The word for gains from the spectra of the log.


def settings_of(words: Sequence[str]) -> "Settings":
    """The parameters of ``OBSERVER.PARAMETER=VALUE`` words."""
    from vftcli.observers.table import parse_settings

    return parse_settings(words)


def source_of(source: str | Path) -> "str | Path | Goal":
    """Source of gains: `PAPER_GAINS`, `LOG_GAINS`, a goal for all, or a file."""
    text = str(source)
    if text in {PAPER_GAINS, LOG_GAINS}:
        return text
    if text.startswith(("delay=", "bandwidth=")):
        from vftcli.observers.tuning import parse_goal

        return parse_goal(text, allowed=("delay", "bandwidth"))
    if text.startswith("false-alarms="):
        raise ParameterError(
            f"--gains {text}: vftcli identify --method gains writes a file for this goal; give its "
            "name"
        )
    return Path(text)


class ObserverChoice(Choice):
    """Observers to run, and their gains."""

    GROUP = ESTIMATE

    #: Keys of `table.OBSERVERS`. None for `DEFAULT`, or for the paper's four
    #: with its formulas or a common goal.
    names: Annotated[
        tuple[str, ...],
        Option(
            "--observer",
            "NAME",
            "Run this observer. Repeatable (help observers).",
            several=True,
            completes=names_at("observers.table:OBSERVERS"),
        ),
    ] = ()
    #: Whether to leave out what could not run online.
    causal: Annotated[bool, Option("--causal", "", "Use only what could run online.")] = False
    #: The user's parameters, which override every file's.
    settings: Annotated[
        "Settings",
        Option(
            NUMBERS,
            "OBSERVER.NUMBER",
            "One, or one per joint: gmo.gain=5,3,4,10,10,10, kfo.noise_convention=density.",
            settings_of,
            several=True,
            completes=names_at("observers.table:NUMBERS"),
        ),
    ] = field(default_factory=dict)
    #: `PAPER_GAINS` or `LOG_GAINS`, for observers without their own.
    gains: Annotated[
        "str | Path | Goal",
        Option(
            "--gains",
            "SOURCE",
            "Take gains from auto, paper, FILE... (help gains).",
            source_of,
            completes=lambda: (LOG_GAINS, PAPER_GAINS, "delay=", "bandwidth=", "false-alarms="),
        ),
    ] = PAPER_GAINS
    #: Whether to use the paper's printed formulas and numeric dynamics.
    as_printed: Annotated[
        bool, Option("--as-printed", "", "Use the paper's formulas as printed.")
    ] = False
    #: Whether estimates start at the first sample's static residual.
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
    def takes(cls, name: str) -> bool:
        """Whether a name is one of an observer's numbers, as ``gmo.gain``."""
        from vftcli.observers.table import SECTIONS

        return name.partition(".")[0] in SECTIONS

    @property
    def match(self) -> "Goal | None":
        """The goal that every observer shares on every joint, or None."""
        return None if isinstance(self.gains, str | Path) else self.gains

    @property
    def from_spectra(self) -> bool:
        """Whether an observer has gains from the log's spectra."""
        from vftcli.observers.table import OBSERVERS

        return self.gains_of_log or any(OBSERVERS[name].from_spectra for name in self.names)

    @property
    def gains_of_log(self) -> bool:
        """Whether observers without own gains have the log's."""
        return self.gains == LOG_GAINS

    @property
    def of_robot_file(self) -> bool:
        """Whether all observers run with the robot file's gains."""
        return self.gains == PAPER_GAINS and not self.settings

    def beside_print(self) -> "ObserverChoice":
        """The choice beside a printed table: without a default `best`."""
        from vftcli.observers.table import DEFAULT, PAPER

        return replace(self, names=PAPER) if self.names == DEFAULT else self

    def build(
        self, robot: "Robot", step: float, shown: "LogSpectra | None" = None
    ) -> "tuple[tuple[Observer, ...], tuple[Remark, ...]]":
        """Observers for one robot and sample time [s], with remarks on unset gains.

        Raises:
            ParameterError: If a gain is out of range, or a match cannot be reached.
        """
        from vftcli.observers import table
        from vftcli.signals.remarks import caution

        shown, gains = shown or table.LogSpectra(), robot.gains
        table.check_gains(gains, str(robot.path or robot.name))
        if self.gains_of_log:
            gains = table.overlay_gains(gains, shown.gains or {})
        elif isinstance(self.gains, Path):
            gains = table.overlay_gains(gains, table.load_gains(self.gains))
        setup = table.Setup(gains, self.settings, robot.joints, step, self.as_printed, shown)
        if self.gains_of_log:
            # the convention of a log's gains, and so of their fallback
            setup = table.read_as("density", setup)
        observers, remarks = table.build_observers(self.names, setup)
        if self.gains_of_log and shown.gains is None:
            remarks = (*remarks, caution("gains-without-free-part"))
        if self.match is None:
            return observers, remarks
        from vftcli.observers.tuning import match_observers

        if self.as_printed:
            raise ParameterError(
                "--gains tunes the corrected observers; the printed ones have another response. "
                "Leave --gains or --as-printed out"
            )
        observers, on_match = match_observers(observers, self.match, step, robot.joints)
        return observers, (*remarks, *on_match)

    def run(self, observer: "Observer", terms: "DynamicsTerms") -> "ExternalTorque":
        """Estimate of one of the observers over a log, from zero or from rest.

        From rest it is as if the log's first sample had lasted for long. Then τ̂⁰ = −μ⁰ where
        unbiased, by ṗ = μ + τ_ext; from zero a log that begins in contact rises over some delays.
        """
        if not self.from_rest:
            return observer.estimate(terms)
        import numpy as np

        from vftcli.signals.external_torque import DynamicsTerms

        step = terms.clock.step
        count = lead_samples(observer, step, terms.joints)
        before = terms.t[0] - step * np.arange(count, 0, -1)
        p, mu = (np.vstack([x[:1].repeat(count, axis=0), x]) for x in (terms.p, terms.mu))
        found = observer.estimate(DynamicsTerms(t=np.concatenate([before, terms.t]), p=p, mu=mu))
        sd = None if found.sd is None else found.sd[count:]
        return replace(found, t=terms.t, tau=found.tau[count:], sd=sd)


LEAD = 60.0  #: Rest before a log, in 1/ω_n of the slowest joint.
LONGEST = 1 << 17  #: Samples of that time at most.
SETTLED = 0.01  #: Share of its start left in a settled estimate.


def settling_samples(observer: "Observer", step: float, joints: int) -> int:
    """Samples until `SETTLED` of a start is left, 0 of a smoother; step in s."""
    import numpy as np

    from vftcli.signals.external_torque import DynamicsTerms

    samples = 2 + lead_samples(observer, step, joints)
    zero = np.zeros((samples, joints))
    terms = DynamicsTerms(t=step * np.arange(float(samples)), p=zero, mu=zero - 1.0)
    answer = observer.estimate(terms).tau
    left = abs(answer - answer[-1]).max(axis=1)
    return int(np.flatnonzero(left > SETTLED * abs(answer[-1]).max()).max(initial=-1)) + 1


def lead_samples(observer: "Observer", step: float, joints: int) -> int:
    """Samples in which an observer forgets its past. [s] → count"""
    slowest = float(observer.tuning(step, joints).omega_n.min())
    return min(LONGEST, max(1, ceil(LEAD / (slowest * step))))


class GoalChoice(Choice):
    """Goal of gains."""

    GROUP = ESTIMATE

    gains: Annotated[str, ObserverChoice.option("gains", reads=None)] = LOG_GAINS
    threshold: Annotated[
        str | None, Option("alarm.threshold", "NUMBER(S)", "Alarm above this torque [N·m].")
    ] = None
