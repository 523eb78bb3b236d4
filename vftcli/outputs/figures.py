"""Figures of one log (force, torque, wrench, errors, spectra) and of gains."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.evaluation.errors import POOLED
from vftcli.observers.observer import Observer
from vftcli.observers.spectra import Spectra
from vftcli.observers.table import BEST
from vftcli.observers.tuning import Curve, Tuned, tuning_curves
from vftcli.outputs.charts import INK, Chart, ChartLine, colours_of_names, lines_of_names
from vftcli.outputs.error_tables import block, logs_of
from vftcli.outputs.files import OutputFolder, write_text
from vftcli.outputs.page.log_charts import (
    contact_spans,
    joint_panels,
    reference_name,
    torque_chart,
    wrench_chart,
)
from vftcli.outputs.paper import (
    NARROW,
    WIDTHS,
    DotPlot,
    Drawing,
    dot_figure,
    figure_files,
    line_figure,
    paper_style,
    plots_of,
    write_figures,
)
from vftcli.robots.robot_file import lines_of
from vftcli.signals.errors import ParameterError
from vftcli.signals.packages import check_installed
from vftcli.signals.parsing import check_known

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vftcli.signals.arrays import Array

#: Every figure that a log may have.
LOG_FIGURES = ("force", "torque", "errors", "wrench", "spectra", "tuning")
TUNED_FIGURES = ("spectra", "tuning")  #: Those beside gains that were found.
ERROR_FIGURES = ("errors",)  #: The figure of a table of errors.
MOST = 8  #: Most logs in one figure of errors; more show only their summary.
#: Gain drawn for none, -240 dB; lowest gain shown. [–], [dB]
QUIETEST, LOWEST = 1e-12, -80.0
#: Colours of the two spectra.
FREE, LOADED = "#3b7ea1", "#c2410c"
#: Dashes of responses, drawn in black beside coloured spectra.
BROKEN = ("1.5 2", "8 2 1.5 2", "4 2", "8 2 1.5 2 1.5 2", "12 4", "")


def log_figures(analysis: Analysis) -> dict[str, Drawing]:
    """Every figure of a log that is not empty."""
    name, numbers = analysis.recording.name, numbers_of(analysis.listed)
    found = {}
    if analysis.contacts is not None and analysis.contacts.hardest is not None:
        found["force"] = force_drawing(analysis.contacts, analysis.t)
    title = f"{name}: external torque on the robot about each joint's axis"
    plots = plots_of(drawn_lines(analysis, torque_chart(analysis)))
    found["torque"] = Drawing(title, partial(line_figure, plots=plots, numbers=numbers))
    if analysis.errors is not None:
        found |= error_figures(analysis.errors)
    if (wrench := wrench_chart(analysis)) is not None:
        axes = drawn_lines(analysis, wrench)
        found["wrench"] = Drawing(
            f"{name}: force and moment on the robot, {wrench.title}",
            # Forces above moments, or beside them in one column's width.
            lambda width: line_figure(
                width,
                plots_of(axes, only=range(6) if width > NARROW else (0, 3, 1, 4, 2, 5)),
                numbers=numbers,
            ),
        )
    if (refined := analysis.refinement) is not None:
        if (spectra := refined.baselines.plain.spectra) is not None:
            # One observer's |H|: all would hide one another.
            lead = next((o for o in analysis.observers if o.name == BEST), analysis.observers[0])
            found["spectra"] = spectra_drawing(spectra, {lead.name: lead})
        if refined.curves:
            best = {key: (curve.best, curve.least) for key, curve in refined.curves.items()}
            found["tuning"] = tuning_drawing(refined.curves, best)
    return found


#: A notebook's plot → its chart, None if not of lines over the log.
PLOTS = {"contacts": None, "torques": torque_chart, "wrench": wrench_chart, "errors": None}


def plot(
    analysis: Analysis,
    what: str,
    joints: int | Sequence[int] | None,
    observers: str | Sequence[str] | None,
) -> "Figure":
    """A figure for a notebook: `what` of `PLOTS`, joints from 1."""
    check_known(str(what), PLOTS, f"no plot {what!r}")
    found, errors, drawing = analysis.contacts, analysis.errors, None
    numbers, names = ([] if x is None else np.atleast_1d(x).tolist() for x in (joints, observers))
    for name in names:
        check_known(str(name), [e.name for e in analysis.estimates], f"no estimate of {name!r}")
    for joint in numbers:
        if joint not in range(1, analysis.recording.joints + 1):
            raise ParameterError(f"no joint {joint!r}; there is 1 to {analysis.recording.joints}")
    if what == "contacts" and found is not None:
        drawing = force_drawing(found, analysis.t)
    elif what == "errors" and errors is not None:
        rows = [
            observer in (names or [observer]) and joint in (numbers or [joint])
            for observer, joint in errors.select("observer", "joint").iter_rows()
        ]
        drawing = error_figures(errors.filter(rows)).get("errors")
    elif (draw := PLOTS[what]) is not None and (chart := draw(analysis)) is not None:
        only = [int(j) - 1 for j in numbers] if what == "torques" else []
        plots = plots_of(drawn_lines(analysis, chart, names), only=only or None)
        drawing = Drawing(
            "", partial(line_figure, plots=plots, numbers=numbers_of(analysis.listed))
        )
    if drawing is None:
        raise ParameterError(f"the analysis holds no {what} to plot")
    return on_paper(drawing)


def on_paper(drawing: Drawing) -> "Figure":
    """A figure as wide as two columns of a paper."""
    check_installed("matplotlib", "a plot")
    with paper_style():
        return drawing.draw(WIDTHS["double"])


def force_drawing(found: ContactList, t: "Array | Sequence[float]" = ()) -> Drawing:
    """|F| of every contact with its 95 % band. (T,) [s]"""
    courses = [c.course for c in found.contacts if c.course is not None]
    lines = [ChartLine("|F|", c.force[:, None], half=c.band[:, None], x=c.t) for c in courses]
    spans = contact_spans(found.contacts)
    clock = [*t] or [0.0, found.duration, *(at for span in spans for at in span)]
    ends = np.array([min(clock), max(clock)])
    chart = Chart.of_one("force", "|F|", "N", ends, lines)._replace(
        band=np.array([found.detectable_force or np.nan]),
        band_label="detectable force",
        spans=spans,
        lowest=0.0,
    )
    draw = partial(line_figure, plots=plots_of(chart), numbers=numbers_of(found.contacts))
    return Drawing(f"{found.recording}: size of the force on the robot, 95 % band", draw)


def drawn_lines(analysis: Analysis, chart: Chart, names: Sequence[str] = ()) -> Chart:
    """The chart with these observers' lines and the reference."""
    estimated = [line.name for line in analysis.estimates]
    wanted = names or ([BEST] if BEST in estimated else estimated)
    kept = [x for x in chart.series if x.name in wanted or x.name not in estimated]
    alone, series = sum(line.name in wanted for line in kept) == 1, []
    for line in kept:
        name = line.name
        if analysis.reference is not None and name == reference_name(analysis):
            # A file's path would not fit.
            name = f"reference ({analysis.reference.name.split(':')[0]})"
        series.append(line._replace(name=name, shown=True, half=line.half if alone else None))
    return chart._replace(series=tuple(series))


