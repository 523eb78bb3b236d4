"""What a plot of a Rerun recording shows: lines on one clock, and which plots stand together."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.outputs.decimation import level_rows
from vftcli.signals.arrays import Array


class PlotLine(NamedTuple):
    """One line of a plot.

    Attributes:
        name: What the legend calls it.
        values: NaN where not known. (T,)
        colour: ``#rrggbb``.
        width: In pixels.
    """

    name: str
    values: Array
    colour: str
    width: float = 1.5


class PlotPoints(NamedTuple):
    """Single points of a plot, at times of their own.

    Attributes:
        name: What the legend calls them.
        t: Times. (K,) [s]
        values: (K,)
        colour: ``#rrggbb``.
    """

    name: str
    t: Array
    values: Array
    colour: str


class Lines(NamedTuple):
    """The lines of one plot.

    Attributes:
        path: The entity.
        title: What the plot shows, with its unit.
        lines: At least one, all of one length.
        family: Plots of one family have the same vertical axis; "" stands alone.
        points: Single points among the lines, or none.
        legend: Whether a legend may cover a corner of it, where the title does not say it all.
        t: Times of these samples where they are not all of the tab's. (T,) [s]
    """

    path: str
    title: str
    lines: Sequence[PlotLine]
    family: str = ""
    points: PlotPoints | None = None
    legend: bool = True
    t: Array | None = None

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
    """One line of a text log.

    Attributes:
        path: The entity.
        t: When. [s]
        text: What happened.
        colour: ``#rrggbb``.
        level: How much it matters: INFO, WARN or ERROR.
    """

    path: str
    t: float
    text: str
    colour: str
    level: str = "INFO"


class Tab(NamedTuple):
    """Plots shown together.

    Attributes:
        name: The tab's name.
        t: Time of their samples. (T,) [s]
        plots: What they show.
        log: A text log below them, or none.
    """

    name: str
    t: Array
    plots: Sequence[Lines]
    log: Sequence[LogLine] = ()

    def ends(self, lines: Lines) -> tuple[float, float]:
        """Lower and upper end of a plot's vertical axis: those of its whole family."""
        alike = [p for p in self.plots if p.family and p.family == lines.family] or [lines]
        low, high = zip(*(plot.ends for plot in alike), strict=True)
        return min(low), max(high)
