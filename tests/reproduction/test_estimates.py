"""What is read off the bearing's assembly: weights, and how the arm moves under it."""

from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from vftcli.outputs.charts import Chart, ChartLine
from vftcli.reproduction import estimates
from vftcli.reproduction.estimates import mean_of, put_motion, put_weights, rms
from vftcli.reproduction.paper import CORRECTED, RunResult
from vftcli.signals.wrench import Wrench


def test_the_circles_lag_and_free_rms_are_those_of_the_first_three_joints(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Free is its first round, but for a second in which observers settle."""
    t = np.arange(0.0, 8.0, 0.5)
    tau = np.where((t > 1.0) & (t < 4.0), 2.0, 50.0)[:, None] * [1.0, 2.0, 2.0, 9.0, 9.0, 9.0]
    named = ("observer", "joint", "rmse_Nm", "reference_floor_Nm", "lag_s")
    rows = [("gmo", j, 0.1 * j, 0.01 * j, None if j == 2 else float(j)) for j in range(1, 7)]
    errors = pl.DataFrame([*rows, ("fdo", 1, 9.0, 0.01, None)], schema=named, orient="row")
    made = SimpleNamespace(
        errors=errors, estimates=[SimpleNamespace(name="gmo", t=t, tau=tau)], observers=()
    )
    chart = Chart("torque", "", (), (), t, (ChartLine("gmo", tau, "#000", half=tau),))
    monkeypatch.setattr(estimates, "simulate", lambda *_: SimpleNamespace(recording=None))
    monkeypatch.setattr(estimates, "analyse", lambda *_: made)
    monkeypatch.setattr(estimates, "guideline_numbers", lambda _: {"gmo": {"delay": 0.2}})
    monkeypatch.setattr(estimates, "torque_chart", lambda _: chart)
    found = estimates.tapped_circle(1, scenario="ur5-circle", period=4.0)
    of = {key: value[CORRECTED] for key, value in found.values.items() if CORRECTED in value}
    assert of["free/gmo"] == pytest.approx(2.0 * np.sqrt(3.0))  # 1, 2 and 2 of each 3
    assert of["lag/gmo"] == 2.0  # of J1 and J3, the one that is not known left out
    assert (of["gmo/6"], of["fdo/1"], of["delay/gmo"]) == (pytest.approx(0.6), 9.0, 0.2)
    assert "lag/fdo" not in of
    assert found.values["gmo/6"]["floor"] == pytest.approx(0.06)
    (line,) = found.charts["fig3"].series
    assert (line.shown, line.half) == (True, None)


def test_a_mean_is_of_what_is_known_inside_a_span() -> None:
    t = np.arange(6.0)
    values = np.outer([9.0, 1.0, 2.0, np.nan, 6.0, 9.0], np.arange(1.0, 7.0))
    wrench = Wrench(name="x", t=t, values=values, frame="base")
    np.testing.assert_allclose(mean_of(wrench, (0.0, 5.0)), 3.0 * np.arange(1.0, 7.0))
    assert rms(np.array([3.0, np.nan, -4.0])) == pytest.approx(np.sqrt(12.5))


def test_a_bearing_weighs_what_hangs_less_what_drifted() -> None:
    result = RunResult()
    put_weights(result, CORRECTED, np.arange(1.0, 7.0), np.array([0, 0, -12.0, 0, 0, 0]))
    found = {key: value[CORRECTED] for key, value in result.values.items()}
    axes = ("fx", "fy", "fz", "mx", "my", "mz")
    drift = {f"drift/{axis}": k + 1.0 for k, axis in enumerate(axes)}
    assert found == {**drift, "weight/raw": 12.0, "weight/zeroed": 15.0}


def test_an_arm_is_back_at_a_tenth_left_where_it_rests_and_moved_by_knocks() -> None:
    """Led .5 m along x until 2 s, back by a fifth of that a second; knocks of 4 and 3 mm later."""
    t = np.arange(0.0, 12.0, 0.01)
    x = np.zeros((len(t), 1, 6))
    x[:, 0, 0] = 0.5 * np.clip(np.minimum(t / 2.0, 1.0 - (t - 2.0) / 5.0), 0.006, 1.0)
    x[(t > 8.5) & (t < 9.0), 0, 1:3] = [0.004, 0.003]
    x[t > 9.5, 0, 2] = 0.7  # after the knocks
    rows = [
        {"controller": "variable", "axis": "x", "peak": 0.001, "release_s": 0.5},
        {"controller": "variable", "axis": "x", "peak": -0.5, "release_s": 2.0},
        {"controller": "variable", "axis": "y", "peak": 9.0, "release_s": 1.0},
        {"controller": "traditional", "axis": "x", "peak": 9.0, "release_s": 1.0},
    ]
    found = SimpleNamespace(
        motion=SimpleNamespace(t=t, x=x), controllers=[SimpleNamespace(kind="variable")], rows=rows
    )
    result = RunResult()
    put_motion(result, CORRECTED, found, (8.0, 9.4))
    values = {key: value[CORRECTED] for key, value in result.values.items()}
    assert values["back/variable"] == pytest.approx(4.5, abs=0.011)  # a sample
    assert values["left/variable"] == pytest.approx(3.0)
    assert values["knocked/variable"] == pytest.approx(5.0)
