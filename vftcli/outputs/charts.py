"""Charts of page, recording and paper figures, with colours and drawn samples.

Every chart is an SVG (`page/shell.py`), one picture a joint or axis, for print and for
readers without a script; the page's script replaces it.
"""

from collections.abc import Iterable, Sequence
from itertools import cycle, groupby
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from vftcli.free_motion.free_motion import within
from vftcli.signals.arrays import Array, Mask, gaps_of

#: Okabe and Ito's hues, in tones visible on white and on black.
COLOURS = {
    "best": "#d3224b",
    "fdo": "#2f86d0",
    "gmo": "#dd6415",
    "kfo-fe": "#0c9f76",
    "kfo-zoh": "#c95fa4",
    "kfo-rts": "#b98900",
    "kfo-auto": "#7a6fd6",
    "rts-auto": "#a0522d",
}
#: For estimates without a colour of their own, in turn.
SPARE = ("#2f86d0", "#dd6415", "#0c9f76", "#c95fa4", "#b98900", "#7a6fd6", "#a0522d", "#5b8c00")
#: Colours that follow the page: its text's, and the reference's.
INK, REFERENCE = "ink", "reference"
OLIVE = "#77801f"  #: The page's colour for a blue that is no force.
GREY = "#8a929a"  #: Both on an unknown background.
#: Touched part of the arm → its colour.
PLACES = {
    "wrist": "#dd6415",
    "forearm": "#2f86d0",
    "upper arm": "#c95fa4",
    "cannot tell": "#c8a200",
}
#: Dashes of lines, the first without gaps: colour alone distinguishes none.
DASHES = ("", "7 3", "2 2.5", "9 3 2 3", "4 2", "1.5 3.5", "12 3")
QUIET = "95 % band, no contact listed"  #: Name of a grey ribbon.
GAP_STEPS = 10.0  #: A step of this many medians breaks the line.
STRETCHES = 150  #: Stretches of a line in a still drawing, two samples each.

LineStyle = tuple[str, str]  #: Colour and dash of a line.
Index = NDArray[np.intp]


class ChartLine(NamedTuple):
    """One line of a chart, for every panel."""

    name: str  #: Its name in the legend.
    values: Array  #: One column a panel. (T, n)
    colour: str = INK  #: ``#rrggbb``, `INK` or `REFERENCE`.
    dash: str = ""  #: Dashes as in SVG; "" for a line without gaps.
    #: Half the width of a ribbon about it, NaN if unknown. (T, n)
    half: Array | None = None
    leads: bool = False  #: Whether it is drawn thicker.
    shown: bool = True  #: Whether it is drawn from the start.
    x: Array | None = None  #: Its own horizontal places, None for the chart's. (T,)
    #: Where the ribbon is grey: no contact is listed. None: nowhere. (T,)
    quiet: Mask | None = None


class Span(NamedTuple):
    """Both ends of an axis."""

    low: float
    high: float


class Chart(NamedTuple):
    """A picture for every joint or axis."""

    key: str  #: Its name on the page.
    title: str  #: Its content, in words.
    units: tuple[str, ...]  #: Unit of each panel's vertical axis. (n,)
    panels: tuple[str, ...]  #: Their names. (n,)
    x: Array  #: Horizontal places. (T,)
    series: tuple[ChartLine, ...]  #: Its lines, the last on top.
    #: Panels of one number share a scale; () for all of one unit. (n,)
    families: tuple[int, ...] = ()
    #: Half the width of a band about zero, one a panel, or None. (n,)
    band: Array | None = None
    band_label: str = ""
    spans: Sequence[tuple[float, float]] = ()  #: Stretches that are marked, as contacts. [s]
    #: Least lower end of the vertical axis, with 0; None: by lines.
    lowest: float | None = None
    highest: float | None = None  #: Upper end; None: by the lines.

    @classmethod
    def of_one(
        cls, key: str, title: str, unit: str, x: Array, lines: Iterable[ChartLine]
    ) -> Self:
        """A chart of one panel, which has its title."""
        return cls(key, title, (unit,), (title,), x, tuple(lines))

    def ends(self, panel: int) -> Span:
        """Ends of a panel's vertical axis, about ±1 without values."""
        low, high, families = np.inf, -np.inf, self.families or self.units
        for j in (j for j, family in enumerate(families) if family == families[panel]):
            # Visible lines, one by one: all of a long log would fill the memory.
            for line in (line for line in self.series if line.shown):
                half = 0.0 if line.half is None else np.nan_to_num(line.half[:, j])
                for values in (line.values[:, j] - half, line.values[:, j] + half):
                    known = np.isfinite(values)
                    low = min(low, float(np.min(values, where=known, initial=np.inf)))
                    high = max(high, float(np.max(values, where=known, initial=-np.inf)))
            if self.band is not None and np.isfinite(self.band[j]):
                low, high = min(low, -float(self.band[j])), max(high, float(self.band[j]))
        # A constant line has no scale of its own.
        room = 0.05 * (high - low) if high > low else abs(high) or 1.0
        low, high = (low - room, high + room) if low <= high else (-1.0, 1.0)
        low = low if self.lowest is None else max(min(low, 0.0), self.lowest)
        return Span(low, high if self.highest is None else self.highest)


