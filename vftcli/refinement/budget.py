"""The error budget: how much of an estimate's error each cause makes, and what limits a log."""

from typing import NamedTuple

import numpy as np

from vftcli.observers.spectra import Spectra
from vftcli.refinement.baseline import Baseline, FreeReading
from vftcli.robots.friction import ONE_STOP, dry_friction
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.remarks import Remark, Where, fact

STICTION = "stiction at rest"
"""The cause that is not part of an error's sum: it says what a standing joint may hide."""

CAUSES = ("noise", "friction", "model", "bandwidth", STICTION)
"""What an error is divided into."""

SIGN_SPEED = 0.02
"""Velocity over which the sign of friction turns. [rad/s]"""


class Budget(NamedTuple):
    """Where one observer's error comes from, estimated on the log itself.

    Attributes:
        name: The observer.
        parts: Cause → root mean square. (n,) [N·m]
    """

    name: str
    parts: dict[str, Array]

    @property
    def total(self) -> Array:
        """Root sum of squares of all causes but stiction at rest. (n,) [N·m]"""
        squares = [v**2 for cause, v in self.parts.items() if cause != STICTION]
        return np.asarray(np.sqrt(np.sum(squares, axis=0)))


def budget(found: Baseline, spectra: Spectra, reading: FreeReading) -> Budget:
    """Divide an observer's error into its causes, each estimated from the log.

    Noise is the flat floor of S_n through |H|²; bandwidth ∫|1−H|²S_τ df. What else the observer
    reads on the free part is model error: friction as far as sign and size of a joint's own
    velocity explain it, the rest of the model otherwise. Stiction at rest is the dry friction a
    standing joint may hide, F_c/√3, times the share of the time that it stands.
    """
    observer = reading.observer
    response = observer.frequency_response(spectra.frequency, spectra.step, spectra.joints)
    read = reading.rms**2
    share: Array = np.abs(response) ** 2
    noise = np.minimum(np.sum(spectra.floor * share, axis=0) * spectra.width, read)
    modelled = read - noise
    velocity = [piece.run.recording.require("dq")[piece.inside] for piece in found.pieces]
    by_friction = modelled * friction_share(np.concatenate(velocity), reading.samples)
    robot = found.motion.log.robot
    hidden = ONE_STOP * dry_friction(robot.friction, robot.joints)
    squares = {
        "noise": noise,
        "friction": by_friction,
        "model": modelled - by_friction,
        "bandwidth": spectra.missed(response),
        STICTION: hidden**2 * found.standing.mean(axis=0),
    }
    return Budget(observer.name, {cause: np.sqrt(value) for cause, value in squares.items()})


def friction_share(dq: Array, tau: Array) -> Array:
    """Share of a torque's power that sign and size of a joint's own velocity explain. (n,)

    Args:
        dq: Joint velocities. (S, n) [rad/s]
        tau: What the observer reads there. (S, n) [N·m]
    """
    shares = []
    for velocity, y in zip(dq.T, tau.T, strict=True):
        X = np.column_stack([np.tanh(velocity / SIGN_SPEED), velocity])
        weights, *_ = np.linalg.lstsq(X, y, rcond=None)
        power = float(np.sum(y**2))
        shares.append(1.0 - float(np.sum((y - X @ weights) ** 2)) / power if power > 0 else 0.0)
    return np.clip(shares, 0.0, 1.0)


def limits_remark(found: Budget, stuck: Mask) -> Remark:
    """What limits a log: the largest cause of each joint, and how much of the error it makes.

    What stiction may hide is added to the error of a joint that stands, so that it is a part of it.

    Args:
        found: The budget.
        stuck: Joints that stand in most samples, where stiction decides. (n,)
    """
    causes = [cause for cause in CAUSES if cause != STICTION]
    largest = [
        max(causes, key=lambda cause: float(found.parts[cause][j])) for j in range(len(stuck))
    ]
    decided = stuck & (found.parts[STICTION] > 0.0)  # no friction known: nothing known of stiction
    named = [STICTION if stands else cause for cause, stands in zip(largest, decided, strict=True)]
    size = [float(found.parts[cause][j]) for j, cause in enumerate(named)]
    total = np.hypot(found.total, np.where(stuck, found.parts[STICTION], 0.0))
    where = Where(about=found.name)
    return fact("limits", where, causes=named, size_Nm=size, total_Nm=total.tolist())
