"""Charts that stand still: SVG that prints and needs no script, its ticks and its lines."""

from collections.abc import Iterable, Sequence
from html import escape
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vftcli.outputs.decimation import decimated
from vftcli.outputs.quantity import minus
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.intervals import runs_of

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
        if self.log:
            x, low, high = np.log(x), np.log(self.x.low), np.log(self.x.high)
        else:
            low, high = self.x
        share = (np.asarray(x) - low) / ((high - low) or 1.0)
        places: Array = self.box.left + share * (self.box.width - self.box.left - self.box.right)
        return places

    def up(self, y: Array | float) -> Array:
        """Vertical places, which count downwards."""
        share = (np.asarray(y) - self.y.low) / ((self.y.high - self.y.low) or 1.0)
        places: Array = self.floor - share * (self.floor - self.box.top)
        return places

    @property
    def floor(self) -> float:
        """Where the plot ends below."""
        return self.box.height - self.box.bottom

    @property
    def side(self) -> float:
        """Where the plot ends to the right."""
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


def ends_of(values: Iterable[Array], *, zero: bool = False) -> Span:
    """Ends of an axis that shows all values, with some room; about ±1 where none is known."""
    low, high = np.inf, -np.inf
    for x in values:
        known = np.isfinite(x)
        low = min(low, float(np.min(x, where=known, initial=np.inf)))
        high = max(high, float(np.max(x, where=known, initial=-np.inf)))
    if low > high:
        return Span(-1.0, 1.0)
    if zero:
        low, high = min(low, 0.0), max(high, 0.0)
    # A line that does not change has no scale of its own.
    room = 0.05 * (high - low) if high > low else abs(high) or 1.0
    return Span(low - room, high + room)


def path_of(scales: Scales, t: Array, y: Array) -> str:
    """A line as the text of an SVG path, broken where a value is not known."""
    x, z = scales.across(t), scales.up(np.clip(y, *outside(scales)))
    parts = []
    for start, stop in runs_of(np.isfinite(z) & np.isfinite(x)):
        points = " ".join(
            f"{a:.1f} {b:.1f}" for a, b in zip(x[start:stop], z[start:stop], strict=True)
        )
        # A single point is a dot.
        parts.append(f"M{points}" + ("h.01" if stop - start == 1 else ""))
    return "".join(parts)


def outside(scales: Scales) -> tuple[float, float]:
    """What lies far outside of a chart is drawn just outside of it."""
    height = scales.y.high - scales.y.low
    return scales.y.low - height, scales.y.high + height


def line(scales: Scales, t: Array, y: Array, look: str) -> str:
    """A line; `look` is its attributes."""
    path = path_of(scales, t, y)
    return f'<path d="{path}" fill="none" {look}/>' if path else ""


def ribbon(scales: Scales, t: Array, low: Array, high: Array, look: str) -> str:
    """What lies between two lines, broken where either is not known."""
    known: Mask = np.isfinite(low) & np.isfinite(high)
    parts = []
    for start, stop in runs_of(known):
        x = scales.across(t[start:stop])
        ends = outside(scales)
        above = scales.up(np.clip(high[start:stop], *ends))
        below = scales.up(np.clip(low[start:stop], *ends))
        there = " ".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, above, strict=True))
        back = " ".join(f"{a:.1f} {b:.1f}" for a, b in zip(x[::-1], below[::-1], strict=True))
        parts.append(f"M{there} {back}Z")
    return f'<path d="{"".join(parts)}" {look}/>' if parts else ""


def rectangle(x: float, y: float, width: float, height: float, look: str) -> str:
    """A filled rectangle; `look` is its attributes."""
    return (
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{max(width, 0.5):.1f}" '
        f'height="{max(height, 0.0):.1f}" {look}/>'
    )


def stripe(scales: Scales, start: float, stop: float, look: str) -> str:
    """A stretch of time from top to floor."""
    left, right = (
        float(scales.across(max(min(v, scales.x.high), scales.x.low))) for v in (start, stop)
    )
    return rectangle(left, scales.box.top, right - left, scales.floor - scales.box.top, look)


def stripes(scales: Scales, spans: Sequence[tuple[float, float]], look: str) -> str:
    """Many stretches of time as one path."""
    height = scales.floor - scales.box.top
    places = [(float(scales.across(a)), float(scales.across(b))) for a, b in spans]
    path = "".join(
        f"M{left:.1f} {scales.box.top:g}h{max(right - left, 0.5):.1f}v{height:g}"
        f"h{-max(right - left, 0.5):.1f}z"
        for left, right in places
    )
    return f'<path d="{path}" {look}/>' if path else ""


def axes(scales: Scales, unit: str, count: tuple[int, int] = (6, 3)) -> str:
    """Grid lines and numbers of both axes; the last number below bears the unit."""
    parts = []
    for value in ticks(scales.y, count[1]):
        y = float(scales.up(value))
        strong = ' class="zero"' if value == 0.0 else ' class="grid"'
        parts.append(f'<path d="M{scales.box.left:.1f} {y:.1f}H{scales.side:.1f}"{strong}/>')
        parts.append(
            f'<text x="{scales.box.left - 5:.1f}" y="{y + 3.5:.1f}" text-anchor="end">'
            f"{label(value)}</text>"
        )
    below = decades(scales.x) if scales.log else ticks(scales.x, count[0])
    for k, value in enumerate(below):
        x = float(scales.across(value))
        last = k == len(below) - 1
        text = f"{label(value)} {unit}" if last else label(value)
        anchor = "end" if last and scales.side - x < 14 else "middle"
        parts.append(
            f'<text x="{x:.1f}" y="{scales.box.height - 3:.1f}" text-anchor="{anchor}">'
            f"{escape(text)}</text>"
        )
    return "".join(parts)


def svg(box: Box, title: str, content: str, *, kind: str = "") -> str:
    """The drawing; `title` is read to those who cannot see it."""
    words = f' class="{kind}"' if kind else ""
    return (
        f'<svg{words} viewBox="0 0 {box.width:g} {box.height:g}" role="img">'
        f"<title>{escape(title)}</title>{content}</svg>"
    )


def thinned(t: Array, values: Array, stretches: int = STRETCHES) -> tuple[Array, Array]:
    """One series as it is drawn: of every stretch its lowest and its highest sample."""
    (drawn,) = decimated(t, values[:, None], stretches)
    return drawn.t, drawn.y


def thinned_log(x: Array, values: Array, stretches: int = STRETCHES) -> tuple[Array, Array]:
    """The same over a logarithmic axis: stretches of equal width there."""
    if len(x) <= 2 * stretches:
        return x, values
    starts = np.unique(np.searchsorted(x, np.geomspace(x[0], x[-1], stretches)))
    index = [0, len(x) - 1]
    for start, stop in pairwise(starts):
        index += [
            start + int(np.argmin(values[start:stop])),
            start + int(np.argmax(values[start:stop])),
        ]
    chosen = np.unique(index)
    return x[chosen], values[chosen]
