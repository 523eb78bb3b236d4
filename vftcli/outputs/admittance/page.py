"""The page of an admittance replay: Figs 6/9, 7/10, 12/13 and Tables III/IV for the user's log."""

import json
from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

import numpy as np

from vftcli.admittance.closed_loop import ClosedLoop
from vftcli.admittance.deviations_from_paper import DIFFERENCES
from vftcli.admittance.law import Controller
from vftcli.admittance.parameters import AXES
from vftcli.admittance.replay import Replay
from vftcli.outputs.admittance.files import COLUMNS, cells, latency_rows, ordered
from vftcli.outputs.page.page import asset, document, headline
from vftcli.outputs.page.payload import Chart, ChartLine, packed
from vftcli.outputs.page.sections import bullets, fact, html_table, pairs, provenance, remarks
from vftcli.outputs.palette import SPARE
from vftcli.signals.arrays import Array

UNITS = {"x": ("m", "rad"), "v": ("m/s", "rad/s"), "force": ("N", "N·m"), "energy": ("J", "J")}
"""Chart → unit of a translational and of a rotational axis."""


def render_admittance(
    replay: Replay, record: Mapping[str, Any], title: str, run: ClosedLoop | None = None
) -> str:
    """The page: self-contained, nothing is loaded from anywhere."""
    text = f"Admittance replay on {replay.robot.title or replay.robot.name}: {replay.source}"
    body = "".join(
        (
            headline(title, text),
            facts(replay),
            remarks(replay.notes),
            closed_loop(run),
            comparison(replay),
            charts_section(),
            parameters(replay),
            stability(replay),
            differences(),
            f"<h2>Conventions</h2>{pairs(record['conventions'])}",
            origin(record),
            f'<script type="application/json" id="data">{data(replay, run)}</script>',
            f"<script>{asset('page.js')}</script>",
        )
    )
    return document(f"{title}: admittance", body)


def facts(replay: Replay) -> str:
    """The robot, the span, the control period."""
    p, t = replay.parameters, replay.motion.t
    found = {
        "Robot": replay.robot.title or replay.robot.name,
        "Span": f"{t[0]:.3f} – {t[-1]:.3f} s",
        "Control period": f"{1e3 * p.period:g} ms",
        "Threshold": p.threshold_mode,
        "Controllers": f"{len(replay.controllers)}",
        "Poses out of reach": f"{int(np.count_nonzero(~replay.path.reached))}",
    }
    return f'<dl class="facts">{"".join(fact(*item) for item in found.items())}</dl>'


def closed_loop(run: ClosedLoop | None) -> str:
    """Latencies of the loop, as the paper reports them, or nothing without one."""
    if run is None:
        return ""
    rows = []
    for row in latency_rows(run):
        values = (row["force_s"], row["detection_s"], row["motion_s"], row["withdrawal_s"])
        shown = "".join(f"<td>{'–' if v is None else f'{v:.3f}'}</td>" for v in values)
        still = "yes" if row["at_rest_before"] else "no"
        rows.append(f'<tr><th scope="row">{row["axis"]}</th>{shown}<td>{still}</td></tr>')
    header = ["Axis", "force [s]", "detected [s]", "moved [s]", "withdrawal [s]", "at rest before"]
    caption = (
        "From the true force past its threshold to the estimate's, to 5 mm (0.02 rad) of the "
        "flange; from its fall below to the estimate's"
    )
    state = "" if run.stable else f"<p>The arm ran away at {run.t[-1]:.2f} s.</p>"
    return (
        f"<h2>Closed loop in simulation</h2>{state}{html_table(caption, header, rows)}"
        '<p class="soft">The paper measured 0.24 and 0.28 s to motion, 0.26 and 0.12 s to '
        "withdrawal on its UR5; its sensor's noise convention decides (docs/admittance.md).</p>"
    )


