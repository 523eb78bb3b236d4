"""The line that says how far the work is: bar, stage, time left, and nothing printed into it."""

import io
import json
import os
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator

import pytest
from example_logs import BEARING, CIRCLE, EPISODES, TAPS

from vftcli.cli.console import echo_top, speaking
from vftcli.cli.progress import Stages, fitted
from vftcli.signals.progress import heard_by, stage, steps


@pytest.fixture
def now(monkeypatch) -> list[float]:
    """The clock, which goes only as the test moves it; nothing ticks."""
    time = [0.0]
    monkeypatch.setattr("vftcli.cli.progress.time.monotonic", lambda: time[0])
    monkeypatch.setattr(Stages, "_wait", lambda *_: None)
    monkeypatch.setenv("COLUMNS", "80")
    return time


@pytest.fixture
def stages(now: list[float]) -> Iterator[Stages]:  # noqa: ARG001 - made on that clock
    """The line, which hears how far the work is."""
    line = Stages()
    with heard_by(line.hear):
        yield line


@pytest.fixture
def shown(capsys) -> Callable[[], str]:
    """What has been written to the terminal since it was asked before."""
    return lambda: capsys.readouterr().err.replace("·", ".")


def bar(done: int) -> str:
    return f"[{'#' * done}{'.' * (20 - done)}]"


def test_work_over_a_second_shows_share_stage_and_time_left(now, stages: Stages, shown) -> None:
    stage("reading")
    assert shown() == ""
    now[0] = 2.0
    stage("running observers", 0.2, 0.6)
    # A fifth in 2 s: the other four fifths take 8 s.
    assert shown() == f"\r{bar(4)} 20 %  running observers  0:08 left"
    now[0] = 120.0
    for _ in steps("ab"):
        stages._tick()
    # Half of the stage, which goes from .2 to .6, is .4; it is shown though no stage has begun.
    assert shown().endswith(f"\r{bar(8)} 40 %  running observers  3:00 left")
    # The next log begins anew: its own speed counts, of which nothing is known yet.
    stage("b.csv: reading", 0.0, 0.1)
    assert shown().strip("\r").rstrip() == f"{bar(0)}  0 %  b.csv: reading"
    stages.end()
    assert shown().strip() == ""
    stages._tick()
    assert shown() == ""


def test_what_is_printed_takes_the_line_away_first(now, stages: Stages, capsys) -> None:
    stage("one")
    now[0] = 2.0
    stage("two")
    line = capsys.readouterr().err.lstrip("\r")
    stages.echo("result")
    out, err = capsys.readouterr()
    assert (out, err) == ("result\n", "\r" + " " * len(line) + "\r")
    stages.echo("again")
    assert capsys.readouterr() == ("again\n", "")


def test_the_line_comes_after_a_second_and_anew_each_second(now, stages, shown, monkeypatch):
    waited: list[float] = []
    monkeypatch.setattr(Stages, "_wait", lambda _, seconds: waited.append(seconds))
    stage("one")
    now[0] = 1.0
    stage("two", 0.02)
    assert shown() == ""
    now[0] = 2.0
    stage("three", 0.02)  # a fiftieth is too little to guess the rest from
    assert shown().endswith("]  2 %  three")
    stage("four", 0.03)  # 2 s · .97/.03
    assert shown().endswith("]  3 %  four  1:05 left")
    stage("four", 0.04)  # what is the same stage waits for its second
    assert shown() == ""
    stages._tick()
    assert shown().rstrip().endswith("]  4 %  four  0:48 left")
    assert waited == [1.0, 1.0]
    for now[0], text in ((59.6, "1:00"), (3599.4, "59:59"), (3725.0, "1:02:05")):
        stage(text, 0.5)
        assert shown().rstrip().endswith(f"] 50 %  {text}  {text} left")


@pytest.mark.usefixtures("stages")
@pytest.mark.parametrize(("width", "length"), [(60, 59), (80, 79), (200, 79)])
def test_a_long_stage_is_cut_to_the_terminal(now, shown, monkeypatch, width, length):
    monkeypatch.setenv("COLUMNS", str(width))
    stage("one")
    now[0] = 2.0
    stage("x" * 200, 0.5)
    line = shown().lstrip("\r")
    assert (len(line), line.endswith("x  0:02 left")) == (length, True)
    stage("y", 0.75)  # what is shorter blots out what was there
    assert len(shown().lstrip("\r")) == length


@pytest.mark.usefixtures("stages")
@pytest.mark.parametrize(("encoding", "rest"), [("utf-8", "·"), ("ascii", ".")])
def test_the_bar_is_of_letters_that_the_terminal_has(now, monkeypatch, encoding, rest) -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr("sys.stderr", stream)
    stage("one")
    now[0] = 2.0
    stage("two", 0.25)
    stream.flush()
    shown = stream.buffer.getvalue().decode(encoding)  # type: ignore[attr-defined]
    assert shown == f"\r[{'#' * 5}{rest * 15}] 25 %  two  0:06 left"


#: A program whose work counts as long from its begin on, whatever the processor does.
PROGRAM = """
import sys
import vftcli.cli.progress as progress
progress.QUICK, progress.EVERY = 0.0, 0.01
sys.argv[0] = "vftcli"
from vftcli.cli import launch
launch()
"""


