"""For the tests of readers: where a log of any kind is written."""

from pathlib import Path

import pytest


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file in a folder of its own, without an ending: the content tells what it is."""
    return tmp_path / "x"
