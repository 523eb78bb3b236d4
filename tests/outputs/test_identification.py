"""What `identify` makes: a robot file, tables, figures, a page that opens offline, run.json."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from drawings import drawn, names_in
from unpacking import Page, page_data

from vftcli.doctor import examine
from vftcli.identification import Task
from vftcli.identification.fitting import identify
from vftcli.outputs.files import OutputFolder
from vftcli.outputs.grid import terminal
from vftcli.outputs.identification import (
    IDENTIFICATION_FIGURES,
    identification_figures,
    identification_record,
    parameter_grid,
    render_identification,
    residual_grid,
    shape_choice_grid,
    shown_trace,
    tables_text,
    torque_charts,
    write_identification,
)
from vftcli.robots import load_robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.signals.errors import OutputError
from vftcli.signals.recording import Recording, Source


@pytest.fixture(scope="module")
def log() -> Recording:
    """A short log that has a name that would break a careless page."""
    robot = load_robot("ur5")
    t = np.arange(0, 20, 0.008)
    w = 2 * np.pi * np.array([0.1, 0.15, 0.2, 0.25, 0.3, 0.35])
    q, dq = 0.5 * np.sin(w * t[:, None]), 0.5 * w * np.cos(w * t[:, None])
    noise = np.random.default_rng(0).normal(size=q.shape)
    ddq = -0.5 * w**2 * np.sin(w * t[:, None])
    torque = torque_regressor(robot.chain, q, dq, ddq) @ chain_parameters(robot.chain)
    torque += robot.chain.rotor_inertia * ddq + friction_torque(robot.friction, dq) + 0.2 * noise
    source = Source(path=Path("<b>log & co</b>.csv"), sha256="0" * 64)
    return Recording(t=t, q=q, dq=dq, current=torque / robot.torque_constant, source=source)


@pytest.fixture(scope="module")
def found(log: Recording) -> Any:
    return identify([log], load_robot("ur5"), Task(method="friction", name="mine"), [log])


def test_all_files_are_written_and_it_loads(found: Any, log: Recording, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    text = write_identification(path, found, [examine(log)], "vftcli identify", force=False)
    names = ["mine.html", "mine.run.json", "mine.toml"]
    assert sorted(p.name for p in tmp_path.iterdir()) == names
    robot = load_robot(path)
    assert robot.name == "mine"
    assert robot.friction == found.robot.friction
    assert np.array_equal(robot.chain.rotor_inertia, found.robot.chain.rotor_inertia)
    account = robot.document["identification"]
    assert account["sha256"] == ["0" * 64]
    assert account["method"] == "friction"
    assert "0" * 64 in robot.friction[0].confidence
    assert robot.document["joints"][0]["rotor_inertia_source"].startswith("identified")
    record = json.loads(text)
    assert record["processing"]["cutoff_hz"] == 8.0
    assert "never" in record["processing"]["differentiation"]
    assert record["inputs"][0]["sha256"] == "0" * 64
    with pytest.raises(OutputError, match=r"ends in \.toml"):
        write_identification(tmp_path / "other", found, [examine(log)], "", force=False)
    assert sorted(p.name for p in tmp_path.iterdir()) == names


def test_a_failure_at_the_last_file_leaves_all_as_it_was(found, log, tmp_path, monkeypatch):
    """The files were written one by one: a full disk left a page beside another run's robot."""
    path = tmp_path / "mine.toml"
    path.write_text("earlier", encoding="utf-8")
    write = OutputFolder.write

    def failing(folder: OutputFolder, name: str, text: str) -> None:
        if name.endswith(".toml"):
            raise OutputError("the disk is full")
        write(folder, name, text)

    monkeypatch.setattr(OutputFolder, "write", failing)
    with pytest.raises(OutputError, match="disk is full"):
        write_identification(path, found, [examine(log)], "", force=True)
    assert [p.name for p in tmp_path.iterdir()] == ["mine.toml"]
    assert path.read_text(encoding="utf-8") == "earlier"


@pytest.fixture(scope="module")
def html(found: Any, log: Recording) -> str:
    return render_identification(found, identification_record(found, [examine(log)], ""))


