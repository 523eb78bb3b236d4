"""The program as the shell calls it: exit codes, streams, how much is said, what is opened."""

import csv
import ctypes
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import webbrowser
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from example_logs import CIRCLE, FIXTURES, TAPS

from vftcli.cli.console import canvas, say, speaking
from vftcli.cli.options import LARGE, give_back
from vftcli.signals.errors import ParameterError

# The program as the shell calls it: it leaves at once, all written, with the right code.

PROGRAM = "import sys; sys.argv[0] = 'vftcli'; from vftcli.cli import launch; launch()"


def launched(
    *words: object, begin: tuple[str, ...] = ("-m", "vftcli"), **how: Any
) -> subprocess.CompletedProcess[str]:
    """The program as a process of its own, begun as a module unless another begin is given."""
    command = [sys.executable, *begin, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **how)


def limited(which: str, size: int) -> dict[str, Any]:
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
    truth = f"file:{CIRCLE}.truth.parquet"
    done = launched("compare", CIRCLE, "--robot", "ur5", "--reference", truth, "--json")
    assert (done.returncode, done.stdout.rstrip()[-1:]) == (0, "}")


@pytest.mark.slow
def test_files_are_complete_when_it_has_left(tmp_path: Path) -> None:
    done = launched("estimate", CIRCLE, "--robot", "ur5", "-o", tmp_path / "out")
    assert done.returncode == 0
    assert pl.read_parquet(tmp_path / "out" / "estimates.parquet").height == 2501


@pytest.mark.parametrize(("words", "code", "said"), [
    (("--help",), 1, "error: standard output is closed\n"),
    (("help", "robots"), 1, "error: standard output is closed\n"),
    (("estimate",), 2, "Missing argument"),
])  # fmt: skip
def test_a_closed_output_is_one_line(words: tuple[str, ...], code: int, said: str) -> None:
    shell = ["sh", "-c", 'exec "$@" >&-', "sh", sys.executable, "-c", PROGRAM, *words]
    done = subprocess.run(shell, capture_output=True, text=True, check=False)
    assert done.returncode == code
    assert said in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_without_streams_the_files_are_written(tmp_path: Path) -> None:
    """What takes the place of a closed stream is no output file, into which words would go."""
    words = ["convert", CIRCLE, "-o", tmp_path / "x.csv"]
    shell = ["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", sys.executable, "-c", PROGRAM]
    done = subprocess.run([*shell, *map(str, words)], check=False)
    assert done.returncode == 0
    assert (tmp_path / "x.csv").read_text(encoding="utf-8").startswith("t,")


def test_an_interrupt_while_the_program_loads_is_no_traceback() -> None:
    script = (
        "import os, runpy, signal, sys\n"
        "class Interrupt:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'vftcli.cli':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupt())\n"
        "runpy.run_module('vftcli', run_name='__main__')\n"
    )
    done = launched("--version", begin=("-c", script))
    assert done.returncode == -signal.SIGINT  # 130 in a shell
    assert done.stdout + done.stderr == ""


def test_an_interrupt_that_a_library_swallows_ends_the_command() -> None:
    """NumPy's random module dropped it while it loaded, and the command ran to its end."""
    script = (
        "import os, signal, sys\n"
        "class Swallows:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'vftcli.pipeline':\n"
        "            try:\n"
        "                os.kill(os.getpid(), signal.SIGINT)\n"
        "            except BaseException:\n"
        "                pass\n"
        "sys.meta_path.insert(0, Swallows())\n"
    )
    done = launched("contacts", CIRCLE, begin=("-c", script + PROGRAM))
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr.endswith("error: interrupted; run the command again\n")


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
    words = ["estimate", CIRCLE, "--robot", "ur5", "--csv", "--anyway", "-o", tmp_path / "out"]
    done = launched(*words, begin=("-c", script + PROGRAM))
    assert done.returncode == 128 + number
    lines = [line for line in done.stderr.splitlines() if not line.startswith("note: ")]
    assert lines == ["log health: sound", "error: interrupted; run the command again"]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("words", [(), ("--rrd", "-v")])
