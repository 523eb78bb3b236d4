"""Admittance: the paper's variable-parameter law, on recorded forces and in closed loop."""

from typing import TYPE_CHECKING

from vftcli.signals.packages import door

if TYPE_CHECKING:
    from vftcli.admittance.law import variable
    from vftcli.admittance.motion import release
    from vftcli.admittance.parameters import from_table
else:
    __getattr__ = door(__name__, "law", "motion", "parameters")

__all__ = ["from_table", "release", "variable"]
