"""Charts: what the page, its script and figures for papers draw, and how the script is given them.

Every chart is drawn as SVG (`svg.py`), one small picture a joint or axis, for print and for readers
without a script; with a script the plotting library draws the chosen one large beside them.
"""

import base64
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from vftcli.outputs.decimation import decimated
from vftcli.outputs.palette import colours_of_names
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.wrench import ExternalTorque

#: Bytes that the large charts of a page may take; a long log's may take more, up to this factor.
ROOM, LONG = 350_000, 4.0
#: Stretches a long log is cut into, two samples each, however many lines there are.
FEWEST, MOST = 250, 2000
#: Bytes of a stretch of a line: two samples of a float32 and an int16 as base64.
POINT = 2 * (4 + 2) * 4 / 3
#: Steps between a line's lowest and highest value, finer than any screen; the number for NaN.
STEPS, UNKNOWN = 65534, -32768
#: Dashes of lines, in turn: colour alone distinguishes none.
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
    """Colour and dash of every name: the first has a line without gaps."""
    colours = colours_of_names(names)
    dashes = ("", *DASHES)
    return {
        name: (colour, dashes[k % len(dashes)]) for k, (name, colour) in enumerate(colours.items())
    }


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
