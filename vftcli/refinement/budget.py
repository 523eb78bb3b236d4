"""The error budget: how much of an estimate's error each cause makes, and what limits a log."""

from typing import NamedTuple

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.refinement.baseline import (
    Baseline,
    free_estimates,
    free_rms,
    free_samples,
    stuck_joints,
)
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording

CAUSES = ("noise", "friction", "model", "bandwidth", "stiction at rest")
"""What an error is divided into."""

SLOW = 0.02
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
        squares = [v**2 for cause, v in self.parts.items() if cause != "stiction at rest"]
        return np.asarray(np.sqrt(np.sum(squares, axis=0)))


def budget(
    found: Baseline,
    recording: Recording,
    robot: Robot,
    observer: Observer,
    estimate: ExternalTorque,
) -> Budget:
    """Divide an observer's error into its causes, each estimated from the log.

    Noise is the flat floor of S_n through |H|²; bandwidth ∫|1−H|²S_τ df. What else the observer
    reads on the free part is model error: friction as far as sign and size of a joint's own
    velocity explain it, the rest of the model otherwise. Stiction at rest is the dry friction a
    resting joint may hide, F_c/√3, times the share of the time that it rests.
    """
    spectra = found.spectra
    n = found.terms.joints
    if spectra is None:
        return Budget(observer.name, {cause: np.zeros(n) for cause in CAUSES})
    response = observer.frequency_response(spectra.frequency, spectra.step, n)
    free = free_estimates(found, observer, estimate)
    read = free_rms(found, free) ** 2
    share: Array = np.abs(response) ** 2
    noise = np.minimum(np.sum(spectra.floor * share, axis=0) * spectra.width, read)
    modelled = read - noise
    by_friction = modelled * friction_share(found, recording, free)
    squares = {
        "noise": noise,
        "friction": by_friction,
        "model": modelled - by_friction,
        "bandwidth": spectra.missed(response),
        "stiction at rest": dry_friction(robot, n) ** 2 / 3.0 * found.rest.mean(axis=0),
    }
    return Budget(observer.name, {cause: np.sqrt(value) for cause, value in squares.items()})


def friction_share(
    found: Baseline, recording: Recording, free: tuple[ExternalTorque, ...]
) -> Array:
    """Share of the free estimate's power that sign and size of a joint's velocity explain. (n,)"""
    logs = found.part.runs if found.part is not None and found.part.runs else (recording,)
    inside = [part.inside for part in free_samples(found)]
    dq = np.concatenate([g.require("dq")[m] for g, m in zip(logs, inside, strict=True)])
    tau = np.concatenate([e.tau[m] for e, m in zip(free, inside, strict=True)])
    shares = []
    for velocity, y in zip(dq.T, tau.T, strict=True):
        X = np.column_stack([np.tanh(velocity / SLOW), velocity])
        weights, *_ = np.linalg.lstsq(X, y, rcond=None)
        power = float(np.sum(y**2))
        shares.append(1.0 - float(np.sum((y - X @ weights) ** 2)) / power if power > 0 else 0.0)
    return np.clip(shares, 0.0, 1.0)


def dry_friction(robot: Robot, joints: int) -> Array:
    """Coulomb friction of each joint, 0 where the robot's model has none. (n,) [N·m]"""
    from vftcli.robots.friction import friction_torque

    if not robot.friction:
        return np.zeros(joints)
    creep = np.full((1, joints), 0.05)
    sides = [friction_torque(robot.friction, v, np.zeros((1, joints)))[0] for v in (creep, -creep)]
    return np.asarray(0.5 * np.abs(sides[0] - sides[1]))


def sentence(found: Budget, survey: Baseline) -> str:
    """What limits this log, in plain words: the largest cause of each joint."""
    causes = [cause for cause in CAUSES if cause != "stiction at rest"]
    stuck = stuck_joints(survey)
    words = []
    for j, total in enumerate(found.total):
        name = f"J{j + 1}"
        if name in stuck:
            size = found.parts["stiction at rest"][j]
            words.append(f"{name} stiction at rest (up to about {size:.2g} N·m rms)")
            continue
        largest = max(causes, key=lambda cause: float(found.parts[cause][j]))
        words.append(f"{name} {largest} ({found.parts[largest][j]:.2g} of {total:.2g} N·m)")
    return f"what limits {found.name} on this log: {', '.join(words)}"
