"""The page of an identification: residuals, numbers with their spread, residual over velocity."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from vftcli.doctor.examination import Examination
from vftcli.identification.result import Identification, Trace
from vftcli.outputs.identification.tables import (
    base_grid,
    parameter_grid,
    residual_grid,
    shape_choice_grid,
)
from vftcli.outputs.page.charts import Chart, ChartLine, families_of
from vftcli.outputs.page.log_charts import joint_panels
from vftcli.outputs.page.shell import (
    alarms,
    all_remarks,
    axes,
    bullets,
    document,
    frame,
    health,
    large,
    lead,
    multiples,
    pairs,
    section,
    soft,
    table,
    top,
)
from vftcli.outputs.page.svg import Box, Scales, Span
from vftcli.outputs.palette import SPARE

DOTS = 600  #: Samples drawn in a residual-over-velocity plot.


def render_identification(
    found: Identification, record: Mapping[str, Any], examinations: Sequence[Examination] = ()
) -> str:
    """The page as text: self-contained, nothing is loaded from anywhere."""
    names = dict.fromkeys(t.motion.recording.name for t in found.traces)
    charts = torque_charts(found)
    parts = (
        alarms(examinations, fitting=False),
        top(
            (found.robot.title or found.robot.name, f"method {found.method}", ", ".join(names)),
            headline(found),
            lead("Residual: measured less predicted torque, from the first to the last movement."),
        ),
        residual_section(found),
        velocity_section(found),
        "<h2>Details</h2>",
        parameter_section(found),
        series_section(found, charts),
        health(examinations, opened=True),
        section("Signal processing", pairs(found.processing)),
        all_remarks(found.remarks),
        provenance_section(record),
    )
    return document(f"{found.robot.name}: identification", "".join(parts), charts)


def headline(found: Identification) -> str:
    """What was identified, and how well it predicts, in one sentence."""
    count = len({trace.motion.recording.name for trace in found.traces})
    source = f" from {count} log{'s' * (count > 1)}" if count else ""
    return f"{found.robot.title or found.robot.name}{source}."


def residual_section(found: Identification) -> str:
    """The table of residuals, "" where no log was used."""
    if found.residuals.is_empty():
        return ""
    return f"<h2>How much torque is left unexplained</h2>{table(residual_grid(found))}"


def parameter_section(found: Identification) -> str:
    """The identified numbers, how friction models competed, and base parameters."""
    parts = []
    if not found.parameters.is_empty():
        parts.append(section("Identified numbers", table(parameter_grid(found)), opened=True))
    if not found.shape_choices.is_empty():
        parts.append(
            section("Friction models compared", table(shape_choice_grid(found.shape_choices)))
        )
    if found.base is not None:
        parts.append(section(f"Base parameters ({len(found.base)})", table(base_grid(found.base))))
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
    words = "Friction that the model misses shows here as a curve."
    return (
        f'<h2>Residual over velocity</h2><p class="legend">{key}</p>'
        f'<div class="multiples">{plots}</div>{soft(words)}'
    )


def coloured(traces: Sequence[Trace]) -> list[tuple[Trace, str]]:
    """Each log with the colour of its dots."""
    return [(trace, SPARE[k % len(SPARE)]) for k, trace in enumerate(traces)]


def velocity_plot(traces: Sequence[Trace], j: int) -> str:
    """One joint: residual over velocity, each log in its colour."""
    # One scale for all logs of a joint, or their dots could not be compared.
    speed = max(float(np.max(np.abs(t.motion.dq[:, j]))) for t in traces) or 1.0
    sizes = np.concatenate([np.abs(t.residual[:, j]) for t in traces])
    # A few samples at reversals are far off; they are drawn at the edge.
    high = float(np.quantile(sizes, 0.995)) or 1.0
    scales = Scales(Box(height=180), Span(-speed, speed), Span(-high, high))
    dots = "".join(scatter(t, j, scales, colour) for t, colour in coloured(traces))
    drawn = frame(
        scales.box, f"Residual over velocity, J{j + 1}", axes(scales, "rad/s", (4, 4)) + dots
    )
    return f"<figure><figcaption>J{j + 1} <span>N·m</span></figcaption>{drawn}</figure>"


def scatter(trace: Trace, j: int, scales: Scales, colour: str) -> str:
    """One log's dots as a single path of short strokes."""
    pick = np.unique(np.linspace(0, len(trace.motion.t) - 1, DOTS).astype(int))
    x = scales.across(trace.motion.dq[pick, j])
    y = scales.up(np.clip(trace.residual[pick, j], *scales.y))
    # One path of strokes without length: 600 circles a log and joint would make a slow page.
    path = "".join(f"M{a:.1f} {b:.1f}h.01" for a, b in zip(x, y, strict=True))
    return (
        f'<path d="{path}" stroke="{colour}" stroke-width="2.4" stroke-linecap="round" '
        'stroke-opacity=".55" fill="none"/>'
    )


def series_section(found: Identification, charts: Sequence[Chart]) -> str:
    """One log's torques over time, measured, predicted and their difference."""
    if not charts:
        return ""
    name = shown_trace(found).motion.recording.name
    drawn = "".join(f"<h3>{escape(c.title)}</h3>{multiples(c)}{large(c)}" for c in charts)
    return section("Torques over time", drawn, name)


def shown_trace(found: Identification) -> Trace:
    """The log that is drawn over time: the first held-out one, else the first."""
    # A log that the fit has not seen shows how well it predicts.
    held = [t for t in found.traces if t.role == "held-out"]
    return (held or list(found.traces))[0]


def torque_charts(found: Identification) -> tuple[Chart, ...]:
    """Measured and predicted torque of one log, and what is left."""
    if not found.traces:
        return ()
    trace, n = shown_trace(found), found.robot.joints
    measured = ChartLine("measured", trace.measured)
    predicted = ChartLine("predicted", trace.predicted, SPARE[1], "5 2")
    panels, families = joint_panels(trace.measured), families_of(found.robot.limits.tau_max)
    left = ChartLine("measured − predicted", trace.residual)
    return tuple(
        Chart(key, title, ("N·m",) * n, panels, trace.motion.t, lines, families=families)
        for key, title, lines in (
            ("torque", "Drive torque, filtered", (measured, predicted)),
            ("left", "Measured − predicted", (left,)),
        )
    )


def provenance_section(record: Mapping[str, Any]) -> str:
    """The command, digests of all logs, versions: what is needed to make it again."""
    lines = [f"{log.get('path')}: sha256 {log.get('sha256')}" for log in record.get("inputs", ())]
    command = f"<pre>{escape(str(record.get('command', '')))}</pre>"
    return section("Provenance", command + bullets(lines) + pairs(record.get("versions", {})))