def numbers_of(contacts: Iterable[Contact]) -> dict[int, float]:
    """Number of every contact → the middle of it. [s]"""
    return {c.number: 0.5 * (c.start + c.stop) for c in contacts if not c.is_load}


def error_figures(errors: pl.DataFrame) -> dict[str, Drawing]:
    """RMSE with its interval by joint, a plot a log, or pooled."""
    groups = list(logs_of(errors, "joint"))
    if len(groups) > MOST:
        groups = [rows for rows in groups if rows["recording"][0] == POOLED]
    if not 0 < len(groups) <= MOST:
        return {}
    plots, names = [], dict[str, None]()
    for rows in groups:
        found, ends = block(rows), ("rmse_low_Nm", "rmse_high_Nm")
        intervals = [block(rows.with_columns(rmse_Nm=pl.col(end))).rmse for end in ends]
        dots = zip(found.observers, found.rmse, np.stack(intervals, axis=1), strict=True)
        title = f"{found.recording}, {found.reference}"
        plots.append(DotPlot(title, found.joint_heads, list(dots), found.floor))
        names |= dict.fromkeys(found.observers)
    draw = partial(dot_figure, plots=plots, paints=colours_of_names([*names]), label="RMSE (N·m)")
    return {"errors": Drawing("RMSE of the external torque with its 95 % interval", draw)}