def comparison(replay: Replay) -> str:
    """Every controller on the same force, axis by axis (Figs 7 and 10)."""
    if not replay.rows:
        return "<h2>Comparison</h2><p>No axis was dragged.</p>"
    rows = []
    for row in ordered(replay.rows):
        first, *rest = cells(row)
        alpha = row["alpha"]
        name = first if alpha is None else label_of(replay, float(alpha), row["axis"])
        head = f'<th scope="row" data-swatch="{escape(name)}">{escape(name)}</th>'
        rows.append(f"<tr>{head}{''.join(f'<td>{escape(cell)}</td>' for cell in rest)}</tr>")
    table = html_table(
        "The same force through every controller", [heading for _, heading, _ in COLUMNS], rows
    )
    return (
        f"<h2>Comparison</h2>{table}"
        '<p class="soft">Times to the peak and idle times count from the start of a drag, return '
        "times from its release: the last moment at which the deviation is beyond that share of "
        "its value at the release. “–” did not happen before the next drag or the end. Advance: "
        "how much sooner than with the traditional controller the peak is reached. Overshoot: to "
        "the other side, as a share of the deviation at the release. Work: what the hand does on "
        "the arm while it drags.</p>"
    )


def label_of(replay: Replay, alpha: float, axis: str) -> str:
    """The name of the variable controller that has this α on an axis."""
    k = AXES.index(axis)
    names = [c.name for c in replay.controllers if c.kind == "variable" and c.alpha[k] == alpha]
    return names[0]


def charts_section() -> str:
    """Where the script puts the charts, and how to read them."""
    return (
        "<h2>Force and motion over time</h2>"
        '<p class="soft">Deviation of the flange (Figs 6b, 9b, 7, 10, 13), force with the '
        "threshold band (Figs 6a, 9a, 12), speed with its limit, and the Lyapunov function W of "
        "the recovery phases beside the printed V, which rises.</p>"
        '<p class="soft help">Drag to zoom in, double-click to see all, shift and drag to pan; '
        "keys + − ← → Home. Click a small chart to choose its axis.</p>"
        '<div id="toolbar"><div class="buttons" id="joints" role="group" aria-label="Axis">'
        '<span class="name">Axis</span></div>'
        '<div id="legend" role="group" aria-label="Controller"><span class="name">Controller</span>'
        '</div><div class="buttons"><button type="button" id="all">Whole span</button></div></div>'
        '<div id="overview"></div><div id="detail"></div>'
        "<noscript><p>The charts need JavaScript; the tables do not.</p></noscript>"
    )


