"""The commands without pin and rerun-sdk: what can be done is done, the rest says how."""

import subprocess
import sys
from pathlib import Path

import pytest
from example_logs import CIRCLE

pytestmark = pytest.mark.statistical  # long: CI does the same in an environment without the two

FEW = "--robot", "ur5", "--interval", "0:6"

HIDDEN = "pinocchio", "rerun"


def launched(*words: object) -> subprocess.CompletedProcess[str]:
    """The command in a process in which the two cannot be imported."""
    script = (
        f"import sys; sys.modules |= dict.fromkeys({HIDDEN}); "
        "from vftcli.cli import launch; launch()"
    )
    command = [sys.executable, "-c", script, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report, estimates with the wrench, and the log as Parquet, made without the two."""
    folder = tmp_path_factory.mktemp("slim")
    no_recording = "recording.rrd not written: pip install rerun-sdk"
    estimate = ("estimate", CIRCLE, *FEW, "--observer", "gmo", "--wrench")
    for words, lines in {
        ("report", CIRCLE, *FEW, "-o", folder / "report"): [no_recording],
        (*estimate, "-o", folder / "out"): [],
        ("convert", CIRCLE, "-o", folder / "log.parquet"): [],
    }.items():
        done = launched(*words)
        assert done.returncode == 0, done.stderr
        assert [line for line in done.stderr.splitlines() if "pip install" in line] == lines
    return folder


def test_a_report_holds_all_but_the_recording(folder: Path) -> None:
    there = {path.name for path in (folder / "report").iterdir()}
    assert {"index.html", "run.json", "estimates.parquet", "contacts.json"} <= there
    assert "recording.rrd" not in there


@pytest.mark.parametrize("words", [
    ("inspect", CIRCLE),
    ("compare", CIRCLE, "--robot", "ur5", "--reference", "zero", "--interval", "0:4"),
    ("identify", CIRCLE, "--robot", "ur5", "--method", "gains", "-o", "gains.toml"),
    ("identify", CIRCLE, "--robot", "ur5", "--method", "friction", "-o", "mine.toml"),
    ("benchmark", "speed", "--set", "bench.rounds=1", "--set", "bench.samples=1200"),
])  # fmt: skip
def test_what_needs_none_of_them_works(words: tuple[str, ...], folder: Path) -> None:
    done = launched(*(folder / w if "." in str(w) and "=" not in str(w) else w for w in words))
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
