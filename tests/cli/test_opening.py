"""What `--open` does: no browser and no viewer is started here."""

import subprocess
import sys
import webbrowser
from pathlib import Path

import pytest

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


def test_a_page_goes_before_the_recording_and_that_is_named(run, opened, tmp_path: Path) -> None:
    out = tmp_path / "o t"
    out.mkdir()
    (out / "recording.rrd").touch()
    code, _, err = run(*RELEASED, "-o", out, "--open")
    assert code == 0
    assert opened == [(out / "index.html").resolve().as_uri()]
    assert f"wrote {out}: open {out / 'index.html'}\n" in err
    assert f"the recording: rerun {out / 'recording.rrd'}\n" in err


def test_no_browser_is_said(run, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(webbrowser, "open", lambda _address: False)
    code, _, err = run(*RELEASED, "-o", tmp_path / "out", "--open")
    assert code == 0
    assert f"no browser could be started: open {tmp_path / 'out' / 'index.html'} in one" in err


def test_open_of_estimates_implies_the_recording(run, opened: list[str], tmp_path: Path) -> None:
    log = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
    fast = ("--robot", "ur5", "--causal", "--observer", "gmo", "--interval", "0:4")
    assert run("estimate", log, *fast, "-o", tmp_path, "--open")[0] == 0
    assert opened == [str(tmp_path / "recording.rrd")]


def test_without_a_folder_there_is_nothing_to_open(run, opened: list[str]) -> None:
    code, _, err = run(*RELEASED, "--open")
    assert code == 2
    assert "give -o too" in err
    assert not opened
