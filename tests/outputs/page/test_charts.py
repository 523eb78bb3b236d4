import re

import numpy as np
import pytest

from vftcli.outputs.charts import QUIET, Chart, ChartLine, families_of
from vftcli.outputs.page.shell import part


def chart(t: np.ndarray, *lines: ChartLine, **kind: object) -> Chart:
    n = lines[0].values.shape[1]
    return Chart("k", "K", ("N",) * n, tuple("abcdef"[:n]), t, lines, **kind)  # type: ignore[arg-type]


def test_a_ribbon_is_grey_where_no_contact_is_listed() -> None:
    t, values = np.arange(6.0), np.zeros((6, 1))
    quiet = np.array([True, True, False, False, True, True])
    line = ChartLine("best", values, "#112233", half=np.full((6, 1), 2.0), quiet=quiet)
    html = part("svg/multiples", chart(t, line))
    assert html.count('class="rim"/>') == 1 + 1  # one more in the legend
    assert html.count('class="floor"/>') == 1
    assert QUIET in html
    assert QUIET not in part("svg/multiples", chart(t, line._replace(quiet=None)))


def test_a_ribbon_goes_along_its_upper_edge_and_back_along_the_lower() -> None:
    """Between two level lines it fills its whole box: the area of its outline, by Gauss."""
    line = ChartLine("best", np.zeros((6, 1)), "#112233", half=np.full((6, 1), 2.0))
    (outline,) = set(
        re.findall(r'"(M[^"]*)Z"', part("svg/multiples", chart(np.arange(6.0), line)))
    )
    steps = np.array([float(number) for number in re.findall(r"-?\d*\.?\d+", outline)])
    x, y = np.cumsum(steps.reshape(-1, 2), axis=0).T
    area = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    assert 1.0 < area == pytest.approx(np.ptp(x) * np.ptp(y))


def test_neighbours_of_one_drive_size_share_a_scale() -> None:
    nan = np.nan
    assert families_of(np.array([150.0, 150.0, 28.0, 28.0, 150.0])) == (1, 1, 2, 2, 3)
    assert families_of(np.array([nan, nan])) == (1, 1)
    values = np.array([[1.0, 40.0, 3.0], [-1.0, 0.0, 0.0]])
    shown = chart(np.arange(2.0), ChartLine("a", values), families=(1, 1, 2))
    assert shown.ends(0) == shown.ends(1)
    assert shown.ends(0).high > 40.0
    assert shown.ends(2).high < 4.0


def test_a_ribbon_and_a_band_are_within_their_scale() -> None:
    t, half = np.arange(2.0), np.full((2, 1), 5.0)
    ends = chart(t, ChartLine("a", np.ones((2, 1)), half=half)).ends(0)
    assert (ends.low < -4.0, ends.high > 6.0) == (True, True)
    ends = chart(t, ChartLine("a", np.ones((2, 1))), band=np.array([9.0])).ends(0)
    assert (ends.low < -9.0, ends.high > 9.0) == (True, True)


def test_only_what_is_shown_stands_in_the_small_pictures() -> None:
    t = np.arange(3.0)
    lines = (
        ChartLine("first", np.ones((3, 2)), "#112233"),
        ChartLine("<i>", np.ones((3, 2)), "#445566"),
        ChartLine("later", np.ones((3, 2)), "#778899", shown=False),
    )
    html = part("svg/multiples", chart(t, *lines))
    assert html.count("<figure") == 2
    # Each line has a switch, those that are shown a place in the legend.
    assert html.count('stroke="#112233"') == 2 + 1 + 1
    assert html.count('stroke="#778899"') == 1
    assert html.count('aria-pressed="false"') == 1
    assert "<i>" not in html
    assert "&lt;i&gt;" in html
    assert "legend" in html
    assert "legend" not in part("svg/multiples", chart(t, lines[0]))  # one line needs none
