"""inspect and convert at the command line."""

import json
from pathlib import Path

import numpy as np
import pytest

from vftcli.outputs.conversion import convert
from vftcli.signals.recording import Recording

KEYS = {"format", "joints", "samples", "duration_s", "rate_hz", "max_gap_s", "duplicates",
        "repairs", "warnings"}  # fmt: skip


@pytest.fixture
def table(tmp_path: Path) -> Path:
    t = 0.01 * np.arange(400)
    rows = [f"{a:.2f},{np.sin(a):.9f},{np.cos(a):.9f},{3 * np.cos(a):.9f}" for a in t]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t,q1,dq1,tau1", *rows, rows[-1], ""]))
    return path


def test_inspect_as_json(run, table: Path) -> None:
    code, out, _ = run("inspect", table, "--json")
    reported = json.loads(out)
    assert code == 0
    assert set(reported) >= KEYS
    assert reported["format"] == "table"
    assert (reported["joints"], reported["samples"], reported["duplicates"]) == (1, 400, 1)
    assert reported["duration_s"] == pytest.approx(3.99)
    assert reported["rate_hz"] == pytest.approx(100)
    assert reported["max_gap_s"] == pytest.approx(0.01)
    assert isinstance(reported["repairs"], list)
    assert isinstance(reported["warnings"], list)


def test_inspect_in_words_and_strict_fails_on_warnings(run, table: Path) -> None:
    code, out, _ = run("inspect", table)
    assert code == 0
    assert "400 of 401 rows" in out
    assert "no-profile" in out
    for logs, said in (
        ([table], "1 warning (--strict)\n"),
        ([table] * 2, "2 warnings (--strict)\n"),
    ):
        code, _, err = run("inspect", *logs, "--strict")
        assert (code, err) == (1, said)


def test_names_with_control_characters_are_shown_harmlessly(run, tmp_path: Path) -> None:
    names = ("\x1b[31mred", "two\nlines", "<b>three</b>")
    log = Recording(t=0.1 * np.arange(5), q=np.zeros((5, 3)), joint_names=names)
    convert(log, tmp_path / "x.parquet")
    code, out, _ = run("inspect", tmp_path / "x.parquet")
    assert code == 0
    assert "\x1b" not in out
    assert r"two\nlines" in out


@pytest.mark.parametrize("ending", ["parquet", "csv", "mcap"])
def test_convert(run, refused, table: Path, tmp_path: Path, ending: str) -> None:
    out = tmp_path / f"x.{ending}"
    assert run("convert", table, "-o", out)[0] == 0
    assert json.loads(run("inspect", out, "--json")[1])["samples"] == 400
    assert "--force" in refused("convert", table, "-o", out)
