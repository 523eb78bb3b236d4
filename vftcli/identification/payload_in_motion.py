"""A load on the flange, weighed while the arm moves: for logs without enough poses at rest."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.identification.payload import (
    APART,
    DWELL,
    POSES,
    STATIC,
    LoadFit,
    LoadSolution,
    different_poses,
    fit_all_joints,
    gain_covariance,
    load_at_flange,
    names_of,
    stretch_covariance,
)
from vftcli.identification.processing import gravity_torque
from vftcli.identification.result import root_mean_square
from vftcli.repetition.free_load import LEAST, PARTLY, SURE, columns, weighed
from vftcli.robots.chain import Payload
from vftcli.robots.drive import gain_sd
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run, RunSamples
from vftcli.signals.arrays import Array, handed_over
from vftcli.signals.errors import IdentificationError
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import fact
from vftcli.signals.rest import faster

LOOKED_AT = 400  #: RunSamples of a motion, at most, by which its different poses are counted.
#: What a weighing needs: of a UR10e and a UR3 the masses of 9 stretches of 10 s scatter by .7
#: of their standard deviation, those of 5 s by 1.6, of 2.5 s by 2.4. [s]
LONG = 10.0
#: Weighings with the load on the arm: the third moves mass and centre by less than .1 %.
ROUNDS = 3


class MotionWeighing(NamedTuple):
    """What a motion says of a load."""

    x: Array  #: Mass and first moment in flange axes. (4,) [kg, kg·m]
    covariance: Array  #: Of these. (4, 4)
    residual: Array  #: RMS left in each joint. (n,) [N·m]
    share: float  #: What is left of the torque beside weight and friction of the arm, by its power.

    @property
    def least(self) -> float:
        """The mass from which on it would show. [kg]"""
        return max(LEAST, SURE * float(np.sqrt(self.covariance[0, 0])))

    @property
    def shows(self) -> bool:
        """Whether there is a load."""
        return bool(self.x[0] >= self.least and self.share <= PARTLY)


def payload_from_motion(recordings: Sequence[Recording], robot: Robot) -> LoadFit:
    """Find a load from motion: what the torque has beyond the robot's own weight.

    The columns of `vftcli.repetition.free_load` know of a load's weight alone: with what was found
    on the arm the motion is weighed again, so that the load's inertia does not count as weight.
    """
    names = names_of(recordings)
    q = np.concatenate([recording.q for recording in recordings])
    if (different := different_poses(q[:: 1 + len(q) // LOOKED_AT])) < POSES:
        raise IdentificationError(
            f"{names}: the arm passes {different} different poses, and a load needs {POSES} at "
            f"least, {APART:g} rad apart; move more joints, or give a pair of logs of one motion "
            "with and without it"
        )
    if (seconds := sum(recording.duration for recording in recordings)) < LONG:
        raise IdentificationError(
            f"{names}: {seconds:.3g} s of motion are too short to weigh a load; record {LONG:g} s "
            "at least"
        )
    runs = [Run(recording=recording, robot=robot) for recording in recordings]
    found = weigh_motion(runs, np.zeros(STATIC))
    if not found.shows:
        least = float(f"{found.least:.2g}")
        raise IdentificationError(
            f"{names}: no load shows; in this motion one from {least:g} kg would, a "
            f"lighter one in {POSES} different poses at rest of at least {DWELL:g} s, or in a pair "
            "of logs of one motion with and without it"
        )
    origin = fact("load-from-motion", logs=len(runs), left_percent=100.0 * found.share)
    for _ in range(ROUNDS):
        found = weigh_motion(runs, found.x)
    in_link = np.eye(STATIC)
    in_link[1:, 0], in_link[1:, 1:] = robot.chain.flange_translation, robot.chain.flange_rotation
    sd = np.sqrt(np.diag(in_link @ found.covariance @ in_link.T))
    return load_at_flange(
        LoadSolution(in_link @ found.x, sd, found.residual), robot, recordings, origin
    )


def weigh_motion(runs: Sequence[Run], carried: Array) -> MotionWeighing:
    """Weigh a load in motion, from what it is known to be.

    A joint counts where it moves, and its friction is free: a tanh(q̇/v₀) + b q̇ + o. Nothing is
    subtracted that went through the same drives, so that an error of theirs acts on the arm's own
    weight.

    Args:
        runs: Logs that carry it.
        carried: Mass and first moment of what their models carry of it. (4,) [kg, kg·m]
    """
    robot, signals = runs[0].robot, []
    for run in [carrying(run, carried) for run in runs] if carried.any() else runs:
        piece = RunSamples(run, np.ones(run.recording.samples, dtype=bool))
        at, own = weighed(piece), columns(piece)
        if own is not None:
            signals.append((*own, run.q[at], run.dq[at]))
    if not signals:
        names = names_of([run.recording for run in runs])
        raise IdentificationError(f"{names}: no log is long enough to be filtered")
    d, A, q, dq = (np.concatenate(each) for each in zip(*signals, strict=True))
    A = np.concatenate([A, dq[:, :, None] * np.eye(robot.joints)], axis=2)
    usable = faster(dq).astype(float)

    def left_by(columns: Array) -> tuple[Array, Array]:
        fit = fit_all_joints(columns, d, usable)
        return fit, d - np.einsum("knp,p->kn", columns, fit)

    (fit, left), (_, bare) = left_by(A), left_by(A[:, :, STATIC:])
    gain = max(gain_sd(run.recording, robot) for run in runs)
    x = carried + fit[:STATIC]
    weight = gravity_torque(robot, q) - np.einsum("knp,p->kn", A[:, :, :STATIC], x)
    covariance = stretch_covariance(A, left, usable)
    covariance = covariance + gain_covariance(A, left, weight, usable, gain)
    power = float(np.sum(usable * left**2) / max(float(np.sum(usable * bare**2)), 1e-12))
    return MotionWeighing(
        x=x,
        covariance=covariance[:STATIC, :STATIC],
        residual=root_mean_square(left),
        share=float(np.sqrt(power)),
    )


def carrying(run: Run, x: Array) -> Run:
    """A run whose model carries a load too, a point mass of x (4,) [kg, kg·m] in flange axes."""
    load = Payload(mass=float(x[0]), com=x[1:] / x[0], inertia=np.zeros((3, 3)))
    q, dq, bare, terms = run.q, run.dq, run.robot.chain, run.terms
    own, loaded = momentum_terms(bare, q, dq), momentum_terms(bare.with_payload(load), q, dq)
    more = loaded.coriolis_transpose_dq - own.coriolis_transpose_dq
    mu = handed_over(terms.mu + more - loaded.gravity + own.gravity)
    return run.holding(terms=replace(terms, p=handed_over(terms.p + loaded.p - own.p), mu=mu))
