"""The program as the shell calls it: it leaves at once, all written, with the right code."""

import subprocess
import sys
from pathlib import Path

import pytest

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"
PROGRAM = "import sys; sys.argv[0] = 'vftcli'; from vftcli.cli import launch; launch()"


def launched(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    ("words", "code"), [(("robots",), 0), (("robots", "nobody"), 1), (("estimate",), 2)]
)
def test_exit_codes(words: tuple[str, ...], code: int) -> None:
    assert launched(*words).returncode == code


def test_long_output_arrives_whole_through_a_pipe() -> None:
    done = launched("compare", FIXTURE, "--robot", "ur5", "--reference", "zero", "--json")
    assert done.returncode == 0
    assert done.stdout.rstrip().endswith("]")


def test_functions_registered_for_the_exit_are_called() -> None:
    script = "import atexit; atexit.register(lambda: print('called at exit')); " + PROGRAM
    done = subprocess.run(
        [sys.executable, "-c", script, "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "called at exit"


def test_files_are_complete_when_it_has_left(tmp_path: Path) -> None:
    import polars as pl

    done = launched("estimate", FIXTURE, "--robot", "ur5", "-o", tmp_path / "out")
    assert done.returncode == 0
    assert pl.read_parquet(tmp_path / "out" / "estimates.parquet").height == 2501