def data(replay: Replay, run: ClosedLoop | None) -> str:
    """What the page's script draws; nothing in it can end the element."""
    t = replay.motion.t
    shown = {
        "joints": 6,
        "labels": list(AXES),
        "span": [float(t[0]), float(t[-1])],
        "charts": [
            packed(chart, t) | {"units": [UNITS[chart.key.split("-")[0]][k // 3] for k in range(6)]}
            for chart in charts(replay, run)
        ],
        "responses": [],
    }
    text = json.dumps(shown, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", " ").replace("\u2029", " ")


def colours(replay: Replay) -> list[str]:
    """The page's ink for the traditional controller, a colour for each variable one."""
    spare = iter(SPARE * len(replay.controllers))
    return [next(spare) if c.kind == "variable" else "ink" for c in replay.controllers]


def charts(replay: Replay, run: ClosedLoop | None = None) -> Iterator[Chart]:
    """The charts, top to bottom; one column an axis."""
    p, paint = replay.parameters, colours(replay)
    pairs_of = list(zip(replay.controllers, paint, strict=True))
    moved = () if run is None else (ChartLine("closed loop", padded(run.moved), "#8a929a", True),)
    shown = (*lines(pairs_of, replay.motion.x), *moved)
    yield Chart("x", "Deviation", "m", shown, height=1.6)
    true = () if run is None else (ChartLine("true force", padded(run.truth)),)
    yield Chart(
        "force",
        "Force on the robot",
        "N",
        (
            *true,
            ChartLine("force", padded(replay.wrench), "#8a929a"),
            ChartLine("force that enters the law", padded(replay.phases.force), SPARE[1]),
        ),
        np.asarray(p.threshold),
        "± threshold",
    )
    limit = np.where(np.isfinite(p.speed_limit), p.speed_limit, np.nan)
    speed = lines(pairs_of, replay.motion.v)
    yield Chart("v", "Velocity", "m/s", speed, limit, "± speed limit")
    yield Chart(
        "energy-w",
        "Lyapunov function W (recovery phases)",
        "J",
        lines(pairs_of, replay.lyapunov.corrected),
    )
    yield Chart(
        "energy-v", "The printed V (52): it rises", "J", lines(pairs_of, replay.lyapunov.printed)
    )


def padded(values: Array) -> Array:
    """Rows with an unknown one more: the last deviation follows from the force before it."""
    return np.vstack([values, np.full((1, values.shape[1]), np.nan)])


def lines(controllers: list[tuple[Controller, str]], values: Array) -> tuple[ChartLine, ...]:
    """One line a controller. (T+1, N, 6)"""
    return tuple(
        ChartLine(controller.name, values[:, n], colour)
        for n, (controller, colour) in enumerate(controllers)
    )


def parameters(replay: Replay) -> str:
    """Tables III and IV with the values used."""
    p = replay.parameters
    rows = []
    for k, axis in enumerate(AXES):
        unit = ("N", "m/s") if k < 3 else ("N·m", "rad/s")
        limit = p.speed_limit[k]  # type: ignore[index]
        values = (
            f"{p.mass[k]:g}",
            f"{p.damping[k]:g}",
            f"{p.stiffness[k]:g}",
            f"{p.alpha[k]:g}",
            f"{p.damping_ratio[k]:.3g}",
            f"{p.threshold[k]:g} {unit[0]}",
            f"{limit:g} {unit[1]}" if np.isfinite(limit) else "none",
        )
        tail = "".join(f"<td>{escape(value)}</td>" for value in values)
        rows.append(f'<tr><th scope="row">{axis}</th>{tail}</tr>')
    header = ["Coordinates", "M_d", "B_d", "K_d", "α", "ξ", "F_tsd", "Ẋ_tsd"]
    source = p.source or "the command line"
    return f"<h2>Parameters</h2>{html_table(f'Values used; {source}', header, rows)}"


def stability(replay: Replay) -> str:
    """The numbers that decide before anything moves."""
    rows = []
    for verdict in replay.verdicts:
        for k, axes in ((0, "position"), (3, "rotation")):
            part = slice(k, k + 3)
            unit = "m" if k == 0 else "rad"
            bound = float(np.min(verdict.escape[part]))
            escape_text = f"{bound:.3g} {unit}" if np.isfinite(bound) else "none"
            numbers = (float(np.max(verdict.drag[part])), float(np.max(verdict.recovery[part])))
            shown = "".join(f"<td>{value:.3g}</td>" for value in numbers)
            name = escape(verdict.controller.name)
            rows.append(
                f'<tr><th scope="row" data-swatch="{name}">{name}</th><td class="text">{axes}</td>'
                f"{shown}<td>{escape_text}</td></tr>"
            )
    header = ["Controller", "Axes", "drag phase", "recovery, at the limit", "escape bound"]
    table = html_table("2TsB/M + Ts²K/M, stable below 4", header, rows, words=2)
    return (
        f"<h2>Stability before motion</h2>{table}"
        '<p class="soft">The escape bound is the largest deviation from which a release at rest '
        "would not run away if there were no speed limit.</p>"
    )


def differences() -> str:
    """What differs from the paper, in plain words."""
    listed = bullets(f"{what} {why}" for what, why in DIFFERENCES)
    return f"<h2>What differs from the paper, and why</h2>{listed}"


def origin(record: Mapping[str, Any]) -> str:
    """Command, versions, inputs."""
    if record["input"] is None:
        versions = ", ".join(f"{name} {v}" for name, v in record["versions"].items())
        table = {"Command": record["command"] or "from Python", "Versions": versions}
        return f"<h2>Provenance</h2>{pairs(table)}"
    return provenance(record)
