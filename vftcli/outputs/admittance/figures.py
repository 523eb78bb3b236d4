"""The figure of an admittance replay: force and deviation along the axes that were dragged."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from vftcli.admittance.closed_loop import ClosedLoop
from vftcli.admittance.parameters import AXES
from vftcli.admittance.replay import Replay
from vftcli.outputs.admittance.page import charts
from vftcli.outputs.figures.lines import NARROW, line_figure, plots_of
from vftcli.outputs.figures.paper import Drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPLAY_FIGURES = ("release",)  #: Its name.


def replay_figures(replay: Replay, run: ClosedLoop | None = None) -> dict[str, Drawing]:
    """The figure of a replay; none where nothing moved."""
    moved = [k for k in range(len(AXES)) if np.nanmax(np.abs(replay.motion.x[:, :, k])) > 0.0]
    dragged = {row["axis"] for row in replay.rows}
    shown = [k for k in moved if AXES[k] in dragged] or moved
    title = f"Deviation of the flange from its target, {replay.robot.name}, base axes"
    return {"release": Drawing(title, partial(release, replay, run, shown))} if shown else {}


def release(replay: Replay, run: ClosedLoop | None, axes: list[int], width: float) -> "Figure":
    """Deviations under every controller, above them the force where there is one."""
    deviation, force, *_ = charts(replay, run)
    columns = min(len(axes), 3 if width > NARROW else 2)
    drawn = [force, deviation] if np.any(replay.wrench) else [deviation]
    plots = []
    # The plots of an axis stand below one another.
    for k in range(0, len(axes), columns):
        for chart in drawn:
            plots += plots_of(chart, only=axes[k : k + columns])
    return line_figure(width, plots, columns=columns)
