"""The smoother as a solver beside the others: from a log and its free motion to a `Wrench`."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from vftcli.repetition.free_load import FreeLoad
from vftcli.repetition.free_motion import FreeMotion, FreePiece
from vftcli.repetition.free_run import ModelledRun
from vftcli.robots.kinematics import link_poses
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Mask, handed_over
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.series import resample_columns
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.frames import from_base
from vftcli.virtual_sensor.smoother.noise import FreeTerms
from vftcli.virtual_sensor.smoother.prior import WrenchPrior
from vftcli.virtual_sensor.smoother.smoothing import SmoothedWrench, prior_of, smooth_wrench
from vftcli.virtual_sensor.virtual_sensor import CHUNK, VirtualSensor


class Gate(NamedTuple):
    """The contacts of a log, outside of which nothing touches the arm."""

    spans: Sequence[tuple[float, float]]  #: From and to of every contact. [s]
    #: How their wrench moves, as the contacts themselves show it; None to choose it.
    prior: WrenchPrior | None = None


class SmootherInput(NamedTuple):
    """What one observer's wrench is smoothed from."""

    terms: DynamicsTerms  #: p and μ along the log, corrected as the observer's are.
    #: Motion that nobody touched, corrected alike, less a load that it carries; none where nothing
    #: is known of it.
    free: tuple[FreeTerms, ...]
    #: A load that the free motion carries, and with it the whole log; None without one.
    load: FreeLoad | None = None
    #: The same as the robot's model alone gives it, None where nothing is corrected.
    uncorrected: "SmootherInput | None" = None


#: From an observer's name to what its wrench is smoothed from.
#:
#: A correction of the model's error is used where the wrench comes and goes. Where the uncorrected
#: log calls for one steady load it is left out, since a load and an error of the model look alike.
InputOf = Callable[[str], SmootherInput]


def plain_input(motion: FreeMotion) -> SmootherInput:
    """The log as the robot's model explains it, with the free part that is given or found."""
    try:
        pieces = motion.part.pieces
    except ReferenceTorqueError:
        pieces = ()
    return input_under(motion, pieces, lambda run: run.terms)


def corrected_input(
    motion: FreeMotion,
    pieces: Sequence[FreePiece],
    load: FreeLoad | None,
    terms_of: Callable[[str, ModelledRun], DynamicsTerms],
    name: str,
) -> SmootherInput:
    """The log and its free pieces as one observer has them, and as the robot's model does."""
    plain = input_under(motion, pieces, lambda run: run.terms, load)
    own = input_under(motion, pieces, partial(terms_of, name), load)
    return plain if own.terms is plain.terms else own._replace(uncorrected=plain)


def input_under(
    motion: FreeMotion,
    pieces: Sequence[FreePiece],
    terms_of: Callable[[ModelledRun], DynamicsTerms],
    load: FreeLoad | None = None,
) -> SmootherInput:
    """The log and its free pieces under one correction, these less a load."""
    free = []
    for run, inside in pieces:
        terms = terms_of(run)
        terms = terms if load is None else load.off(terms, run)
        free.append(FreeTerms(terms, run.recording.q, inside))
    return SmootherInput(terms_of(motion.log), tuple(free), load)


def known_free(motion: FreeMotion, found: SmootherInput, unloaded: Mask) -> tuple[FreeTerms, ...]:
    """The free motion of an input, what a zero says is free where there is no other.

    Args:
        motion: The log.
        found: The input.
        unloaded: Samples of the log that its zero says are unloaded. (T,)
    """
    if found.free:
        return found.free
    if np.count_nonzero(unloaded) < 2:
        return ()
    return (FreeTerms(found.terms, motion.log.recording.q, unloaded),)


def carrying(found: SmoothedWrench, load: FreeLoad, run: ModelledRun) -> SmoothedWrench:
    """A wrench that was found beside a load, with the load in it."""
    q = resample_columns(found.t, run.recording.t, run.recording.q)
    values, covariance = load.wrench(run.robot.chain, q)
    return replace(
        found,
        values=found.values + values,
        covariance=found.covariance + covariance,
        load=load,
    )


def smoothed_wrench(
    found: SmoothedWrench, wrench: Wrench, sensor: VirtualSensor, motion: FreeMotion
) -> Wrench:
    """A wrench with the smoother's values and band in place of its own, nothing of it masked."""
    chain, q, t = motion.log.robot.chain, motion.log.recording.q, wrench.t
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
    motion: FreeMotion,
    names: Sequence[str],
    input_of: InputOf | None = None,
    *,
    unloaded: Mask,
    gate: Gate | None = None,
) -> dict[str, SmoothedWrench]:
    """What the smoother finds for each observer, once for all that rest on the same terms.

    Args:
        motion: The log and its arm.
        names: The observers.
        input_of: What each one's wrench is smoothed from; None for `plain_input`.
        unloaded: Samples of the log that its zero says are unloaded. (T,)
        gate: The contacts, outside of which there is no wrench; None where the log is one.
    """
    made: list[tuple[DynamicsTerms, SmoothedWrench]] = []
    found: dict[str, SmoothedWrench] = {}
    for name in names:
        given = plain_input(motion) if input_of is None else input_of(name)
        same = next((smoothed for terms, smoothed in made if terms is given.terms), None)
        found[name] = same or smooth_input(motion, given, unloaded, gate)
        made.append((given.terms, found[name]))
    return found


def smooth_input(
    motion: FreeMotion, given: SmootherInput, unloaded: Mask, gate: Gate | None
) -> SmoothedWrench:
    """What the smoother finds from one input; the other arguments as of `smooth_all`."""
    q, robot, plain = motion.log.recording.q, motion.log.robot, given.uncorrected
    if gate is not None:
        load = given.load
        terms = given.terms if load is None else load.off(given.terms, motion.log)
        free = known_free(motion, given, unloaded)
        found = smooth_wrench(terms, q, robot, free, gate.spans, gate.prior)
        return found if load is None else carrying(found, load, motion.log)
    if plain is not None:
        free = known_free(motion, plain, unloaded)
        prior = prior_of(plain.terms, q, robot, free)
        if prior.is_steady:
            found = smooth_wrench(plain.terms, q, robot, free, prior=prior)
            return replace(found, uncorrected=True)
    free = known_free(motion, given, unloaded)
    return smooth_wrench(given.terms, q, robot, free)