def colours_of_names(names: Sequence[str]) -> dict[str, str]:
    """A colour for each estimate's name."""
    own = {COLOURS.get(name) for name in names}
    spare = cycle([colour for colour in SPARE if colour not in own] or SPARE)
    return {name: COLOURS.get(name) or next(spare) for name in names}


def lines_of_names(names: Sequence[str]) -> dict[str, LineStyle]:
    """Colour and dash of every name."""
    colours = colours_of_names(names).items()
    return {name: (colour, DASHES[k % len(DASHES)]) for k, (name, colour) in enumerate(colours)}


def paint(colour: str) -> str:
    """A line's colour in the page: only force and `best` are blue."""
    own = {COLOURS["best"]: "var(--force)", INK: "var(--ink)", REFERENCE: "var(--reference)"}
    return {**own, COLOURS["fdo"]: OLIVE}.get(colour, colour)


def families_of(limits: Array) -> tuple[int, ...]:
    """Family of each joint: neighbours of one torque limit."""
    runs = groupby(limits.tolist(), lambda limit: limit if np.isfinite(limit) else None)
    return tuple(number for number, (_, run) in enumerate(runs, 1) for _ in run)


def drawn_line(
    chart: Chart, line: ChartLine, panel: int, stretches: int = STRETCHES
) -> tuple[Array, Array, list[Array]]:
    """A line's points in a panel, and half widths of its ribbon and the grey part.

    Each is NaN where the other applies; none without a ribbon.
    """
    x = chart.x if line.x is None else line.x
    t, y = thinned(x, line.values[:, panel], stretches)
    if line.half is None:
        return t, y, []
    half = line.half[:, panel]
    quiet = np.zeros(len(half), dtype=bool) if line.quiet is None else line.quiet
    halves = np.where(quiet, np.nan, half), np.where(quiet, half, np.nan)
    return t, y, [np.interp(t, x, each) for each in halves]


def thinned(t: Array, values: Array, stretches: int) -> tuple[Array, Array]:
    """A series with at most two samples a stretch, and its ends.

    The lowest and highest sample of every stretch keep their time and value. A log of at most
    twice as many samples stays whole. NaN breaks the line at unknown values and at gaps of
    the clock.
    """
    gaps, x, y = gaps_of(t, GAP_STEPS), t, values
    if len(t) > 2 * stretches:
        # Samples beside a gap stay, so that lines end there.
        ends = extremes([values], even_starts(len(t), stretches))
        kept = np.unique(np.concatenate([[0, len(t) - 1], ends, gaps, gaps + 1]))
        x, y = t[kept], values[kept]
    after = np.searchsorted(x, t[gaps], side="right")
    return np.insert(x, after, 0.5 * (t[gaps] + t[gaps + 1])), np.insert(y, after, np.nan)


def level_rows(
    t: Array, lines: Sequence[Array], stretches: int, whole: Sequence[tuple[float, float]] = ()
) -> Index | None:
    """Sample numbers of a plot with one clock for all lines, None for all. (P,)

    Of every stretch the lowest, highest and first unknown sample of every line stay, so
    that no spike is lost and no gap closed; of the spans `whole` [s] every sample.
    """
    if len(t) <= 2 * len(lines) * stretches:
        return None
    kept, starts = np.zeros(len(t), dtype=bool), even_starts(len(t), stretches)
    gaps = gaps_of(t, GAP_STEPS)
    for rows in ([0, -1], gaps, gaps + 1, extremes(lines, starts)):
        kept[rows] = True
    for line in lines:
        unknown = np.flatnonzero(np.isnan(line))
        _, first = np.unique(np.searchsorted(starts, unknown, "right"), return_index=True)
        kept[unknown[first]] = True
    return np.flatnonzero(kept | within(t, whole))


def even_starts(samples: int, stretches: int) -> Index:
    """First samples of equal stretches, rounded up. (stretches,)"""
    return np.arange(0, samples, -(-samples // stretches))


def extremes(lines: Sequence[Array], starts: Index) -> Index:
    """Lowest, highest known sample of lines (T,) a stretch, or its first."""
    stops, kept = np.append(starts[1:], len(lines[0])), list[Index]()
    at = np.minimum(starts[:, None] + np.arange(max(stops - starts)), stops[:, None] - 1)
    for line in lines:
        here = line[at]
        unknown = np.isnan(here)
        kept.append(starts + np.where(unknown, np.inf, here).argmin(axis=1))
        kept.append(starts + np.where(unknown, -np.inf, here).argmax(axis=1))
    return np.concatenate(kept)
