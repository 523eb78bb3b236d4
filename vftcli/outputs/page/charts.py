"""Charts of the page: small pictures that stand still, and what the script draws large from them.

Every chart is drawn as SVG, one small picture a joint or axis, for print and for readers without a
script; with a script the plotting library draws the chosen one large beside them.
"""

import base64
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from vftcli.outputs.decimation import decimated
from vftcli.outputs.page import figures
from vftcli.outputs.page.figures import Box, Scales, Span
from vftcli.outputs.palette import colours_of_names
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.external_torque import ExternalTorque

#: Bytes that the large charts of a page may take; a long log's may take more, up to this factor.
ROOM, LONG = 350_000, 4.0
#: Stretches a long log is cut into, two samples each, however many lines there are.
FEWEST, MOST = 250, 2000
#: Bytes of a stretch of a line: two samples of a float32 and an int16 as base64.
POINT = 2 * (4 + 2) * 4 / 3
#: Steps between a line's lowest and highest value, finer than any screen; what stands for NaN.
STEPS, UNKNOWN = 65534, -32768
#: How lines are broken, in turn: none is told by its colour alone.
DASHES = ("7 3", "2 2.5", "9 3 2 3", "4 2", "1.5 3.5", "12 3")
QUIET = "95 % band, no contact listed"  #: What a grey ribbon is called.
#: Colours that follow the page: its text's, and the reference's.
INK, REFERENCE = "ink", "reference"
LineStyle = tuple[str, str]  #: Colour and dash of a line.


class ChartLine(NamedTuple):
    """One line of a chart, for every panel."""

    name: str  #: What the legend calls it.
    values: Array  #: One column a panel. (T, n)
    colour: str = INK  #: ``#rrggbb``, `INK` or `REFERENCE`.
    dash: str = ""  #: How it is broken, as SVG says it; "" for a line without gaps.
    #: Half the width of a ribbon about the line, NaN where it is not known. (T, n)
    half: Array | None = None
    leads: bool = False  #: Whether it is the line to look at: drawn thicker.
    shown: bool = True  #: Whether it is drawn at once, rather than when asked for.
    x: Array | None = None  #: Its own horizontal places, None for the chart's. (T,)
    #: Where the ribbon is grey: no contact is listed there, so that it says what would show. None
    #: for nowhere. (T,)
    quiet: Mask | None = None

    def ribbons(self, panel: int) -> tuple[Array, Array] | None:
        """The half width in the line's colour and the grey one, NaN where it is the other. (T,)"""
        if self.half is None:
            return None
        half = self.half[:, panel]
        quiet = np.zeros(len(half), dtype=bool) if self.quiet is None else self.quiet
        return np.where(quiet, np.nan, half), np.where(quiet, half, np.nan)


class Chart(NamedTuple):
    """A picture for every joint or axis."""

    key: str  #: Its name on the page.
    title: str  #: What it shows, in words.
    units: tuple[str, ...]  #: Unit of each panel's vertical axis. (n,)
    panels: tuple[str, ...]  #: Their names. (n,)
    x: Array  #: Horizontal places. (T,)
    series: tuple[ChartLine, ...]  #: Its lines, the last on top.
    families: tuple[int, ...] = ()  #: Which panels share a scale: those of one number. (n,)
    band: Array | None = None  #: Half the width of a band about zero, one a panel, or None. (n,)
    band_label: str = ""  #: What the band is.
    spans: Sequence[tuple[float, float]] = ()  #: Stretches that are marked, as contacts. [s]
    unit: str = "s"  #: Unit of the horizontal axis.
    log: bool = False  #: Whether the horizontal axis is logarithmic.
    lowest: float | None = None  #: Least end of the vertical axis, None for what the lines need.


def observer_lines(estimates: Sequence[ExternalTorque]) -> dict[str, LineStyle]:
    """Colour and dash of every observer: the first has a line without gaps."""
    return lines_of_names([estimate.name for estimate in estimates])


def lines_of_names(names: Sequence[str]) -> dict[str, LineStyle]:
    """The same of the names alone."""
    colours = colours_of_names(names)
    dashes = ("", *DASHES)
    return {
        name: (colour, dashes[k % len(dashes)]) for k, (name, colour) in enumerate(colours.items())
    }


def multiples(chart: Chart) -> str:
    """One small picture a panel, below the legend; panels of a family have one scale."""
    return (
        f'{legend(chart)}<div class="multiples" data-of="{escape(chart.key)}">'
        f"{pictures_of(chart)}</div>"
    )


