"""Figures for a paper: style, files, lines of the page's charts, dots.

Nothing here loads matplotlib before a figure is drawn; it is an extra (``vftcli[figures]``).
"""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vftcli.outputs.charts import INK, QUIET, REFERENCE, Chart, ChartLine, drawn_line
from vftcli.outputs.error_tables import DAGGER
from vftcli.outputs.files import OutputFolder
from vftcli.signals.arrays import Array
from vftcli.signals.packages import VERSION
from vftcli.signals.parsing import printable

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

WIDTHS = {"single": 3.5, "double": 7.16}  #: One and two columns of the IEEE's journals. [in]
RESOLUTION = 600  #: Of PNG, as the IEEE asks for line drawings. [dots/in]

#: Matplotlib's own Times-like type, for equal bytes everywhere.
#: PDF embeds it, SVG holds paths.
STYLE: dict[str, Any] = {
    "font.family": ["STIXGeneral", "DejaVu Sans"],
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "legend.fontsize": 7.0,
    "text.parse_math": False,
    "axes.linewidth": 0.5,
    "lines.linewidth": 0.8,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "legend.columnspacing": 1.2,
    "legend.labelspacing": 0.3,
    "figure.constrained_layout.h_pad": 0.02,
    "figure.constrained_layout.w_pad": 0.02,
    "figure.constrained_layout.hspace": 0.03,
    "figure.constrained_layout.wspace": 0.03,
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "vftcli",
}
TICKS = {"labelsize": 7.0, "direction": "in", "major.width": 0.5, "minor.width": 0.3}
STYLE |= {f"{axis}tick.{key}": value for axis in "xy" for key, value in TICKS.items()}

#: Legend: width of a letter and a line's sample, line height. [in]
LETTER, SAMPLE, LINE = 0.043, 0.41, 0.15
LONGEST = 44  #: Most letters of a name in a figure.
#: Stretches of a line in a plot of two inches, two samples each.
STRETCHES = 500
#: Below it a figure has one column; height of a row, by width. [in]
NARROW, HIGH = 5.0, {False: 0.95, True: 1.15}
#: Marks in turn: their shapes differ, for print without colours.
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "*")
#: Width of a contact number's digit; least gap to the next. [in]
DIGIT, BETWEEN = 0.046, 0.02
SPREAD = 0.66  #: Share of a joint's room that its dots take.
RANGE = 10.0  #: A larger ratio of numbers has a logarithmic axis.
PLOTTED = 0.75  #: Rough share of a plot's room for its axes.

Look = dict[str, Any]  #: Arguments of matplotlib.
BAND_LOOK: Look = {
    "color": "black", "linewidth": 0.6, "linestyle": (0, (1.0, 2.0)), "zorder": 1.9,
}  # fmt: skip
#: Place of a contact's number, above a plot.
ABOVE: Look = {
    "xycoords": ("data", "axes fraction"), "xytext": (0, 1), "textcoords": "offset points",
    "ha": "center", "va": "bottom", "fontsize": 6.5,
}  # fmt: skip
WHISKER_LOOK: Look = {"elinewidth": 0.6, "capsize": 1.4, "capthick": 0.6}
CONTACT_LOOK: Look = {"facecolor": "0.9", "linewidth": 0.0, "zorder": 0.9}
#: Colours of the page that follow its theme → theirs on white paper.
PAINTS = {INK: "black", REFERENCE: "0.65"}
#: Dashes of the page → on paper, where they are like others.
PAPER_DASHES = {"4 2": "9 3 2 3 2 3"}


class Drawing(NamedTuple):
    """A figure that can be drawn in both widths."""

    title: str  #: Its content, with sign and frame, in the file's metadata.
    #: Its width [in] → the figure; called in the style of a paper.
    draw: "Callable[[float], Figure]"


def figure_files(form: str | None, names: Sequence[str], before: str = "figures/") -> list[str]:
    """The files of these figures in both widths."""
    each = product(names, WIDTHS) if form else ()
    return [f"{before}{name}-{width}.{form}" for name, width in each]


