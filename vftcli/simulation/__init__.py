"""Simulated experiments: a robot's log with the truth beside it."""

from vftcli.simulation.arm import Arm
from vftcli.simulation.experiment import Simulation, Truth, observe, prepare, simulate
from vftcli.simulation.scenario import SCENARIOS, Scenario, load_scenario

__all__ = [
    "SCENARIOS",
    "Arm",
    "Scenario",
    "Simulation",
    "Truth",
    "load_scenario",
    "observe",
    "prepare",
    "simulate",
]
