"""How far the paper's gains are off the best on a log: what keeping them gives away.

The error that the spectra let expect of an estimator with response H is √(∫|1−H|²S_τ + |H|²S_n).
It is taken for the paper's four observers with the gains of the robot's file, on what the model
gives, and for the smoother with the gains of the log, on what `best` runs on; means over the
joints, and over the four.
"""

import numpy as np

from vftcli.observers.auto_tuning import error_curve, kalman_smoother
from vftcli.observers.choice import ObserverChoice
from vftcli.observers.table import BEST, PAPER
from vftcli.refinement.baseline import Baseline
from vftcli.signals.remarks import Remark, fact

EXPECTED = "paper-gains-expected"
"""Code of the remark that holds what the spectra let expect."""


def expected_gap(found: Baseline) -> Remark | None:
    """The expected error of the paper's gains over that of the best; None without spectra."""
    plain, best = found.spectra, found.under(BEST).spectra
    if plain is None or best is None:
        return None
    n, robot = plain.joints, found.motion.log.robot
    observers, _ = ObserverChoice(names=PAPER).build(robot, plain.step)
    least = float(error_curve(kalman_smoother, best).least.mean())
    if not least > 0.0:
        return None
    ratios, delays = {}, []
    for observer in observers:
        response = observer.frequency_response(plain.frequency, plain.step, n)
        expected = np.sqrt(plain.missed(response) + plain.passed(response))
        ratios[observer.name] = float(expected.mean()) / least
        delays.append(observer.tuning(plain.step, n).delay)
    return fact(
        EXPECTED,
        ratio=float(np.mean(list(ratios.values()))),
        ratios=ratios,
        least_delay_ms=1e3 * float(np.min(delays)),
        most_delay_ms=1e3 * float(np.max(delays)),
    )
