"""The ladder's required figures over stiff servo, soft servo and clock drift, five seeds each."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.free_motion import FreeChoice
from vftcli.free_motion.cycles import find_period
from vftcli.free_motion.difference import RUNGS
from vftcli.free_motion.two_cycle import two_cycle_difference
from vftcli.robots import load_robot
from vftcli.signals.arrays import Array
from vftcli.simulation import Simulation, load_scenario, simulate

MOVING = [0, 1, 2, 3, 5]

STICKS = "friction.presliding=0"
"""The joints that the figures are required of."""
SETTINGS = {
    "stiff": ["servo.stiffness=stiff"],
    "soft": ["servo.stiffness=soft"],
    "drift": ["sensing.clock_drift=0.003"],
}

OVERSTATED = pytest.mark.xfail(
    strict=True, reason="the floor of joint 4 is stated too large there: it errs by .65 of it"
)
RUNS = [
    pytest.param(name, seed, marks=OVERSTATED if (name, seed) == ("soft", 2) else ())
    for name in SETTINGS
    for seed in range(1, 6)
]


def error_of(run: Simulation, choice: FreeChoice) -> tuple[Array, Array]:
    """True and reported error of the moving joints. (5,), (5,) [N·m]"""
    log = run.recording
    truth = np.column_stack([np.interp(log.t, run.truth.t, x) for x in run.truth.tau_ext.T])
    reference = two_cycle_difference(log, (), load_robot("ur5"), choice)
    assert reference.floor is not None
    shown = np.sqrt(np.nanmean((reference.tau - truth) ** 2, axis=0))
    return shown[MOVING], reference.floor[MOVING]


@pytest.mark.statistical
@pytest.mark.parametrize(("name", "seed"), RUNS)
def test_required_figures(name: str, seed: int) -> None:
    run = simulate(load_scenario("ur5-circle", [*SETTINGS[name], STICKS]), seed)
    wanted = 4.0 * (1.003 if name == "drift" else 1.0)
    assert find_period(run.recording).seconds == pytest.approx(wanted, rel=2e-4)

    best, floor = error_of(run, FreeChoice())
    plain = FreeChoice(period=4.0, alignment="commanded", low_pass=None)
    commanded, _ = error_of(run, plain)
    assert best.mean() <= 0.6 * commanded.mean()
    assert np.all((best / floor >= 0.7) & (best / floor <= 1.4)), best / floor

    for low_pass in (None, 12.0):
        chosen, _ = error_of(run, FreeChoice(period=4.0, low_pass=low_pass))
        lowest, _ = error_of(run, replace(plain, low_pass=low_pass))
        assert chosen.mean() <= 1.05 * lowest.mean(), RUNGS
