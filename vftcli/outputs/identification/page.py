"""The page of an identification: residuals, numbers with their spread, residual over velocity."""

import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
import polars as pl

from vftcli.identification.result import Identification, Trace
from vftcli.outputs.page.page import asset, document, headline
from vftcli.outputs.page.payload import Chart, ChartLine, packed
from vftcli.outputs.page.sections import bullets, html_table, number_text, pairs, remarks
from vftcli.outputs.palette import SPARE
from vftcli.signals.remarks import explanation

DOTS = 600
"""Samples drawn in a residual-over-velocity plot."""

WIDTH, HEIGHT, EDGE = 360, 220, 40
"""Size of such a plot and room for its numbers. [px]"""


def render_identification(found: Identification, record: Mapping[str, Any]) -> str:
    """The page as text: self-contained, nothing is loaded from anywhere."""
    logs = ", ".join(dict.fromkeys(t.recording.name for t in found.traces)) or found.robot.name
    text = f"{found.robot.title}: method {found.method}, from {logs}"
    body = [
        headline(found.robot.name, text),
        remarks([explanation(remark) for remark in found.remarks]),
        residual_section(found),
        velocity_section(found),
        parameter_section(found),
        shape_choice_section(found.shape_choices),
        base_section(found.base),
        series_section(found),
        "<h2>Signal processing</h2>",
        pairs(found.processing),
        provenance(record),
    ]
    if found.traces:
        body.append(f'<script type="application/json" id="data">{chart_data(found)}</script>')
        body.append(f"<script>{asset('page.js')}</script>")
    return document(f"{found.robot.name}: identification", "".join(body))


def residual_section(found: Identification) -> str:
    """RMS per joint of every log, identified beside profile."""
    if found.residuals.is_empty():
        return ""
    joints = found.robot.joints
    rows = []
    for (_, log, role, model), part in found.residuals.group_by(
        ["log_index", "log", "role", "model"], maintain_order=True
    ):
        values = part["rms_Nm"].to_list()
        cells = "".join(f"<td>{number_text(v)}</td>" for v in (*values, float(np.mean(values))))
        words = (
            f'<td class="text">{escape(str(role))}</td><td class="text">{escape(str(model))}</td>'
        )
        rows.append(f'<tr><th scope="row">{escape(str(log))}</th>{words}{cells}</tr>')
    header = ["Log", "Role", "Model", *(f"J{j}" for j in range(1, joints + 1)), "mean"]
    caption = "RMS of measured less predicted torque in N·m, from the first to the last movement"
    return f"<h2>Residuals</h2>{html_table(caption, header, rows, words=3)}"


def velocity_section(found: Identification) -> str:
    """Residual over velocity, one small plot a joint: friction that is missed shows here."""
    if not found.traces:
        return ""
    plots = "".join(velocity_plot(found.traces, j) for j in range(found.robot.joints))
    key = "".join(
        f'<span style="color:{colour}">● {escape(trace.recording.name)} ({trace.role})</span> '
        for trace, colour in coloured(found.traces)
    )
    return (
        f'<h2>Residual over velocity</h2><p class="soft">{key}</p><div class="plots">{plots}</div>'
    )


def coloured(traces: Sequence[Trace]) -> list[tuple[Trace, str]]:
    """Each log with its colour."""
    return [(trace, SPARE[k % len(SPARE)]) for k, trace in enumerate(traces)]


def velocity_plot(traces: Sequence[Trace], j: int) -> str:
    """One joint's plot as SVG."""
    speed = max(float(np.max(np.abs(t.dq[:, j]))) for t in traces) or 1.0
    sizes = np.concatenate([np.abs(t.residual[:, j]) for t in traces])
    high = float(np.quantile(sizes, 0.995)) or 1.0
    dots = "".join(scatter(t, j, speed, high, colour) for t, colour in coloured(traces))
    middle, centre = HEIGHT / 2, (WIDTH + EDGE) / 2
    axes = (
        f'<path d="M{EDGE} {middle}H{WIDTH}M{centre} 0V{HEIGHT}" stroke="currentColor" '
        'stroke-opacity=".35" fill="none"/>'
    )
    words = (
        f'<text x="{EDGE + 4}" y="12">J{j + 1} ±{high:.3g} N·m</text>'
        f'<text x="{WIDTH - 4}" y="{middle - 4}" text-anchor="end">{speed:.2g} rad/s</text>'
    )
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" role="img" '
        f'aria-label="Residual over velocity of joint {j + 1}" font-size="11" fill="currentColor">'
        f"{axes}{dots}{words}</svg>"
    )


def scatter(trace: Trace, j: int, speed: float, high: float, colour: str) -> str:
    """One log's dots as a single path of short strokes."""
    pick = np.unique(np.linspace(0, len(trace.t) - 1, DOTS).astype(int))
    x = EDGE + (WIDTH - EDGE) * (trace.dq[pick, j] / speed + 1.0) / 2.0
    y = HEIGHT / 2 * (1.0 - np.clip(trace.residual[pick, j] / high, -1.0, 1.0))
    path = "".join(f"M{a:.1f} {b:.1f}h.01" for a, b in zip(x, y, strict=True))
    return (
        f'<path d="{path}" stroke="{colour}" stroke-width="2.4" stroke-linecap="round" '
        'stroke-opacity=".55" fill="none"/>'
    )


