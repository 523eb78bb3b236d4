"""The line that says what is being done: stage and share, only once it takes long."""

import pytest

from vftcli.cli.progress import WIDTH, Stages
from vftcli.signals.progress import steps


def test_a_stage_is_shown_only_once_it_takes_long(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [0.0]
    monkeypatch.setattr("vftcli.cli.progress.time.monotonic", lambda: now[0])
    monkeypatch.setattr(Stages, "_wait", lambda *_: None)  # the clock stands: nothing ticks
    stages = Stages()
    stages.begin("reading")
    assert capsys.readouterr().err == ""
    now[0] = 1.5
    stages.begin("running observers", 0.2, 0.6)
    line = capsys.readouterr().err
    assert line.startswith("\rrunning observers ")
    assert line.endswith("  20 %    2 s")
    assert len(line) == 1 + WIDTH
    for _ in steps("ab"):
        stages._tick()
    # half of the stage, which goes from .2 to .6, is .4; it is shown though no stage has begun
    assert " 20 %" in (shown := capsys.readouterr().err)
    assert shown.endswith("  40 %    2 s")
    stages.end()
    assert capsys.readouterr().err.strip() == ""
    stages._tick()
    assert capsys.readouterr().err == ""
