"""`vftcli annotate` as a user types it."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vftcli.cli import main, make_app

app = make_app()

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "panda_episodes"


@pytest.mark.slow
def test_it_says_what_was_written(tmp_path: Path) -> None:
    words = ["annotate", str(FIXTURE), "-o", str(tmp_path / "copy"), "--add", "wrench,contact"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert "3 episodes (3 done), 540 frames, panda, kfo-zoh, causal" in result.stderr
    assert "wrench: N, N·m, flange axes" in result.stderr
    assert "contact: 1 in a contact of the list, else 0" in result.stderr
    assert "the first 4 frames of an episode still show" in result.stderr
    again = CliRunner().invoke(app, [*words, "--force", "--json", "--observer", "kfo-rts"])
    assert json.loads(again.stdout)["causal"] is False


def test_a_load_is_sought_in_all_episodes_and_too_few_poses_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["identify", str(FIXTURE), "--method", "payload", "-o", str(tmp_path / "robot.toml")]
    monkeypatch.setattr("sys.argv", ["vftcli", *words])
    with pytest.raises(SystemExit):
        main()
    error = capsys.readouterr().err.splitlines()[-1]
    assert "panda_episodes episode 0, panda_episodes episode 1, panda_episodes episode 2" in error
    assert "the arm passes 2 different poses, and a load needs 4 at least" in error


def test_refusals_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    inside = str(FIXTURE / "copy")
    for words, said in (
        (["-o", inside], "one inside the other"),
        (["-o", str(tmp_path / "c"), "--episode", "1"], "leave --interval and --episode out"),
        (["-o", str(tmp_path / "c"), "--add", "sd,force"], "--add force; there is wrench, sd,"),
        (["-o", str(tmp_path / "c"), "--robot", "ur5"], "Choose this log's arm with --robot"),
    ):
        monkeypatch.setattr("sys.argv", ["vftcli", "annotate", str(FIXTURE), *words])
        with pytest.raises(SystemExit) as stop:
            main()
        assert stop.value.code == 1
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count("\n") == 1
        assert said in err
    assert not any(tmp_path.iterdir())