def write_figures(
    folder: OutputFolder, drawings: Mapping[str, Drawing], form: str, before: str = "figures/"
) -> None:
    """Write figures in both widths, in equal bytes."""
    maker = f"vftcli {VERSION}"
    own: dict[str, dict[str, str | None]] = {
        "pdf": {"Creator": maker, "CreationDate": None},
        "svg": {"Creator": maker, "Date": None},
        "png": {"Software": maker},
    }
    for (name, drawing), (width, inches) in product(drawings.items(), WIDTHS.items()):
        path = folder / f"{before}{name}-{width}.{form}"
        about = {"Title": printable(drawing.title)} | own[form]
        with paper_style():
            drawing.draw(inches).savefig(path, format=form, dpi=RESOLUTION, metadata=about)


@contextmanager
def paper_style() -> Iterator[None]:
    """Set matplotlib's style for a paper in a block."""
    from matplotlib import style

    with style.context(["default", STYLE]), warnings.catch_warnings():
        # A log's name may hold letters that the fonts lack.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


def sheet(width: float, cells: int, columns: int, height: float) -> "tuple[Figure, NDArray[Any]]":
    """A figure for `cells` plots; width and row height. [in]"""
    from matplotlib.figure import Figure

    rows = -(-cells // columns)
    figure = Figure(figsize=(width, rows * height + 0.22), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False).ravel()


def add_legend(figure: "Figure", handles: "Mapping[str, Artist]") -> None:
    """Add one legend above all plots; the figure grows by its lines."""
    width, height = figure.get_size_inches()
    widest = SAMPLE + LETTER * max(map(len, handles))
    lines = -(-len(handles) // max(int(width / widest), 1))
    figure.set_figheight(height + LINE * lines + 0.05)
    # As many columns as rows of about one length need.
    columns = -(-len(handles) // lines)
    figure.legend([*handles.values()], [*handles], loc="outside upper center", ncols=columns)


def shortened(name: str) -> str:
    """A name, cut to fit a figure."""
    text = printable(name)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"


class Plot(NamedTuple):
    """One plot of a figure."""

    chart: Chart
    panel: int  #: Number of the panel, from 0.


def plots_of(chart: Chart, only: Sequence[int] | None = None) -> list[Plot]:
    """Every panel of a chart, or only some, as plots."""
    return [Plot(chart, j) for j in (range(len(chart.panels)) if only is None else only)]


def line_figure(
    width: float,
    plots: Sequence[Plot],
    *,
    numbers: Mapping[int, float] = {},
    columns: int | None = None,
) -> "Figure":
    """Plots over time, row by row under one legend, in this width. [in]

    Above the first row are numbers at their times [s]. A row has `columns` plots, None for
    what fits.
    """
    wide = width > NARROW
    columns = min(len(plots), columns or (2 if not wide else 4 if len(plots) > 6 else 3))
    figure, grid = sheet(width, len(plots), columns, HIGH[wide])
    if numbers:
        figure.set_figheight(figure.get_figheight() + 0.12)
    for k, (axes, plot) in enumerate(zip(grid, plots, strict=False)):
        draw_plot(axes, plot)
        axes.set_ylabel(f"{plot.chart.panels[plot.panel]} ({plot.chart.units[plot.panel]})")
        if k + columns >= len(plots):
            axes.set_xlabel("Time (s)")
            # An empty place below has room.
            axes.xaxis.set_in_layout(k + columns >= len(grid))
        else:
            axes.tick_params(labelbottom=False)
        (start, stop), end = axes.get_xlim(), -np.inf
        for number, at in numbers.items() if k < columns else ():
            # As far as they have room.
            inch = (stop - start) * columns / (PLOTTED * width)
            half = 0.5 * DIGIT * len(str(number)) * inch
            if at - half >= end:
                axes.annotate(str(number), (at, 1.0), **ABOVE)
                end = at + half + BETWEEN * inch
    for axes in grid[len(plots) :]:
        axes.set_axis_off()
    figure.align_ylabels(list(grid[: len(plots)]))
    each = (zip(*axes.get_legend_handles_labels(), strict=True) for axes in figure.axes)
    named = {name: artist for artists in each for artist, name in artists}
    if len(named) > 1:
        add_legend(figure, named)
    return figure


def draw_plot(axes: "Axes", plot: Plot) -> None:
    """One panel with contacts, bands and lines."""
    from matplotlib.ticker import MaxNLocator

    chart, j = plot.chart, plot.panel
    # The legend names lines, then ribbons, band and contacts.
    shown = [(s, *drawn_line(chart, s, j, STRETCHES)) for s in chart.series if s.shown]
    for series, t, y, _ in shown:
        axes.plot(t, y, label=shortened(series.name), **look(series))
    for series, t, y, halves in shown:
        own: Look = {"facecolor": look(series)["color"], "alpha": 0.25, "linewidth": 0.0}
        # Grey where no contact is listed, if any is.
        looks = {"label": "95 % band"}, {"facecolor": "0.4", "label": QUIET}
        for half, style in zip(halves, looks[: 1 + (series.quiet is not None)], strict=False):
            axes.fill_between(t, y - half, y + half, **own | style)
    if chart.band is not None and np.isfinite(chart.band[j]):
        for sign in (1.0, -1.0):
            axes.axhline(sign * chart.band[j], label=chart.band_label, **BAND_LOOK)
    for start, stop in chart.spans:
        axes.axvspan(start, stop, label="contact", **CONTACT_LOOK)
    axes.set_xlim(float(chart.x[0]), float(chart.x[-1]))
    axes.set_ylim(*chart.ends(j))
    axes.yaxis.set_major_locator(MaxNLocator(4))


def dot_look(k: int, paint: str = "black", edge: float = 0.7, fill: str = "white") -> Look:
    """Look of the marks of one name: distinct by shape."""
    shape = {"marker": MARKS[k % len(MARKS)], "markersize": 3.6, "markerfacecolor": fill}
    return {"color": paint, "linestyle": "none", "markeredgewidth": edge, **shape}


def look(series: ChartLine) -> Look:
    """Look of a line: dashes or width distinguish it in grey too."""
    dashes = PAPER_DASHES.get(series.dash, series.dash).split()
    return {
        "color": PAINTS.get(series.colour, series.colour),
        "linestyle": (0, tuple(0.6 * float(part) for part in dashes)) if dashes else "solid",
        "linewidth": 1.8 if series.colour == REFERENCE else 0.9,
        "solid_capstyle": "butt",
    }


class DotPlot(NamedTuple):
    """One plot."""

    title: str
    joints: Sequence[str]  #: Names below. (n,)
    #: Name, numbers (n,), ends of their intervals (2, n); NaN unknown.
    rows: Sequence[tuple[str, Array, Array | None]]
    floor: Array  #: The reference's own error, NaN where it is not known. (n,)


def dot_figure(
    width: float, plots: Sequence[DotPlot], paints: Mapping[str, str], label: str
) -> "Figure":
    """Plots under one legend, with the logs' names if several.

    `paints` is name → colour of every row; `label` is the vertical axis with its unit.
    """
    from matplotlib.lines import Line2D

    columns = 1 if width <= NARROW or len(plots) == 1 else 2
    # Every second name is hollow.
    looks = {
        name: dot_look(k, paint, 0.8, "white" if k % 2 else paint)
        for k, (name, paint) in enumerate(paints.items())
    }
    handles: dict[str, Any] = {shortened(n): Line2D([], [], **how) for n, how in looks.items()}
    if any(np.isfinite(plot.floor).any() for plot in plots):
        handles["floor of the reference"] = Line2D([], [], color="black", linewidth=1.2)
    figure, grid = sheet(width, len(plots), columns, 1.7 if len(plots) == 1 else 1.45)
    add_legend(figure, handles)
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


def draw_dots(axes: "Axes", plot: DotPlot, looks: Mapping[str, Look]) -> None:
    """The dots of one log at each joint, and the floor."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    places = np.arange(len(plot.joints), dtype=np.float64)
    step = SPREAD / max(len(plot.rows), 1)
    axes.hlines(plot.floor, places - 0.42, places + 0.42, color="black", linewidth=1.2)
    for k, (name, values, ends) in enumerate(plot.rows):
        across, whiskers = places + step * (k - 0.5 * (len(plot.rows) - 1)), None
        if ends is not None:
            # An interval of resampled errors need not hold the error itself.
            whiskers = np.nan_to_num(np.maximum([values - ends[0], ends[1] - values], 0.0))
        axes.errorbar(across, values, yerr=whiskers, **WHISKER_LOOK, **looks[name])
    axes.set_xticks(places, list(plot.joints))
    axes.set_xlim(-0.5, len(places) - 0.5)
    axes.tick_params(axis="x", length=0.0)
    shown = np.concatenate([plot.floor, *(values for _, values, _ in plot.rows)])
    shown = shown[np.isfinite(shown)]
    if shown.size and shown.min() > 0.0 and shown.max() > RANGE * shown.min():
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    else:
        axes.set_ylim(bottom=0.0)
