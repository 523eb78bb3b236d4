from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vftcli.analysis import Analysis
from vftcli.outputs.charts import REFERENCE
from vftcli.outputs.page import log_charts
from vftcli.outputs.page.pages import render


def test_every_line_has_its_look_and_drives_of_a_size_a_scale(analysis: Analysis) -> None:
    chart = log_charts.torque_chart(analysis)
    assert len({line.dash for line in chart.series[1:]}) == 5  # none differs by its colour alone
    assert chart.series[0].colour == REFERENCE
    assert chart.panels == tuple(f"J{j}" for j in range(1, 7))
    assert chart.families == (1, 1, 1, 2, 2, 2)  # 150 and 28 N·m
    assert chart.ends(0) == chart.ends(2) != chart.ends(3)


def test_a_reference_at_rest_is_another_line(analysis: Analysis) -> None:
    moving = np.ones((len(analysis.t), 6), dtype=bool)
    moving[100:200, 2] = False
    partly = replace(analysis, reference=replace(analysis.reference, moving=moving))
    whole, resting = log_charts.torque_chart(partly).series[:2]
    assert "rests" in resting.name
    assert np.isnan([whole.values[150, 2], resting.values[150, 1]]).all()
    assert np.isfinite(resting.values[150, 2])


def test_wrenches_have_a_panel_an_axis(with_wrench: Analysis) -> None:
    chart = log_charts.wrench_chart(with_wrench)
    assert chart.panels == ("fx", "fy", "fz", "mx", "my", "mz")
    assert chart.units == ("N",) * 3 + ("N·m",) * 3
    assert chart.ends(0) == chart.ends(2) != chart.ends(3) == chart.ends(5)
    (leading,) = (line for line in chart.series if line.leads)
    assert leading.name == "best"
    known = next(w for w in with_wrench.wrenches if w.name == "best").known
    np.testing.assert_array_equal(leading.values, known)
    assert [line.shown for line in chart.series if not line.leads] == [False] * 4
    html = render(with_wrench)
    assert html.count('data-panel="5"') == 2  # J6 and mz
    assert "ON the robot in base axes" in html
    bare = replace(with_wrench, virtual_sensor=None)
    assert log_charts.wrench_chart(bare) is None
    assert "Wrench axes" not in render(bare)


def test_the_force_is_that_of_the_contacts_and_has_their_peaks(pushed: Analysis) -> None:
    found = pushed.contacts
    chart = log_charts.force_chart(pushed, found)
    (line,) = chart.series
    force, t = line.values[:, 0], pushed.t
    inside = np.zeros(len(t), dtype=bool)
    for c in found.contacts:
        own = (t >= c.course.t[0]) & (t <= c.course.t[-1])
        inside |= own
        assert force[np.argmin(np.abs(t - c.peak))] == c.peak_force
        # The line between two blocks never leaves them.
        assert np.nanmax(force[own]) <= c.peak_force * (1 + 1e-12)
    assert np.isfinite(force[inside]).all()
    assert np.isnan(force[~inside]).all()
    assert chart.spans == tuple((c.start, c.stop) for c in found.contacts)
    assert chart.ends(0) == (0.0, log_charts.highest(found))


def test_the_axis_of_the_force_holds_every_peak_with_its_band(pushed: Analysis) -> None:
    found = pushed.contacts
    assert log_charts.highest(found) > max(c.peak_force + c.peak_band for c in found.contacts)
    assert log_charts.highest(replace(found, contacts=())) == 2.5 * found.detectable_force
    assert log_charts.highest(replace(found, contacts=(), smallest_force=None)) == 1.0
    # A band wider than its force stretches no axis.
    wide = replace(found.contacts[0], peak_force=88.0, peak_band=900.0)
    assert log_charts.highest(replace(found, contacts=(wide,))) < 250.0


def test_all_of_a_loads_force_is_in_its_chart_which_begins_at_zero(pushed: Analysis) -> None:
    """Its size is a mean of 20 N: what was felt, up to 32 ± 6 N, is in the chart all the same."""
    found = pushed.contacts
    first = found.contacts[0]
    load = replace(first, is_load=True, peak_force=20.0, peak_band=2.0, stop=first.course.t[-1])
    size = 26.0 + 6.0 * np.sin(9.0 * first.course.t)
    course = first.course._replace(force=size, band=np.full(len(size), 6.0))
    only = replace(found, contacts=(replace(load, course=course),))
    chart = log_charts.force_chart(pushed, only)
    low, high = chart.ends(0)
    assert low == 0.0
    assert high >= size.max() + 6.0
    html = render(replace(pushed, contacts=only))
    assert 'class="patch contact"></span> contact</span>' not in html.partition("believed")[0]


def test_the_force_stands_before_the_logs_own_wrench(pushed: Analysis, as_if: Callable) -> None:
    wrench = np.zeros((len(pushed.t), 6))
    wrench[:, 1:3] = 30.0, -40.0
    logs = (replace(pushed.recording, wrench=w) for w in (0 * wrench, wrench))
    silent, felt = (as_if(pushed, log) for log in logs)
    bare, chart = (log_charts.force_chart(x, pushed.contacts) for x in (silent, felt))
    own, best = chart.series
    assert (own.colour, best.name) == (REFERENCE, "best")
    np.testing.assert_allclose(own.values, 50.0)
    assert [line.name for line in bare.series] == ["best"]
    assert "the log&#x27;s own wrench" in render(felt)


def test_the_band_is_grey_where_no_contact_is_listed(pushed: Analysis) -> None:
    """The twelve pushes of the circle and their edges of a block; a wrench without a list: none."""
    (line,) = log_charts.wrench_chart(pushed).series
    t, inside = pushed.t, np.zeros(len(pushed.t), dtype=bool)
    for row in pushed.contacts.contacts:
        inside |= (t > row.start) & (t < row.stop)
    first = pushed.contacts.contacts[0]
    assert line.quiet[np.argmin(np.abs(t - first.start + 0.2))]
    assert not line.quiet[inside].any()
    assert line.quiet[t < 4.0].all()
    assert np.nanmin(line.half) > 0.0
