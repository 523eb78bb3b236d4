"""Charts that stand still as SVG: where values lie, ticks, the lines, and the arm at a contact."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vftcli.outputs.decimation import decimated
from vftcli.outputs.page.charts import Chart, ChartLine
from vftcli.outputs.quantity import minus
from vftcli.signals.arrays import Array
from vftcli.signals.series import runs_of

STEPS = 1.0, 2.0, 5.0, 10.0  #: What a tick's distance may begin with.
ROOM = 1.4  #: How much smaller than wanted a tick's distance may be.
STRETCHES = 250  #: Stretches of a line in a small chart: two samples a stretch, about one a pixel.


class Box(NamedTuple):
    """A chart's size and the room around its plot, in the units of the drawing."""

    width: float = 300.0  #: Whole width.
    height: float = 130.0  #: Whole height.
    left: float = 38.0  #: Room for the numbers beside the vertical axis.
    bottom: float = 18.0  #: Room for the numbers below.
    top: float = 8.0  #: Room above.
    right: float = 8.0  #: Room to the right.


class Span(NamedTuple):
    """Both ends of an axis."""

    low: float
    high: float


class Scales(NamedTuple):
    """From values to places in the drawing."""

    box: Box  #: The chart.
    x: Span  #: Ends of the horizontal axis.
    y: Span  #: Ends of the vertical axis.
    log: bool = False  #: Whether the horizontal axis is logarithmic.

    def across(self, x: Array | float) -> Array:
        """Horizontal places."""
        low, high = np.log(self.x) if self.log else self.x
        share = ((np.log(x) if self.log else np.asarray(x)) - low) / ((high - low) or 1.0)
        places: Array = self.box.left + share * (self.side - self.box.left)
        return places

    def up(self, y: Array | float) -> Array:
        """Vertical places, which count downwards."""
        share = (np.asarray(y) - self.y.low) / ((self.y.high - self.y.low) or 1.0)
        places: Array = self.floor - share * (self.floor - self.box.top)
        return places

    def inside(self, span: Sequence[float]) -> Array:
        """Horizontal places of times, those outside of the chart at its edge."""
        return self.across(np.clip(span, *self.x))

    @property
    def floor(self) -> float:
        """Lower end of the plot."""
        return self.box.height - self.box.bottom

    @property
    def side(self) -> float:
        """Right end of the plot."""
        return self.box.width - self.box.right


def ticks(span: Span, count: int) -> list[float]:
    """Round numbers along an axis, about as many as wanted."""
    width = (span.high - span.low) / max(count, 1)
    if not np.isfinite(width) or width <= 0.0:
        return [span.low]
    power = 10.0 ** np.floor(np.log10(width))
    # A few more numbers than wanted are better than too few.
    step = next(s for s in STEPS if width <= ROOM * s * power) * power
    first, last = np.ceil(span.low / step - 1e-9), np.floor(span.high / step + 1e-9)
    found = [float(k * step) for k in np.arange(first, last + 1)]
    # One number or two leave the scale unsaid.
    return found if len(found) >= min(count, 3) else ticks(span, count + 2)


def decades(span: Span) -> list[float]:
    """Powers of ten along a logarithmic axis."""
    first, last = np.ceil(np.log10(span.low) - 1e-9), np.floor(np.log10(span.high) + 1e-9)
    return [float(10.0**k) for k in np.arange(first, last + 1)]


def label(value: float) -> str:
    """A tick's number without an exponent where one can do without."""
    return minus(f"{value + 0.0:.6g}")


def ends_of(values: Iterable[Array]) -> Span:
    """Ends of an axis that shows all values, with some room; about ±1 where none is known."""
    low, high = np.inf, -np.inf
    for x in values:
        known = np.isfinite(x)
        low = min(low, float(np.min(x, where=known, initial=np.inf)))
        high = max(high, float(np.max(x, where=known, initial=-np.inf)))
    if low > high:
        return Span(-1.0, 1.0)
    # A line that does not change has no scale of its own.
    room = 0.05 * (high - low) if high > low else abs(high) or 1.0
    return Span(low - room, high + room)


def ends_of_family(chart: Chart, panel: int) -> Span:
    """Ends of a panel's vertical axis: those of all panels of its family."""
    families = chart.families or (0,) * len(chart.panels)
    members = [j for j, family in enumerate(families) if family == families[panel]]
    span = ends_of(values for j in members for values in drawn_values(chart, j))
    return span if chart.lowest is None else Span(max(span.low, chart.lowest), span.high)


