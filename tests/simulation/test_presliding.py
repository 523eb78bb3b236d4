"""A simulated arm that gives before it slides: at rest, and modelled with and without that."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.observers.paper import MomentumObserver
from vftcli.robots import Robot
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.arrays import Array
from vftcli.simulation import load_scenario, simulate
from vftcli.simulation.plant import CREEP
from vftcli.simulation.scenario import MismatchSpec

pytestmark = pytest.mark.slow

SHARE = 0.6
SETTINGS = [
    *("robot=ur5e", "contacts=[]", "duration=4.0", "friction.stribeck=0"),
    *(f"mismatch.{name}=0" for name in MismatchSpec.__dataclass_fields__),
    f"friction.presliding={SHARE}",
]


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
    run = simulate(load_scenario("ur5-circle", SETTINGS), 1)

    def residual(robot: Robot) -> Array:
        tau = MomentumObserver(gain=10.0).estimate(dynamics_terms(run.recording, robot)).tau
        return np.sqrt(np.mean(tau[run.recording.t > 0.1] ** 2, axis=0))

    ratio = residual(giving(run.robot)) / residual(run.robot)
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
