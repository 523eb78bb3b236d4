"""Identification: logs become a robot. `identify` is the door."""

from vftcli.identification.identify import METHODS, Task, identify
from vftcli.identification.processing import Processing
from vftcli.identification.result import Identification

__all__ = ["METHODS", "Identification", "Processing", "Task", "identify"]