def on_a_terminal(*words: object, **variables: str) -> list[str]:
    """Run a command on a terminal; return the lines as they stand on the screen at the end."""
    pty = pytest.importorskip("pty")
    mine, its = pty.openpty()
    kept: list[bytes] = []

    def read() -> None:
        while True:
            try:
                if not (some := os.read(mine, 1 << 16)):
                    return
            except OSError:  # nobody has the other end any more
                return
            kept.append(some)

    reader = threading.Thread(target=read)
    reader.start()
    command = [sys.executable, "-c", PROGRAM, *map(str, words)]
    terminal = {"TERM": "xterm", "COLUMNS": "80", "NO_COLOR": "1"}
    env = os.environ | terminal | variables
    subprocess.run(command, stdout=its, stderr=its, check=False, env=env)
    os.close(its)
    reader.join()
    os.close(mine)
    text = b"".join(kept).decode("utf-8")
    assert "TERM" not in variables or "[·" not in text
    return [on_screen(line) for line in text.replace("\r\n", "\n").split("\n")]


def on_screen(line: str) -> str:
    """What stands where a line was written, after all that went back to its begin."""
    seen = ""
    for part in line.split("\r"):
        seen = part + seen[len(part) :]
    return seen.rstrip()


SHORT = ("--robot", "ur5", "--interval", "3:6")
GMO = (*SHORT, "--observer", "gmo")
#: Commands, quick ones of each.
COMMANDS = (
    (TAPS, *SHORT),
    ("contacts", TAPS, CIRCLE, *SHORT),
    ("contacts", CIRCLE, "--robot", "ur5e"),
    ("report", TAPS, *SHORT, "--wrench", "-o", "out"),
    ("estimate", TAPS, *GMO, "-v", "-o", "out"),
    ("compare", TAPS, *GMO, "--reference", "zero", "-v"),
    ("compare", TAPS, *SHORT, "--reference", "zero"),
    ("inspect", CIRCLE),
    ("identify", CIRCLE, *SHORT, "-o", "out.toml"),
    ("identify", CIRCLE, "--robot", "ur5", "--method", "gains", "-o", "out.toml"),
    ("thresholds", BEARING, "--robot", "panda", "--rate", 60, "--anyway"),
    ("convert", TAPS, "-o", "out.csv"),
    ("batch", TAPS, *GMO, "--do", "estimate", "--jobs", 0, "-o", "out"),
    ("annotate", EPISODES, "--robot", "panda", "--jobs", 0, "-o", "out"),
    ("admit", CIRCLE, "--robot", "ur5", "--interval", "0:6"),
    ("simulate", "list"),
    ("simulate", "ur5-circle", "--set", "duration=1", "-o", "out.csv"),
    ("reproduce", "huang2025", "--only", "table1", "--fast"),
    ("benchmark", "speed", "--set", "bench.samples=2000", "--set", "bench.rounds=1"),
    ("help",),
    ("help", "settings"),
    ("help", "robots", "ur5"),
    ("report", "--help"),
    ("contact", TAPS),
    ("contacts", TAPS, "--robot", "ur55"),
)


@pytest.mark.slow
@pytest.mark.parametrize("width", [80, 120])
@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: " ".join(map(str, words))[-40:])
@pytest.mark.usefixtures("here")
def test_no_line_is_wider_than_the_terminal_or_printed_into_the_line(words, width):
    """Commands and paths may be, which are copied."""
    lines = on_a_terminal(*words, COLUMNS=str(width))
    assert len(lines) > 1
    assert lines[0]
    for line in lines:
        assert not re.search(r"\[[#·.]+\] +\d+ %", line)
        longest = max(map(len, line.split()), default=0)
        assert len(line) <= width or line.lstrip().startswith("vftcli ") or longest > width // 2


def test_what_is_for_programs_is_printed_as_it_is() -> None:
    lines = on_a_terminal("compare", TAPS, *GMO, "--reference", "zero", "--json", "-q")
    assert json.loads("\n".join(lines))["rows"][0]["observer"] == "gmo"


BRIGHT = "\x1b[32m" + "word " * 3 + "\x1b[0m"


@pytest.mark.parametrize(("text", "width", "lines"), [
    ("ab cd", 5, ["ab cd"]),
    ("ab cd", 4, ["ab", "  cd"]),
    ("a bcdefg", 6, ["a", "  bcdefg"]),  # a word of the width is broken off,
    ("a bcdefgh", 6, ["a bcdefgh"]),  # a longer one is a path to copy
    ("  a-b c", 5, ["  a-b", "    c"]),
    (f"{BRIGHT}\nvftcli cd ef", 15, [BRIGHT, "vftcli cd ef"]),  # colours have no width
    ("vftcli cd ef", 6, ["vftcli cd ef"]),  # words to copy
])  # fmt: skip
def test_a_line_is_broken_where_it_does_not_fit(text: str, width: int, lines: list[str]) -> None:
    assert fitted(text, width).split("\n") == lines


def test_a_result_is_one_screen_without_details(capsys) -> None:
    text = "".join(f"{k}\n" for k in range(50))
    echo_top(text)
    *_, last, more = capsys.readouterr().out.splitlines()
    assert (last, more) == ("34", "and 15 lines more: --details")
    with speaking(details=True, quiet=False):
        echo_top(text)
    assert capsys.readouterr().out == text


def test_a_dumb_terminal_has_no_line() -> None:
    lines = on_a_terminal("contacts", TAPS, "--interval", "0:2", TERM="dumb")
    assert "ur5_taps_ur_rtde.csv" in "".join(lines)
