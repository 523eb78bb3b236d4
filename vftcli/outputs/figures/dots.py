"""One number a joint and observer on paper: a dot with its interval, each observer its own mark."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vftcli.outputs.figures.lines import MARKS, NARROW, plain
from vftcli.outputs.figures.paper import sheet, shortened
from vftcli.outputs.log.rmse_tables import DAGGER
from vftcli.signals.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SPREAD = 0.66  #: Share of a joint's room that its dots take.
RANGE = 10.0  #: Numbers that differ by more than this factor stand on a logarithmic axis.


class DotRow(NamedTuple):
    """One number a joint, of one observer."""

    name: str  #: Whose they are.
    values: Array  #: NaN where not known. (n,)
    low: Array | None = None  #: Lower ends of their intervals, or None. (n,)
    high: Array | None = None  #: Upper ends. (n,)


class DotPlot(NamedTuple):
    """One plot."""

    title: str  #: Which log.
    joints: Sequence[str]  #: What stands below. (n,)
    rows: Sequence[DotRow]  #: Dots, observer by observer.
    floor: Array  #: The reference's own error, NaN where it is not known. (n,)


def dot_figure(
    width: float, plots: Sequence[DotPlot], paints: Mapping[str, str], label: str
) -> "Figure":
    """Plots under one legend, their logs' names above them where there are several.

    Args:
        width: Of the figure. [in]
        plots: What is drawn.
        paints: Name of every row → its colour.
        label: What the vertical axis is, with its unit.
    """
    from matplotlib.lines import Line2D

    columns = 1 if width <= NARROW or len(plots) == 1 else 2
    looks = {name: look(k, paint) for k, (name, paint) in enumerate(paints.items())}
    handles: dict[str, Any] = {shortened(n): Line2D([], [], **how) for n, how in looks.items()}
    if any(np.isfinite(plot.floor).any() for plot in plots):
        handles["floor of the reference"] = Line2D([], [], color="black", linewidth=1.2)
    figure, grid = sheet(width, len(plots), columns, 1.7 if len(plots) == 1 else 1.45, handles)
    for axes, plot in zip(grid, plots, strict=False):
        draw_dots(axes, plot, looks)
        axes.set_ylabel(label)
        doubtful = any(DAGGER in joint for joint in plot.joints)
        axes.set_xlabel(f"Joint{f' ({DAGGER} rests: reference not to be trusted)' * doubtful}")
        if len(plots) > 1:
            axes.set_title(shortened(plot.title), fontsize=7.0, pad=3.5)
    for axes in grid[len(plots) :]:
        axes.set_axis_off()
    return figure


def look(k: int, paint: str) -> dict[str, Any]:
    """How the dots of one row look: every second one is hollow."""
    hollow = {"markerfacecolor": "white"} if k % 2 else {}
    shape = {"marker": MARKS[k % len(MARKS)], "markersize": 3.6, "markeredgewidth": 0.8}
    return {"color": paint, "linestyle": "none", **shape, **hollow}


def draw_dots(axes: "Axes", plot: DotPlot, looks: Mapping[str, dict[str, Any]]) -> None:
    """The dots of one log, side by side at each joint, and the floor below them."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    places = np.arange(len(plot.joints), dtype=np.float64)
    step = SPREAD / max(len(plot.rows), 1)
    axes.hlines(plot.floor, places - 0.42, places + 0.42, color="black", linewidth=1.2)
    for k, row in enumerate(plot.rows):
        whiskers = None
        if row.low is not None and row.high is not None:
            # An interval of resampled errors need not hold the error itself.
            ends = (row.values - row.low, row.high - row.values)
            whiskers = np.nan_to_num(np.maximum(np.array(ends), 0.0))
        axes.errorbar(
            places + step * (k - 0.5 * (len(plot.rows) - 1)),
            row.values,
            yerr=whiskers,
            elinewidth=0.6,
            capsize=1.4,
            capthick=0.6,
            **looks[row.name],
        )
    axes.set_xticks(places, list(plot.joints))
    axes.set_xlim(-0.5, len(places) - 0.5)
    axes.tick_params(axis="x", length=0.0)
    shown = np.concatenate([plot.floor, *(row.values for row in plot.rows)])
    shown = shown[np.isfinite(shown)]
    if shown.size and shown.min() > 0.0 and shown.max() > RANGE * shown.min():
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(plain))
        axes.yaxis.set_minor_formatter(NullFormatter())
    else:
        axes.set_ylim(bottom=0.0)
