"""Identification: logs become a robot. `identify` is the door."""

from typing import TYPE_CHECKING

from vftcli.identification.choice import Task
from vftcli.signals.packages import door

if TYPE_CHECKING:
    from vftcli.identification.fitting import Identification, identify
else:
    __getattr__ = door(__name__, "fitting")

__all__ = ["Identification", "Task", "identify"]
