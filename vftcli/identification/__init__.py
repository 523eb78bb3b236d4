"""Identification: logs become a robot. `identify` is the door."""

from typing import TYPE_CHECKING

from vftcli.identification.choice import Task
from vftcli.signals.packages import door

if TYPE_CHECKING:
    from vftcli.identification.fitting import identify
    from vftcli.identification.result import Identification
else:
    __getattr__ = door(__name__, "fitting", "result")

__all__ = ["Identification", "Task", "identify"]
