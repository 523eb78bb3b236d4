from dataclasses import replace

import numpy as np

from vftcli.analysis import Analysis
from vftcli.outputs.page.wrench_part import (
    condition_charts,
    wrench_chart,
    wrench_section,
)


def test_the_pose_has_a_chart_with_its_threshold(with_wrench: Analysis) -> None:
    reading = with_wrench.virtual_sensor
    assert reading is not None
    first = next(condition_charts(with_wrench))
    assert (first.key, first.units) == ("sigma_min", ("m",))
    assert first.band is not None
    assert first.band.tolist() == [reading.sensor.least_sigma]
    sigma = reading.wrenches[0].sigma_min
    assert sigma is not None
    np.testing.assert_array_equal(first.series[0].values[:, 0], sigma)


def test_without_wrenches_there_is_no_section(without_reference: Analysis) -> None:
    bare = replace(without_reference, virtual_sensor=None)
    assert wrench_chart(bare) is None
    assert wrench_section(bare, None) == ""
    assert list(condition_charts(bare)) == []


def test_wrenches_have_a_panel_an_axis(with_wrench: Analysis) -> None:
    chart = wrench_chart(with_wrench)
    assert chart is not None
    assert chart.panels == ("fx", "fy", "fz", "mx", "my", "mz")
    assert chart.units == ("N",) * 3 + ("N·m",) * 3
    assert chart.families == (1, 1, 1, 2, 2, 2)
    (leading,) = (line for line in chart.series if line.leads)
    assert leading.name == "best"
    known = next(w for w in with_wrench.wrenches if w.name == "best").known
    np.testing.assert_array_equal(leading.values, known)
    assert [line.shown for line in chart.series if not line.leads] == [False] * 4
    html = wrench_section(with_wrench, chart)
    assert html.count('data-panel="0"') >= 2  # fx, and what the pose can tell
    assert "ON the robot in base axes" in html


def test_the_band_is_grey_where_no_contact_is_listed(pushed: Analysis) -> None:
    """The twelve pushes of the circle and their edges of a block; a wrench without a list: none."""
    chart = wrench_chart(pushed)
    assert chart is not None
    (line,) = chart.series
    assert pushed.contacts is not None
    assert line.quiet is not None
    t, inside = pushed.t, np.zeros(len(pushed.t), dtype=bool)
    for row in pushed.contacts.contacts:
        inside |= (t > row.start) & (t < row.stop)
        assert line.quiet[np.argmin(np.abs(t - row.start + 0.2))] or row.number > 1
    assert not line.quiet[inside].any()
    assert line.quiet[t < 4.0].all()
    assert np.nanmin(line.half) > 0.0
