"""Identification: logs become a robot. `identify` is the door."""

from vftcli.identification.identify import Task, identify
from vftcli.identification.methods import METHODS
from vftcli.identification.processing import Processing
from vftcli.identification.result import Identification

__all__ = ["METHODS", "Identification", "Processing", "Task", "identify"]
