"""Admittance: the paper's variable-parameter law, on recorded forces and in closed loop."""

from vftcli.admittance.law import variable
from vftcli.admittance.motion import release
from vftcli.admittance.parameters import from_table

__all__ = ["from_table", "release", "variable"]