def over_frequency(
    key: str, title: str, unit: str, x: "Array", lines: Sequence[ChartLine]
) -> Chart:
    """A chart over frequency, a panel a joint. (T,) [Hz]"""
    panels = joint_panels(lines[0].values.shape[1])
    return Chart(key, title, (unit,) * len(panels), panels, x, tuple(lines), unit="Hz", log=True)


def spectra_drawing(spectra: Spectra, observers: Mapping[str, Observer]) -> Drawing:
    """Spectra of free and loaded part, with |H| of these observers."""
    frequency = spectra.frequency[1:]
    # In decibels; the least number above 0 replaces zero.
    parts = [
        ChartLine(name, 10.0 * np.log10(np.maximum(power[1:], np.finfo(float).tiny)), *style)
        for name, power, style in (
            ("free part, S_n", spectra.free, (FREE, "")),
            ("loaded part, S_d", spectra.loaded, (LOADED, "5 2")),
        )
    ]
    title = "Spectrum of the disturbance, dB of 1 (N·m)²/Hz"
    chart, lines = over_frequency("spectra", title, "dB", frequency, parts), []
    for k, (name, observer) in enumerate(observers.items()):
        response = observer.frequency_response(frequency, spectra.step, spectra.joints)
        gain = 20.0 * np.log10(np.maximum(np.abs(response), QUIETEST))
        gain = np.broadcast_to(gain, (len(frequency), spectra.joints))
        lines.append(ChartLine(f"|H| of {name}", gain, INK, BROKEN[k % len(BROKEN)]))
    over = chart._replace(key="gain", title="|H|", series=tuple(lines), lowest=LOWEST)

    def draw(width: float) -> "Figure":
        figure = line_figure(width, plots_of(chart, over))
        figure.supylabel("Power density (dB of 1 (N·m)²/Hz)", fontsize=8.0)
        return figure

    return Drawing(f"{chart.title}, and |H|", draw)


def tuning_drawing(
    curves: "Mapping[str, Curve]", chosen: "Mapping[str, tuple[Array, Array]]"
) -> Drawing:
    """Expected error over frequency, chosen rates [rad/s]."""
    styles = lines_of_names(list(curves))
    lines = [
        ChartLine(name, curve.rmse, *styles[name], x=curve.omega_n / (2.0 * np.pi))
        for name, curve in curves.items()
    ]
    x = np.concatenate([line.x for line in lines if line.x is not None])
    title, ends = "Expected error against natural frequency ω_n/2π", np.array([x.min(), x.max()])
    chart = over_frequency("curve", title, "N·m", ends, lines)
    marks = {name: (rate / (2.0 * np.pi), least) for name, (rate, least) in chosen.items()}
    plots, below = plots_of(chart), "Natural frequency (Hz)"
    return Drawing(chart.title, partial(line_figure, plots=plots, marks=marks, below=below))


def tuned_figures(spectra: Spectra, tuned: Sequence[Tuned]) -> dict[str, Drawing]:
    """Spectra with |H| of every observer, and expected errors."""
    running = {line.observer: line.running for line in tuned if line.running is not None}
    chosen = {line.observer: (line.rate, line.rmse) for line in tuned}
    return {
        "spectra": spectra_drawing(spectra, running),
        "tuning": tuning_drawing(tuning_curves(spectra), chosen),
    }


def write_tuned(
    path: Path,
    heading: Sequence[str],
    spectra: Spectra,
    tuned: Sequence[Tuned],
    *,
    force: bool = False,
    form: str | None = None,
) -> None:
    """Write gains, and their figures beside them, all or nothing."""
    comments = "".join(f"# {line}\n" for line in heading)
    gains = {"observers": {line.section: dict(line.gains) for line in tuned}}
    text = comments + "".join(lines_of(gains))
    if form is None:
        write_text(path, text, force)
        return
    before = f"{path.stem}-"
    names = [path.name, *figure_files(form, TUNED_FIGURES, before)]
    with OutputFolder(path.parent, force, names) as folder:
        folder.write(path.name, text)
        write_figures(folder, tuned_figures(spectra, tuned), form, before)
