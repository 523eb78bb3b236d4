"""The page of an admittance replay: Figs 6/9, 7/10, 12/13 and Tables III/IV for the user's log."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.admittance.closed_loop import ClosedLoop
from vftcli.admittance.law import Controller
from vftcli.admittance.parameters import AXES
from vftcli.admittance.replay import Replay
from vftcli.doctor.examination import Examination
from vftcli.outputs.admittance.recording import colours, padded
from vftcli.outputs.admittance.tables import (
    comparison_grid,
    latency_grid,
    parameter_grid,
    stability_grid,
)
from vftcli.outputs.grid import html
from vftcli.outputs.page.charts import Chart, ChartLine, packed
from vftcli.outputs.page.shell import (
    bullets,
    chart_places,
    document,
    fact_list,
    headline,
    health,
    pairs,
    provenance,
    remarks,
    soft,
)
from vftcli.outputs.palette import SPARE
from vftcli.signals.arrays import Array

UNITS = {"x": ("m", "rad"), "v": ("m/s", "rad/s"), "force": ("N", "N·m"), "energy": ("J", "J")}
"""Chart → unit of a translational and of a rotational axis."""


def deviations_from_paper() -> dict[str, str]:
    """What is done otherwise than in the paper → why, from the table beside this file."""
    text = Path(__file__).with_name("deviations_from_paper.toml").read_text(encoding="utf-8")
    return {entry["what"]: entry["why"] for entry in tomllib.loads(text)["difference"]}


def render_admittance(
    replay: Replay,
    record: Mapping[str, Any],
    title: str,
    run: ClosedLoop | None = None,
    examinations: Sequence[Examination] = (),
) -> str:
    """The page: self-contained, nothing is loaded from anywhere."""
    text = f"Admittance replay on {replay.robot.title or replay.robot.name}: {replay.source}"
    differences = bullets(f"{what} {why}" for what, why in deviations_from_paper().items())
    parts = (
        headline(title, text),
        facts_section(replay),
        health(examinations),
        remarks(replay.remarks),
        closed_loop_section(run),
        comparison_section(replay),
        "<h2>Force and motion over time</h2>",
        soft(
            "Deviation of the flange (Figs 6b, 9b, 7, 10, 13), force with the threshold band (Figs "
            "6a, 9a, 12), speed with its limit, and the Lyapunov function W of the recovery phases "
            "beside the printed V, which rises."
        ),
        chart_places("Axis", "Controller"),
        f"<h2>Parameters</h2>{html(parameter_grid(replay))}",
        f"<h2>Stability before motion</h2>{html(stability_grid(replay))}",
        soft(
            "The escape bound is the largest deviation from which a release at rest would not run "
            "away if there were no speed limit."
        ),
        f"<h2>What differs from the paper, and why</h2>{differences}",
        f"<h2>Conventions</h2>{pairs(record['conventions'])}",
        provenance(record),
    )
    return document(f"{title}: admittance", "".join(parts), payload(replay, run))


def facts_section(replay: Replay) -> str:
    """The robot, the span, the control period."""
    p, t = replay.parameters, replay.motion.t
    return fact_list(
        {
            "Robot": replay.robot.title or replay.robot.name,
            "Span": f"{t[0]:.3f} – {t[-1]:.3f} s",
            "Control period": f"{1e3 * p.period:g} ms",
            "Threshold": p.threshold_mode,
            "Controllers": f"{len(replay.controllers)}",
            "Poses out of reach": f"{int(np.count_nonzero(~replay.path.reached))}",
        }
    )


def closed_loop_section(run: ClosedLoop | None) -> str:
    """Latencies of the loop, as the paper reports them, or nothing without one."""
    if run is None:
        return ""
    state = "" if run.stable else f"<p>The arm ran away at {run.t[-1]:.2f} s.</p>"
    words = soft(
        "The paper measured 0.24 and 0.28 s to motion, 0.26 and 0.12 s to withdrawal on its UR5; "
        "its sensor's noise convention decides (docs/admittance.md)."
    )
    return f"<h2>Closed loop in simulation</h2>{state}{html(latency_grid(run))}{words}"


def comparison_section(replay: Replay) -> str:
    """Every controller on the same force, axis by axis (Figs 7 and 10)."""
    if not replay.rows:
        return "<h2>Comparison</h2><p>No axis was dragged.</p>"

    def name_of(row: Mapping[str, Any]) -> str:
        """A variable controller by the name that the charts' legend has for its α."""
        k, alpha = AXES.index(row["axis"]), row["alpha"]
        for controller in replay.controllers if alpha is not None else ():
            if controller.kind == "variable" and controller.alpha[k] == alpha:
                return controller.name
        return str(row["controller"])

    grid = comparison_grid(replay.rows, name_of, "The same force through every controller")
    words = soft(
        "Times to the peak and idle times count from the start of a drag, return times from its "
        "release: the last moment at which the deviation is beyond that share of its value at the "
        "release. “–” did not happen before the next drag or the end. Advance: how much sooner "
        "than with the traditional controller the peak is reached. Overshoot: to the other side, "
        "as a share of the deviation at the release. Work: what the hand does on the arm while it "
        "drags."
    )
    return f"<h2>Comparison</h2>{html(grid)}{words}"


def payload(replay: Replay, run: ClosedLoop | None) -> dict[str, Any]:
    """The charts with their units, as the page's script takes them."""
    t = replay.motion.t
    return {
        "joints": 6,
        "labels": list(AXES),
        "span": [float(t[0]), float(t[-1])],
        "charts": [
            packed(chart, t) | {"units": [UNITS[chart.key.split("-")[0]][k // 3] for k in range(6)]}
            for chart in charts(replay, run)
        ],
        "responses": [],
    }


def charts(replay: Replay, run: ClosedLoop | None = None) -> Iterator[Chart]:
    """The charts, top to bottom; one column an axis."""
    p, paint = replay.parameters, colours(replay, "ink")
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


def lines(controllers: list[tuple[Controller, str]], values: Array) -> tuple[ChartLine, ...]:
    """One line a controller. (T+1, N, 6)"""
    return tuple(
        ChartLine(controller.name, values[:, n], colour)
        for n, (controller, colour) in enumerate(controllers)
    )
