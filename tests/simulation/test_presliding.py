"""Simulated friction through the model: joints that give before they slide, and that warm up."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.observers.paper import MomentumObserver
from vftcli.robots import Robot
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.arrays import Array, root_mean_squares
from vftcli.signals.recording import Recording
from vftcli.simulation import load_scenario, simulate
from vftcli.simulation.plant import CREEP
from vftcli.simulation.scenario import MismatchSpec

pytestmark = pytest.mark.slow

SHARE = 0.6
# A UR5e on the circle that nobody touches, its profile exact but for what a test adds.
SETTINGS = [
    *("robot=ur5e", "contacts=[]"),
    *(f"mismatch.{name}=0" for name in MismatchSpec.__dataclass_fields__),
]


def residual(log: Recording, robot: Robot) -> Array:
    """RMS of what a momentum observer reads of nothing, without its start. (n,) [N·m]"""
    tau = MomentumObserver(gain=10.0).estimate(dynamics_terms(log, robot)).tau
    return root_mean_squares(tau[log.t > 0.5])


def test_the_law_takes_the_drift_out_of_the_residual() -> None:
    """25 → 40 °C: at most 1.1 times the residual at a constant 35 °C; without it, four times.

    Stiction and Stribeck peak grow like all friction where the joints are cold: hence not the same
    residual.
    """
    plain = [*SETTINGS, "duration=12.0", "sensing.rate=125", "friction.presliding=0"]
    drift = ("friction.temperature_begin=25", "friction.temperature_end=40")
    steady = simulate(load_scenario("ur5-circle", plain), 1)
    warming = simulate(load_scenario("ur5-circle", [*plain, *drift]), 1).recording
    unknown = replace(warming, temperature=None)
    np.testing.assert_array_equal(steady.recording.temperature, 35.0)
    np.testing.assert_allclose(warming.temperature[[0, -1]], [[25.0] * 6, [40.0] * 6])
    least, law, none = (
        np.mean(residual(log, steady.robot)) for log in (steady.recording, warming, unknown)
    )
    assert law <= 1.1 * least
    assert none > 3.5 * least


def giving(robot: Robot) -> Robot:
    """The robot with the share of its dry friction that the plant turned into presliding."""
    friction = []
    for joint in robot.friction:
        part = SHARE * joint.torques[0]
        more = joint.parameters | {"presliding": part, "presliding_length": 3e-4}
        more["smoothing"] = CREEP
        torques = tuple(torque - part for torque in joint.torques)
        friction.append(replace(joint, parameters=more, torques=torques))
    return replace(robot, friction=tuple(friction))


def test_the_models_presliding_is_the_plants() -> None:
    """Seed 1: what a momentum observer reads of nothing falls below half on joints that move.

    Joint 5 rests, where the noise of its position moves the model's play. What is left comes from
    the steps and the noise of the logged positions, which the model's play follows.
    """
    giving_way = [f"friction.presliding={SHARE}", "friction.stribeck=0", "duration=4.0"]
    run = simulate(load_scenario("ur5-circle", [*SETTINGS, *giving_way]), 1)
    ratio = residual(run.recording, giving(run.robot)) / residual(run.recording, run.robot)
    assert np.all(ratio[[0, 1, 2, 3, 5]] < 0.55), ratio


def held_at_rest(name: str, seed: int, *settings: str) -> float:
    """What a momentum observer reads of a resting arm that nobody touches, in Coulomb torques.

    Its root mean square over the samples slower than .01 rad/s, the first .5 s left out, gain 10,
    the profile's friction; the mean of the joints.
    """
    run = simulate(load_scenario(name, settings), seed)
    recording, truth = run.recording, run.truth.tau_ext
    tau = MomentumObserver(gain=10.0).estimate(dynamics_terms(recording, run.robot)).tau
    free = ~truth.any(axis=1) & (recording.t - recording.t[0] > 0.5)
    rests = free[:, None] & (np.abs(recording.dq) < 0.01)
    coulomb = [joint.torques[0] for joint in run.robot.friction]
    return float(np.mean(np.sqrt(np.mean((tau - truth) ** 2, axis=0, where=rests)) / coulomb))


LEAST, MOST = 0.3, 0.65
"""A UR10e's, in eight free logs, is .28 to .48; the bar that was set for the simulation."""


def test_a_resting_arm_holds_what_its_teeth_hold() -> None:
    """Seed 1 until the second drag: .44 (whole run .50); an arm that sticks holds .65 (.73)."""
    assert LEAST <= held_at_rest("ur5-drag", 1, "duration=17") <= MOST


@pytest.mark.statistical
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("name", ["ur5-drag", "ur5-sensor"])
def test_stiction_is_a_real_arms(name: str, seed: int) -> None:
    assert LEAST <= held_at_rest(name, seed) <= MOST
