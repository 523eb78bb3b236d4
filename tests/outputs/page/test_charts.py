import base64

import numpy as np
import pytest

from vftcli.outputs.charts import QUIET, Chart, ChartLine, families_of
from vftcli.outputs.page.shell import (
    FEWEST,
    LONG,
    ROOM,
    STEPS,
    packed,
    packed_charts,
    part,
    quantised,
)


def floats(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype="<f4")


def unpacked(found: dict) -> np.ndarray:
    """As the page's script reads it."""
    points = np.frombuffer(base64.b64decode(found["points"]), dtype="<i2").astype(float)
    return np.where(points == -32768, np.nan, found["low"] + found["step"] * (points + 32767))


def chart(t: np.ndarray, *lines: ChartLine, **kind: object) -> Chart:
    n = lines[0].values.shape[1]
    return Chart("k", "K", ("N",) * n, tuple("abcdef"[:n]), t, lines, **kind)  # type: ignore[arg-type]


def test_values_are_kept_to_a_step() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(0.0, 30.0, 500)
    values[7] = np.nan
    # Half a step of the range in 65534, and the rounding of a double.
    step = np.nanmax(values) - np.nanmin(values)
    np.testing.assert_allclose(
        unpacked(quantised(values)), values, atol=0.5 * step / STEPS * (1 + 1e-9), rtol=0
    )
    assert unpacked(quantised(np.array([4.0, 4.0]))).tolist() == [4.0, 4.0]
    assert np.isnan(unpacked(quantised(np.array([np.nan])))).all()


def test_a_chart_over_time_keeps_every_column_and_its_band() -> None:
    t = np.arange(4.0)
    values = np.array([[1.0, 2.0], [3.0, np.nan], [5.0, 6.0], [7.0, 8.0]])
    half = np.array([[0.5, 1.0], [0.5, 2.0], [np.nan, 3.0], [0.5, 4.0]])
    line = ChartLine("gmo", values, "#112233", "7 3", half)
    found = packed(chart(t, line, band=np.array([1.0, 2.0]), band_label="floor"), 100)
    (series,) = found["series"]
    assert (series["name"], series["colour"], series["dash"]) == ("gmo", "#112233", [7.0, 3.0])
    assert (found["band"], found["bandLabel"]) == ([1.0, 2.0], "floor")
    np.testing.assert_array_equal(floats(series["lines"][0]["x"]), t)
    # a step of 6 in 65534
    np.testing.assert_allclose(unpacked(series["lines"][1]["y"]), values[:, 1], atol=1e-4)
    np.testing.assert_allclose(unpacked(series["lines"][0]["half"]), half[:, 0], atol=1e-4)


def test_a_ribbon_is_grey_where_no_contact_is_listed() -> None:
    t, values = np.arange(6.0), np.zeros((6, 1))
    quiet = np.array([True, True, False, False, True, True])
    line = ChartLine("best", values, "#112233", half=np.full((6, 1), 2.0), quiet=quiet)
    (lines,) = packed(chart(t, line), 100)["series"][0]["lines"]
    assert np.isnan(unpacked(lines["half"])).tolist() == quiet.tolist()
    assert np.isnan(unpacked(lines["quiet"])).tolist() == (~quiet).tolist()
    html = part("svg/multiples", chart(t, line))
    assert html.count('class="rim"/>') == 1 + 1  # one more in the legend
    assert html.count('class="floor"/>') == 1
    assert QUIET in html
    plain = chart(t, line._replace(quiet=None))
    assert "quiet" not in packed(plain, 100)["series"][0]["lines"][0]
    assert QUIET not in part("svg/multiples", plain)


@pytest.mark.slow
@pytest.mark.parametrize(("seconds", "factor"), [(60.0, 1.0), (600.0, LONG)])
def test_a_long_log_is_decimated_into_the_room_of_the_page(seconds: float, factor: float) -> None:
    t = np.arange(0.0, seconds, 1e-3)
    values = np.random.default_rng(2).normal(size=(len(t), 7))
    lines = [ChartLine(f"o{k}", values, half=np.abs(values)) for k in range(3)]
    found = packed_charts([chart(t, ChartLine("a", values[:, :6])), chart(t, *lines)])
    size = sum(
        len(line["x"]) + len(line["y"]["points"]) + len(line.get("half", {}).get("points", ""))
        for each in found
        for series in each["series"]
        for line in series["lines"]
    )
    # The bound counts a ribbon as a line of its own, with places of its own.
    assert 0.5 * factor * ROOM < size <= factor * ROOM
    drawn = unpacked(found[0]["series"][0]["lines"][0]["y"])
    assert len(drawn) > 2 * FEWEST
    assert np.nanmax(drawn) == pytest.approx(values[:, 0].max(), abs=1e-3)


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
    assert html.count('stroke="#112233"') == 2 + 1  # one more in the legend
    assert "#778899" not in html
    assert "<i>" not in html
    assert "&lt;i&gt;" in html
    assert "legend" in html
    assert "legend" not in part("svg/multiples", chart(t, lines[0]))  # one line needs none


@pytest.mark.parametrize(
    ("values", "shown"),
    [(None, None), ([np.nan, np.nan], None), ([1.0, np.nan], [1.0, None])],
)
def test_a_band_of_unknowns_is_none(values: list | None, shown: list | None) -> None:
    line = ChartLine("a", np.zeros((3, 2)))
    band = None if values is None else np.array(values)
    assert packed(chart(np.arange(3.0), line, band=band), 100)["band"] == shown
