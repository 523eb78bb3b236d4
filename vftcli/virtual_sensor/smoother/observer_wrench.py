"""The smoother as a solver beside the others: from a log and its free motion to a `Wrench`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.repetition.free_load import FreeLoad, without_load
from vftcli.repetition.free_motion import FreeMotion
from vftcli.robots.chain import link_poses
from vftcli.robots.run import Run, RunSamples
from vftcli.signals.arrays import Mask, handed_over
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.series import resample_columns
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.frames import from_base
from vftcli.virtual_sensor.smoother.prior import WrenchPrior
from vftcli.virtual_sensor.smoother.smoothing import SmoothedWrench, prior_of, smooth_wrench
from vftcli.virtual_sensor.virtual_sensor import CHUNK, VirtualSensor


class Gate(NamedTuple):
    """The contacts of a log, outside of which nothing touches the arm."""

    spans: Sequence[tuple[float, float]]  #: From and to of every contact. [s]
    #: How their wrench moves, as the contacts themselves show it; None to choose it.
    prior: WrenchPrior | None = None


class FreeLog(NamedTuple):
    """A log as an observer has it, and what nobody touched."""

    run: Run  #: The log.
    #: RunSamples that nobody touched, less a load that they carry; none where nothing is known.
    free: tuple[RunSamples, ...]
    #: A load that the free samples carry, and with them the whole log; None without one.
    load: FreeLoad | None = None

    def known_free(self, unloaded: Mask) -> tuple[RunSamples, ...]:
        """The free samples; without any, the samples (T,) that a zero says are unloaded."""
        if self.free or np.count_nonzero(unloaded) < 2:
            return self.free
        return (RunSamples(self.run, unloaded),)


def as_modelled(motion: FreeMotion) -> FreeLog:
    """The log as the robot's model explains it, with the free part that is given or found."""
    try:
        return FreeLog(motion.log, motion.known.pieces)
    except ReferenceTorqueError:
        return FreeLog(motion.log, ())


def smoothed_wrench(
    found: SmoothedWrench, wrench: Wrench, sensor: VirtualSensor, motion: FreeMotion
) -> Wrench:
    """A wrench with the smoother's values and band in place of its own, nothing of it masked."""
    chain, q, t = motion.log.robot.chain, motion.log.q, wrench.t
    values, sd = np.empty((len(t), 6)), np.empty((len(t), 6))
    for start in range(0, len(t), CHUNK):
        span = slice(start, min(start + CHUNK, len(t)))
        flange = link_poses(chain, q[span]).rotation[:, -1]
        X = from_base(sensor.frame, flange, sensor.mounting)
        moved = found.at(t[span]).seen_in(X)
        values[span], sd[span] = moved.values, moved.sd
    return replace(
        wrench,
        values=handed_over(values),
        sd=handed_over(sd),
        masked=None,
        remarks=found.remarks(wrench.name),
    )


def smooth_all(
    names: Sequence[str],
    plain: FreeLog,
    own: Mapping[str, FreeLog],
    *,
    unloaded: Mask,
    gate: Gate | None = None,
) -> dict[str, SmoothedWrench]:
    """The smoothed wrench of each observer, made once for all that have the same log.

    Args:
        names: The observers.
        plain: The log as the robot's model alone has it.
        own: The log as an observer has it that has another.
        unloaded: RunSamples of the log that its zero says are unloaded. (T,)
        gate: The contacts, outside of which there is no wrench; None where the log is one.
    """
    made: dict[Run, SmoothedWrench] = {}
    for name in names:
        log = own.get(name, plain)
        if log.run not in made:
            made[log.run] = smooth_log(log, plain, unloaded, gate)
    return {name: made[own.get(name, plain).run] for name in names}


def smooth_log(log: FreeLog, plain: FreeLog, unloaded: Mask, gate: Gate | None) -> SmoothedWrench:
    """The smoothed wrench of one log; the arguments as of `smooth_all`.

    A correction of the model's error is used where the wrench comes and goes. Where the uncorrected
    log calls for one steady load it is left out, since a load and an error of the model look alike.
    """
    free = log.known_free(unloaded)
    if gate is not None:
        bare = without_load(log.run, log.load)
        found = smooth_wrench(bare, free, gate.spans, gate.prior)
        if log.load is None:
            return found
        q = resample_columns(found.t, log.run.t, log.run.q)
        values, covariance = log.load.wrench(log.run.robot.chain, q)
        return replace(
            found,
            values=found.values + values,
            covariance=found.covariance + covariance,
            load=log.load,
        )
    if log.run is not plain.run:
        modelled = plain.known_free(unloaded)
        prior = prior_of(plain.run, modelled)
        if prior.is_steady:
            found = smooth_wrench(plain.run, modelled, prior=prior)
            return replace(found, uncorrected=True)
    return smooth_wrench(log.run, free)
