"""Admittance: the paper's variable-parameter law, on recorded forces and in closed loop."""

from vftcli.admittance.law import Controller, controllers, traditional, variable
from vftcli.admittance.motion import AxisMotion, release, run
from vftcli.admittance.parameters import AXES, Admittance, from_table
from vftcli.admittance.stability import UnstableError, check_stable

__all__ = [
    "AXES",
    "Admittance",
    "AxisMotion",
    "Controller",
    "UnstableError",
    "check_stable",
    "controllers",
    "from_table",
    "release",
    "run",
    "traditional",
    "variable",
]
