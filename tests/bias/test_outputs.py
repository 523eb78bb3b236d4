"""Bands, curves and limits reach the page and the recording."""

from dataclasses import replace

import numpy as np

from vftcli.outputs.page.log_charts import torque_chart
from vftcli.outputs.page.pages import render
from vftcli.outputs.rerun_recording import plot_groups


def test_bands_are_ribbons_and_curves_are_kept(worked_up):
    halves = {s.name: s.half for s in torque_chart(worked_up).series if s.half is not None}
    assert set(halves) == {e.name for e in worked_up.estimates}
    band = worked_up.estimates[-1].error_sd
    np.testing.assert_array_equal(halves["rts-auto"], 1.96 * band)
    assert list(worked_up.refinement.curves) == ["kfo-auto", "rts-auto"]
    assert "Error budget in N·m rms" in render(replace(worked_up, run={}))


def test_the_recording_shows_both_edges_of_the_last_band(worked_up):
    plot = next(iter(plot_groups(worked_up)["Joint torques"]))
    lines = {line.name: line.values[:, 0] for line in plot.series}
    upper, lower = (lines[f"rts-auto 95 % {edge}"] for edge in ("upper", "lower"))
    estimate = worked_up.estimates[-1]
    np.testing.assert_allclose(0.5 * (upper + lower), estimate.tau[:, 0], atol=1e-9)
    np.testing.assert_allclose(upper - lower, 2 * 1.96 * estimate.error_sd[:, 0], rtol=1e-9)
    assert not any("kfo-auto 95 %" in name for name in lines)
