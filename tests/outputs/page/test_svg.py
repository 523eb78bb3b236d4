import re

import numpy as np
import pytest

from vftcli.outputs.charts import Span
from vftcli.outputs.page.shell import (
    Box,
    Scales,
    label,
    part,
    path_of,
    polyline,
    ribbon,
    stripes,
    ticks,
)

SCALES = Scales(
    Box(128, 112, left=20, bottom=5, top=7, right=8), Span(2.0, 12.0), Span(-1.0, 4.0)
)
"""A plot of 100 by 100 with another room on each side."""


def test_values_have_their_places() -> None:
    np.testing.assert_allclose(SCALES.across(np.array([2.0, 7.0, 12.0])), [20, 70, 120])
    np.testing.assert_allclose(SCALES.up(np.array([-1.0, 4.0])), [107, 7])
    # Of a span without width all have one place.
    flat = SCALES._replace(x=Span(3.0, 3.0), y=Span(1.0, 1.0))
    assert (flat.across(3.0), flat.up(1.0)) == (20.0, 107.0)


@pytest.mark.parametrize(
    ("span", "count", "found"),
    [
        (Span(0.0, 18.4), 9, [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0]),
        (Span(-7.0, 12.0), 3, [-5.0, 0.0, 5.0, 10.0]),
        (Span(1.0, 1.0), 3, [1.0]),
    ],
)
def test_ticks_are_round(span: Span, count: int, found: list[float]) -> None:
    np.testing.assert_allclose(ticks(span, count), found)


@pytest.mark.parametrize("high", [1.0, 1.7, 3.3, 6.1, 14.0])
def test_there_are_always_numbers_on_an_axis(high: float) -> None:
    assert 3 <= len(ticks(Span(-0.4 * high, high), 3)) <= 7


def test_numbers_of_axes() -> None:
    assert (label(-0.5), label(-0.0), label(1e6)) == ("−0.5", "0", "1e+06")
    text = part("svg/axes", SCALES, "<s>")
    assert "&lt;s&gt;" in text
    assert "<s>" not in text


def test_a_line_breaks_where_nothing_is_known() -> None:
    t = np.arange(5.0)
    assert path_of(SCALES, t, np.array([0.0, 5.0, np.nan, 5.0, 0.0])).count("M") == 2
    assert path_of(SCALES, t, np.array([np.nan, 1.0, np.nan, 5.0, 0.0])).count("h.01") == 1
    half = ribbon(SCALES, t, np.zeros(5), np.array([1.0, 1.0, np.nan, 1.0, 1.0]))
    assert half.count("Z") == 2


def test_what_is_far_outside_stays_near() -> None:
    t = np.array([2.0, 3.0])
    assert path_of(SCALES, t, np.array([-1.0, 1e9])) == "M20 107l10-200"
    assert path_of(SCALES, t, np.array([-1.0, -1e9])) == "M20 107l10 100"


def test_a_path_is_drawn_to_a_tenth_without_its_errors_adding_up() -> None:
    """Moves of 0.04 are nothing, ten of them 0.4."""
    assert polyline([[0.0, 0.0], [0.5, -1.1], [0.6, 9.0]]) == "M0 0l.5-1.1 .1 10.1"
    points = np.column_stack([0.04 * np.arange(11), np.zeros(11)])
    moves = re.findall(r"-?[\d.]+", polyline(points).partition("l")[2])[::2]
    assert sum(map(float, moves)) == pytest.approx(0.4)
    assert polyline([[3.0, 4.0]]) == "M3 4h.01"


def test_a_stripe_stays_in_the_plot() -> None:
    assert SCALES.inside((7.0, 99.0)).tolist() == [70.0, 120.0]


def test_many_stripes_are_one_path() -> None:
    found = stripes(SCALES, [(2.0, 3.0), (7.0, 7.0)])
    assert found == "M20.0 7h10.0v100h-10.0zM70.0 7h0.5v100h-0.5z"


def test_the_title_is_words() -> None:
    assert "&lt;b&gt;" in part("svg/svg", Box(), "<b>", "<g/>")