def pictures_of(chart: Chart) -> str:
    """The small pictures of a chart alone."""
    families = chart.families or (0,) * len(chart.panels)
    ends = {family: ends_of_family(chart, families.index(family)) for family in set(families)}
    return "".join(picture(chart, j, ends[families[j]]) for j in range(len(chart.panels)))


def legend(chart: Chart) -> str:
    """The lines that are drawn at once, where there is more than one, and the band."""
    shown = [s for s in chart.series if s.shown]
    parts = [f"{swatch(s.colour, s.dash, leads=s.leads)} {escape(s.name)}" for s in shown]
    if chart.band is not None:
        parts.append(f'<span class="patch floor"></span> {escape(chart.band_label)}')
    ribbons = dict.fromkeys(s.colour for s in shown if s.half is not None)
    parts += [f"{patch(colour)} 95 % band" for colour in ribbons]
    if any(s.quiet is not None and s.half is not None for s in shown):
        parts.append(f'<span class="patch floor"></span> {QUIET}')
    if chart.spans:
        parts.append('<span class="patch contact"></span> contact')
    if len(parts) < 2:
        return ""
    return f'<p class="legend">{"".join(f"<span>{part}</span>" for part in parts)}</p>'


def patch(colour: str) -> str:
    """A small piece of a ribbon."""
    box = f'<rect width="26" height="8" fill="{colour}" class="rim"/>'
    return f'<svg class="swatch" viewBox="0 0 26 8" aria-hidden="true">{box}</svg>'


def swatch(colour: str, dash: str, *, leads: bool = False) -> str:
    """A short piece of a line."""
    return (
        '<svg class="swatch" viewBox="0 0 26 8" aria-hidden="true">'
        f'<path d="M0 4H26" {look_of(colour, dash, leads=leads)}/></svg>'
    )


def look_of(colour: str, dash: str, *, leads: bool = False) -> str:
    """The attributes of a line."""
    if colour == REFERENCE:
        return 'class="reference"'
    paint = "var(--ink)" if colour == INK else colour
    broken = f' stroke-dasharray="{dash}"' if dash else ""
    return f'stroke="{paint}" stroke-width="{1.9 if leads else 1.3}"{broken}'


def ends_of_family(chart: Chart, panel: int) -> Span:
    """Ends of a panel's vertical axis: those of all panels of its family."""
    families = chart.families or (0,) * len(chart.panels)
    members = [j for j, family in enumerate(families) if family == families[panel]]
    span = figures.ends_of(values for j in members for values in drawn_values(chart, j))
    return span if chart.lowest is None else Span(max(span.low, chart.lowest), span.high)


def drawn_values(chart: Chart, panel: int) -> Iterator[Array]:
    """What is drawn at once in a panel, line by line: of a long log all have no room at once."""
    for series in chart.series:
        if series.shown:
            values = series.values[:, panel]
            if series.half is None:
                yield values
            else:
                half = np.nan_to_num(series.half[:, panel])
                yield from (values - half, values + half)
    if chart.band is not None:
        yield np.array([chart.band[panel], -chart.band[panel]])


def picture(chart: Chart, panel: int, ends: Span) -> str:
    """One panel as a figure with its head."""
    box = Box()
    scales = Scales(box, Span(float(chart.x[0]), float(chart.x[-1])), ends, chart.log)
    parts = [figures.stripes(scales, chart.spans, 'class="contact"')]
    if chart.band is not None and np.isfinite(chart.band[panel]):
        top, foot = (float(scales.up(sign * chart.band[panel])) for sign in (1.0, -1.0))
        foot = min(foot, scales.floor)
        parts.append(
            figures.rectangle(box.left, top, scales.side - box.left, foot - top, 'class="floor"')
        )
    parts.append(figures.axes(scales, chart.unit, (4, 3)))
    parts += [drawn_line(scales, chart, series, panel) for series in chart.series if series.shown]
    name, unit = escape(chart.panels[panel]), escape(chart.units[panel])
    title = f"{chart.title}, {chart.panels[panel]}"
    return (
        f'<figure data-panel="{panel}"><figcaption>{name} <span>{unit}</span></figcaption>'
        f"{figures.svg(box, title, ''.join(parts))}</figure>"
    )


