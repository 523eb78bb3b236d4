"""What `admit` makes of a release and of a push: a folder, tables, figures, a page."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from drawings import drawn, names_in
from unpacking import page_data

from vftcli.admittance.closed_loop import Replayed
from vftcli.admittance.law import controllers, from_table, variable
from vftcli.admittance.replay import Replay, replay, replay_release
from vftcli.outputs import admittance
from vftcli.outputs.charts import GREY
from vftcli.outputs.paper import WIDTHS
from vftcli.outputs.run_record import to_json
from vftcli.robots import load_robot
from vftcli.signals.remarks import fact, sentence, warning
from vftcli.signals.wrench import Wrench

START = np.array([0.0, -1.35, 1.9, -2.1208, -1.5708, 0.0])
"""Pose of the UR5 in which the paper drags it. [rad]"""


def parameters(name: str) -> Any:
    return from_table(load_robot(name).admittance, name, {})


@pytest.fixture(scope="module")
def release() -> Replay:
    """The UR5 let go at 0.1 m along x, watched for two seconds."""
    x = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    laws = controllers(parameters("ur5"))
    return replay_release(x, load_robot("ur5"), laws, start=START, duration=2.0)


@pytest.fixture(scope="module")
def push() -> Replay:
    """24 N along y from 1 to 1.6 s of a log of 4 s at 125 Hz, the arm at rest."""
    t = 0.008 * np.arange(500)
    values = np.zeros((500, 6))
    values[(t > 1.0) & (t < 1.6), 1] = 24.0
    wrench = Wrench(name="push", t=t, values=values, frame="base")
    laws, source = controllers(parameters("ur5")), fact("force-of-sensor", frame="a push")
    return replay(wrench, np.tile(START, (500, 1)), load_robot("ur5"), laws, source=source)


def test_a_replay_becomes_a_folder_of_unrounded_rows(release: Replay, tmp_path: Path) -> None:
    admittance.write_admittance(tmp_path / "out", Replayed(release), "vftcli admit")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(admittance.FILES)
    record = json.loads((tmp_path / "out/run.json").read_text(encoding="utf-8"))
    assert record["command"] == "vftcli admit"
    assert record["input"] is None
    assert len(record["controllers"]) == len(release.controllers)
    assert json.loads(to_json(release.rows)) == json.loads(json.dumps(list(release.rows)))
    with (tmp_path / "out/comparison.csv").open(encoding="utf-8") as file:
        read = list(csv.DictReader(file))
    assert [float(r["peak"]) for r in read] == [row["peak"] for row in release.rows]
    admittance.write_admittance(tmp_path / "empty", Replayed(replace(release, drags=())))
    empty = (tmp_path / "empty/comparison.csv").read_text(encoding="utf-8")
    assert empty.strip().split(",") == list(admittance.COLUMNS)


def test_record_and_motion_hold_the_force_its_source_and_every_controller(push: Replay) -> None:
    record = json.loads(to_json(admittance.admittance_record(Replayed(push), "")))
    assert record["force"]["code"] == "force-of-sensor"
    assert record["force"]["values"] == {"frame": "a push"}
    assert len(record["remarks"]) == len(push.remarks) > 0
    table = admittance.motion_table(push)
    assert len(table) == len(push.motion.t)
    label = push.controllers[1].name.replace(" ", "").replace("/", "-")
    np.testing.assert_array_equal(table[f"x/{label}/y"].to_numpy(), push.motion.x[:, 1, 1])
    np.testing.assert_array_equal(table[f"q/{label}/6"].to_numpy(), push.path.q[:, 1, 5])
    assert table["force/fy"][:-1].to_list() == push.wrench[:, 1].tolist()
    assert table["force/fy"][-1] is None  # the last deviation follows from the force before it
    assert table.schema["reached/" + label] == pl.Float64


def test_controllers_stand_under_each_other_by_axis_and_drag(release: Replay) -> None:
    rows = [dict(row) for row in release.rows]
    along_z = [row | {"axis": "z"} for row in rows]
    late = [row | {"drag": 2} for row in along_z]
    grid = admittance.comparison_grid([*late, *along_z, *rows])
    keys, n = list(admittance.COLUMNS), len(rows)
    axes = [(row[keys.index("axis")], row[keys.index("drag")]) for row in grid.rows]
    assert axes == [("x", 1)] * n + [("z", 1)] * n + [("z", 2)] * n
    # An overshoot is in per cent.
    row = rows[0] | {"overshoot": 0.0523, "peak": -0.1, "return_2_s": None}
    (cells,) = admittance.comparison_grid([row]).cells
    assert {"5.2", "−0.1000", "–"} <= {cell.text for cell in cells}


def test_parameters_of_the_profile_and_an_axis_without_a_speed_limit(release: Replay) -> None:
    """Table III of the paper: 3 kg, 5 N·s/m, 8 N/m, threshold 20 N and 6 N·m."""
    assert "8 ms, hard threshold" in admittance.parameter_grid(release).title
    rows = {row[0]: row[1:] for row in admittance.parameter_grid(release).rows}
    assert rows["x"][:3] == (3.0, 5.0, 8.0)
    assert rows["x"][-2:] == ("20 N", "0.9 m/s")
    assert rows["rz"][-2:] == ("6 N·m", "1 rad/s")
    limit = np.array([np.inf, 2.0, 3.0, 4.0, 4.0, 4.0])
    slowed = controllers(replace(release.parameters, speed_limit=limit))
    changed = replace(release, controllers=slowed)
    assert [row[-1] for row in admittance.parameter_grid(changed).rows][:2] == ["none", "2 m/s"]


def test_stability_is_reported_of_the_worst_axis(release: Replay) -> None:
    """The discrete number 2 Ts B/M + Ts² K/M; the traditional controller keeps it in recovery."""
    p = release.parameters
    numbers = (2 * p.period * p.damping + p.period**2 * p.stiffness) / p.mass
    rows = admittance.stability_grid(release).rows
    assert rows[0][2] == pytest.approx(max(numbers[:3]))
    assert [row[1] for row in rows] == ["position", "rotation"] * len(release.controllers)


def page_of(replay: Replay, command: str = "", title: str = "r") -> str:
    made = Replayed(replay)
    return admittance.render_admittance(made, admittance.admittance_record(made, command), title)


def test_the_page_shows_every_part(release: Replay) -> None:
    page = page_of(release, "vftcli admit --release x=0.1", "<release>")
    assert "<h2>Comparison</h2>" in page
    for heading in ("Deviation", "Parameters", "Stability before motion"):
        assert f"<summary>{heading}" in page
    assert "How this was made" in page
    assert "<release>" not in page
    assert (
        '<p class="eyebrow">&lt;release&gt; · Universal Robots UR5 (CB3) · 0.000 – 2.000 s · '
        "a release from rest, no force · control period 8 ms · threshold hard</p>"
        "<h1>One force through 2 admittance controllers.</h1>"
    ) in page
    for controller in release.controllers:  # as in the legend
        assert f'data-swatch="{controller.name}"' in page
    # An option is in an element of its own, which no line breaks.
    assert "vftcli admit --release x=0.1" in re.sub("</?span[^>]*>", "", page)
    assert page_data(page)["charts"][0]["panels"] == ["x", "y", "z", "rx", "ry", "rz"]


def test_the_page_says_what_limits_it(release: Replay) -> None:
    far = np.array(release.motion.x)
    far[-3:, 0, 0] = 5.0  # metres beyond the arm's reach
    untitled = replace(
        release, motion=release.motion._replace(x=far), robot=replace(release.robot, title=""),
        force_remarks=(warning("saturation", signal="current"), fact("as-printed")), drags=(),
    )  # fmt: skip
    page = page_of(untitled)
    banner = page.partition("</h1>")[2].partition("<h2>")[0]
    assert (sentence(untitled.force_remarks[0]) in banner, "printed" in banner) == (True, False)
    assert ">r · ur5 · 0.000 – " in page
    assert " · threshold hard · 3 poses out of reach</p>" in page
    assert "No axis was dragged." in page


def test_charts_have_the_unit_of_their_axis(push: Replay) -> None:
    found = admittance.charts(push)
    names = [controller.name for controller in push.controllers]
    bands = {"force": ("± threshold", [20.0] * 3 + [6.0] * 3),
             "v": ("± speed limit", [0.9] * 3 + [1.0] * 3)}  # fmt: skip
    units = {"x": ("m", "rad"), "force": ("N", "N·m"), "v": ("m/s", "rad/s")}
    assert [chart.key for chart in found] == ["x", "force", "v", "energy-w", "energy-v"]
    for chart in found:
        along, about = units.get(chart.key, ("J", "J"))
        assert chart.units == (along,) * 3 + (about,) * 3
        band = None if chart.band is None else chart.band.tolist()
        assert (chart.band_label, band) == bands.get(chart.key, ("", None))
        of_force = chart.key == "force"
        shown = ["force", "force that enters the law"] if of_force else names
        assert [line.name for line in chart.series] == shown
        assert chart.series[0].colour == (GREY if of_force else "ink")
        # none differs by its colour alone
        assert len({line.dash for line in chart.series}) == len(names)
        assert all(len(line.values) == len(chart.x) == 501 for line in chart.series)
    force, into_law = (line.values[:, 1] for line in found[1].series)
    # 24 N while 1 < t < 1.6 s; a hard threshold of 20 N lets all of them in.
    felt = 24.0 * ((found[1].x[:-1] > 1.0) & (found[1].x[:-1] < 1.6))
    assert (force[:-1].tolist(), into_law[:-1].tolist()) == (felt.tolist(), felt.tolist())
    assert np.isnan([force[-1], into_law[-1]]).all()
    unbounded = replace(push.parameters, speed_limit=np.full(6, np.inf))
    free = tuple(replace(controller, parameters=unbounded) for controller in push.controllers)
    assert admittance.charts(replace(push, controllers=free))[2].band is None


def test_differences_from_the_paper_are_said_in_numbers_that_hold(release: Replay) -> None:
    page = page_of(release)
    reason = page.partition("<li>ξ is stated.")[2].partition("</li>")[0]
    ratios = {"ur5": ("0.510", "0.671"), "panda": ("2.74", "1.06")}
    for name, figures in ratios.items():
        xi = parameters(name).xi
        for value, figure in zip((xi[0], xi[3]), figures, strict=True):
            assert figure in reason
            half = 0.5 * 10.0 ** -len(figure.split(".")[1])
            assert value == pytest.approx(float(figure), abs=half), name
    assert "18°" in page.partition("<li>Rotation has a speed limit.")[2].partition("</li>")[0]
    bound = variable(parameters("ur5")).escape[3]
    assert np.degrees(bound) == pytest.approx(18.0, abs=0.5)


def test_the_page_draws_its_charts(release: Replay, opened: Any) -> None:
    opened(page_of(release)).check()


def figure_of(replay: Replay, width: str = "single") -> Any:
    pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")
    found = admittance.replay_figures(replay)
    assert list(found) == list(admittance.REPLAY_FIGURES)
    return drawn(found["release"], width)


@pytest.mark.parametrize("width", WIDTHS)
def test_a_release_is_a_plot_with_a_line_a_controller(release: Replay, width: str) -> None:
    figure = figure_of(release, width)
    (axes,) = figure.axes
    assert (axes.get_ylabel(), axes.get_xlabel()) == ("x (m)", "Time (s)")
    assert names_in(figure) == [controller.name for controller in release.controllers]
    first = axes.lines[0].get_ydata()
    assert first[0] == pytest.approx(0.1)
    np.testing.assert_array_equal(first, release.motion.x[:, 0, 0])


def test_a_push_has_its_force_above_with_the_threshold(push: Replay) -> None:
    figure = figure_of(push)
    assert [axes.get_ylabel() for axes in figure.axes] == ["y (N)", "y (m)"]
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "Time (s)"]
    levels = {line.get_ydata()[0] for line in figure.axes[0].lines if len(line.get_ydata()) == 2}
    assert levels == {20.0, -20.0}
    assert "± threshold" in names_in(figure)


def test_what_never_moved_is_not_drawn(release: Replay) -> None:
    still = release.motion._replace(x=np.zeros_like(release.motion.x))
    assert admittance.replay_figures(replace(release, motion=still, drags=())) == {}
    both = np.array(release.motion.x)
    both[:, :, 4] = both[:, :, 0]
    tilted = replace(release, motion=release.motion._replace(x=both), drags=())
    assert [axes.get_ylabel() for axes in figure_of(tilted).axes] == ["x (m)", "ry (rad)"]
