"""The program as the shell calls it: it leaves at once, all written, with the right code."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from vftcli.signals.errors import ParameterError

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
TRUTH = f"file:{FIXTURE}.truth.parquet"
PROGRAM = "import sys; sys.argv[0] = 'vftcli'; from vftcli.cli import launch; launch()"


def launched(
    *words: object, begin: tuple[str, ...] = ("-m", "vftcli"), **how: Any
) -> subprocess.CompletedProcess[str]:
    """The program as a process of its own, begun as a module unless another begin is given."""
    command = [sys.executable, *begin, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **how)


def limited(which: str, size: int) -> dict[str, Any]:
    """How a process is begun with a limit."""
    resource = pytest.importorskip("resource")
    return {"preexec_fn": lambda: resource.setrlimit(getattr(resource, which), (size, size))}


@pytest.mark.parametrize(
    ("words", "code"), [(("help",), 0), (("help", "robots", "nobody"), 1), (("estimate",), 2)]
)
def test_exit_codes(words: tuple[str, ...], code: int) -> None:
    done = launched(*words)
    assert done.returncode == code
    assert "__main__" not in done.stderr  # the program is called by its name


@pytest.mark.slow
def test_long_output_arrives_whole_through_a_pipe() -> None:
    done = launched("compare", FIXTURE, "--robot", "ur5", "--reference", TRUTH, "--json")
    assert done.returncode == 0
    assert done.stdout.rstrip().endswith("}")


def test_functions_registered_for_the_exit_are_called() -> None:
    script = "import atexit; atexit.register(lambda: print('called at exit')); " + PROGRAM
    done = launched("--version", begin=("-c", script))
    assert done.returncode == 0
    assert done.stdout.splitlines()[-1] == "called at exit"


@pytest.mark.slow
def test_files_are_complete_when_it_has_left(tmp_path: Path) -> None:
    done = launched("estimate", FIXTURE, "--robot", "ur5", "-o", tmp_path / "out")
    assert done.returncode == 0
    assert pl.read_parquet(tmp_path / "out" / "estimates.parquet").height == 2501


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("--help",), 1, "error: standard output is closed\n"),
        (("help", "robots"), 1, "error: standard output is closed\n"),
        (("estimate",), 2, "Missing argument"),
    ],
)
def test_a_closed_output_is_one_line(words: tuple[str, ...], code: int, said: str) -> None:
    shell = ["sh", "-c", 'exec "$@" >&-', "sh", sys.executable, "-c", PROGRAM, *words]
    done = subprocess.run(shell, capture_output=True, text=True, check=False)
    assert done.returncode == code
    assert said in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_without_streams_the_files_are_written(tmp_path: Path) -> None:
    """What takes the place of a closed stream is no output file, into which words would go."""
    words = ["convert", FIXTURE, "-o", tmp_path / "x.csv"]
    shell = ["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", sys.executable, "-c", PROGRAM]
    done = subprocess.run([*shell, *map(str, words)], check=False)
    assert done.returncode == 0
    assert (tmp_path / "x.csv").read_text(encoding="utf-8").startswith("t,")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_command_says_so_and_leaves_nothing(tmp_path: Path, number: int) -> None:
    """The signal comes while half of the files are written, and again while they are removed."""
    script = (
        "import os, shutil, polars\n"
        f"polars.DataFrame.write_csv = lambda *_, **__: os.kill(os.getpid(), {int(number)})\n"
        "remove = shutil.rmtree\n"
        f"shutil.rmtree = lambda *a, **k: (os.kill(os.getpid(), {int(number)}), remove(*a, **k))\n"
    )
    words = ["estimate", FIXTURE, "--robot", "ur5", "--csv", "--anyway", "-o", tmp_path / "out"]
    done = launched(*words, begin=("-c", script + PROGRAM))
    assert done.returncode == 128 + number
    lines = [line for line in done.stderr.splitlines() if not line.startswith("note: ")]
    assert lines == ["log health: sound", "error: interrupted; run the command again"]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("words", [(), ("--rrd", "-v")])
def test_a_full_disk_is_one_error_in_words_of_the_system(
    tmp_path: Path, words: tuple[str, ...]
) -> None:
    """Polars' own "File out of specification: underlying IO error" stood around them."""
    limit = limited("RLIMIT_FSIZE", 60_000)
    done = launched("estimate", FIXTURE, "-o", tmp_path / "out", *words, **limit)
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if not line.startswith("note: ")]
    full = "error: estimates.parquet cannot be written: file too large; give another -o"
    # With --details there is more between the two, on the log: the answer comes first.
    assert [lines[0], *[x for x in lines if "error" in x]] == ["log health: sound", full]
    assert list(tmp_path.iterdir()) == []


def test_a_limit_on_memory_that_holds_no_library_is_one_line(tmp_path: Path) -> None:
    """Libraries ended the program with words of their own, thousands of lines at some limits."""
    limit = limited("RLIMIT_AS", 700_000_000)
    done = launched("estimate", FIXTURE, "-o", tmp_path / "out", **limit)
    assert done.returncode == 1
    assert done.stderr.startswith(
        "error: the memory limit of 0.7 GB (ulimit -v) is less than the 3"
    )
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError(), "error: out of memory; use --interval to take a part of the log\n"),
        (OSError(28, "No space left", "x.csv"), "error: No space left: x.csv\n"),
        (OSError(5, "Input/output error"), "error: Input/output error\n"),
        (OSError("odd"), "error: odd\n"),
        (BrokenPipeError(32, "Broken pipe"), ""),  # nobody reads any more
        (ParameterError("two\n  lines\x07"), "error: two lines\\x07\n"),
    ],
)
def test_what_goes_wrong_is_one_line(
    run, monkeypatch: pytest.MonkeyPatch, error: Exception, said: str
) -> None:
    def fail(**_: object) -> None:
        raise error

    monkeypatch.setattr("vftcli.cli.make_app", lambda _: fail)
    assert run("inspect") == (1, "", said)


@pytest.mark.slow
def test_the_caller_s_threads_of_linear_algebra_change_no_byte(tmp_path: Path) -> None:
    """The order of sums moved the last digits of the estimates."""
    made = []
    for threads in ("1", "4"):
        folder = tmp_path / threads
        env = {**os.environ, "OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads}
        words = ("--robot", "ur5", "--observer", "best", "-o", folder)
        assert launched("estimate", FIXTURE, *words, env=env).returncode == 0
        made.append((folder / "estimates.parquet").read_bytes())
    assert made[0] == made[1]


@pytest.mark.slow
@pytest.mark.parametrize("command", ["report", "estimate"])
def test_the_answer_needs_neither_scipy_nor_rerun_and_no_file(command: str, tmp_path) -> None:
    """The screen is there before anything is written, and before what writes is loaded."""
    script = (
        "import sys, vftcli.outputs.files as files\n"
        "def refuse(*_):\n"
        "    heavy = {'scipy', 'rerun', 'pinocchio', 'matplotlib'} & sys.modules.keys()\n"
        "    raise files.OutputError(f'the disk is full; loaded: {sorted(heavy)}')\n"
        "files.OutputFolder.__enter__ = refuse\n"
        "from vftcli.cli import launch\n"
        "launch()\n"
    )
    words = [command, FIXTURE, "--robot", "ur5", "-o", "out"]
    if command == "report":
        words += ["--reference", "two-cycle"]
    done = launched(*words, begin=("-c", script), cwd=tmp_path)
    assert "12 contacts" in done.stdout
    assert done.returncode == 1
    assert "loaded: []" in done.stderr
    assert not (tmp_path / "out").exists()