def test_a_full_disk_is_one_error_in_words_of_the_system(tmp_path, words):
    """Polars' own "File out of specification: underlying IO error" stood around them."""
    limit = limited("RLIMIT_FSIZE", 60_000)
    done = launched("estimate", CIRCLE, "-o", tmp_path / "out", *words, **limit)
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if not line.startswith("note: ")]
    full = "error: estimates.parquet cannot be written: file too large; give another -o"
    # With --details there is more between the two, on the log: the answer comes first.
    assert [lines[0], *[x for x in lines if "error" in x]] == ["log health: sound", full]
    assert list(tmp_path.iterdir()) == []


def test_a_limit_on_memory_that_holds_no_library_is_one_line(tmp_path: Path) -> None:
    """Libraries ended the program with words of their own, thousands of lines at some limits."""
    limit = limited("RLIMIT_AS", 700_000_000)
    done = launched("estimate", CIRCLE, "-o", tmp_path / "out", **limit)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "error: the memory limit of 0.7 GB (ulimit -v) is less than the 3" in done.stderr


@pytest.mark.parametrize(("error", "said"), [
    (MemoryError(), "error: out of memory; use --interval to take a part of the log\n"),
    (OSError(28, "No space left", "x.csv"), "error: No space left: x.csv\n"),
    (OSError(5, "Input/output error"), "error: Input/output error\n"),
    (OSError("odd"), "error: odd\n"),
    (BrokenPipeError(32, "Broken pipe"), ""),  # nobody reads any more
    (ParameterError("two\n  lines\x07"), "error: two lines\\x07\n"),
])  # fmt: skip
def test_what_goes_wrong_is_one_line(run, monkeypatch, error, said):
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
        assert launched("estimate", CIRCLE, *words, env=env).returncode == 0
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
    )
    words = [command, CIRCLE, "--robot", "ur5", "-o", "out"]
    if command == "report":
        words += ["--reference", "two-cycle"]
    done = launched(*words, begin=("-c", script + PROGRAM), cwd=tmp_path)
    assert "12 contacts" in done.stdout
    assert done.returncode == 1
    assert "loaded: []" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("words", [("report", "--reference", "vendor"), ("estimate",)])
def test_the_first_lines_come_before_any_observer(words: tuple[str, ...], tmp_path) -> None:
    """They need the contacts alone; what fails later costs what it fails at."""
    script = (
        "import sys, vftcli.pipeline as pipeline\n"
        "def refuse(*_):\n"
        "    raise pipeline.VftError(f'no observer; tables: {\"polars\" in sys.modules}')\n"
        "pipeline.observe = refuse\n"
    )
    command, *more = words
    begin = ("-c", script + PROGRAM)
    done = launched(command, CIRCLE, *more, "-o", "out", begin=begin, cwd=tmp_path)
    assert "12 contacts. The hardest, at 5.1 s" in done.stdout
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "error: no observer; tables: False"


@pytest.mark.slow
def test_a_recording_is_written_without_pandas(tmp_path: Path) -> None:
    """Pyarrow imports it for others wherever it is installed, as beside most notebooks."""
    last = "print('rerun' in sys.modules, 'pandas' in sys.modules)"
    script = f"import atexit, sys\natexit.register(lambda: {last})\n"
    words = ("report", CIRCLE, "--robot", "ur5", "--interval", "0:4", "-o", tmp_path / "out")
    done = launched(*words, begin=("-c", script + PROGRAM))
    assert done.stdout.endswith("True False\n")
    assert "Warning" not in done.stderr
    assert (tmp_path / "out" / "recording.rrd").stat().st_size


# How much is said and to whom: -v, -q, colours, stages; a bad log of several is left out.

