"""Outputs of an identification: robot file, page, figures, record."""

from collections.abc import Sequence
from functools import partial
from itertools import cycle
from pathlib import Path

import numpy as np
import polars as pl

from vftcli.doctor.examination import Examination
from vftcli.identification.fitting import Identification, Trace
from vftcli.outputs import Record
from vftcli.outputs.charts import SPARE, Chart, ChartLine, Span, families_of
from vftcli.outputs.examination import health_record, overridden_lines
from vftcli.outputs.files import SEAL, OutputFolder
from vftcli.outputs.grid import Column, Grid, Rows, joint_columns, keyed_grid, signed, terminal
from vftcli.outputs.page.log_charts import joint_panels
from vftcli.outputs.page.shell import Box, Scales, page, polyline
from vftcli.outputs.paper import (
    DotPlot,
    Drawing,
    dot_figure,
    figure_files,
    line_figure,
    plots_of,
    write_figures,
)
from vftcli.outputs.run_record import (
    CONVENTIONS,
    envelope,
    input_record,
    log_entry,
    log_remarks,
    robot_record,
    seal,
)
from vftcli.robots.profile import robot_toml
from vftcli.signals.errors import OutputError
from vftcli.signals.parsing import counted

IDENTIFICATION_FIGURES = ("torque", "residuals")
#: Key of an identified number → its column.
COLUMNS = {
    "parameter": "parameter",
    "joint": Column("joint"),
    "value": Column("value", form=".5g"),
    "sd": Column("sd", form=".2g"),
    "profile": Column("profile", form=".5g"),
    "unit": "unit",
}
#: Key of a base parameter → its column.
BASE_COLUMNS = {
    "parameter": "parameter",
    "value": Column("value (SI)", form=signed),
    "sd": Column("sd", form=signed),
    "determined": Column("determined"),
}
RESIDUALS = "RMS of measured less modelled drive torque [N·m]; check: of a --check log"
#: Below the identified numbers.
LEGEND = (
    "profile: of your --robot, – if it has none; sd: standard deviation; not determined: "
    "not settled by the log; com: in flange axes. More: docs/robots.md"
)
DOTS = 600  #: Samples drawn in a residual-over-velocity plot.


def files_beside(path: Path, form: str | None) -> list[str]:
    """Names of a robot file, page, record and figures."""
    if path.suffix.lower() != ".toml":
        raise OutputError(f"{path}: -o needs a name that ends in .toml, as my_robot.toml")
    drawn = figure_files(form, IDENTIFICATION_FIGURES, f"{path.stem}-")
    return [path.name, f"{path.stem}.html", f"{path.stem}.{SEAL}", *drawn]


def write_identification(
    path: Path,
    found: Identification,
    logs: Sequence[Examination],
    command: str,
    force: bool,
    form: str | None = None,
) -> str:
    """Write all files or none; the text of `run.json`."""
    record = identification_record(found, logs, command)
    heading = [
        *overridden_lines(logs, fitting=False),
        f"{found.robot.title}; written by vftcli identify, keys: docs/robots.md.",
        command,
    ]
    with OutputFolder(path.parent, force, names := files_beside(path, form)) as folder:
        toml, page, run, *_ = names
        folder.write(page, render_identification(found, record, logs))
        folder.write(toml, robot_toml(found.robot, heading))
        if form is not None:
            write_figures(folder, identification_figures(found), form, f"{path.stem}-")
        return seal(folder, run, record)


def identification_record(
    found: Identification, logs: Sequence[Examination], command: str
) -> Record:
    """Everything `run.json` holds, and `--json` prints."""
    recordings, profile = [one.recording for one in logs], robot_record(found.profile)
    about = {
        "examination": health_record(logs, fitting=False),
        "method": found.method,
        "inputs": [input_record(log) for log in recordings],
        "profile": profile,
        "profile_sha256": profile["sha256"],
        "robot": found.robot.name,
        "processing": dict(found.processing),
        "residuals": found.residuals.to_dicts(),
        "parameters": found.parameters.to_dicts(),
        "friction_models": found.shape_choices.to_dicts(),
        "base_parameters": found.base.to_dicts() if found.base is not None else [],
        "conventions": CONVENTIONS,
        **log_remarks(recordings),
    }
    return envelope(command, list(map(log_entry, recordings)), found.remarks, about)


def render_identification(
    found: Identification, record: Record, examinations: Sequence[Examination] = ()
) -> str:
    """The page."""
    logs = list(dict.fromkeys(t.motion.recording.name for t in found.traces))
    title, charts = found.robot.title or found.robot.name, torque_charts(found)
    source = f" from {counted(len(logs), 'log')}" if logs else ""
    grids = {
        "Identified numbers": parameter_grid(found),
        "Friction models compared": shape_choice_grid(found.shape_choices),
    }
    if (base := found.base) is not None:
        above = "Weighted least squares, before physical consistency"
        grid = keyed_grid(BASE_COLUMNS, base.iter_rows(named=True), above)
        grids[f"Base parameters ({len(base)})"] = grid
    traces = list(zip(found.traces, cycle(SPARE), strict=False))
    return page(
        "identification.html",
        f"{found.robot.name}: identification",
        charts,
        examinations=examinations,
        eyebrow=(title, f"method {found.method}", ", ".join(logs)),
        headline=f"{title}{source}.",
        residuals=residual_grid(found),
        traces=traces,
        plots=(velocity_plot(traces, j) for j in range(found.robot.joints)),
        grids=grids,
        shown=shown_trace(found).motion.recording.name if charts else "",
        processing=found.processing,
        remarks=found.remarks,
        record=record,
        inputs=[f"{log.get('path')}: sha256 {log.get('sha256')}" for log in record["inputs"]],
    )


