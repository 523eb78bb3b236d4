"""The command line of the virtual sensor, on the circle of the repository's own fixture."""

import sys
from pathlib import Path

import polars as pl
import pytest

from vftcli.cli import main

CIRCLE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
COMMON = [str(CIRCLE), "--robot", "ur5", "--observer", "gmo"]


def run(monkeypatch, capsys, *words: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command."""
    monkeypatch.setattr(sys, "argv", ["vftcli", *words])
    code = 0
    try:
        main()
    except SystemExit as stop:
        code = int(stop.code or 0)
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.parametrize(
    ("option", "asks"),
    [
        (("--frame", "base"), True),
        (("--set", "virtual-sensor.solver=map"), True),
        (("--zero", "1:3"), True),
        ((), False),
    ],
)
def test_any_wrench_option_asks_for_the_wrench(
    monkeypatch, capsys, tmp_path, option, asks
) -> None:
    code, _, err = run(monkeypatch, capsys, "estimate", *COMMON, *option, "-o", str(tmp_path))
    assert code == 0, err
    columns = pl.read_parquet_schema(tmp_path / "estimates.parquet")
    assert any("wrench" in name for name in columns) is asks


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (("--frame", "wrist"), "no frame 'wrist' for a wrench; there is flange"),
        (("--frame", "tool"), "the robot has no tool"),
        (
            ("--set", "virtual-sensor.solver=svd"),
            "no solver 'svd' for a wrench; there is smoother, pinv",
        ),
        (("--zero", "500:600"), "is outside the log"),
        (
            ("--frame", "sensor", "--set", "virtual-sensor.sensor=0,0,0,2,0,0,0,1,0,0,0,1"),
            "three or six",
        ),
    ],
)
def test_bad_options_are_one_line_and_leave_nothing(
    monkeypatch, capsys, tmp_path, option, words
) -> None:
    out = tmp_path / "out"
    code, _, err = run(monkeypatch, capsys, "estimate", *COMMON, *option, "-o", str(out))
    assert code == 1
    assert words in err
    lines = [line for line in err.splitlines() if not line.startswith(("log health: ", "note: "))]
    assert len(lines) == 1
    assert not out.exists()
