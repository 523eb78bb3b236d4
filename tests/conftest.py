"""Fixtures for all tests: the folders of real logs, or a skip that says why."""

import os
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
