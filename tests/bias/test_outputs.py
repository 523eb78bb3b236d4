"""Bands, curves and limits reach the Parquet, the page, the recording and `run.json`."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.analysis import Analysis
from vftcli.observers.choice import ObserverChoice
from vftcli.outputs.estimates import estimates_table
from vftcli.outputs.page.log_charts import (
    observer_styles,
    spectra_chart,
    torque_chart,
    tuning_chart,
)
from vftcli.outputs.page.pages import render
from vftcli.outputs.rerun_recording import plot_groups
from vftcli.outputs.run_record import run_record, to_json
from vftcli.readers.reader import ReadChoice
from vftcli.robots.choice import RobotChoice


@pytest.mark.slow
def test_the_parquet_holds_the_band_beside_the_covariance(worked_up: Analysis) -> None:
    table = estimates_table(worked_up)
    assert isinstance(table, pl.DataFrame)
    for j in (1, 6):
        band = worked_up.estimates[-1].error_sd
        assert band is not None
        np.testing.assert_array_equal(table[f"band/rts-auto/{j}"].to_numpy(), band[:, j - 1])
        assert f"sd/rts-auto/{j}" in table.columns


def test_ribbons_curve_and_spectra_are_charts(worked_up: Analysis) -> None:
    halves = {s.name: s.half for s in torque_chart(worked_up).series if s.half is not None}
    assert set(halves) == {e.name for e in worked_up.estimates}
    band = worked_up.estimates[-1].error_sd
    assert band is not None
    np.testing.assert_array_equal(halves["rts-auto"], 1.96 * band)
    found = worked_up.refinement
    assert found is not None
    curve = tuning_chart(found.curves, observer_styles(worked_up))
    assert [s.name for s in curve.series] == ["kfo-auto", "rts-auto"]
    assert found.baselines.plain.spectra is not None
    assert len(spectra_chart(found.baselines.plain.spectra).series) == 2
    assert "Error budget in N·m rms" in render(worked_up)


def test_the_recording_shows_both_edges_of_the_last_band(worked_up: Analysis) -> None:
    plot = next(iter(plot_groups(worked_up)["Joint torques"]))
    lines = {line.name: line.values[:, 0] for line in plot.series}
    upper, lower = (lines[f"rts-auto 95 % {edge}"] for edge in ("upper", "lower"))
    estimate = worked_up.estimates[-1]
    assert estimate.error_sd is not None
    np.testing.assert_allclose(0.5 * (upper + lower), estimate.tau[:, 0], atol=1e-9)
    np.testing.assert_allclose(upper - lower, 2 * 1.96 * estimate.error_sd[:, 0], rtol=1e-9)
    assert not any("kfo-auto 95 %" in name for name in lines)


def test_run_json_records_what_was_chosen(worked_up: Analysis) -> None:
    record = json.loads(to_json(run_record(worked_up, "vftcli report")))
    reported = record["complete_log"]
    assert reported["bias_removed"] == "auto"
    assert reported["best"] is None  # it was not asked for
    assert len(reported["tuned"]["rts-auto"]["omega_n_rad_s"]) == 6
    assert set(reported["error_budget_Nm"]) == {e.name for e in worked_up.estimates}
    assert "filter" in next(
        o["parameters"] for o in record["observers"] if o["name"] == "rts-auto"
    )


def test_a_run_that_asks_for_nothing_shows_nothing() -> None:
    from made_runs import analyse_log

    from vftcli.pipeline import AnalysisChoice

    fixture = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"
    plain = analyse_log(
        fixture,
        AnalysisChoice(
            read=ReadChoice(interval=(0.0, 5.0)),
            robot=RobotChoice(name="ur5"),
            observers=ObserverChoice(names=("gmo",)),
        ),
    )
    assert plain.refinement is None
    assert "What the complete log tells" not in render(plain)
    assert json.loads(to_json(run_record(plain, "")))["complete_log"] is None


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["base", "flange"])
def test_the_wrench_takes_its_band_from_the_joint_torques(frame: str) -> None:
    from made_runs import analyse_log

    from vftcli.pipeline import AnalysisChoice
    from vftcli.wrench.choice import WrenchChoice

    fixture = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"
    request = AnalysisChoice(
        wrench=WrenchChoice(frame=frame),
        read=ReadChoice(interval=(0.0, 12.0)),
        robot=RobotChoice(name="ur5"),
        observers=ObserverChoice(names=("rts-auto",)),
    )
    analysis = analyse_log(fixture, request)
    assert analysis.virtual_sensor is not None
    assert "band-from-torques" in [remark.code for remark in analysis.virtual_sensor.remarks]
    # the covariance of the filter alone would say another thing
    wrench = analysis.virtual_sensor.wrenches[0]
    assert wrench.sd is not None
    assert np.all(np.isfinite(wrench.sd))
