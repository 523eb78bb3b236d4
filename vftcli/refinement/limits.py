"""Limits of a log, cause by cause, and the paper's gains against the best.

Without a reference the bands tell what an estimate's error is expected to be: the root mean square
of their standard deviation over the log, the mean over the joints.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vftcli.observers.choice import ObserverChoice
from vftcli.observers.spectra import Spectra
from vftcli.observers.table import BEST, PAPER
from vftcli.refinement.band import with_band
from vftcli.refinement.baseline import Baseline, FreeReading, free_reading
from vftcli.robots.friction import ONE_STOP, dry_friction
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.remarks import Remark, Where, fact
from vftcli.signals.wrench import ExternalTorque

#: The cause that is not part of an error's sum: it says what a standing joint may hide.
STICTION = "stiction at rest"
CAUSES = ("noise", "friction", "model", "bandwidth", STICTION)  #: What an error is divided into.
SIGN_SPEED = 0.02  #: Velocity over which the sign of friction turns. [rad/s]
#: Codes of the remark that holds what the bands let expect: the gains are off the best, or not.
EXPECTED = ("paper-gains-expected", "paper-gains-expected-level")
#: The same of the remark that holds what a reference says.
MEASURED = ("paper-gains-measured", "paper-gains-measured-level")
AHEAD = 1.05  #: The best is ahead where the paper's gains make this many times its error.


class Budget(NamedTuple):
    """Sources of one observer's error, estimated on the log itself."""

    name: str  #: The observer.
    parts: dict[str, Array]  #: Cause → root mean square. (n,) [N·m]

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
    resting joint may hide, F_c/√3, times the share of its time at rest.
    """
    observer = reading.observer
    response = observer.frequency_response(spectra.frequency, spectra.step, spectra.joints)
    read = reading.rms**2
    share: Array = np.abs(response) ** 2
    noise = np.minimum(np.sum(spectra.floor * share, axis=0) * spectra.width, read)
    modelled = read - noise
    velocity = [piece.run.dq[piece.inside] for piece in found.pieces]
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
    """Share of a torque's power by a joint's own velocity, sign and size. (n,)

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
    """Limits of a log: each joint's largest cause, and its part of the error.

    What stiction may hide is added to the error of a standing joint.

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


def expected_gap(
    found: Baseline, estimates: Sequence[ExternalTorque], *, gains_of_file: bool
) -> Remark | None:
    """Expected error of the paper's gains over `best`'s; None if unknown."""
    known = {estimate.name: estimate for estimate in estimates}
    if BEST not in known or known[BEST].error_sd is None:
        return None
    log = found.motion.log
    step, n = log.recording.median_step, log.robot.joints
    observers, _ = ObserverChoice(names=PAPER).build(log.robot, step)
    paper = [o for o in observers if gains_of_file and o.name in known]
    if not paper:
        paper = [*observers]
        readings = [free_reading(found, o, o.estimate(found.log.terms)) for o in paper]
        known |= {r.observer.name: with_band(found, r) for r in readings}
    errors = {}
    for name in (BEST, *(o.name for o in paper)):
        sd = known[name].error_sd
        errors[name] = np.nan if sd is None else float(np.sqrt(np.mean(sd**2, axis=0)).mean())
    return gap_remark(EXPECTED, errors, {o.name: o.tuning(step, n).delay for o in paper})


def gap_remark(
    codes: tuple[str, str], errors: Mapping[str, float], delays: Mapping[str, Array]
) -> Remark | None:
    """Distance of the paper's gains from the best; None without errors.

    Args:
        codes: `MEASURED` or `EXPECTED`.
        errors: Observer → error, `best` among them. [N·m]
        delays: Observer of the paper → delay of each joint. (n,) [s]
    """
    ratios = {name: errors[name] / errors[BEST] for name in delays} if errors[BEST] > 0.0 else {}
    ratio = float(np.mean([*ratios.values()])) if ratios else float("nan")
    if not np.isfinite(ratio):
        return None
    spread = np.concatenate([*delays.values()])
    return fact(
        codes[0] if ratio >= AHEAD else codes[1],
        ratio=ratio,
        ratios=ratios,
        least_delay_ms=1e3 * float(spread.min()),
        most_delay_ms=1e3 * float(spread.max()),
    )
