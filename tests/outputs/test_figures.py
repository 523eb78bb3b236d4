from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
import pytest

from vftcli.analysis import Analysis
from vftcli.evaluation.errors import POOLED
from vftcli.outputs.figures import (
    LOG_FIGURES,
    MOST,
    error_figures,
    log_figures,
)
from vftcli.outputs.paper import WIDTHS, paper_style

pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")


def drawn(drawing: Any, width: str = "double") -> Any:
    with paper_style():
        figure = drawing.draw(WIDTHS[width])
        figure.draw_without_rendering()
    return figure


def names_in(figure: Any) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


@pytest.mark.slow
def test_every_axis_of_every_figure_has_its_unit(pushed: Analysis) -> None:
    """A number below bears the unit of the lowest plot; joints have none."""
    found = log_figures(pushed)
    assert list(found) == list(LOG_FIGURES)
    for name, drawing in found.items():
        for axes in drawn(drawing, "single").axes:
            if axes.axison and axes.get_ylabel():
                assert axes.get_ylabel().endswith((" (N·m)", " (N)", " (dB)", " (°)", " (ms)"))
            assert axes.get_xlabel() in {
                "",
                "Time (s)",
                "Frequency (Hz)",
                "Natural frequency (Hz)",
                "Joint",
                "Joint († rests: reference not to be trusted)",
            }, name


@pytest.mark.slow
def test_torque_shows_best_with_its_band_or_all_or_the_chosen(pushed: Analysis) -> None:
    shown = names_in(drawn(log_figures(pushed)["torque"]))
    assert "reference (two-cycle)" in shown
    assert {"best", "95 % band", "contact"} <= set(shown)
    assert not {"fdo", "gmo"} & set(shown)
    estimates = tuple(e for e in pushed.estimates if e.name in {"fdo", "gmo"})
    observers = tuple(o for o in pushed.observers if o.name in {"fdo", "gmo"})
    without = replace(pushed, estimates=estimates, observers=observers, virtual_sensor=None)
    two = names_in(drawn(log_figures(without)["torque"]))
    assert {"fdo", "gmo"} <= set(two)
    assert not {"best", "95 % band"} & set(two)


@pytest.mark.slow
def test_forces_stand_above_moments_or_beside_them(pushed: Analysis) -> None:
    drawing = log_figures(pushed)["wrench"]
    heads = {w: [a.get_ylabel()[:2] for a in drawn(drawing, w).axes] for w in WIDTHS}
    assert heads["double"] == ["fx", "fy", "fz", "mx", "my", "mz"]
    assert heads["single"] == ["fx", "mx", "fy", "my", "fz", "mz"]


def test_a_log_without_wrench_and_errors_has_no_figures_of_them(
    without_reference: Analysis,
) -> None:
    from dataclasses import replace

    bare = replace(without_reference, virtual_sensor=None)
    assert "errors" not in log_figures(bare)
    assert "wrench" not in log_figures(bare)


def test_errors_are_drawn_as_the_table_has_them(pushed: Analysis) -> None:
    errors = pushed.errors
    assert errors is not None
    (axes,) = drawn(error_figures(errors)["errors"]).axes
    rows = errors.filter((pl.col("observer") == "fdo") & pl.col("joint").is_not_null())
    order = list(dict.fromkeys(errors["observer"].drop_nulls()))
    dots = axes.containers[order.index("fdo")].lines[0].get_ydata()
    np.testing.assert_array_equal(dots, rows.sort("joint")["rmse_Nm"].to_numpy())


def test_of_many_logs_only_what_stands_for_all_is_drawn(pushed: Analysis) -> None:
    assert pushed.errors is not None
    rows = pushed.errors.filter(pl.col("joint").is_not_null())
    many = [rows.with_columns(recording=pl.lit(f"{k}.csv")) for k in range(MOST + 1)]
    assert error_figures(pl.concat(many)) == {}
    pooled = rows.with_columns(recording=pl.lit(POOLED))
    drawing = error_figures(pl.concat([*many, pooled]))["errors"]
    assert len(drawn(drawing).axes) == 1
    assert error_figures(rows.clear()) == {}
