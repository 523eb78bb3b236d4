import json
import re

import numpy as np
import pytest

from vftcli.admittance.closed_loop import Replayed
from vftcli.admittance.law import from_table, variable
from vftcli.admittance.replay import Replay
from vftcli.outputs.admittance import admittance_record, charts, render_admittance
from vftcli.robots import load_robot


def test_the_page_shows_every_part(release: Replay) -> None:
    found = Replayed(release)
    record = admittance_record(found, "vftcli admit --release x=0.1")
    page = render_admittance(found, record, "<release>")
    assert "<h2>Comparison</h2>" in page
    for heading in ("Deviation", "Parameters", "Stability before motion"):
        assert f"<summary>{heading}" in page
    assert "How this was made" in page
    assert "<release>" not in page
    # An option is in an element of its own, which no line breaks.
    assert "vftcli admit --release x=0.1" in re.sub("</?span[^>]*>", "", page)
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert data is not None
    assert json.loads(data.group(1))["charts"][0]["panels"] == ["x", "y", "z", "rx", "ry", "rz"]


def page_of(replay: Replay) -> str:
    found = Replayed(replay)
    return render_admittance(found, admittance_record(found, ""), "r")


def test_rows_bear_the_name_that_the_legend_has(release: Replay) -> None:
    page = page_of(release)
    for controller in release.controllers:
        assert f'data-swatch="{controller.name}"' in page


def test_charts_have_the_unit_of_their_axis(push: Replay) -> None:
    found = {chart.key: chart for chart in charts(push)}
    assert list(found) == ["x", "force", "v", "energy-w", "energy-v"]
    assert found["force"].units == ("N",) * 3 + ("N·m",) * 3
    assert found["energy-w"].units == ("J",) * 6
    assert found["v"].units[3] == "rad/s"
    band = found["force"].band
    assert band is not None
    assert band[:4].tolist() == [20.0, 20.0, 20.0, 6.0]
    lines = found["x"].series
    assert [line.name for line in lines] == [controller.name for controller in push.controllers]
    assert len({line.dash for line in lines}) == len(lines)  # none differs by its colour alone


def test_without_a_drag_the_page_says_so(release: Replay) -> None:
    from dataclasses import replace

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
