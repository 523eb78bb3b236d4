"""The page of an admittance replay: Figs 6/9, 7/10, 12/13 and Tables III/IV for the user's log."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.admittance.closed_loop import ClosedLoop
from vftcli.admittance.law import Controller
from vftcli.admittance.parameters import AXES
from vftcli.admittance.replay import Replay
from vftcli.doctor.examination import Examination
from vftcli.outputs.admittance.tables import (
    comparison_grid,
    latency_grid,
    parameter_grid,
    stability_grid,
)
from vftcli.outputs.page.charts import DASHES, Chart, ChartLine
from vftcli.outputs.page.shell import (
    alarms,
    all_remarks,
    bullets,
    document,
    health,
    large,
    lead,
    multiples,
    provenance,
    section,
    soft,
    table,
    top,
)
from vftcli.outputs.palette import SPARE
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import Remark, sentence

#: Chart → unit of a translational and of a rotational axis.
UNITS = {"x": ("m", "rad"), "v": ("m/s", "rad/s"), "force": ("N", "N·m"), "energy": ("J", "J")}


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
    differences = bullets(f"{what} {why}" for what, why in deviations_from_paper().items())
    drawn = charts(replay, run)
    parts = (
        alarms(examinations),
        top(eyebrow(replay, title), headline(replay), lead(*map(sentence, told(replay)))),
        closed_loop_section(run),
        comparison_section(replay),
        "<h2>Force and motion over time</h2>",
        *map(chart_section, drawn),
        soft(
            "Deviation of the flange (Figs 6b, 9b, 7, 10, 13), force with the threshold band (Figs "
            "6a, 9a, 12), speed with its limit, and the Lyapunov function W of the recovery phases "
            "beside the printed V, which rises."
        ),
        "<h2>Details</h2>",
        section("Parameters", table(parameter_grid(replay))),
        section(
            "Stability before motion",
            table(stability_grid(replay))
            + soft(
                "The escape bound is the largest deviation from which a release at rest would not "
                "run away if there were no speed limit."
            ),
        ),
        section("What differs from the paper, and why", differences),
        health(examinations, opened=True),
        all_remarks(replay.remarks),
        provenance(record),
    )
    styles = {controller.name: (colour, "") for controller, colour in painted(replay)}
    return document(f"{title}: admittance", "".join(parts), drawn, styles)


def headline(replay: Replay) -> str:
    """What was replayed, in one sentence."""
    count = len(replay.controllers)
    return f"The same force through {count} admittance controller{'s' * (count > 1)}."


def told(replay: Replay) -> list[Remark]:
    """Remarks that may change what a reader makes of the numbers."""
    return [remark for remark in replay.remarks if remark.level == "warning"]


def eyebrow(replay: Replay, title: str) -> tuple[str, ...]:
    """The log, the robot, the span, the force, the control period."""
    p, t = replay.parameters, replay.motion.t
    lost = int(np.count_nonzero(~replay.path.reached))
    return (
        title,
        replay.robot.title or replay.robot.name,
        f"{t[0]:.3f} – {t[-1]:.3f} s",
        str(replay.source),
        f"control period {1e3 * p.period:g} ms",
        f"threshold {p.threshold_mode}",
        f"{lost} poses out of reach" if lost else "",
    )


def chart_section(chart: Chart) -> str:
    """One quantity axis by axis; the deviation is open at once."""
    return section(
        chart.title, multiples(chart) + large(chart), name=chart.key, opened=chart.key == "x"
    )


def closed_loop_section(run: ClosedLoop | None) -> str:
    """Latencies of the loop, or nothing without one."""
    if run is None:
        return ""
    state = "" if run.stable else f"<p>The arm ran away at {run.t[-1]:.2f} s.</p>"
    words = soft(
        "The paper measured 0.24 and 0.28 s from detection to motion, 0.26 and 0.12 s from "
        "withdrawal to the turn on its UR5 (docs/admittance.md)."
    )
    return f"<h2>Closed loop in simulation</h2>{state}{table(latency_grid(run))}{words}"


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
    return f"<h2>Comparison</h2>{table(grid)}{words}"


def painted(replay: Replay) -> list[tuple[Controller, str]]:
    """Every controller with its colour: the traditional one's is that of the page's ink."""
    # Every variable controller its own colour, again from the start when there are no more.
    spare = iter(SPARE * len(replay.controllers))
    return [(c, next(spare) if c.kind == "variable" else "ink") for c in replay.controllers]


def charts(replay: Replay, run: ClosedLoop | None = None) -> list[Chart]:
    """The charts, top to bottom; one panel an axis, three axes on one scale."""
    p, paint = replay.parameters, painted(replay)
    moved = () if run is None else (ChartLine("closed loop", padded(run.moved), "#8a929a", "5 3"),)
    true = () if run is None else (ChartLine("true force", padded(run.truth), dash="2 2"),)
    force = (
        *true,
        ChartLine("force", padded(replay.wrench), "#8a929a", "1.5 2"),
        ChartLine("force that enters the law", padded(replay.phases.force), SPARE[1]),
    )
    limit = np.where(np.isfinite(p.speed_limit), p.speed_limit, np.nan)
    found = (
        ("x", "Deviation", (*lines(paint, replay.motion.x), *moved), None, ""),
        ("force", "Force on the robot", force, np.asarray(p.threshold), "± threshold"),
        ("v", "Velocity", lines(paint, replay.motion.v), limit, "± speed limit"),
        (
            "energy-w",
            "Lyapunov function W (recovery phases)",
            lines(paint, replay.lyapunov.corrected),
            None,
            "",
        ),
        (
            "energy-v",
            "The printed V (52): it rises",
            lines(paint, replay.lyapunov.printed),
            None,
            "",
        ),
    )
    return [
        Chart(
            key,
            title,
            tuple(UNITS[key.split("-")[0]][k // 3] for k in range(6)),
            AXES,
            replay.motion.t,
            shown,
            families=(1, 1, 1, 2, 2, 2),
            band=band if band is not None and np.isfinite(band).any() else None,
            band_label=label,
        )
        for key, title, shown, band, label in found
    ]


def padded(values: Array) -> Array:
    """Rows with an unknown one more: the last deviation follows from the force before it."""
    return np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])


def lines(controllers: list[tuple[Controller, str]], values: Array) -> tuple[ChartLine, ...]:
    """One line a controller, each with its own dashes. (T+1, N, 6)"""
    dashes = ("", *DASHES)
    return tuple(
        ChartLine(controller.name, values[:, n], colour, dashes[n % len(dashes)])
        for n, (controller, colour) in enumerate(controllers)
    )
