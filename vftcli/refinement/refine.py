"""From a log's baseline to finished estimates: bands drawn, limits named.

Gains from a log's spectra and a clock with gaps may together be more than numbers can hold. On such
a joint the momentum observer, which adds up its input, replaces it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vftcli.observers.auto_tuning import AutoTuned, Curve, bound_remarks
from vftcli.observers.choice import ObserverChoice
from vftcli.observers.observer import Complex, Observer, Tuning
from vftcli.observers.table import BEST
from vftcli.refinement.band import band_remarks, with_band
from vftcli.refinement.baseline import Baseline, Baselines, free_reading
from vftcli.refinement.choice import AUTOMATIC
from vftcli.refinement.limits import Budget, budget, expected_gap, limits_remark
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, Mask, handed_over
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.signals.shown import Shown
from vftcli.signals.wrench import ExternalTorque


@dataclass(frozen=True, kw_only=True, repr=False)
class SparedObserver(Shown):
    """An observer with some of its joints left to another."""

    observer: Observer  #: Whose name it has.
    spare: Observer  #: Who does those joints.
    lost: Mask  #: Which they are. (n,)

    @property
    def name(self) -> str:
        """Its name at the command line."""
        return self.observer.name

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """Run over a whole log; without the filter's own deviation, which the spare has not."""
        own, spare = (o.estimate(terms).tau for o in (self.observer, self.spare))
        tau = handed_over(np.where(self.lost, spare, own))
        return ExternalTorque(name=self.name, t=terms.t, tau=tau)

    def tuning(self, step: float, joints: int) -> Tuning:
        """What the parameters mean at a sample time. [s]"""
        own, spare = (o.tuning(step, joints) for o in (self.observer, self.spare))
        mixed: dict[str, Array] = {
            name: np.where(self.lost, getattr(spare, name), getattr(own, name))
            for name in ("omega_n", "zeta", "delay", "bandwidth", "dc_gain")
        }
        return Tuning(**mixed, parameter_count=own.parameter_count)

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Complex gain from external torque to estimate at `frequency` [Hz]. (F, n)"""
        with np.errstate(all="ignore"):  # skip what is no number
            own, spare = (
                o.frequency_response(frequency, step, joints) for o in (self.observer, self.spare)
            )
        mixed: Complex = np.where(self.lost, spare, own)
        return mixed


def with_spare(
    found: Baseline, observer: Observer, estimate: ExternalTorque
) -> tuple[Observer, ExternalTorque, tuple[Remark, ...]]:
    """An observer and its estimate, their lost joints left to the momentum observer.

    Returns:
        Both as they are where every joint is finite; and what is said of those that are not.
    """
    lost = np.any(~estimate.known, axis=0)
    if not lost.any():
        return observer, estimate, ()
    log = found.motion.log
    (spare,), _ = ObserverChoice(names=("gmo",)).build(log.robot, log.recording.median_step)
    made = SparedObserver(observer=observer, spare=spare, lost=lost)
    joints = tuple(int(j) + 1 for j in np.flatnonzero(lost))
    said = caution("estimate-without-number", Where(observer.name, joints))
    return made, made.estimate(found.log.terms), (said,)


@dataclass(frozen=True, kw_only=True, repr=False)
class Refinement(Shown):
    """What the complete log makes of its estimates."""

    estimates: tuple[ExternalTorque, ...]  #: The estimates with their bands.
    baselines: Baselines  #: The log's free part and spectra, as the observers have them.
    curves: Mapping[str, Curve]  #: Observer that was tuned → the curve that was minimised.
    #: Where each observer's error comes from, one an observer; none without spectra.
    budgets: tuple[Budget, ...]
    removed: str  #: What ``bias.method`` asked for.
    remarks: tuple[Remark, ...]  #: What the reader of the estimates should know.


def refine(
    found: Baselines,
    observers: Sequence[Observer],
    estimates: Sequence[ExternalTorque],
    removed: str = AUTOMATIC,
    *,
    gains_of_file: bool = False,
) -> Refinement:
    """Give estimates their bands, and say what limits them.

    Args:
        found: What the observers run on.
        observers: The observers.
        estimates: Their estimates, in this order.
        removed: What ``bias.method`` asked for.
        gains_of_file: Whether the paper's observers ran with the gains of the robot's file.
    """
    # Observers may run on different terms: each is measured on its own.
    under = [found.of(observer.name) for observer in observers]
    spared = [with_spare(*each) for each in zip(under, observers, estimates, strict=True)]
    readings = [free_reading(on, *each[:2]) for on, each in zip(under, spared, strict=True)]
    budgets = [
        budget(on, on.spectra, reading)
        for on, reading in zip(under, readings, strict=True)
        if on.spectra is not None
    ]
    curves = {o.name: o.curve for o in observers if isinstance(o, AutoTuned) and o.curve}
    shown = tuple(with_band(*pair) for pair in zip(under, readings, strict=True))
    # Of the most accurate estimate: of `best` if it ran, else of the last.
    leading = [one for one in budgets if one.name == BEST] or budgets[-1:]
    plain = found.plain
    gap = expected_gap(plain, shown, gains_of_file=gains_of_file)
    return Refinement(
        estimates=shown,
        baselines=found,
        curves=curves,
        budgets=tuple(budgets),
        removed=removed,
        remarks=(
            *found.remarks,
            *(remark for _, _, said in spared for remark in said),
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
            *band_remarks(plain),
            *(limits_remark(one, plain.stuck) for one in leading),
            *(() if gap is None else (gap,)),
        ),
    )
