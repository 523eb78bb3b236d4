"""The Rerun recording of an identification: measured and predicted torque of every log.

`/torque/<log>/J1` … hold the measured and the predicted torque, `/residual/<log>/J1` … their
difference, on the timeline `t` in seconds from each log's first sample. Logs of one name are
numbered.
"""

import re
from pathlib import Path

import numpy as np

from vftcli.identification.result import Identification, Trace
from vftcli.outputs.files import numbered
from vftcli.outputs.grid import escape_markdown
from vftcli.outputs.palette import REFERENCE, SPARE
from vftcli.outputs.plots import Lines, PlotLine, Tab
from vftcli.outputs.rerun_file import rerun_file
from vftcli.signals.remarks import explanation


def write_identification_rrd(path: Path, found: Identification) -> None:
    """Write the recording with its blueprint, so that it opens arranged."""
    # An entity's path may hold no blank; names of files may. A log may be there in two roles.
    names = [re.sub(r"[^A-Za-z0-9_.-]", "_", t.motion.recording.name) for t in found.traces]
    entities = zip(found.traces, numbered(names), strict=True)
    tabs = [tab for trace, entity in entities for tab in tabs_of(trace, entity)]
    with rerun_file(path, found.robot.name, tabs, {"Summary": summary(found)}):
        pass  # there is no arm to draw


def tabs_of(trace: Trace, entity: str) -> tuple[Tab, Tab]:
    """The plots of one log, called `entity` in paths: torques, and residuals, joint by joint."""
    torque, residual = [], []
    for j in range(trace.measured.shape[1]):
        both = (
            PlotLine("measured", trace.measured[:, j], REFERENCE, 2.5),
            PlotLine("predicted", trace.predicted[:, j], SPARE[1]),
        )
        left = PlotLine("residual", trace.residual[:, j], SPARE[0])
        joint = f"J{j + 1}"
        torque.append(Lines(f"/torque/{entity}/{joint}", f"{joint} drive torque [N·m]", both))
        title = f"{joint} measured − predicted [N·m]"
        residual.append(Lines(f"/residual/{entity}/{joint}", title, [left]))
    t, title = trace.motion.t, f"{trace.motion.recording.name} ({trace.role})"
    return Tab(title, t, torque), Tab(f"{title}: residual", t, residual)


def summary(found: Identification) -> str:
    """What was identified, from what, and the remarks."""
    logs = [
        f"- {escape_markdown(t.motion.recording.name)} ({t.role}): sha256 "
        f"{t.motion.recording.source.sha256 or 'unknown'}, mean RMS "
        f"{np.mean(t.rms):.3f} N·m"
        for t in found.traces
    ]
    notes = [f"- {escape_markdown(explanation(remark))}" for remark in found.remarks]
    head = f"# {escape_markdown(found.robot.name)}\n\nMethod {found.method}."
    return "\n".join([head, "", *logs, "", "## Notes", *notes]) + "\n"
