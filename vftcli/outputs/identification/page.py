"""The page of an identification: residuals, numbers with their spread, residual over velocity."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
import polars as pl

from vftcli.identification.result import Identification, Trace
from vftcli.outputs.grid import Column, Entry, Grid, html, joint_columns, signed
from vftcli.outputs.identification.tables import residual_rows
from vftcli.outputs.page.charts import Chart, ChartLine, packed
from vftcli.outputs.page.shell import (
    bullets,
    chart_places,
    document,
    folded,
    headline,
    pairs,
    remarks,
)
from vftcli.outputs.palette import SPARE

DOTS = 600
"""Samples drawn in a residual-over-velocity plot."""

WIDTH, HEIGHT, EDGE = 360, 220, 40
"""Size of such a plot and room for its numbers. [px]"""


def render_identification(found: Identification, record: Mapping[str, Any]) -> str:
    """The page as text: self-contained, nothing is loaded from anywhere."""
    logs = ", ".join(dict.fromkeys(t.recording.name for t in found.traces)) or found.robot.name
    text = f"{found.robot.title}: method {found.method}, from {logs}"
    parts = (
        headline(found.robot.name, text),
        remarks(found.remarks),
        residual_section(found),
        velocity_section(found),
        parameter_section(found),
        shape_choice_section(found.shape_choices),
        base_section(found.base),
        series_section(found),
        "<h2>Signal processing</h2>",
        pairs(found.processing),
        provenance_section(record),
    )
    data = payload(found) if found.traces else None
    return document(f"{found.robot.name}: identification", "".join(parts), data)


def residual_section(found: Identification) -> str:
    """RMS per joint of every log, identified beside profile."""
    rows: list[tuple[Entry, ...]] = [
        (*names, *values, float(np.mean(values))) for names, values in residual_rows(found)
    ]
    if not rows:
        return ""
    numbers = (*joint_columns(found.robot.joints, form=signed), Column("mean", form=signed))
    grid = Grid(
        title="RMS of measured less predicted torque in N·m, from the first to the last movement",
        columns=(*words("Log", "Role", "Model"), *numbers),
        rows=tuple(rows),
    )
    return f"<h2>Residuals</h2>{html(grid)}"


def words(*heads: str) -> tuple[Column, ...]:
    """Columns of words."""
    return tuple(Column(head, words=True) for head in heads)


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
    numbers = {"value": "Value", "sd": "sd", "profile": "Profile"}
    value, sd, profile = (Column(head, form=signed) for head in numbers.values())
    grid = Grid(
        title="One row a number",
        columns=(
            *words("Number"),
            Column("Joint"),
            value,
            sd,
            Column("Unit"),
            profile,
            Column("Determined"),
        ),
        rows=tuple(
            (
                row["parameter"],
                f"J{row['joint']}",
                row["value"],
                row["sd"],
                row["unit"],
                row["profile"],
                yes_or_no(row["determined"]),
            )
            for row in found.parameters.iter_rows(named=True)
        ),
    )
    return f"<h2>Identified numbers</h2>{html(grid)}"


def yes_or_no(truth: bool) -> str:
    """A truth in words."""
    return "yes" if truth else "no"


def shape_choice_section(choices: pl.DataFrame) -> str:
    """How the friction models competed, folded away."""
    if choices.is_empty():
        return ""
    grid = Grid(
        title="RMS on the fifth of the log left out; the simplest within 1 % of the best is chosen",
        columns=(
            *words("Friction"),
            Column("Joint"),
            Column("RMS [N·m]", form=signed),
            Column(""),
        ),
        rows=tuple(
            (r["friction"], f"J{r['joint']}", r["cv_rms_Nm"], "chosen" if r["chosen"] else "")
            for r in choices.iter_rows(named=True)
        ),
    )
    return folded("Friction models compared", html(grid))


def base_section(base: pl.DataFrame | None) -> str:
    """Base parameters, folded away."""
    if base is None:
        return ""
    value, sd = (Column(head, form=signed) for head in ("Value (SI)", "sd"))
    grid = Grid(
        title="Weighted least squares, before physical consistency",
        columns=(*words("Parameter"), value, sd, Column("Determined")),
        rows=tuple(
            (r["parameter"], r["value"], r["sd"], yes_or_no(r["determined"]))
            for r in base.iter_rows(named=True)
        ),
    )
    return folded(f"Base parameters ({len(base)})", html(grid))


def series_section(found: Identification) -> str:
    """Where the script draws torques over time."""
    if not found.traces:
        return ""
    name = escape(shown_trace(found).recording.name)
    return (
        f"<h2>Torques over time: {name}</h2>"
        f'<p class="soft">The Rerun recording holds every log.</p>{chart_places()}'
    )


def shown_trace(found: Identification) -> Trace:
    """The log that is drawn over time: the first held-out one, else the first."""
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
        Chart("dq", "Velocity", "rad/s", (ChartLine("velocity", trace.dq),)),
    )
    return {
        "joints": found.robot.joints,
        "span": [float(trace.t[0]), float(trace.t[-1])],
        "charts": [packed(chart, trace.t) for chart in charts],
        "responses": [],
    }


def provenance_section(record: Mapping[str, Any]) -> str:
    """Command, versions and digests."""
    lines = [f"{log.get('path')}: sha256 {log.get('sha256')}" for log in record.get("inputs", ())]
    command = f"<pre>{escape(str(record.get('command', '')))}</pre>"
    return f"<h2>Provenance</h2>{command}{bullets(lines)}{pairs(record.get('versions', {}))}"
