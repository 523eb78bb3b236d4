"""What takes the place of an estimate that is no number on a joint: that of the momentum observer.

Gains from a log's spectra and a clock with gaps may together be more than numbers can hold. The
momentum observer adds up what it is given, and has none of that.
"""

from dataclasses import dataclass

import numpy as np

from vftcli.observers.choice import ObserverChoice
from vftcli.observers.observer import Complex, Observer, Tuning
from vftcli.refinement.baseline import Baseline
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, Mask, handed_over
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, caution
from vftcli.signals.shown import Shown


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
        with np.errstate(all="ignore"):  # what is no number is not taken
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
