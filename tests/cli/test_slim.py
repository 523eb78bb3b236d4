"""The commands without pin and rerun-sdk: what can be done is done, the rest says how."""

import subprocess
import sys
from pathlib import Path

import pytest
from example_logs import CIRCLE

pytestmark = pytest.mark.statistical  # long

HIDDEN = "pinocchio", "rerun"


def launched(*words: object) -> subprocess.CompletedProcess[str]:
    """The command in a process in which the two cannot be imported."""
    hidden = f"import sys; sys.modules |= dict.fromkeys({HIDDEN}); "
    script = hidden + "from vftcli.cli import launch; launch()"
    command = [sys.executable, "-c", script, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("words", [
    ("convert", CIRCLE, "-o", "log.parquet"),
    ("identify", CIRCLE, "--robot", "ur5", "--method", "friction", "-o", "mine.toml"),
    ("benchmark", "speed", "--set", "bench.rounds=1", "--set", "bench.samples=1200"),
])  # fmt: skip
def test_what_needs_none_of_them_works(words: tuple[str, ...]) -> None:
    """What else does is tried where the wheel is, in an environment without the two."""
    done = launched(*words)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("words", "line"), [
    (("simulate", "ur5-circle", "-o", "x.csv"), "vftcli simulate needs pin"),
    (("admit", "--release", "x=0.3", "--robot", "ur5"), "vftcli admit needs pin"),
    (("estimate", CIRCLE, "--robot", "ur5", "--rrd", "-o", "x"),
     "recording.rrd (--rrd, --open) needs rerun-sdk"),
    (("compare", CIRCLE, "--robot", "ur5", "--reference", "zero", "--as-printed"),
     "a Pinocchio model (simulation, replay, --as-printed) needs pin"),
])  # fmt: skip
def test_the_others_say_what_is_missing(words: tuple[str, ...], line: str) -> None:
    done = launched(*words)
    package = line.rsplit(maxsplit=1)[-1]
    expected = f"error: {line}, which is not installed here: pip install {package}"
    assert (done.returncode, done.stderr.splitlines()[-1]) == (1, expected)
    assert not Path("x.csv").exists()
