"""Figures of one log: force, torque, wrench, errors."""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.evaluation.errors import POOLED
from vftcli.observers.table import BEST
from vftcli.outputs.charts import Chart, ChartLine, colours_of_names
from vftcli.outputs.error_tables import block, logs_of
from vftcli.outputs.page.log_charts import (
    contact_spans,
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
    line_figure,
    paper_style,
    plots_of,
)
from vftcli.signals.errors import ParameterError
from vftcli.signals.packages import check_installed
from vftcli.signals.parsing import check_known

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vftcli.signals.arrays import Array

#: Every figure that a log may have.
LOG_FIGURES = ("force", "torque", "errors", "wrench")
ERROR_FIGURES = ("errors",)  #: The figure of a table of errors.
MOST = 8  #: Most logs in one figure of errors; more show only their summary.


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