def drawn_values(chart: Chart, panel: int) -> Iterator[Array]:
    """What is drawn at once in a panel, line by line: of a long log all have no room at once."""
    for series in chart.series:
        if series.shown:
            half = 0.0 if series.half is None else np.nan_to_num(series.half[:, panel])
            yield series.values[:, panel] - half
            yield series.values[:, panel] + half
    if chart.band is not None:
        yield np.array([chart.band[panel], -chart.band[panel]])


def scales_of(chart: Chart) -> Iterator[Scales]:
    """The scales of every panel's small picture."""
    families = chart.families or (0,) * len(chart.panels)
    ends = {family: ends_of_family(chart, families.index(family)) for family in set(families)}
    x = Span(float(chart.x[0]), float(chart.x[-1]))
    return (Scales(Box(), x, ends[family], chart.log) for family in families)


def strokes(scales: Scales, chart: Chart, line: ChartLine, panel: int) -> tuple[str, str, str]:
    """A line's paths in a panel: its ribbon, the ribbon's grey part, and itself; "" for none."""
    t, y, halves = drawn_line(chart, line, panel)
    own, quiet = (ribbon(scales, t, y - half, y + half) for half in halves) if halves else ("", "")
    return own, quiet, path_of(scales, t, y)


def drawn_line(
    chart: Chart, line: ChartLine, panel: int, stretches: int = STRETCHES
) -> tuple[Array, Array, list[Array]]:
    """A line's points in a panel, and there the half widths of its ribbon and its grey part."""
    x = chart.x if line.x is None else line.x
    thin = thinned_log if chart.log else thinned
    t, y = thin(x, line.values[:, panel], stretches)
    return t, y, [np.interp(t, x, half) for half in line.ribbons(panel) or ()]


def path_of(scales: Scales, t: Array, y: Array) -> str:
    """A line as the text of an SVG path, broken where a value is not known."""
    x, z = scales.across(t), scales.up(np.clip(y, *outside(scales)))
    runs = runs_of(np.isfinite(z) & np.isfinite(x))
    return "".join(polyline(np.column_stack([x, z])[start:stop]) for start, stop in runs)


def polyline(points: Array) -> str:
    """Points as the text of an SVG path; a single one is a dot. (K, 2)"""
    text = "M" + " ".join(f"{x:.1f} {y:.1f}" for x, y in points)
    return text + ("h.01" if len(points) == 1 else "")


def outside(scales: Scales) -> tuple[float, float]:
    """What lies far outside of a chart is drawn just outside of it."""
    height = scales.y.high - scales.y.low
    return scales.y.low - height, scales.y.high + height


def ribbon(scales: Scales, t: Array, low: Array, high: Array) -> str:
    """What lies between two lines as a path, broken where either is not known."""
    x, ends, parts = scales.across(t), outside(scales), []
    edges = [np.column_stack([x, scales.up(np.clip(edge, *ends))]) for edge in (high, low)]
    for start, stop in runs_of(np.isfinite(low) & np.isfinite(high)):
        above, below = (edge[start:stop] for edge in edges)
        parts.append(
            f"M{' '.join(f'{a:.1f} {b:.1f}' for a, b in np.vstack([above, below[::-1]]))}Z"
        )
    return "".join(parts)


def stripes(scales: Scales, spans: Sequence[tuple[float, float]]) -> str:
    """Many stretches of time from top to floor as one path."""
    height, path = scales.floor - scales.box.top, ""
    for left, right in (scales.across(np.asarray(span)) for span in spans):
        width = max(right - left, 0.5)
        path += f"M{left:.1f} {scales.box.top:g}h{width:.1f}v{height:g}h{-width:.1f}z"
    return path


def thinned(t: Array, values: Array, stretches: int) -> tuple[Array, Array]:
    """One series as it is drawn: of every stretch its lowest and its highest sample."""
    (drawn,) = decimated(t, values[:, None], stretches)
    return drawn.t, drawn.y


def thinned_log(x: Array, values: Array, stretches: int) -> tuple[Array, Array]:
    """One series as drawn over a logarithmic axis: stretches of equal width there."""
    if len(x) <= 2 * stretches:
        return x, values
    starts = np.unique(np.searchsorted(x, np.geomspace(x[0], x[-1], stretches)))
    index = [0, len(x) - 1]
    for start, stop in pairwise(starts):
        part = values[start:stop]
        index += [start + int(np.argmin(part)), start + int(np.argmax(part))]
    chosen = np.unique(index)
    return x[chosen], values[chosen]