def parameter_section(found: Identification) -> str:
    """The identified numbers."""
    if found.parameters.is_empty():
        return ""
    header = ["Number", "Joint", "Value", "sd", "Unit", "Profile", "Determined"]
    rows = []
    for row in found.parameters.iter_rows(named=True):
        cells = (
            f"<td>J{row['joint']}</td><td>{number_text(row['value'])}</td>"
            f"<td>{number_text(finite(row['sd']))}</td>"
            f"<td>{escape(row['unit'])}</td><td>{number_text(finite(row['profile']))}</td>"
            f"<td>{'yes' if row['determined'] else 'no'}</td>"
        )
        rows.append(f'<tr><th scope="row">{escape(row["parameter"])}</th>{cells}</tr>')
    return f"<h2>Identified numbers</h2>{html_table('One row a number', header, rows)}"


def shape_choice_section(choices: pl.DataFrame) -> str:
    """How the friction models competed, folded away."""
    if choices.is_empty():
        return ""
    rows = [
        f'<tr><th scope="row">{escape(r["friction"])}</th><td>J{r["joint"]}</td>'
        f"<td>{number_text(r['cv_rms_Nm'])}</td><td>{'chosen' if r['chosen'] else ''}</td></tr>"
        for r in choices.iter_rows(named=True)
    ]
    caption = "RMS on the fifth of the log left out; the simplest within 1 % of the best is chosen"
    table = html_table(caption, ["Friction", "Joint", "RMS [N·m]", ""], rows)
    return f"<details><summary>Friction models compared</summary>{table}</details>"


def base_section(base: pl.DataFrame | None) -> str:
    """Base parameters, folded away."""
    if base is None:
        return ""
    rows = [
        f'<tr><th scope="row">{escape(r["parameter"])}</th><td>{number_text(r["value"])}</td>'
        f"<td>{number_text(finite(r['sd']))}</td><td>{'yes' if r['determined'] else 'no'}</td></tr>"
        for r in base.iter_rows(named=True)
    ]
    header = ["Parameter", "Value (SI)", "sd", "Determined"]
    table = html_table("Weighted least squares, before physical consistency", header, rows)
    return f"<details><summary>Base parameters ({len(rows)})</summary>{table}</details>"


def finite(value: float | None) -> float | None:
    """A number, None where it is not known."""
    return value if value is not None and np.isfinite(value) else None


def series_section(found: Identification) -> str:
    """Where the script draws torques over time."""
    if not found.traces:
        return ""
    name = escape(shown_trace(found).recording.name)
    return (
        f"<h2>Torques over time: {name}</h2>"
        '<p class="soft help">Drag to zoom in, double-click to see all; the Rerun recording holds '
        "every log.</p>"
        '<div id="toolbar"><div class="buttons" id="joints" role="group" aria-label="Joint">'
        '<span class="name">Joint</span></div>'
        '<div id="legend" role="group" aria-label="Series"><span class="name">Series</span></div>'
        '<div class="buttons"><button type="button" id="all">Whole span</button></div></div>'
        '<div id="overview"></div><div id="detail"></div>'
        "<noscript><p>The charts need JavaScript; the tables do not.</p></noscript>"
    )


def shown_trace(found: Identification) -> Trace:
    """The log that is drawn over time: the first held-out one, else the first."""
    held = [t for t in found.traces if t.role == "held-out"]
    return (held or list(found.traces))[0]


def chart_data(found: Identification) -> str:
    """JSON for the script: nothing in it can end the element."""
    trace = shown_trace(found)
    measured = ChartLine("measured", trace.measured)
    predicted = ChartLine("predicted", trace.predicted, SPARE[1])
    charts = (
        Chart("torque", "Drive torque, filtered", "N·m", (measured, predicted), height=1.5),
        Chart("left", "Measured − predicted", "N·m", (ChartLine("residual", trace.residual),)),
        Chart("dq", "Velocity", "rad/s", (ChartLine("velocity", trace.dq),)),
    )
    data = {
        "joints": found.robot.joints,
        "span": [float(trace.t[0]), float(trace.t[-1])],
        "charts": [packed(chart, trace.t) for chart in charts],
        "responses": [],
    }
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", " ").replace("\u2029", " ")


def provenance(record: Mapping[str, Any]) -> str:
    """Command, versions and digests."""
    logs: Iterable[Mapping[str, Any]] = record.get("inputs", ())
    lines = [f"{log.get('path')}: sha256 {log.get('sha256')}" for log in logs]
    command = f"<pre>{escape(str(record.get('command', '')))}</pre>"
    versions = pairs(record.get("versions", {}))
    return f"<h2>Provenance</h2>{command}{bullets(lines)}{versions}"
