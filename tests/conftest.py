"""Fixtures for all tests: the folders of real logs, or a skip that says why."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings

# How long an example takes tells how busy the machine is, not whether the code is right.
settings.register_profile("steady", deadline=None)
settings.load_profile("steady")


@pytest.fixture(scope="session")
def logs() -> Path:
    """The folder of real logs that VFT_LOGS names."""
    folder = os.environ.get("VFT_LOGS", "")
    if not folder:
        pytest.skip("VFT_LOGS is not set: the real logs are not part of the repository")
    return Path(folder)


@pytest.fixture(scope="session")
def samples(logs: Path) -> Path:
    """The folder of sample files, beside the real logs."""
    folder = logs.parent / "samples"
    if not folder.is_dir():
        pytest.skip("the folder of samples is not beside VFT_LOGS")
    return folder


@pytest.fixture(scope="session")
def loaded() -> Callable[[str], set[str]]:
    """What Python has loaded once some modules, as "a, b", are imported in a process of its own."""

    def after(modules: str) -> set[str]:
        script = f"import sys, {modules}\nprint(*sys.modules)"
        command = [sys.executable, "-c", script]
        return set(
            subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        )

    return after
