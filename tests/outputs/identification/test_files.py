"""What `identify` writes: a robot file, a page that opens offline, a recording, run.json."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from vftcli.identification import Task, identify
from vftcli.outputs.identification import files
from vftcli.outputs.identification.files import identification_record, write_identification
from vftcli.outputs.identification.page import render_identification
from vftcli.robots import load_robot
from vftcli.signals.errors import OutputError
from vftcli.signals.recording import Recording


@pytest.fixture(scope="module")
def found():
    """A short identification whose log has a name that would break a careless page."""
    from pathlib import Path

    from vftcli.signals.recording import Source

    robot = load_robot("ur5")
    t = np.arange(0, 20, 0.008)
    w = 2 * np.pi * np.array([0.1, 0.15, 0.2, 0.25, 0.3, 0.35])
    q, dq = 0.5 * np.sin(w * t[:, None]), 0.5 * w * np.cos(w * t[:, None])
    noise = np.random.default_rng(0).normal(size=q.shape)
    from vftcli.robots.friction import friction_torque
    from vftcli.robots.regressor import chain_parameters, torque_regressor

    ddq = -0.5 * w**2 * np.sin(w * t[:, None])
    torque = torque_regressor(robot.chain, q, dq, ddq) @ chain_parameters(robot.chain)
    torque += robot.chain.rotor_inertia * ddq + friction_torque(robot.friction, dq) + 0.2 * noise
    source = Source(path=Path("<b>log & co</b>.csv"), sha256="0" * 64)
    log = Recording(t=t, q=q, dq=dq, current=torque / robot.torque_constant, source=source)
    return identify([log], robot, Task(name="mine"), [log]), log


def test_all_files_are_written_and_the_robot_loads(found, tmp_path):
    result, log = found
    path = tmp_path / "mine.toml"
    text = write_identification(path, result, [log], "vftcli identify", force=False)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "mine.html",
        "mine.rrd",
        "mine.run.json",
        "mine.toml",
    ]
    robot = load_robot(path)
    assert robot.name == "mine"
    assert robot.friction == result.robot.friction
    assert np.array_equal(robot.chain.rotor_inertia, result.robot.chain.rotor_inertia)
    account = robot.document["identification"]
    assert account["sha256"] == ["0" * 64]
    assert account["method"] == "friction"
    assert "0" * 64 in robot.friction[0].confidence
    assert robot.document["joints"][0]["rotor_inertia_source"].startswith("identified")
    assert (tmp_path / "mine.rrd").read_bytes().startswith(b"RRF2")
    record = json.loads(text)
    assert record["processing"]["cutoff_hz"] == 8.0
    assert "never" in record["processing"]["differentiation"]
    assert record["inputs"][0]["sha256"] == "0" * 64
    with pytest.raises(OutputError, match="--force"):
        write_identification(path, result, [log], "", force=False)


def test_a_name_without_toml_is_refused(found, tmp_path):
    result, log = found
    with pytest.raises(OutputError, match=r"ends in \.toml"):
        write_identification(tmp_path / "mine", result, [log], "", force=False)
    assert not list(tmp_path.iterdir())


def test_a_failure_at_the_last_file_leaves_everything_as_it_was(found, tmp_path, monkeypatch):
    """The files were written one by one: a full disk left a page beside another run's robot."""
    result, log = found
    path = tmp_path / "mine.toml"
    path.write_text("earlier", encoding="utf-8")
    last = files.write_text

    def failing(target, text):
        if target.suffix == ".toml":
            raise OutputError("the disk is full")
        last(target, text)

    monkeypatch.setattr(files, "write_text", failing)
    with pytest.raises(OutputError, match="disk is full"):
        write_identification(path, result, [log], "", force=True)
    assert [p.name for p in tmp_path.iterdir()] == ["mine.toml"]
    assert path.read_text(encoding="utf-8") == "earlier"


class Balance(HTMLParser):
    """Checks that every element is closed in its turn."""

    VOID = frozenset({"meta", "br", "hr", "img", "input", "link", "path"})

    def __init__(self):
        super().__init__()
        self.open = []

    def handle_starttag(self, tag, attrs):
        del attrs
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.open.pop() == tag


def test_the_page_is_whole_and_loads_nothing(found):
    result, log = found
    page = render_identification(result, identification_record(result, [log], "vftcli identify"))
    checker = Balance()
    checker.feed(page)
    assert checker.open == []
    assert "<b>log" not in page
    assert "&lt;b&gt;log &amp; co" in page
    assert not re.search(r"(src|href)\s*=\s*[\"']?https?:", page)
    assert page.count("<svg viewBox=") == 6  # one residual-over-velocity plot a joint
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert data is not None
    assert json.loads(data.group(1))["joints"] == 6
    for heading in ("Residuals", "Residual over velocity", "Identified numbers"):
        assert f"<h2>{heading}</h2>" in page
