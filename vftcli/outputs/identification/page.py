"""The page of an identification: residuals, numbers with their spread, residual over velocity."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from vftcli.doctor.examination import Examination
from vftcli.identification.result import Identification, Trace
from vftcli.outputs.grid import html
from vftcli.outputs.identification.tables import (
    base_grid,
    parameter_grid,
    residual_grid,
    shape_choice_grid,
)
from vftcli.outputs.page.charts import Chart, ChartLine, packed
from vftcli.outputs.page.shell import (
    bullets,
    chart_places,
    document,
    folded,
    headline,
    health,
    pairs,
    remarks,
    soft,
)
from vftcli.outputs.palette import SPARE

DOTS = 600
"""Samples drawn in a residual-over-velocity plot."""

WIDTH, HEIGHT, EDGE = 360, 220, 40
"""Size of such a plot and room for its numbers. [px]"""


def render_identification(
    found: Identification, record: Mapping[str, Any], examinations: Sequence[Examination] = ()
) -> str:
    """The page as text: self-contained, nothing is loaded from anywhere."""
    logs = (
        ", ".join(dict.fromkeys(t.motion.recording.name for t in found.traces)) or found.robot.name
    )
    text = f"{found.robot.title}: method {found.method}, from {logs}"
    residuals = ""
    if not found.residuals.is_empty():
        words = "Measured less predicted torque, from the first to the last movement."
        residuals = f"<h2>Residuals</h2>{html(residual_grid(found))}{soft(words)}"
    parts = (
        headline(found.robot.name, text),
        health(examinations, fitting=False),
        remarks(found.remarks),
        residuals,
        velocity_section(found),
        parameter_section(found),
        series_section(found),
        "<h2>Signal processing</h2>",
        pairs(found.processing),
        provenance_section(record),
    )
    data = payload(found) if found.traces else None
    return document(f"{found.robot.name}: identification", "".join(parts), data)


def parameter_section(found: Identification) -> str:
    """The identified numbers; folded away, how friction models competed, and base parameters."""
    parts = []
    if not found.parameters.is_empty():
        parts.append(f"<h2>Identified numbers</h2>{html(parameter_grid(found))}")
    if not found.shape_choices.is_empty():
        parts.append(
            folded("Friction models compared", html(shape_choice_grid(found.shape_choices)))
        )
    if found.base is not None:
        parts.append(folded(f"Base parameters ({len(found.base)})", html(base_grid(found.base))))
    return "".join(parts)


def velocity_section(found: Identification) -> str:
    """Residual over velocity, one small plot a joint: friction that is missed shows here."""
    if not found.traces:
        return ""
    plots = "".join(velocity_plot(found.traces, j) for j in range(found.robot.joints))
    key = "".join(
        f'<span style="color:{colour}">● {escape(t.motion.recording.name)} ({t.role})</span> '
        for t, colour in coloured(found.traces)
    )
    return (
        f'<h2>Residual over velocity</h2><p class="soft">{key}</p><div class="plots">{plots}</div>'
    )


def coloured(traces: Sequence[Trace]) -> list[tuple[Trace, str]]:
    """Each log with the colour of its dots."""
    return [(trace, SPARE[k % len(SPARE)]) for k, trace in enumerate(traces)]


def velocity_plot(traces: Sequence[Trace], j: int) -> str:
    """SVG of one joint: residual over velocity, each log in its colour."""
    # One scale for all logs of a joint, or their dots could not be compared.
    speed = max(float(np.max(np.abs(t.motion.dq[:, j]))) for t in traces) or 1.0
    sizes = np.concatenate([np.abs(t.residual[:, j]) for t in traces])
    # A few samples at reversals are far off; they are drawn at the edge.
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
    pick = np.unique(np.linspace(0, len(trace.motion.t) - 1, DOTS).astype(int))
    x = EDGE + (WIDTH - EDGE) * (trace.motion.dq[pick, j] / speed + 1.0) / 2.0
    y = HEIGHT / 2 * (1.0 - np.clip(trace.residual[pick, j] / high, -1.0, 1.0))
    # One path of strokes without length: 600 circles a log and joint would make a slow page.
    path = "".join(f"M{a:.1f} {b:.1f}h.01" for a, b in zip(x, y, strict=True))
    return (
        f'<path d="{path}" stroke="{colour}" stroke-width="2.4" stroke-linecap="round" '
        'stroke-opacity=".55" fill="none"/>'
    )


def series_section(found: Identification) -> str:
    """Where the script draws torques over time."""
    if not found.traces:
        return ""
    name = escape(shown_trace(found).motion.recording.name)
    return (
        f"<h2>Torques over time: {name}</h2>"
        f"{soft('The Rerun recording holds every log.')}{chart_places()}"
    )


def shown_trace(found: Identification) -> Trace:
    """The log that is drawn over time: the first held-out one, else the first."""
    # A log that the fit has not seen shows how well it predicts.
    held = [t for t in found.traces if t.role == "held-out"]
    return (held or list(found.traces))[0]


def payload(found: Identification) -> dict[str, Any]:
    """What the script draws: one log's torques, their difference, its velocities."""
    trace = shown_trace(found)
    measured = ChartLine("measured", trace.measured)
    predicted = ChartLine("predicted", trace.predicted, SPARE[1])
    charts = (
        Chart("torque", "Drive torque, filtered", "N·m", (measured, predicted), height=1.5),
        Chart("left", "Measured − predicted", "N·m", (ChartLine("residual", trace.residual),)),
        Chart("dq", "Velocity", "rad/s", (ChartLine("velocity", trace.motion.dq),)),
    )
    return {
        "joints": found.robot.joints,
        "span": [float(trace.motion.t[0]), float(trace.motion.t[-1])],
        "charts": [packed(chart, trace.motion.t) for chart in charts],
        "responses": [],
    }


def provenance_section(record: Mapping[str, Any]) -> str:
    """The command, digests of all logs, versions: what is needed to make it again."""
    lines = [f"{log.get('path')}: sha256 {log.get('sha256')}" for log in record.get("inputs", ())]
    command = f"<pre>{escape(str(record.get('command', '')))}</pre>"
    return f"<h2>Provenance</h2>{command}{bullets(lines)}{pairs(record.get('versions', {}))}"
