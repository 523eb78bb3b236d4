"""A log whose joints warm up, modelled by the temperature that it holds."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.observers.paper import MomentumObserver
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.recording import Recording
from vftcli.simulation import load_scenario, simulate
from vftcli.simulation.scenario import MismatchSpec

# A UR5e on the circle that nobody touches, its profile exact but for stiction and Stribeck peak,
# which grow like all friction where the joints are cold: hence not the same residual.
UR5E = [
    *("robot=ur5e", "contacts=[]", "duration=12.0", "sensing.rate=125"),
    *(f"mismatch.{name}=0" for name in MismatchSpec.__dataclass_fields__),
    "friction.presliding=0",
]


@pytest.mark.slow
def test_the_law_takes_the_drift_out_of_the_residual() -> None:
    """25 → 40 °C: at most 1.1 times the residual at a constant 35 °C; without it, four times."""

    def residual(log: Recording) -> float:
        """RMS of a momentum observer of nothing, mean of the joints. [N·m]"""
        tau = MomentumObserver(gain=10.0).estimate(dynamics_terms(log, steady.robot)).tau
        return float(np.mean(np.sqrt(np.mean(tau[log.t > 0.5] ** 2, axis=0))))

    drift = ("friction.temperature_begin=25", "friction.temperature_end=40")
    steady = simulate(load_scenario("ur5-circle", UR5E), 1)
    warming = simulate(load_scenario("ur5-circle", [*UR5E, *drift]), 1).recording
    assert steady.recording.temperature is not None
    np.testing.assert_array_equal(steady.recording.temperature, 35.0)
    np.testing.assert_allclose(warming.temperature[[0, -1]], [[25.0] * 6, [40.0] * 6])
    assert residual(warming) <= 1.1 * residual(steady.recording)
    assert residual(replace(warming, temperature=None)) > 3.5 * residual(steady.recording)
