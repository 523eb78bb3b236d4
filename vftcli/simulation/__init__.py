"""Simulated experiments: a robot's log with the truth beside it."""

from vftcli.simulation.arm import Arm
from vftcli.simulation.experiment import Simulation, Truth, observe, prepare, simulate
from vftcli.simulation.scenario import Scenario, load_scenario, scenario_names

__all__ = [
    "Arm",
    "Scenario",
    "Simulation",
    "Truth",
    "load_scenario",
    "observe",
    "prepare",
    "scenario_names",
    "simulate",
]