def test_the_page_is_whole_and_loads_nothing(html: str) -> None:
    page = Page(html)
    assert page.open == []
    assert "<b>log" not in html
    assert "&lt;b&gt;log &amp; co" in html
    for _, attributes in page.elements:
        for key in ("src", "href"):
            assert not str(attributes.get(key, "")).startswith("http")
    assert html.count("<title>Residual over velocity, J") == 6
    assert len(page_data(html)["charts"][0]["panels"]) == 6
    for heading in ("How much torque is left unexplained", "Residual over velocity"):
        assert f"<h2>{heading}</h2>" in html
    assert "<summary>Identified numbers" in html
    # Dots are in their plot, right of the room for the numbers.
    paths = (attributes.get("d", "") for tag, attributes in page.elements if tag == "path")
    moves = [move.split("h")[0] for path in paths for move in path.split("M") if "h.01" in move]
    dots = np.array([move.split() for move in moves], dtype=float)
    assert len(dots) > 1000
    assert (dots.min(axis=0) >= [38.0, 0.0]).all()
    assert (dots.max(axis=0) <= [460.0, 180.0]).all()


def test_the_page_draws_its_charts(html: str, opened: Any) -> None:
    opened(html).check()


def test_the_held_out_log_is_drawn_over_time(found: Any) -> None:
    assert [trace.role for trace in found.traces] == ["train", "held-out"]
    trace = shown_trace(found)
    assert trace.role == "held-out"
    torque, left = torque_charts(found)
    assert torque.x is trace.motion.t
    assert (torque.key, left.key) == ("torque", "left")
    assert [line.name for line in torque.series] == ["measured", "predicted"]
    np.testing.assert_array_equal(left.series[0].values, trace.residual)


def test_figures_are_of_the_torque_and_of_what_is_left(found: Any) -> None:
    pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")
    drawings = identification_figures(found)
    assert list(drawings) == list(IDENTIFICATION_FIGURES)
    torque, left = map(drawn, drawings.values())
    assert names_in(torque) == ["measured", "predicted"]
    assert {axes.get_ylabel() for axes in left.axes} == {"Residual rms (N·m)"}
    rows = found.residuals.filter(found.residuals["joint"] == 1)
    dots = [container.lines[0].get_ydata()[0] for container in left.axes[0].containers]
    assert sorted(dots) == pytest.approx(sorted(rows["rms_Nm"]))
    bare = found._replace(traces=(), residuals=found.residuals.clear())
    assert identification_figures(bare) == {}


def test_one_row_a_log_role_and_model_with_its_mean(found: Any, log: Recording) -> None:
    _, *lines = terminal(residual_grid(found)).splitlines()
    assert lines[0].split()[-7:] == ["J1", "J2", "J3", "J4", "J5", "J6", "mean"]
    assert [", check," in line for line in lines[1:]] == [False, False, True, True]
    numbers = [float(x) for x in lines[1].split()[-7:]]
    assert numbers[-1] == pytest.approx(sum(numbers[:-1]) / 6, abs=1e-2)  # two printed digits
    assert log.name in lines[1]
    # Two logs of one label were one row of twelve numbers for six joints.
    second = found.residuals.with_columns(log_index=pl.col("log_index") + 10)
    both = found._replace(residuals=pl.concat([found.residuals, second]))
    rows = residual_grid(both).rows
    assert len(rows) == 2 * len(residual_grid(found).rows)
    assert {len(row) for row in rows} == {8}
    only = found._replace(residuals=found.residuals.clear())
    assert tables_text(only).startswith("parameter ")
    assert tables_text(only._replace(parameters=found.parameters.clear())) == ""


def test_what_is_not_determined_is_said_and_what_is_no_number_is_a_dash(found: Any) -> None:
    """A profile without a term read "nan", a spread that nothing bounds "inf"."""
    odd = {"determined": False, "profile": float("nan"), "sd": float("inf")}
    doubted = found.parameters.with_columns(**{name: pl.lit(x) for name, x in odd.items()})
    heads, *lines = terminal(parameter_grid(found._replace(parameters=doubted))).splitlines()
    assert heads.split() == ["parameter", "joint", "value", "sd", "profile", "unit"]
    for line in lines:
        assert line.endswith("  (not determined)")
        assert line.count(" –") == 2
        assert "nan" not in line
        assert "inf" not in line


def test_the_chosen_friction_is_marked() -> None:
    rows = [("viscous", 1, 0.5, False), ("coulomb", 1, 0.25, True)]
    choices = pl.DataFrame(rows, ["friction", "joint", "cv_rms_Nm", "chosen"], orient="row")
    lines = terminal(shape_choice_grid(choices)).splitlines()
    assert lines[2].split() == ["viscous", "J1", "0.500"]
    assert lines[3].split() == ["coulomb", "J1", "0.250", "chosen"]