def drawn_line(scales: Scales, chart: Chart, series: ChartLine, panel: int) -> str:
    """A line of a panel with its ribbon."""
    x = chart.x if series.x is None else series.x
    values = series.values[:, panel]
    if chart.log:
        t, y = figures.thinned_log(x, values)
        return figures.line(scales, t, y, look_of(series.colour, series.dash))
    t, y = figures.thinned(x, values)
    under = ""
    looks = f'fill="{series.colour}" class="rim"', 'class="floor"'
    for width, style in zip(series.ribbons(panel) or (), looks, strict=False):
        half = np.interp(t, x, width)
        under += figures.ribbon(scales, t, y - half, y + half, style)
    return under + figures.line(
        scales, t, y, look_of(series.colour, series.dash, leads=series.leads)
    )


def large(chart: Chart) -> str:
    """Where the script draws the chosen panel large, with every line on demand."""
    return f'<div class="large" data-chart="{escape(chart.key)}"></div>'


def families_of(limits: Array) -> tuple[int, ...]:
    """Joints of one drive size, by their torque limits: neighbours of one limit are a family."""
    numbers, last = [], 0
    for j, limit in enumerate(limits):
        same = j > 0 and (limit == limits[j - 1] or not np.isfinite([limit, limits[j - 1]]).any())
        last += not same
        numbers.append(last)
    return tuple(numbers)


def packed_charts(charts: Iterable[Chart]) -> list[dict[str, Any]]:
    """Charts over time as the script takes them, all together within the page's room."""
    charts = list(charts)
    lines = sum(
        len(c.panels) * (1 + (s.half is not None) + (s.quiet is not None))
        for c in charts
        for s in c.series
    )
    duration = max((float(c.x[-1] - c.x[0]) for c in charts), default=0.0)
    room = ROOM * float(np.clip(duration / 60.0, 1.0, LONG))
    stretches = int(np.clip(room / (POINT * max(lines, 1)), FEWEST, MOST))
    return [packed(chart, stretches) for chart in charts]


def packed(chart: Chart, stretches: int) -> dict[str, Any]:
    """A chart over time as JSON can hold it."""
    return {
        "key": chart.key,
        "title": chart.title,
        "units": list(chart.units),
        "panels": list(chart.panels),
        "unit": chart.unit,
        "band": known(chart.band),
        "bandLabel": chart.band_label,
        "spans": [list(span) for span in chart.spans],
        "series": [
            {
                "name": series.name,
                "colour": series.colour,
                "dash": [float(part) for part in series.dash.split()],
                "leads": series.leads,
                "shown": series.shown,
                "lines": packed_lines(chart, series, stretches),
            }
            for series in chart.series
        ],
    }


def packed_lines(chart: Chart, series: ChartLine, stretches: int) -> list[dict[str, Any]]:
    """A line's points, panel by panel: of every stretch its lowest and its highest sample."""
    x = chart.x if series.x is None else series.x
    found = []
    for j, part in enumerate(decimated(x, series.values, stretches)):
        line: dict[str, Any] = {"x": base64_of(part.t, "<f4"), "y": quantised(part.y)}
        names = ("half",) if series.quiet is None else ("half", "quiet")
        for name, half in zip(names, series.ribbons(j) or (), strict=False):
            line[name] = quantised(np.interp(part.t, x, half))
        found.append(line)
    return found


def quantised(values: Array) -> dict[str, Any]:
    """Values in `STEPS` steps between the lowest and the highest, as base64 int16."""
    finite = values[np.isfinite(values)]
    low = float(finite.min()) if finite.size else 0.0
    step = (float(finite.max()) - low) / STEPS if finite.size else 0.0
    # A constant line has no steps; any will do.
    step = step or 1.0
    numbers = np.where(np.isfinite(values), np.round((values - low) / step) - STEPS // 2, UNKNOWN)
    return {"low": low, "step": step, "points": base64_of(numbers, "<i2")}


def base64_of(values: Array, kind: str) -> str:
    """Numbers of a kind as base64: as text they would be three times as long."""
    return base64.b64encode(np.asarray(values).astype(kind).tobytes()).decode("ascii")


def known(values: Array | None) -> list[float | None] | None:
    """Numbers for JSON, None where they are not known."""
    # JSON has no NaN; a band of unknowns only is no band.
    if values is None or not np.any(np.isfinite(values)):
        return None
    return [float(value) if np.isfinite(value) else None for value in values]
