import base64

import numpy as np
import pytest

from vftcli.outputs.page.charts import (
    STRETCHES,
    Chart,
    ChartLine,
    known,
    packed,
    packed_over_frequency,
)


def floats(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype="<f4")


def test_a_chart_over_time_keeps_every_column_and_its_band() -> None:
    t = np.arange(4.0)
    values = np.array([[1.0, 2.0], [3.0, np.nan], [5.0, 6.0], [7.0, 8.0]])
    half = np.array([[0.5, 1.0], [0.5, 2.0], [np.nan, 3.0], [0.5, 4.0]])
    line = ChartLine("gmo", values, "#112233", dashed=True, half=half)
    found = packed(Chart("tau", "Torque", "N·m", (line,), np.array([1.0, 2.0]), "floor"), t)
    (series,) = found["series"]
    assert (series["name"], series["colour"], series["dashed"]) == ("gmo", "#112233", True)
    np.testing.assert_array_equal(floats(series["lines"][1]["half"]), half[:, 1])
    assert np.isnan(floats(series["lines"][0]["half"])[2])
    assert (found["band"], found["bandLabel"]) == ([1.0, 2.0], "floor")
    np.testing.assert_array_equal(floats(series["lines"][1]["y"]), values[:, 1])
    np.testing.assert_array_equal(floats(series["lines"][0]["x"]), t)


def test_a_long_log_is_decimated_its_ribbon_with_it() -> None:
    t = np.arange(5.0 * STRETCHES)
    line = ChartLine("q", t[:, None], half=0.5 * t[:, None])
    found = packed(Chart("q", "", "rad", (line,)), t)
    drawn, half = (floats(found["series"][0]["lines"][0][key]) for key in ("x", "half"))
    np.testing.assert_array_equal(half, 0.5 * drawn)
    assert 2 * STRETCHES - 2 <= len(drawn) <= 2 * STRETCHES + 2  # two a stretch, and both ends


def test_each_line_over_frequency_may_have_its_own_frequencies() -> None:
    lines = (ChartLine("a", np.ones((3, 1))), ChartLine("b", np.ones((2, 1))))
    grids = [np.array([1.0, 2.0, 3.0]), np.array([5.0, 6.0])]
    found = packed_over_frequency(Chart("gain", "", "dB", lines), grids, {"lowest": -80})
    assert found["log"] is True
    assert found["lowest"] == -80
    drawn = [floats(series["lines"][0]["x"]).tolist() for series in found["series"]]
    assert drawn == [grid.tolist() for grid in grids]


@pytest.mark.parametrize(
    ("values", "shown"),
    [(None, None), ([np.nan, np.nan], None), ([1.0, np.nan], [1.0, None])],
)
def test_a_band_of_unknowns_is_none(values: list | None, shown: list | None) -> None:
    assert known(None if values is None else np.array(values)) == shown