def velocity_plot(
    coloured: Sequence[tuple[Trace, str]], j: int
) -> tuple[str, Scales, list[tuple[str, str]]]:
    """A joint's residual over velocity: name, scales, dots by log."""
    # One scale for all logs of a joint.
    speed = max(abs(t.motion.dq[:, j]).max() for t, _ in coloured) or 1.0
    sizes = np.concatenate([np.abs(t.residual[:, j]) for t, _ in coloured])
    # Outliers at reversals are drawn at the edge.
    high = np.quantile(sizes, 0.995) or 1.0
    scales, drawn = Scales(Box(height=180), Span(-speed, speed), Span(-high, high)), []
    for trace, colour in coloured:
        pick = np.unique(np.linspace(0, len(trace.motion.t) - 1, DOTS).astype(int))
        x = scales.across(trace.motion.dq[pick, j])
        y = scales.up(np.clip(trace.residual[pick, j], -high, high))
        # One path of dots: 600 circles a joint make a page slow.
        dots = (polyline(dot[None]) for dot in np.column_stack([x, y]))
        drawn.append((colour, "".join(dots)))
    return f"J{j + 1}", scales, drawn


def shown_trace(found: Identification) -> Trace:
    """The log drawn over time: the first held out, else the first."""
    # A log outside the fit shows how well it predicts.
    return next((t for t in found.traces if t.role == "held-out"), found.traces[0])


def torque_charts(found: Identification) -> tuple[Chart, ...]:
    """Measured and predicted torque of one log, and the rest."""
    if not found.traces:
        return ()
    trace, units = shown_trace(found), ("N·m",) * found.robot.joints
    measured = ChartLine("measured", trace.measured)
    predicted = ChartLine("predicted", trace.predicted, SPARE[1], "5 2")
    panels, families = joint_panels(found.robot.joints), families_of(found.robot.limits.tau_max)
    left, lines = ChartLine("measured − predicted", trace.residual), (measured, predicted)
    chart = Chart(
        "torque", "Drive torque, filtered", units, panels, trace.motion.t, lines, families
    )
    return chart, chart._replace(key="left", title="Measured − predicted", series=(left,))


def identification_figures(found: Identification) -> dict[str, Drawing]:
    """Measured and predicted torque, and residuals, if any."""
    drawings = {}
    if found.traces:
        name = shown_trace(found).motion.recording.name
        title = f"{name}: drive torque, filtered, measured and predicted"
        draw = partial(line_figure, plots=plots_of(torque_charts(found)[0]))
        drawings["torque"] = Drawing(title, draw)
    # The last number of a row of the table is the mean.
    rows = [(str(name), np.array(v[:-1]), None) for name, *v in residual_grid(found).rows]
    if rows:
        joints = joint_panels(found.robot.joints)
        plot = DotPlot(found.robot.name, joints, rows, np.full(len(joints), np.nan))
        paints = dict(zip((name for name, *_ in rows), cycle(SPARE), strict=False))
        draw = partial(dot_figure, plots=[plot], paints=paints, label="Residual rms (N·m)")
        drawings["residuals"] = Drawing("RMS of the measured less the predicted torque", draw)
    return drawings


def tables_text(found: Identification) -> str:
    """Residuals and identified numbers for the terminal."""
    grids = (residual_grid(found), parameter_grid(found))
    return "\n".join(terminal(grid) for grid in grids if grid.rows).removesuffix("\n")


def residual_grid(found: Identification) -> Grid:
    """RMS of residual torque by log, role and model. [N·m]"""
    # The place in the command distinguishes two logs of one label.
    keys = ("log_index", "log", "role", "model")
    rows: Rows = []
    for (_, *names), part in found.residuals.group_by(*keys, maintain_order=True):
        values = part["rms_Nm"].to_list()
        label = ", ".join(str(name) for name in names if name != "train")
        label = label.replace(", held-out,", ", check,")
        rows.append((label, *values, sum(values) / len(values)))
    joints = joint_columns(found.robot.joints, form=".2f")
    return Grid(("log, model", *joints, Column("mean", form=".2f")), rows, RESIDUALS)


def parameter_grid(found: Identification) -> Grid:
    """The identified numbers with their spread, and the profile's."""
    rows = (
        row | {"unit": row["unit"] + ("" if row["determined"] else "  (not determined)")}
        for row in found.parameters.iter_rows(named=True)
    )
    return keyed_grid(COLUMNS, rows)


def shape_choice_grid(choices: pl.DataFrame) -> Grid:
    """Friction models' errors on stretches left out of the fit."""
    rows = [
        (r["friction"], f"J{r['joint']}", r["cv_rms_Nm"], "chosen" if r["chosen"] else "")
        for r in choices.iter_rows(named=True)
    ]
    title = "RMS on the fifth of the log left out; the simplest within 1 % of the best is chosen"
    return Grid(("friction", *map(Column, ("joint", "RMS [N·m]", ""))), rows, title)
