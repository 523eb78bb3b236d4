"""From a log's baseline to finished estimates: bands drawn, bias removed, limits named."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from vftcli.observers.auto_tuning import AutoTuned, Curve
from vftcli.observers.observer import Observer
from vftcli.refinement.bands import band_remarks, with_band
from vftcli.refinement.baseline import Baseline, free_reading
from vftcli.refinement.bias import REMOVALS, check_removal
from vftcli.refinement.budget import Budget, budget, limits_remark
from vftcli.refinement.consistency import Consistency, consistency
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, fact


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """What the complete log makes of its estimates.

    Attributes:
        estimates: The estimates with their bands, and without their bias where that is asked for.
        baseline: The log's free part and spectra.
        curves: Observer that was tuned → the curve that was minimised.
        budgets: Where each observer's error comes from, one an observer; none without spectra.
        consistency: How each Kalman filter's innovations look, one a filter.
        removed: What ``--remove-bias`` asked for.
        remarks: What the reader of the estimates should know.
    """

    estimates: tuple[ExternalTorque, ...]
    baseline: Baseline
    curves: Mapping[str, Curve]
    budgets: tuple[Budget, ...]
    consistency: tuple[Consistency, ...]
    removed: str
    remarks: tuple[Remark, ...]


def refine(
    found: Baseline,
    observers: Sequence[Observer],
    estimates: Sequence[ExternalTorque],
    removal: str = "none",
) -> Refinement:
    """Give estimates their bands, take their bias off, and say what limits them.

    Args:
        found: The log's baseline.
        observers: The observers.
        estimates: Their estimates, in the same order.
        removal: A key of `REMOVALS`.

    Raises:
        ParameterError: If the bias cannot be removed as asked.
    """
    remove = REMOVALS[check_removal(removal)]
    pairs = list(zip(observers, estimates, strict=True))
    readings = [free_reading(found, observer, estimate) for observer, estimate in pairs]
    banded = [reading._replace(estimate=with_band(found, reading)) for reading in readings]
    finished = remove(found, banded)
    budgets: tuple[Budget, ...] = ()
    if found.spectra is not None:
        budgets = tuple(budget(found, reading) for reading in readings)
    curves = {o.name: o.curve for o in observers if isinstance(o, AutoTuned) and o.curve}
    return Refinement(
        estimates=finished.estimates,
        baseline=found,
        curves=curves,
        budgets=budgets,
        consistency=tuple(c for o, e in pairs if (c := consistency(found, o, e)) is not None),
        removed=removal,
        remarks=(
            *found.remarks,
            *tuning_remarks(curves),
            *band_remarks(found),
            *finished.remarks,
            *(limits_remark(one, found.stuck) for one in budgets[-1:]),
        ),
    )


def tuning_remarks(curves: Mapping[str, Curve]) -> tuple[Remark, ...]:
    """What was chosen for each tuned observer."""
    return tuple(
        fact(
            "tuned",
            Where(about=name),
            omega_n_rad_s=curve.best.tolist(),
            expected_rmse_Nm=curve.least.tolist(),
        )
        for name, curve in curves.items()
    )
