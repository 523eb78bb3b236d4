"""What a plot of a Rerun recording shows: lines on one clock, and which plots stand together."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.outputs.decimation import level_rows
from vftcli.signals.arrays import Array


class PlotLine(NamedTuple):
    """One line of a plot."""

    name: str  #: What the legend calls it.
    values: Array  #: NaN where not known. (T,)
    colour: str  #: ``#rrggbb``.
    width: float = 1.5  #: In pixels.


class PlotPoints(NamedTuple):
    """Single points of a plot, at times of their own."""

    name: str  #: What the legend calls them.
    t: Array  #: Times. (K,) [s]
    values: Array  #: (K,)
    colour: str  #: ``#rrggbb``.


class Lines(NamedTuple):
    """The lines of one plot."""

    path: str  #: The entity.
    title: str  #: What the plot shows, with its unit.
    lines: Sequence[PlotLine]  #: At least one, all of one length.
    family: str = ""  #: Plots of one family have the same vertical axis; "" stands alone.
    points: PlotPoints | None = None  #: Single points among the lines, or none.
    #: Whether a legend may cover a corner of it, where the title does not say it all.
    legend: bool = True
    t: Array | None = None  #: Times of these samples where they are not all of the tab's. (T,) [s]

    def thinned(
        self, t: Array, stretches: int, whole: Sequence[tuple[float, float]] = ()
    ) -> "Lines":
        """The same with the samples that `level_rows` keeps; all of them where nothing is gained.

        Args:
            t: Time of its samples. (T,) [s]
            stretches: Number of stretches the log is cut into.
            whole: Spans in which every sample stays. [s]
        """
        rows = level_rows(t, self.values, stretches, whole)
        if rows is None:
            return self
        lines = [line._replace(values=line.values[rows]) for line in self.lines]
        return self._replace(lines=lines, t=t[rows])

    @property
    def values(self) -> Array:
        """One column a line. (T, k)"""
        return np.column_stack([line.values for line in self.lines])

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end of a vertical axis that shows all of them, with some room."""
        known = self.values.ravel()
        if self.points is not None:
            known = np.concatenate([known, self.points.values])
        known = known[np.isfinite(known)]
        low, high = (known.min(), known.max()) if known.size else (-1.0, 1.0)
        room = max(0.05 * (high - low), 1e-3)
        return float(low - room), float(high + room)


class LogLine(NamedTuple):
    """One line of a text log."""

    path: str  #: The entity.
    t: float  #: When. [s]
    text: str  #: What happened.
    colour: str  #: ``#rrggbb``.
    level: str = "INFO"  #: How much it matters: INFO, WARN or ERROR.


class Tab(NamedTuple):
    """Plots shown together."""

    name: str  #: The tab's name.
    t: Array  #: Time of their samples. (T,) [s]
    plots: Sequence[Lines]  #: What they show.
    log: Sequence[LogLine] = ()  #: A text log below them, or none.

    def ends(self, lines: Lines) -> tuple[float, float]:
        """Lower and upper end of a plot's vertical axis: those of its whole family."""
        alike = [p for p in self.plots if p.family and p.family == lines.family] or [lines]
        low, high = zip(*(plot.ends for plot in alike), strict=True)
        return min(low), max(high)
