"""From a survey of the log to finished estimates: bias removed, bands drawn, limits named."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from vftcli.observers.auto_tuning import AutoTuned, Curve
from vftcli.observers.observer import Observer
from vftcli.refinement.bands import band_notes, with_band
from vftcli.refinement.baseline import Baseline
from vftcli.refinement.bias import REMOVALS, check_removal
from vftcli.refinement.budget import Budget, budget, sentence
from vftcli.refinement.consistency import Consistency, consistency
from vftcli.robots.robot import Robot
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """What the complete log told of its estimates.

    Attributes:
        survey: Its free part and spectra.
        curves: Observer that was tuned → the curve that was minimised.
        budgets: Where each observer's error comes from, one an observer; none without spectra.
        consistency: How each Kalman filter's innovations look, one a filter.
        removed: What ``--remove-bias`` asked for.
        notes: One sentence each.
    """

    survey: Baseline
    curves: Mapping[str, Curve]
    budgets: tuple[Budget, ...]
    consistency: tuple[Consistency, ...]
    removed: str
    notes: tuple[str, ...]


def work_up(
    found: Baseline,
    recording: Recording,
    robot: Robot,
    observers: Sequence[Observer],
    estimates: Sequence[ExternalTorque],
    removal: str = "none",
) -> tuple[tuple[ExternalTorque, ...], Refinement]:
    """Give estimates their bands, take their bias off, and say what limits them.

    Args:
        found: The survey of the log.
        recording: The log.
        robot: The arm, for what stiction may hide.
        observers: The observers.
        estimates: Their estimates, in the same order.
        removal: A key of `REMOVALS`.

    Raises:
        ParameterError: If the bias cannot be removed as asked.
    """
    remove = REMOVALS[check_removal(removal)]
    pairs = list(zip(observers, estimates, strict=True))
    banded = [with_band(found, observer, estimate) for observer, estimate in pairs]
    finished, notes = remove(found, recording, observers, banded)
    budgets: tuple[Budget, ...] = ()
    if found.spectra is not None:
        budgets = tuple(budget(found, recording, robot, o, e) for o, e in pairs)
    curves = {o.name: o.curve for o in observers if isinstance(o, AutoTuned) and o.curve}
    limits = (sentence(budgets[-1], found),) if budgets else ()
    return finished, Refinement(
        survey=found,
        curves=curves,
        budgets=budgets,
        consistency=tuple(c for o, e in pairs if (c := consistency(found, o, e)) is not None),
        removed=removal,
        notes=(*found.notes, *tuning_notes(curves), *band_notes(found), *notes, *limits),
    )


def tuning_notes(curves: Mapping[str, Curve]) -> tuple[str, ...]:
    """What was chosen for each tuned observer."""
    return tuple(
        f"{name}: ω_n {', '.join(f'{w:.3g}' for w in curve.best)} rad/s on J1…, ζ 0.707; expected "
        f"rmse {', '.join(f'{e:.2g}' for e in curve.least)} N·m"
        for name, curve in curves.items()
    )