OF_TAPS = f"file:{TAPS}.truth.parquet"
OTHER = FIXTURES / "panda_bag"


class Terminal(io.StringIO):
    """Standard output that is a terminal."""

    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


def test_lines_stay_lines_and_what_a_terminal_obeys_is_shown(capsys) -> None:
    with speaking(details=False, quiet=False):
        say("one\x1b[2J\ntwo\rthree")
    assert capsys.readouterr().err == "one\\x1b[2J\ntwo\\rthree\n"


@pytest.mark.parametrize(
    ("variables", "colour"),
    [({}, True), ({"NO_COLOR": "1"}, False), ({"NO_COLOR": ""}, True), ({"TERM": "dumb"}, False)],
)
def test_colours_and_letters_are_those_that_a_terminal_wants(monkeypatch, variables, colour):
    monkeypatch.delenv("NO_COLOR", raising=False)
    for name, value in {"TERM": "xterm", **variables}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("sys.stdout", Terminal())
    assert (canvas().colour, canvas().unicode) == (colour, True)
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
    assert (canvas().colour, canvas().unicode) == (False, False)


@pytest.fixture
def logs(tmp_path: Path) -> tuple[Path, Path]:
    """Two logs, of which the second is none."""
    good, bad = tmp_path / "good.csv", tmp_path / "bad.csv"
    shutil.copy(TAPS, good)
    bad.write_text("# no log\n")
    return good, bad


def test_a_report_writes_the_others_and_fails(logs, tmp_path: Path, run) -> None:
    out = tmp_path / "out"
    code, stdout, err = run("report", *logs, "--robot", "ur5", "-o", out)
    assert code == 3
    assert "error: bad.csv left out: " in err
    assert err.count("error: ") == 1
    assert (out / "good" / "index.html").exists()
    assert not (out / "bad").exists()
    assert "✗ left out" in stdout
    record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    assert list(record["left_out"]) == ["bad.csv"]
    assert [log["folder"] for log in record["logs"]] == ["good"]


def test_lists_and_tables_show_the_others_and_fail(logs: tuple[Path, Path], run) -> None:
    words = (*logs, "--robot", "ur5")
    code, out, _ = run("contacts", *words, "--json")
    assert code == 3
    assert [record["recording"] for record in json.loads(out)["logs"]] == ["good.csv"]
    code, out, _ = run("compare", *words, "--observer", "gmo", "--reference", OF_TAPS, "--csv")
    assert code == 3
    rows = csv.DictReader(io.StringIO(out))
    assert {row["recording"] for row in rows} == {"good.csv"}


def test_if_all_are_bad_nothing_is_written(tmp_path: Path, run) -> None:
    bad = [tmp_path / name for name in ("one.csv", "two.csv")]
    for path in bad:
        path.write_text("# no log\n")
    out, zero = tmp_path / "out", ("--reference", "zero")
    for name, *options in (("report", "-o", out), ("contacts",), ("compare", *zero)):
        code, stdout, err = run(name, *bad, *options)
        assert (code, stdout) == (1, "")
        assert "none of the logs can be analysed" in err
    assert not out.exists()


def test_each_log_has_the_robot_that_it_settles_itself(ran) -> None:
    out = ran("contacts", TAPS, OTHER)[0]
    assert out.startswith("2 logs · ur5 and panda")


def test_of_several_logs_each_health_line_names_its_own(run) -> None:
    logs = (TAPS, FIXTURES / "ur5_circle.csv")
    words = ("--robot", "ur5", "--observer", "gmo", "--reference", "zero")
    said = [line for line in run("compare", *logs, *words)[2].splitlines() if "health" in line]
    assert said == [f"{log.name}: log health: sound" for log in logs]
    assert run("compare", TAPS, *words)[2].startswith("log health: sound\n")


