"""The figures of an identification: torque measured and predicted, and what is left of each log."""

from functools import partial

import numpy as np

from vftcli.identification.result import Identification
from vftcli.outputs.figures.dots import DotPlot, DotRow, dot_figure
from vftcli.outputs.figures.lines import line_figure, plots_of
from vftcli.outputs.figures.paper import Drawing
from vftcli.outputs.identification.page import shown_trace, torque_charts
from vftcli.outputs.identification.tables import residual_grid
from vftcli.outputs.palette import SPARE

IDENTIFICATION_FIGURES = ("torque", "residuals")  #: Their names.


def identification_figures(found: Identification) -> dict[str, Drawing]:
    """Both figures; none where no log was used."""
    drawings = {}
    if found.traces:
        name = shown_trace(found).motion.recording.name
        plots = plots_of(torque_charts(found)[0])
        drawings["torque"] = Drawing(
            f"{name}: drive torque, filtered, measured and predicted",
            partial(line_figure, plots=plots),
        )
    if not found.residuals.is_empty():
        # The last number of a row of the table is the mean.
        rows = [
            DotRow(str(name), np.array(values[:-1])) for name, *values in residual_grid(found).rows
        ]
        joints = [f"J{j}" for j in range(1, found.robot.joints + 1)]
        plot = DotPlot(found.robot.name, joints, rows, np.full(len(joints), np.nan))
        paints = {row.name: SPARE[k % len(SPARE)] for k, row in enumerate(rows)}
        drawings["residuals"] = Drawing(
            "RMS of the measured less the predicted torque",
            partial(dot_figure, plots=[plot], paints=paints, label="Residual rms (N·m)"),
        )
    return drawings
