"""How far the paper's gains are off the best on a log: what keeping them gives away.

Without a reference the bands tell: the root mean square of their standard deviation over the log is
the error that is expected of an estimate. It is taken of the paper's four observers with the gains
of the robot's file and of `best`, each the mean over the joints.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from vftcli.observers.choice import ObserverChoice
from vftcli.observers.observer import Observer
from vftcli.observers.table import BEST, PAPER
from vftcli.refinement.band import with_band
from vftcli.refinement.baseline import Baseline, free_reading
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, fact

EXPECTED = ("paper-gains-expected", "paper-gains-expected-level")
"""Codes of the remark that holds what the bands let expect: the gains are off the best, or not."""

MEASURED = ("paper-gains-measured", "paper-gains-measured-level")
"""Codes of the remark that holds what a reference says, likewise."""

AHEAD = 1.05
"""The best is ahead where the paper's gains make this many times its error."""


def expected_gap(
    found: Baseline, estimates: Sequence[ExternalTorque], *, gains_of_file: bool
) -> Remark | None:
    """The expected error with the paper's gains over that of `best`; None where either is unknown.

    Args:
        found: What the log shows.
        estimates: The run's estimates, with their bands.
        gains_of_file: Whether those of the paper's observers ran with the robot file's gains.
            Where not, or where none of them ran, they run here.
    """
    ran = {estimate.name: estimate for estimate in estimates}
    if BEST not in ran or ran[BEST].error_sd is None:
        return None
    log = found.motion.log
    step, n = log.recording.median_step, log.robot.joints
    observers, _ = ObserverChoice(names=PAPER).build(log.robot, step)
    own = [o for o in observers if gains_of_file and o.name in ran]
    paper = own or observers
    shown = [ran[BEST], *(ran[o.name] if own else banded(found, o) for o in paper)]
    errors = {estimate.name: expected_error(estimate) for estimate in shown}
    return gap_remark(EXPECTED, errors, {o.name: o.tuning(step, n).delay for o in paper})


def banded(found: Baseline, observer: Observer) -> ExternalTorque:
    """What an observer estimates of the log, with its band."""
    return with_band(found, free_reading(found, observer, observer.estimate(found.terms)))


def expected_error(estimate: ExternalTorque) -> float:
    """The error that an estimate's band lets expect, mean of the joints; NaN without one. [N·m]"""
    if estimate.error_sd is None:
        return float("nan")
    return float(np.sqrt(np.mean(estimate.error_sd**2, axis=0)).mean())


def gap_remark(
    codes: tuple[str, str], errors: Mapping[str, float], delays: Mapping[str, Array]
) -> Remark | None:
    """How far the paper's gains are off the best; None where an error is not known, or is none.

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
