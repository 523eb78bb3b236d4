"""The commands without pin, rerun-sdk and pyarrow: what can be done is done, the rest says how."""

import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest
from example_logs import CIRCLE

from vftcli.readers.reading import read

pytestmark = pytest.mark.statistical  # long: CI does the same in an environment without the three


FEW = "--robot", "ur5", "--interval", "0:6"

HIDDEN = "pinocchio", "rerun", "pyarrow"


def launched(*words: object) -> subprocess.CompletedProcess[str]:
    """The command in a process in which the three cannot be imported."""
    script = (
        f"import sys; sys.modules |= dict.fromkeys({HIDDEN}); "
        "from vftcli.cli import launch; launch()"
    )
    command = [sys.executable, "-c", script, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report, estimates with the wrench, and the log as Parquet, made without the three."""
    folder = tmp_path_factory.mktemp("slim")
    bare = "parquet without units beside its columns: pip install pyarrow"
    no_recording = "recording.rrd not written: pip install rerun-sdk"
    estimate = ("estimate", CIRCLE, *FEW, "--observer", "gmo", "--wrench")
    for words, lines in {
        ("report", CIRCLE, *FEW, "-o", folder / "report"): [no_recording, f"estimates.{bare}"],
        (*estimate, "-o", folder / "out"): [f"estimates.{bare}"],
        ("convert", CIRCLE, "-o", folder / "log.parquet"): [f"log.{bare}"],
    }.items():
        done = launched(*words)
        assert done.returncode == 0, done.stderr
        assert [line for line in done.stderr.splitlines() if "pip install" in line] == lines
    return folder


def test_a_report_holds_all_but_the_recording(folder: Path) -> None:
    there = {path.name for path in (folder / "report").iterdir()}
    assert {"index.html", "run.json", "estimates.parquet", "contacts.json"} <= there
    assert "recording.rrd" not in there


def test_a_table_made_without_pyarrow_reads_the_same_with_it(folder: Path) -> None:
    made, logged = read(folder / "log.parquet"), read(CIRCLE)
    for name in logged.signals:
        assert (getattr(made, name) == getattr(logged, name)).all()
    assert "wrench/gmo/fx" in pl.read_parquet_schema(folder / "out" / "estimates.parquet")


@pytest.mark.parametrize(
    "words",
    [
        ("inspect", CIRCLE),
        ("compare", CIRCLE, "--robot", "ur5", "--reference", "zero", "--interval", "0:4"),
        ("identify", CIRCLE, "--robot", "ur5", "--method", "gains", "-o", "gains.toml"),
        ("identify", CIRCLE, "--robot", "ur5", "--method", "friction", "-o", "mine.toml"),
        ("benchmark", "speed", "--set", "bench.rounds=1", "--set", "bench.samples=1200"),
    ],
)
def test_what_needs_none_of_them_works(words: tuple[str, ...], folder: Path) -> None:
    done = launched(*(folder / w if "." in str(w) and "=" not in str(w) else w for w in words))
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("simulate", "ur5-circle", "-o", "x.csv"), "vftcli simulate needs pin"),
        (("admit", "--release", "x=0.3", "--robot", "ur5"), "vftcli admit needs pin"),
        (("estimate", CIRCLE, "--robot", "ur5", "--rrd", "-o", "x"),
         "recording.rrd (--rrd, --open) needs rerun-sdk"),
        (("compare", CIRCLE, "--robot", "ur5", "--reference", "zero", "--as-printed"),
         "a Pinocchio model (simulation, replay, --as-printed) needs pin"),
    ],
)  # fmt: skip
def test_the_others_say_what_is_missing(words: tuple[str, ...], line: str) -> None:
    done = launched(*words)
    package = line.rsplit(maxsplit=1)[-1]
    expected = f"error: {line}, which is not installed here: pip install {package}"
    assert (done.returncode, done.stderr.splitlines()[-1]) == (1, expected)
    assert not Path("x.csv").exists()


@pytest.mark.parametrize("start", [b"ARROW1\0\0", b"PAR1"])
def test_a_parquet_or_arrow_file_is_named_with_the_remedy(start: bytes, tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(start + bytes(64))
    done = launched("inspect", tmp_path / "log")
    assert done.returncode == 1
    assert ": a Parquet or Arrow file needs pyarrow" in done.stderr
    assert done.stderr.endswith(": pip install pyarrow\n")
