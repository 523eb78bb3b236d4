"""Packages: our version; optional ones, loaded when needed. An error names a missing one."""

import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from vftcli.signals.errors import PackageError, VftError

VERSION = "0.3.0"  #: The version that every output states.
#: Module → the package that holds it, and how to install it.
PACKAGES = {
    "pinocchio": ("pin", "pip install pin"),
    "rerun": ("rerun-sdk", "pip install rerun-sdk"),
    "h5py": ("h5py", "pip install 'vftcli[hdf5]'"),
    "xacro": ("xacro", "pip install 'vftcli[xacro]'"),
    "xacrodoc": ("xacrodoc", "pip install 'vftcli[xacro]'"),
    "matplotlib": ("matplotlib", "pip install 'vftcli[figures]'"),
}

if sys.platform == "win32":
    PACKAGES["pinocchio"] = ("pin", "conda install -c conda-forge pinocchio")  # no wheel there


def installed(module: str) -> bool:
    """Whether a package of this module is there; it is not loaded."""
    return find_spec(module) is not None


def check_installed(module: str, what: str) -> None:
    """See, without loading it, whether a needed package is there."""
    if not installed(module):
        needed(module, what)


def needed(
    module: str, what: str, otherwise: str = "", error: type[VftError] = PackageError
) -> Any:  # noqa: ANN401 - a module
    """The module that something needs."""
    try:
        return import_module(module)
    except ImportError as failure:
        root = module.partition(".")[0]
        package, install = PACKAGES[root]
        absent = isinstance(failure, ModuleNotFoundError) and failure.name == root
        why = "is not installed here" if absent else f"cannot be loaded ({failure})"
        raise error(f"{what} needs {package}, which {why}: {install}{otherwise}") from None


def door(room: str, *files: str) -> Callable[[str], Any]:
    """The `__getattr__` of a room that loads its files when they are used."""

    def attribute(name: str) -> Any:  # noqa: ANN401 - the names are of every kind
        if name in sys.modules[room].__all__:
            for file in files:
                if hasattr(found := import_module(f"{room}.{file}"), name):
                    return getattr(found, name)
        raise AttributeError(f"module {room!r} has no attribute {name!r}")

    return attribute
