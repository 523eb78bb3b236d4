"""From a log's baseline to finished estimates: bands drawn, bias removed, limits named."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from vftcli.observers.auto_tuning import AutoTuned, Curve, bound_remarks
from vftcli.observers.observer import Observer
from vftcli.refinement.band import band_remarks, with_band
from vftcli.refinement.baseline import Baseline, free_reading
from vftcli.refinement.bias import REMOVALS
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
    remove = REMOVALS[removal]
    pairs = list(zip(observers, estimates, strict=True))
    readings = [free_reading(found, observer, estimate) for observer, estimate in pairs]
    finished = remove(found, readings)
    spectra = found.spectra
    budgets = [] if spectra is None else [budget(found, spectra, reading) for reading in readings]
    curves = {o.name: o.curve for o in observers if isinstance(o, AutoTuned) and o.curve}
    return Refinement(
        estimates=tuple(with_band(found, reading) for reading in finished.readings),
        baseline=found,
        curves=curves,
        budgets=tuple(budgets),
        consistency=tuple(c for o, e in pairs if (c := consistency(found, o, e)) is not None),
        removed=removal,
        remarks=(
            *found.remarks,
            *(
                fact(
                    "tuned",
                    Where(about=name),
                    omega_n_rad_s=curve.best.tolist(),
                    expected_rmse_Nm=curve.least.tolist(),
                )
                for name, curve in curves.items()
            ),
            *(
                remark
                for name, curve in curves.items()
                for remark in bound_remarks(name, curve.best, curve.omega_n)
            ),
            *band_remarks(found),
            *finished.remarks,
            *(limits_remark(one, found.stuck) for one in budgets[-1:]),
        ),
    )