def test_quiet_prints_errors_only_and_tables_that_are_asked_for(tmp_path: Path, run) -> None:
    words = ("--robot", "ur5", "--observer", "gmo", "-q")
    assert run("estimate", TAPS, *words, "-o", tmp_path / "out") == (0, "", "")
    code, out, err = run("compare", TAPS, *words, "--reference", OF_TAPS)
    assert (code, err) == (0, "")
    assert "gmo" in out


def test_details_say_everything_that_is_known(tmp_path: Path, run) -> None:
    words = ("estimate", TAPS, "--robot", "ur5", "--observer", "gmo")
    _, short, usual = run(*words, "-o", tmp_path / "one")
    _, same, details = run(*words, "-o", tmp_path / "two", "-v")
    assert "note: " not in usual
    assert "note: " in details
    assert short.splitlines()[:2] == same.splitlines()[:2]


def test_a_log_of_one_sample_has_no_rate(tmp_path: Path, run) -> None:
    path = tmp_path / "one.csv"
    path.write_text("".join(TAPS.read_text().splitlines(keepends=True)[:2]))
    code, _, err = run("identify", path, "--robot", "ur5", "-o", tmp_path / "out.toml", "-v")
    assert code != 0
    assert "6 joints, 1 sample, 0.0 s\n" in err


# What `--open` does: no browser and no viewer is started here.

RELEASED = ("admit", "--release", "x=0.1", "--robot", "ur5", "--set", "admittance.duration=1")


@pytest.fixture
def opened(monkeypatch) -> list[str]:
    """What would have been opened: addresses of pages, and files given to the viewer."""
    found: list[str] = []

    def start(words: list[str], **_how: object) -> None:
        assert words[:3] == [sys.executable, "-m", "rerun"]
        found.append(words[3])

    monkeypatch.setattr(webbrowser, "open", lambda address: found.append(address) or True)
    monkeypatch.setattr(subprocess, "Popen", start)
    return found


def test_a_page_goes_before_the_recording_and_that_is_named(ran, opened, tmp_path: Path) -> None:
    out = tmp_path / "o t"
    out.mkdir()
    (out / "recording.rrd").touch()
    err = ran(*RELEASED, "-o", out, "--open")[1]
    assert opened == [(out / "index.html").resolve().as_uri()]
    assert f"wrote {out}: open {out / 'index.html'}\n" in err
    assert f"the recording: rerun {out / 'recording.rrd'}\n" in err


def test_no_browser_is_said(ran, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(webbrowser, "open", lambda _address: False)
    err = ran(*RELEASED, "-o", tmp_path / "out", "--open")[1]
    assert f"no browser could be started: open {tmp_path / 'out' / 'index.html'} in one" in err


def test_open_of_estimates_implies_the_recording(run, opened: list[str], tmp_path: Path) -> None:
    fast = ("--robot", "ur5", "--causal", "--observer", "gmo", "--interval", "0:4")
    assert run("estimate", CIRCLE, *fast, "-o", tmp_path, "--open")[0] == 0
    assert opened == [str(tmp_path / "recording.rrd")]


def test_without_a_folder_there_is_nothing_to_open(run, opened: list[str]) -> None:
    code, _, err = run(*RELEASED, "--open")
    assert code == 2
    assert "give -o too" in err
    assert not opened


# Freed memory goes back through the C library; another library does no harm.


def test_the_c_library_knows_it_once_it_can(monkeypatch: pytest.MonkeyPatch) -> None:
    reported: list[tuple[int, int]] = []

    class Library:
        def mallopt(self, what: int, size: int) -> None:
            reported.append((what, size))

    monkeypatch.setenv("ARROW_DEFAULT_MEMORY_POOL", "mimalloc")
    monkeypatch.setattr(ctypes, "CDLL", lambda _: Library())
    give_back()
    # M_MMAP_THRESHOLD and M_TRIM_THRESHOLD of malloc.h.
    assert reported == [(-3, LARGE), (-1, 2 * LARGE)]
    monkeypatch.setattr(ctypes, "CDLL", lambda _: object())  # one without mallopt
    give_back()
