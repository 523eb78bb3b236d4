from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from drawings import drawn, names_in

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import ForceCourse
from vftcli.evaluation.errors import POOLED
from vftcli.outputs import figures
from vftcli.outputs.paper import WIDTHS
from vftcli.signals.errors import ParameterError

pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")


@pytest.mark.slow
def test_every_axis_of_every_figure_has_its_unit(pushed: Analysis) -> None:
    """A number below bears the unit of the lowest plot; joints have none."""
    found = figures.log_figures(pushed)
    assert list(found) == list(figures.LOG_FIGURES)
    below = {"", "Time (s)", "Frequency (Hz)", "Natural frequency (Hz)", "Joint",
             "Joint († rests: reference not to be trusted)"}  # fmt: skip
    for name, drawing in found.items():
        for axes in drawn(drawing, "single").axes:
            if axes.axison and axes.get_ylabel():
                assert axes.get_ylabel().endswith((" (N·m)", " (N)", " (dB)", " (°)", " (ms)"))
            assert axes.get_xlabel() in below, name


@pytest.mark.slow
def test_torque_shows_best_with_its_band_or_all_or_the_chosen(pushed: Analysis) -> None:
    shown = names_in(drawn(figures.log_figures(pushed)["torque"]))
    assert "reference (two-cycle)" in shown
    assert {"best", "95 % band", "contact"} <= set(shown)
    assert not {"fdo", "gmo"} & set(shown)
    estimates = tuple(e for e in pushed.estimates if e.name in {"fdo", "gmo"})
    observers = tuple(o for o in pushed.observers if o.name in {"fdo", "gmo"})
    without = replace(pushed, estimates=estimates, observers=observers, virtual_sensor=None)
    two = names_in(drawn(figures.log_figures(without)["torque"]))
    assert {"fdo", "gmo"} <= set(two)
    assert not {"best", "95 % band"} & set(two)


@pytest.mark.slow
def test_forces_stand_above_moments_or_beside_them(pushed: Analysis) -> None:
    drawing = figures.log_figures(pushed)["wrench"]
    heads = {w: [a.get_ylabel()[:2] for a in drawn(drawing, w).axes] for w in WIDTHS}
    assert heads["double"] == ["fx", "fy", "fz", "mx", "my", "mz"]
    assert heads["single"] == ["fx", "mx", "fy", "my", "fz", "mz"]


def test_the_force_has_its_band_and_the_number_of_each_contact(touched: Analysis) -> None:
    course = ForceCourse(np.array([1.0, 1.2, 1.5]), np.array([5.0, 65.0, 8.0]), np.full(3, 7.0))
    first, *others = touched.contacts
    found = replace(touched.contacts, contacts=(replace(first, course=course), *others))
    (axes,) = drawn(figures.log_figures(replace(touched, contacts=found))["force"]).axes
    assert [text.get_text() for text in axes.texts] == ["1", "2"]
    assert course.force.tolist() in [list(line.get_ydata()) for line in axes.lines]
    corners = np.vstack([path.vertices for fill in axes.collections for path in fill.get_paths()])
    assert {(1.2, 58.0), (1.2, 72.0)} <= set(map(tuple, corners.tolist()))
    empty = replace(touched.contacts, contacts=())
    bare = replace(touched, contacts=empty, virtual_sensor=None, errors=None)
    assert not {"force", "wrench", "errors"} & set(figures.log_figures(bare))


def test_errors_are_drawn_as_the_table_has_them(pushed: Analysis) -> None:
    errors = pushed.errors
    (axes,) = drawn(figures.error_figures(errors)["errors"]).axes
    rows = errors.filter((pl.col("observer") == "fdo") & pl.col("joint").is_not_null())
    order = list(dict.fromkeys(errors["observer"].drop_nulls()))
    dots = axes.containers[order.index("fdo")].lines[0].get_ydata()
    np.testing.assert_array_equal(dots, rows.sort("joint")["rmse_Nm"].to_numpy())


def test_of_many_logs_only_what_stands_for_all_is_drawn(pushed: Analysis) -> None:
    rows = pushed.errors.filter(pl.col("joint").is_not_null())
    many = [rows.with_columns(recording=pl.lit(f"{k}.csv")) for k in range(figures.MOST + 1)]
    assert figures.error_figures(pl.concat(many)) == {}
    pooled = rows.with_columns(recording=pl.lit(POOLED))
    drawing = figures.error_figures(pl.concat([*many, pooled]))["errors"]
    assert len(drawn(drawing).axes) == 1
    assert figures.error_figures(rows.clear()) == {}


def test_a_plot_for_a_notebook_is_of_what_is_asked_for(analysis: Analysis) -> None:
    figure = figures.plot(analysis, "torques", [2, 5], "gmo")
    assert [axes.get_ylabel() for axes in figure.axes] == ["J2 (N·m)", "J5 (N·m)"]
    assert names_in(figure) == ["reference (vendor)", "gmo", "± floor of the reference"]
    gmo = next(estimate for estimate in analysis.estimates if estimate.name == "gmo")
    ends = [np.nanmax(line.get_ydata()) for axes in figure.axes for line in axes.lines]
    assert {gmo.tau[:, 1].max(), gmo.tau[:, 4].max()} <= set(ends)  # no spike is lost
    asked = {(None, "fdo"): (1, 6), ((2,), None): (5, 1), (3, ("fdo", "gmo")): (2, 1)}
    for (joints, observers), counts in asked.items():
        (axes,) = figures.plot(analysis, "errors", joints, observers).axes
        assert (len(axes.containers), len(axes.get_xticks())) == counts
    with pytest.raises(ParameterError, match="no joint 7; there is 1 to 6"):
        figures.plot(analysis, "torques", 7, None)
