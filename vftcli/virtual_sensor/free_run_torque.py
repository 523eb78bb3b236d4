"""What observers read in a free run, brought to the log: the zero that ``--zero LOG`` removes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.repetition.free_run import FreeRun
from vftcli.signals.arrays import Array, handed_over
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, fact
from vftcli.virtual_sensor.mean_disturbance import mean_disturbance
from vftcli.virtual_sensor.zero import SETTLING


@dataclass(frozen=True, kw_only=True)
class FreeRunTorque:
    """What a free run reads, by observer; the mean disturbance counts as one of them.

    Attributes:
        there: Its torque at the same place of the trajectory, NaN beyond the free run; empty where
            the free run is of another trajectory. (T, n) [N·m]
        mean: Its mean over the free run. (n,) [N·m]
        rms: Its root mean square over the free run. (n,) [N·m]
        remark: How it was brought to the log.
    """

    there: Mapping[str, Array]
    mean: Mapping[str, Array]
    rms: Mapping[str, Array]
    remark: Remark

    def everywhere(self, name: str) -> Array:
        """One observer's torque in every sample, its mean where the free run does not reach.

        Returns:
            (T, n), or (n,) where the free run is of another trajectory. [N·m]
        """
        mean = self.mean[name]
        there = self.there.get(name, mean)
        return np.where(np.isnan(there), mean, there)


def free_run_torque(run: FreeRun, observers: Sequence[Observer]) -> FreeRunTorque:
    """What a free run reads, at the same place of the trajectory where it is the log's.

    The first `SETTLING` seconds count for no mean, since observers rise from zero.

    Args:
        run: The free run beside its log.
        observers: The observers that run over it.
    """
    terms = run.run.terms
    read = (*(o.estimate(terms) for o in observers), mean_disturbance(terms))
    settled = terms.t - terms.t[0] >= min(SETTLING, 0.5 * float(terms.t[-1] - terms.t[0]))
    where, there = Where(run.recording.name), {}
    remark = fact("zero-mean-of-free-run", where)
    if run.is_same_motion:
        remark = fact("zero-from-free-run", where, shift_s=run.alignment.shift)
        there = {e.name: run.pairing.there(e.tau) for e in read}
    return FreeRunTorque(
        there=there,
        mean={e.name: e.tau[settled].mean(axis=0) for e in read},
        rms={e.name: np.sqrt(np.mean(e.tau[settled] ** 2, axis=0)) for e in read},
        remark=remark,
    )


def less_free_run(
    torques: Sequence[ExternalTorque], free_run: FreeRunTorque | None
) -> tuple[ExternalTorque, ...]:
    """Torques less what a free run reads at the same place, or less its mean; as they are for None.

    Args:
        torques: Torques of the observers that ran over the free run too.
        free_run: What it reads.
    """
    if free_run is None:
        return tuple(torques)
    there, mean = free_run.there, free_run.mean
    return tuple(
        replace(e, tau=handed_over(e.tau - there.get(e.name, mean[e.name]))) for e in torques
    )
