from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from drawings import drawn, names_in

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import ForceCourse
from vftcli.evaluation.errors import POOLED
from vftcli.observers.spectra import Spectra
from vftcli.observers.tuning import Tuned, parse_goal, tune_all, tuning_curves
from vftcli.outputs import figures
from vftcli.outputs.paper import WIDTHS, figure_files
from vftcli.signals.errors import OutputError, ParameterError

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


@pytest.fixture(scope="module")
def spectra() -> Spectra:
    """Torque that falls with f⁻⁴ from 1 Hz over white noise, on two joints of different size."""
    f = np.linspace(0.0, 62.5, 251)
    torque = np.outer(1.0 / (1.0 + f**4), [10.0, 1.0])
    noise = np.full((251, 2), 1e-3)
    return Spectra(frequency=f, free=noise, loaded=noise + torque, step=0.008, segments=(9, 9))


@pytest.fixture(scope="module")
def tuned(spectra: Spectra) -> tuple[Tuned, ...]:
    return tune_all(spectra, parse_goal("auto"))


def test_spectra_bear_responses_and_choices(spectra: Spectra, tuned: tuple[Tuned, ...]) -> None:
    found = figures.tuned_figures(spectra, tuned)
    assert list(found) == list(figures.TUNED_FIGURES)
    first, second = (drawn(drawing, "single") for drawing in found.values())
    assert names_in(first)[2:] == [f"|H| of {line.observer}" for line in tuned]
    assert first._supylabel.get_text() == "Power density (dB of 1 (N·m)²/Hz)"
    gmo = second.axes[1].lines[3 + 1]
    assert gmo.get_xdata()[0] == pytest.approx(tuned[1].rate[1] / (2.0 * np.pi))
    assert gmo.get_ydata()[0] == pytest.approx(tuned[1].rmse[1])


def test_the_least_of_a_curve_is_chosen(spectra: Spectra, tuned: tuple[Tuned, ...]) -> None:
    curves = tuning_curves(spectra)
    for line, name in ((tuned[1], "fdo, gmo"), (tuned[2], "kfo-zoh"), (tuned[3], "kfo-rts")):
        np.testing.assert_array_equal(curves[name].best, line.rate)
        # Both sum the same spectra, in another order.
        np.testing.assert_allclose(curves[name].least, line.rmse, rtol=1e-12)


@pytest.mark.slow
def test_gains_and_figures_appear_together(spectra, tuned, tmp_path):
    path = tmp_path / "gains.toml"
    figures.write_tuned(path, ["why"], spectra, tuned)
    alone = path.read_text(encoding="utf-8")
    assert alone.startswith("# why\n")
    with pytest.raises(OutputError, match="exists"):
        figures.write_tuned(path, ["why"], spectra, tuned, form="svg")
    assert [p.name for p in tmp_path.iterdir()] == ["gains.toml"]
    figures.write_tuned(path, ["why"], spectra, tuned, force=True, form="svg")
    assert path.read_text(encoding="utf-8") == alone
    wanted = {"gains.toml", *figure_files("svg", figures.TUNED_FIGURES, "gains-")}
    assert {p.name for p in tmp_path.iterdir()} == wanted


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
