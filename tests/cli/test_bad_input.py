"""Bad input: one line on stderr, exit 1 or 2, no traceback, and no partial output left."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"


def table(rows: int = 400) -> list[list[str]]:
    """A headerless log t, q, dq, current as rows of cells."""
    t = np.arange(rows) * 0.008
    angle = t[:, None] + np.arange(6)
    values = np.column_stack([t, np.sin(angle), np.cos(angle), 0.5 * np.ones((rows, 6))])
    return [[f"{v:.6f}" for v in row] for row in values]


def saved(path: Path, rows: list[list[str]], end: str = "\n") -> Path:
    path.write_text("\n".join(",".join(row) for row in rows) + end, encoding="utf-8")
    return path


def changed(folder: Path, rows: range, column: int, text: str) -> Path:
    """A log with other text in some cells of a column."""
    cells = table()
    for row in rows:
        cells[row][column] = text
    return saved(folder / "log.csv", cells)


COLUMNS, SOME = "t,q:6,dq:6,current:6", range(200, 201)

CASES: dict[str, tuple[Callable[[Path], Path], str, str]] = {
    "empty file": (lambda d: saved(d / "log.csv", [], end=""), COLUMNS, "empty"),
    "folder": (lambda d: d, COLUMNS, ""),
    "no such file": (lambda d: d / "nothing.csv", COLUMNS, "nothing.csv"),
    "unknown signal described": (
        lambda d: saved(d / "log.csv", table()), "t,q:6,speed:6,current:6", "--columns"
    ),
    "missing current": (
        lambda d: saved(d / "log.csv", table()), "t,q:6,dq:6,_:6", "no motor currents"
    ),
    "missing velocity": (
        # At 125 Hz they would be derived from the positions, and that be said.
        lambda d: saved(d / "log.csv", table()[::5]), "t,q:6,_:6,current:6", "no joint velocities"
    ),
    "all-NaN column": (
        lambda d: changed(d, range(400), 14, "nan"), COLUMNS, "current of joint 2"
    ),
    "NaN in the middle": (lambda d: changed(d, SOME, 3, "nan"), COLUMNS, "q of joint 3"),
    "time backwards": (lambda d: changed(d, SOME, 0, "0.5"), COLUMNS, "backwards"),
    "one sample": (lambda d: saved(d / "log.csv", table(rows=1)), COLUMNS, "one sample"),
    "letters in a number": (lambda d: changed(d, SOME, 3, "abc"), COLUMNS, ""),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("command", ["estimate", "report", "compare"])
def test_a_bad_log_is_one_line(tmp_path: Path, refused, case: str, command: str) -> None:
    make, columns, words = CASES[case]
    inside = tmp_path / "in"
    inside.mkdir()
    log, out = make(inside), tmp_path / "out"
    more = ["--reference", "zero"] if command == "compare" else ["-o", out]
    assert words in refused(command, log, "--robot", "ur5", "--columns", columns, *more)
    assert not out.exists()


def test_binary_noise_is_one_line(tmp_path: Path, refused) -> None:
    log = tmp_path / "noise.csv"
    log.write_bytes(np.random.default_rng(0).bytes(5000))
    refused("estimate", log, "--robot", "ur5", "-o", tmp_path / "out")


def test_a_cut_last_row_is_dropped_and_said(tmp_path: Path, run) -> None:
    log = saved(tmp_path / "log.csv", [*table(), ["3.2", "0.1"]], end="")
    words = ("--robot", "ur5", "--columns", COLUMNS, "-o", tmp_path / "out", "--details")
    code, _, stderr = run("estimate", log, *words)
    assert code == 0
    assert "last" in stderr
    assert "400 samples" in stderr


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_an_unwritable_folder_is_one_line(tmp_path: Path, refused) -> None:
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    refused("estimate", FIXTURE, "--robot", "ur5", "-o", locked / "out")


def test_an_output_that_is_a_file_is_one_line(tmp_path: Path, refused) -> None:
    taken = tmp_path / "taken"
    taken.write_text("a file")
    assert "is a file" in refused("estimate", FIXTURE, "--robot", "ur5", "-o", taken)
    refused("estimate", FIXTURE, "--robot", "ur5", "-o", taken / "below")
    assert taken.read_text() == "a file"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--robot", "pnada"), "Did you mean panda?"),
        (("--observer", "gmoo"), "Did you mean gmo?"),
        (("--set", "gmo.gain=-3"), "must be positive"),
        (("--set", "gmo.gain=1,2"), "one for each of 6"),
        (("--set", "kfo.noise_convention=white"), "there is density"),
        (("--interval", "100:200"), "the log runs from 0 to"),
        (("--reference", "vendor"), "no vendor estimates"),
        (("--reference", "file:nowhere.csv"), "nowhere.csv"),
    ],
)
def test_a_wrong_option_is_one_line(refused, words: tuple[str, ...], expected: str) -> None:
    """Values that every command refuses are in tests/cli/test_options.py."""
    assert expected in refused(
        "compare", FIXTURE, "--robot", "ur5", "--reference", "zero", *words
    )


@pytest.mark.slow
def test_a_name_with_markup_stays_text(tmp_path: Path, run) -> None:
    log = tmp_path / "<script>alert(1)<.csv"
    shutil.copy(FIXTURE, log)
    assert run("report", log, "--robot", "ur5", "-o", tmp_path / "out")[0] == 0
    assert "<script>alert" not in (tmp_path / "out" / "index.html").read_text()
