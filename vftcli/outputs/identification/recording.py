"""The Rerun recording of an identification: measured and predicted torque of every log.

`/torque/<log>/J1` … hold the measured and the predicted torque, `/residual/<log>/J1` … their
difference, on the timeline `t` in seconds from each log's first sample.
"""

import gc
import re
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.identification.result import Identification, Trace
from vftcli.outputs.grid import escape_markdown
from vftcli.outputs.log.rerun_blueprint import Tab, grid
from vftcli.outputs.log.rerun_recording import Lines, plot_of, send_lines
from vftcli.outputs.log.rerun_text import drawable
from vftcli.outputs.palette import REFERENCE, SPARE
from vftcli.signals.remarks import explanation


def write_identification_rrd(path: Path, found: Identification) -> None:
    """Write the recording with its blueprint, so that it opens arranged.

    Args:
        path: Where to; an existing file is replaced.
        found: What to show.
    """
    import rerun as rr

    tabs = [(trace, *lines_of(trace)) for trace in found.traces]
    stream = rr.RecordingStream("vftcli")
    stream.save(str(path), default_blueprint=arrangement(tabs))
    stream.send_recording_name(drawable(found.robot.name))
    for trace, torque, residual in tabs:
        for lines in (*torque, *residual):
            send_lines(stream, trace.t, lines)
    words = rr.TextDocument(drawable(summary(found)), media_type="text/markdown")
    stream.log("/summary", words, static=True)
    stream.flush()
    stream.disconnect()
    del stream
    gc.collect()  # the footer is written when the last reference goes


def lines_of(trace: Trace) -> tuple[list[Lines], list[Lines]]:
    """The plots of one log: torques, and residuals, joint by joint."""
    name = re.sub(r"[^A-Za-z0-9_.-]", "_", trace.recording.name)
    torque, residual = [], []
    for j in range(trace.measured.shape[1]):
        both = np.column_stack([trace.measured[:, j], trace.predicted[:, j]])
        torque.append(
            Lines(
                f"/torque/{name}/J{j + 1}",
                f"J{j + 1} drive torque [N·m]",
                ["measured", "predicted"],
                [REFERENCE, SPARE[1]],
                [2.5, 1.5],
                both,
            )
        )
        residual.append(
            Lines(
                f"/residual/{name}/J{j + 1}",
                f"J{j + 1} measured − predicted [N·m]",
                ["residual"],
                [SPARE[0]],
                [1.5],
                trace.residual[:, j : j + 1],
            )
        )
    return torque, residual


def arrangement(tabs: list[tuple[Trace, list[Lines], list[Lines]]]) -> Any:  # noqa: ANN401
    """Summary to the left, two tabs a log to the right."""
    import rerun.blueprint as rrb

    grids = []
    for trace, torque, residual in tabs:
        title = f"{trace.recording.name} ({trace.role})"
        grids.append(grid(Tab(title, tuple(map(plot_of, torque)))))
        grids.append(grid(Tab(f"{title}: residual", tuple(map(plot_of, residual)))))
    words = rrb.TextDocumentView(origin="/summary", name="Summary")
    views = rrb.Horizontal(words, rrb.Tabs(*grids), column_shares=[2, 5]) if grids else words
    return rrb.Blueprint(
        views,
        rrb.TimePanel(timeline="t", state="collapsed", play_state="paused"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def summary(found: Identification) -> str:
    """What was identified, from what, and the remarks."""
    logs = [
        f"- {escape_markdown(t.recording.name)} ({t.role}): sha256 "
        f"{t.recording.source.sha256 or 'unknown'}, mean RMS "
        f"{t.mean_rms:.3f} N·m"
        for t in found.traces
    ]
    notes = [f"- {escape_markdown(explanation(remark))}" for remark in found.remarks]
    head = f"# {escape_markdown(found.robot.name)}\n\nMethod {found.method}."
    return "\n".join([head, "", *logs, "", "## Notes", *notes]) + "\n"
