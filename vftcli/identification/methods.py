"""The methods by name."""

from collections.abc import Callable

from vftcli.identification.friction_method import friction_method
from vftcli.identification.method_result import MethodResult
from vftcli.identification.target_method import targets_method
from vftcli.identification.training import Training
from vftcli.identification.whole_arm import base_method, consistent_method

METHODS: dict[str, Callable[[Training], MethodResult]] = {
    "friction": friction_method,
    "base": base_method,
    "consistent": consistent_method,
    "targets": targets_method,
}
"""Name at the command line → method."""
