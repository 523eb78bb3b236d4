"""`vftcli open` and `--open`: no browser and no viewer is started here."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from vftcli.cli import opening

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What would have been opened: addresses of pages, and files given to the viewer."""
    found: list[str] = []

    def browse(address: str) -> bool:
        found.append(address)
        return True

    def start(words: list[str], **_how: object) -> None:
        assert words[:3] == [sys.executable, "-m", "rerun"]
        found.append(words[3])

    monkeypatch.setattr(opening.webbrowser, "open", browse)
    monkeypatch.setattr(opening.subprocess, "Popen", start)
    return found


def made(folder: Path, *names: str) -> Path:
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).touch()
    return folder


def test_a_folders_page_is_opened_and_its_recording_told(
    run: Run, opened: list[str], tmp_path: Path
) -> None:
    out = made(tmp_path / "o t", "index.html", "a.html", "recording.rrd")
    code, _, err = run("open", out)
    assert code == 0
    assert opened == [(out / "index.html").resolve().as_uri()]
    assert f"vftcli open {out / 'recording.rrd'}" in err


def test_without_a_page_the_recording_is_opened(
    run: Run, opened: list[str], tmp_path: Path
) -> None:
    out = made(tmp_path / "out", "recording.rrd")
    assert run("open", out)[0] == 0
    assert opened == [str(out / "recording.rrd")]


def test_a_file_is_opened_itself(run: Run, opened: list[str], tmp_path: Path) -> None:
    """A robot file stands for the page that was written beside it."""
    out = made(tmp_path / "out", "index.html", "recording.rrd", "my.toml", "my.html")
    run("open", out / "recording.rrd")
    run("open", out / "my.toml")
    assert opened == [str(out / "recording.rrd"), (out / "my.html").resolve().as_uri()]


@pytest.mark.parametrize(("name", "words"), [("", "holds no page"), ("no", "does not exist")])
def test_where_there_is_nothing_one_line_says_so(
    run: Run, opened: list[str], tmp_path: Path, name: str, words: str
) -> None:
    code, out, err = run("open", tmp_path / name)
    assert (code, out, opened) == (1, "", [])
    assert words in err
    assert err.count("\n") == 1


def test_no_browser_is_said(
    run: Run, opened: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opening.webbrowser, "open", lambda _address: False)
    out = made(tmp_path / "out", "index.html")
    code, _, err = run("open", out)
    assert code == 0
    assert "no browser could be started" in err
    assert not opened


def test_a_command_opens_what_it_made(run: Run, opened: list[str], tmp_path: Path) -> None:
    """A release makes a page; of estimate --open implies the recording."""
    released = ("--release", "x=0.1", "--robot", "ur5", "--set", "admittance.duration=1")
    assert run("admit", *released, "-o", tmp_path / "a", "--open")[0] == 0
    log = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
    fast = ("--robot", "ur5", "--causal", "--observer", "gmo", "--interval", "0:4")
    assert run("estimate", log, *fast, "-o", tmp_path / "e", "--open")[0] == 0
    page = (tmp_path / "a" / "index.html").resolve().as_uri()
    assert opened == [page, str(tmp_path / "e" / "recording.rrd")]


def test_without_a_folder_there_is_nothing_to_open(run: Run, opened: list[str]) -> None:
    code, _, err = run("admit", "--release", "x=0.1", "--robot", "ur5", "--open")
    assert code == 2
    assert "give -o too" in err
    assert not opened
