import json
import re
from dataclasses import replace

import numpy as np
import pytest

from vftcli.admittance.closed_loop import Replayed
from vftcli.admittance.law import from_table, variable
from vftcli.admittance.replay import Replay
from vftcli.outputs.admittance import admittance_record, charts, render_admittance
from vftcli.outputs.charts import GREY
from vftcli.robots import load_robot
from vftcli.signals.remarks import fact, sentence, warning


def test_the_page_shows_every_part(release: Replay) -> None:
    found = Replayed(release)
    record = admittance_record(found, "vftcli admit --release x=0.1")
    page = render_admittance(found, record, "<release>")
    assert "<h2>Comparison</h2>" in page
    for heading in ("Deviation", "Parameters", "Stability before motion"):
        assert f"<summary>{heading}" in page
    assert "How this was made" in page
    assert "<release>" not in page
    assert (
        '<p class="eyebrow">&lt;release&gt; · Universal Robots UR5 (CB3) · 0.000 – 2.000 s · '
        "a release from rest, no force · control period 8 ms · threshold hard</p>"
        "<h1>The same force through 2 admittance controllers.</h1>"
    ) in page
    far = np.array(release.motion.x)
    far[-3:, 0, 0] = 5.0  # metres beyond the arm's reach
    motion = release.motion._replace(x=far)
    untitled = replace(
        release, motion=motion, robot=replace(release.robot, title=""),
        force_remarks=(warning("saturation", signal="current"), fact("as-printed")),
    )  # fmt: skip
    page = render_admittance(Replayed(untitled), record, "x")
    banner = page.partition("</h1>")[2].partition("<h2>")[0]
    assert (sentence(untitled.force_remarks[0]) in banner, "printed" in banner) == (True, False)
    assert ">x · ur5 · 0.000 – " in page
    assert " · threshold hard · 3 poses out of reach</p>" in page
    # An option is in an element of its own, which no line breaks.
    assert "vftcli admit --release x=0.1" in re.sub("</?span[^>]*>", "", page)
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert json.loads(data.group(1))["charts"][0]["panels"] == ["x", "y", "z", "rx", "ry", "rz"]


def page_of(replay: Replay) -> str:
    found = Replayed(replay)
    return render_admittance(found, admittance_record(found, ""), "r")


def test_rows_bear_the_name_that_the_legend_has(release: Replay) -> None:
    page = page_of(release)
    for controller in release.controllers:
        assert f'data-swatch="{controller.name}"' in page


def test_charts_have_the_unit_of_their_axis(push: Replay) -> None:
    found = charts(push)
    names = [controller.name for controller in push.controllers]
    bands = {"force": ("± threshold", [20.0] * 3 + [6.0] * 3),
             "v": ("± speed limit", [0.9] * 3 + [1.0] * 3)}  # fmt: skip
    units = {"x": ("m", "rad"), "force": ("N", "N·m"), "v": ("m/s", "rad/s")}
    assert [chart.key for chart in found] == ["x", "force", "v", "energy-w", "energy-v"]
    for chart in found:
        along, about = units.get(chart.key, ("J", "J"))
        assert chart.units == (along,) * 3 + (about,) * 3
        label, band = bands.get(chart.key, ("", None))
        assert chart.band_label == label
        assert (None if chart.band is None else chart.band.tolist()) == band
        entered = ["force", "force that enters the law"]
        assert [line.name for line in chart.series] == (
            entered if chart.key == "force" else names
        )
        assert chart.series[0].colour == (GREY if chart.key == "force" else "ink")
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
    assert charts(replace(push, controllers=free))[2].band is None


def test_without_a_drag_the_page_says_so(release: Replay) -> None:
    still = replace(release, drags=())
    page = page_of(still)
    assert "No axis was dragged." in page


def why(difference: str, release: Replay) -> str:
    """What the page says of a difference from the paper."""
    page = page_of(release)
    return page.partition(f"<li>{difference}")[2].partition("</li>")[0]


def parameters(name: str):
    return from_table(load_robot(name).admittance, name, {})


@pytest.mark.parametrize(
    ("name", "figures"), [("ur5", ("0.510", "0.671")), ("panda", ("2.74", "1.06"))]
)
def test_damping_ratios(name: str, figures: tuple[str, str], release: Replay) -> None:
    reason = why("ξ is stated.", release)
    ratio = parameters(name).xi
    for value, figure in zip((ratio[0], ratio[3]), figures, strict=True):
        assert figure in reason
        assert value == pytest.approx(float(figure), abs=0.5 * 10.0 ** -len(figure.split(".")[1]))


def test_the_escape_bound_of_the_ur5s_rotation(release: Replay) -> None:
    assert "18°" in why("Rotation has a speed limit.", release)
    bound = variable(parameters("ur5")).escape[3]
    assert np.degrees(bound) == pytest.approx(18.0, abs=0.5)


def test_the_page_draws_its_charts(release: Replay, opened) -> None:
    tab = opened(page_of(release))
    tab.unfold()
    assert tab.blank_charts() == []
    assert tab.errors == []
    assert tab.overflow <= 0
