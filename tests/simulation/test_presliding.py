"""A simulated arm that gives before it slides, modelled with and without that."""

from dataclasses import replace

import numpy as np

from vftcli.observers.momentum import MomentumObserver
from vftcli.robots import Robot
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.arrays import Array
from vftcli.simulation import load_scenario, simulate
from vftcli.simulation.scenario import MismatchSpec

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
        more = {**joint.parameters, "presliding": part, "presliding_length": 3e-4}
        torques = tuple(torque - part for torque in joint.torques)
        friction.append(replace(joint, parameters=more, torques=torques))
    return replace(robot, friction=tuple(friction))


def test_the_models_presliding_is_the_plants() -> None:
    """Seed 1: what a momentum observer reads of nothing falls below half on joints that move.

    Joint 5 rests, where the noise of its position moves the model's play. What is left is stiction
    at the reversals, which the model smooths.
    """
    run = simulate(load_scenario("ur5-circle", SETTINGS), 1)

    def residual(robot: Robot) -> Array:
        tau = MomentumObserver(gain=10.0).estimate(dynamics_terms(run.recording, robot)).tau
        return np.sqrt(np.mean(tau[run.recording.t > 0.1] ** 2, axis=0))

    ratio = residual(giving(run.robot)) / residual(run.robot)
    assert np.all(ratio[[0, 1, 2, 3, 5]] < 0.55), ratio
