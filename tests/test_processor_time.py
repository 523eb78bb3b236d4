"""The limit on processor time: a test over it fails unless it is marked slow."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = """
import time, pytest

def work():
    end = time.process_time() + 0.4
    while time.process_time() < end: pass

@pytest.fixture(scope="module")
def shared(): work()

def test_quick(): pass

def test_first(shared): pass

def test_second(shared): pass

@pytest.mark.slow
def test_marked(): work()
"""

HIDDEN = ["scipy", "polars", "pinocchio", "rerun", "distributed", "matplotlib"]  # seconds to load
PROGRAM = f"""
import sys; sys.modules |= dict.fromkeys({HIDDEN}); import pytest; sys.exit(pytest.main())
"""


@pytest.mark.slow
def test_a_long_test_fails_unless_it_is_marked(tmp_path: Path) -> None:
    shutil.copy(Path(__file__).with_name("conftest.py"), tmp_path)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = slow\n")
    (tmp_path / "test_a.py").write_text(TESTS)
    words = [sys.executable, "-c", PROGRAM, "-p", "no:cacheprovider"]
    words += ["--cpu-limit", "0.2", "--cpu-record", "times.tsv"]
    outer = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_XDIST")}
    bare = outer | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTEST_ADDOPTS": ""}
    how = {"cwd": tmp_path, "env": bare, "capture_output": True, "text": True}
    done = subprocess.run(words, check=False, **how)
    assert "FAILED test_a.py::test_first - Failed: " in done.stdout
    assert "1 failed, 3 passed" in done.stdout
    lines = (tmp_path / "times.tsv").read_text("utf-8").splitlines()
    times = dict(line.split("\t") for line in lines)
    long = {name.split("::")[1] for name, spent in times.items() if float(spent) > 0.2}
    assert long == {"test_first", "test_marked"}
