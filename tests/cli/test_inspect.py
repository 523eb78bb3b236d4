"""inspect, formats and convert at the command line."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from vftcli.cli import make_app
from vftcli.readers.reading import FORMATS
from vftcli.signals.errors import VftError

app = make_app()

KEYS = {"format", "joints", "samples", "duration_s", "rate_hz", "max_gap_s", "duplicates",
        "repairs", "warnings"}  # fmt: skip


@pytest.fixture
def table(tmp_path: Path) -> Path:
    t = 0.01 * np.arange(400)
    rows = [f"{a:.2f},{np.sin(a):.9f},{np.cos(a):.9f},{3 * np.cos(a):.9f}" for a in t]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t,q1,dq1,tau1", *rows, rows[-1], ""]))
    return path


def run(*words: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, [str(word) for word in words])
    if isinstance(result.exception, VftError):
        return 1, str(result.exception)
    return result.exit_code, result.stdout


def test_inspect_as_json(table: Path) -> None:
    code, out = run("inspect", table, "--json")
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


def test_inspect_in_words(table: Path) -> None:
    code, out = run("inspect", table)
    assert code == 0
    assert "400 of 401 rows" in out
    assert "no-profile" in out


def test_strict_fails_on_warnings(table: Path) -> None:
    for logs, said in (
        ([table], "1 warning (--strict)\n"),
        ([table] * 2, "2 warnings (--strict)\n"),
    ):
        result = CliRunner().invoke(app, ["inspect", *map(str, logs), "--strict"])
        assert (result.exit_code, result.stderr) == (1, said)


def test_names_with_control_characters_are_shown_harmlessly(tmp_path: Path) -> None:
    from vftcli.outputs.conversion import convert
    from vftcli.signals.recording import Recording

    names = ("\x1b[31mred", "two\nlines", "<b>three</b>")
    log = Recording(t=0.1 * np.arange(5), q=np.zeros((5, 3)), joint_names=names)
    convert(log, tmp_path / "x.parquet")
    code, out = run("inspect", tmp_path / "x.parquet")
    assert code == 0
    assert "\x1b" not in out
    assert r"two\nlines" in out


def test_inspect_of_what_is_no_log(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(b"")
    code, reported = run("inspect", tmp_path / "x")
    assert code == 1
    assert "empty" in reported


def test_formats_lists_every_reader() -> None:
    code, out = run("help", "formats")
    assert code == 0
    assert all(name in out for name in FORMATS)
    assert "record:" in run("help", "formats", "mcap")[1]
    assert "no format 'nonsense'" in run("help", "formats", "nonsense")[1]


@pytest.mark.parametrize("ending", ["parquet", "csv", "mcap"])
def test_convert(table: Path, tmp_path: Path, ending: str) -> None:
    out = tmp_path / f"x.{ending}"
    assert run("convert", table, "-o", out)[0] == 0
    reported = json.loads(run("inspect", out, "--json")[1])
    assert reported["samples"] == 400
    code, message = run("convert", table, "-o", out)
    assert code == 1
    assert "--force" in message
