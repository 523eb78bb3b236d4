"""What a plot of a Rerun recording shows: lines on one clock, and which plots stand together."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

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


class Lines(NamedTuple):
    """The lines of one plot.

    Attributes:
        path: The entity.
        title: What the plot shows, with its unit.
        lines: At least one, all of one length.
    """

    path: str
    title: str
    lines: Sequence[PlotLine]

    @property
    def values(self) -> Array:
        """One column a line. (T, k)"""
        return np.column_stack([line.values for line in self.lines])

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end of a vertical axis that shows all of them, with some room."""
        known = self.values
        known = known[np.isfinite(known)]
        low, high = (known.min(), known.max()) if known.size else (-1.0, 1.0)
        room = max(0.05 * (high - low), 1e-3)
        return float(low - room), float(high + room)


class Tab(NamedTuple):
    """Plots shown together.

    Attributes:
        name: The tab's name.
        t: Time of their samples. (T,) [s]
        plots: What they show.
    """

    name: str
    t: Array
    plots: Sequence[Lines]
