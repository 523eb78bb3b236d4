"""Simulated experiments: a robot's log with the truth beside it."""

from vftcli.simulation.arm import Arm
from vftcli.simulation.experiment import Simulation, Truth, observe, prepare, simulate
from vftcli.simulation.load import load_scenario, scenario_names
from vftcli.simulation.scenario import Scenario

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
