"""From a log's baseline to finished estimates: bands drawn, bias removed, limits named."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vftcli.observers.auto_tuning import AutoTuned, Curve, bound_remarks
from vftcli.observers.observer import Observer
from vftcli.refinement.baseline import Baseline, FreeReading, free_reading
from vftcli.refinement.bias import REMOVALS
from vftcli.refinement.budget import Budget, budget, limits_remark
from vftcli.refinement.consistency import Consistency, consistency
from vftcli.signals.arrays import handed_over
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, caution, fact


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
    banded = [reading._replace(estimate=with_band(found, reading)) for reading in readings]
    finished = remove(found, banded)
    spectra = found.spectra
    budgets = [] if spectra is None else [budget(found, spectra, reading) for reading in readings]
    curves = {o.name: o.curve for o in observers if isinstance(o, AutoTuned) and o.curve}
    return Refinement(
        estimates=finished.estimates,
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


def with_band(found: Baseline, reading: FreeReading) -> ExternalTorque:
    """The estimate with its band, and marked where joints move; itself without spectra.

    The band is how far the estimate may be off, as the log itself shows it,

        sd² = rms_free² + ∫ |1 − H|² S_τ df,

    what the estimator reads where nothing touches the arm, bias and model error included, and what
    its lag and bandwidth leave out of the torque there is. The Kalman covariance knows neither: it
    is the filter's own account, of a model without error, and stands apart (`sd`).
    """
    estimate, spectra = reading.estimate, found.spectra
    if spectra is None:
        return estimate
    response = reading.observer.frequency_response(spectra.frequency, spectra.step, spectra.joints)
    sd = np.sqrt(reading.rms**2 + spectra.missed(response))
    banded = np.broadcast_to(handed_over(sd), estimate.tau.shape)
    return replace(estimate, error_sd=banded, moving=~found.standing)


def band_remarks(found: Baseline) -> tuple[Remark, ...]:
    """What the bands are, and where they do not hold."""
    if found.spectra is None:
        return ()
    stuck = tuple(int(j) + 1 for j in np.flatnonzero(found.stuck))
    limit = (caution("band-of-a-standing-joint", Where(joints=stuck)),) if stuck else ()
    return (fact("band"), *limit)
