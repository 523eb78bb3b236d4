"""Outputs of an admittance replay: page, motion, comparison, figures, `run.json`."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from vftcli.admittance.closed_loop import ClosedLoop, Replayed, latencies
from vftcli.admittance.law import AXES, PER_AXIS, Controller
from vftcli.admittance.replay import Replay
from vftcli.outputs import Record
from vftcli.outputs.charts import DASHES, GREY, SPARE, Chart, ChartLine
from vftcli.outputs.examination import health_record
from vftcli.outputs.files import SEAL, OutputFolder, table_file
from vftcli.outputs.grid import Column, Grid, Rows, csv_rows, keyed_grid, latex
from vftcli.outputs.page.shell import page
from vftcli.outputs.paper import (
    NARROW,
    Drawing,
    figure_files,
    line_figure,
    plots_of,
    write_figures,
)
from vftcli.outputs.run_record import (
    envelope,
    input_record,
    log_entry,
    log_remarks,
    robot_record,
    seal,
    to_json,
)
from vftcli.signals.arrays import Array
from vftcli.signals.parsing import counted
from vftcli.signals.remarks import sentence
from vftcli.signals.shown import frame_of, per_joint
from vftcli.signals.wrench import per_axis

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "One force through every controller"


#: Key of a row → its column.
COLUMNS = {
    "controller": "controller",
    "alpha": Column("α", form="g"),
    "xi": Column("ξ", form=".3g"),
    "axis": Column("axis"),
    "drag": Column("drag"),
    "start_s": Column("start", "s", ".3f", seldom=True),
    "release_s": Column("release", "s", ".3f", seldom=True),
    "peak": Column("peak", "m, rad", ".4f"),
    "time_to_peak_s": Column("at", "s", ".3f"),
    "peak_advance_s": Column("advance", "s", ".3f", seldom=True),
    "overshoot": Column("overshoot", "%", lambda share: f"{100.0 * share:.1f}"),
    "return_10_s": Column("to 10 %", "s", ".3f", symbol="$t_{10}$"),
    "return_2_s": Column("to 2 %", "s", ".3f", symbol="$t_2$"),
    "idle_s": Column("idle", "s", ".3f", seldom=True),
    "work_J": Column("work", "J", ".3f", seldom=True),
}
#: Key of a latency → its column; it ends in the unit.
LATENCIES = {
    "force_s": Column("force", "s", ".3f"),
    "detection_s": Column("detected", "s", ".3f"),
    "motion_s": Column("moved", "s", ".3f"),
    "withdrawal_s": Column("withdrawal", "s", ".3f"),
    "reaction_s": Column("to motion", "s", ".3f"),
    "turn_s": Column("to turn", "s", ".3f"),
}
LATENCY_TITLE = "Latencies; to motion: from detection; to turn: from withdrawal"
#: Below the table of a replay.
LEGEND = (
    "drag: number of the push along that axis; peak: its largest deviation; "
    "at: time since it began; to 10 %, to 2 %: time from its release until the "
    "deviation stays within that share of its value at release; –: not in this "
    "log, or released near zero. α, ξ: docs/admittance.md"
)
#: Meaning of headings in LaTeX.
RETURNS = (
    "t10, t2: from the release until the deviation stays within 10 % and 2 % of its value there",
)


def comparison_grid(rows: Sequence[Record], title: str = "") -> Grid:
    """Every controller on one force (Figs 7, 10), by axis and drag."""
    # Sorting keeps the order of the controllers within a drag.
    ordered = sorted(rows, key=lambda row: (AXES.index(row["axis"]), row["drag"]))
    return keyed_grid(COLUMNS, ordered, title, swatches=True)


def latency_rows(run: ClosedLoop) -> list[Record]:
    """A closed loop's latencies as rows, None for none."""
    return [
        {
            "axis": AXES[entry.axis],
            **{key: getattr(entry, key.removesuffix("_s")) for key in LATENCIES},
            "at_rest_before": entry.rested,
        }
        for entry in latencies(run)
    ]


def latency_grid(run: ClosedLoop) -> Grid:
    """The latencies of a closed loop."""
    columns = {"axis": "axis", **LATENCIES, "at_rest_before": Column("was at rest")}
    return keyed_grid(columns, latency_rows(run), LATENCY_TITLE)


def parameter_grid(replay: Replay) -> Grid:
    """Tables III and IV of the paper with the values used."""
    p = replay.parameters
    rows: Rows = []
    for k, (axis, limit) in enumerate(zip(AXES, np.broadcast_to(p.speed_limit, 6), strict=True)):
        force, speed = ("N", "m/s") if k < 3 else ("N·m", "rad/s")
        numbers = (float(v[k]) for v in (p.mass, p.damping, p.stiffness, p.alpha))
        ratio, threshold = f"{np.asarray(p.xi)[k]:.3g}", f"{p.threshold[k]:g} {force}"
        bound = f"{limit:g} {speed}" if np.isfinite(limit) else "none"
        rows.append((axis, *numbers, ratio, threshold, bound))
    heads = {
        **{f"{letter}_d": f"${letter}_d$" for letter in "MBK"},
        "α": "",
        "ξ": "",
        "F_tsd": r"$F_\mathrm{tsd}$",
        "Ẋ_tsd": r"$\dot X_\mathrm{tsd}$",
    }
    columns = "coordinates", *(Column(h, form="g", symbol=s) for h, s in heads.items())
    how = f"{1e3 * p.period:g} ms, {p.threshold_mode} threshold"
    return Grid(columns, rows, f"Values used; {p.source or 'the command line'}; {how}")


def stability_grid(replay: Replay) -> Grid:
    """Stability numbers of the worst axis of each kind."""
    rows: Rows = []
    kinds = (("position", slice(0, 3), "m"), ("rotation", slice(3, 6), "rad"))
    for controller, (axes, part, unit) in product(replay.controllers, kinds):
        bound = np.min(controller.escape[part])
        worst = (np.max(values[part]) for values in (controller.drag, controller.recovery))
        escape = f"{bound:.3g} {unit}" if np.isfinite(bound) else "none"
        rows.append((controller.name, axes, *worst, escape))
    phases = (Column(head, form=".3g") for head in ("drag phase", "recovery, at the limit"))
    columns = "controller", "axes", *phases, Column("escape bound")
    return Grid(columns, rows, "2TsB/M + Ts²K/M, stable below 4", swatches=True)


def latex_text(replay: Replay) -> str:
    """Parameters and comparison as LaTeX tables."""
    grids = [parameter_grid(replay)]
    if replay.rows:
        grids.append(replace(comparison_grid(replay.rows, TITLE), notes=RETURNS))
    return "\n".join(map(latex, grids))


FILES = ("index.html", "motion.parquet", "comparison.csv", "comparison.json", SEAL)
REPLAY_FIGURES = ("release",)
CONVENTIONS = {
    "deviation": "X̃ of the flange point from the target pose X_d, base axes; rotation as the "
    "vector log(R R_dᵀ)",
    "force": "force on the robot and moment about the flange point, base axes",
    "row": "a deviation follows from the force of the row before it",
    "units": "s, m, rad, N, N·m, J",
}
#: Key of a controller's record → field.
CONTROLLER = {
    "name": "name", "kind": "kind", "alpha": "alpha", "xi": "xi", "recovery_damping": "damping",
    "discrete_number_drag": "drag", "discrete_number_recovery": "recovery",
    "escape_bound": "escape",
}  # fmt: skip


def files_of_replay(form: str | None) -> list[str]:
    """Files of a replay's folder; `form` is the figures' format."""
    return [*FILES, *figure_files(form, REPLAY_FIGURES)]


def write_admittance(
    path: Path, found: Replayed, command: str = "", force: bool = False, form: str | None = None
) -> None:
    """Write the folder of a replay, all or nothing."""
    replay, run, record = found.replay, found.run, admittance_record(found, command)
    title = found.recording.name if found.recording is not None else "release"
    if run is not None and run.simulation is not None:
        title = f"{run.simulation.scenario.name}, closed loop"
    with OutputFolder(path, force, files_of_replay(form)) as folder:
        folder.write("index.html", render_admittance(found, record, title))
        keys = replay.rows[0] if replay.rows else COLUMNS
        folder.write("comparison.csv", csv_rows(replay.rows, keys))
        folder.write("comparison.json", to_json(replay.rows))
        with table_file(folder / "motion.parquet") as file:
            motion_table(replay).write_parquet(file, compression="zstd")
        if form is not None:
            write_figures(folder, replay_figures(replay, run), form)
        seal(folder, SEAL, record)


def motion_table(replay: Replay) -> pl.DataFrame:
    """Everything along time, flat columns; null where unknown.

    ``t`` [s]; ``force/fx``… [N, N·m]; ``x/<controller>/x``… [m, rad];
    ``v/<controller>/x``…; ``q/<controller>/1``… [rad]; ``reached/<controller>`` 1 or 0;
    ``logged/x``… [m, rad].
    """
    motion, columns = replay.motion, {"t": replay.motion.t}
    columns |= per_axis("force", padded(replay.wrench))
    for n, controller in enumerate(replay.controllers):
        # A slash would add a level to the column's name.
        label = controller.name.replace(" ", "").replace("/", "-")
        for k, axis in enumerate(AXES):
            columns[f"x/{label}/{axis}"] = motion.x[:, n, k]
            columns[f"v/{label}/{axis}"] = motion.v[:, n, k]
        columns |= per_joint(f"q/{label}", replay.path.q[:, n])
        columns[f"reached/{label}"] = replay.path.reached[:, n].astype(np.float64)
    if replay.logged is not None:
        columns |= {f"logged/{a}": padded(replay.logged[:, k]) for k, a in enumerate(AXES)}
    return frame_of(columns.items())


def admittance_record(made: Replayed, command: str) -> Record:
    """Content of a replay's `run.json`."""
    replay, recording, run, examinations = made
    p, logs, loop = replay.parameters, [recording] if recording else [], None
    if run is not None:
        loop = {
            "controller": run.controller.name,
            "stable": run.stable,
            "zero_removed": run.zero,
            "poses_out_of_reach": np.count_nonzero(~run.reached),
            "latencies": latency_rows(run),
        }
        if (simulated := run.simulation) is not None:
            loop |= {"scenario": simulated.scenario.name, "seed": simulated.seed}
    found = {
        "rows": replay.rows,
        "examination": health_record(examinations),
        "input": recording and input_record(recording),
        "robot": robot_record(replay.robot),
        "force": replay.source,
        "closed_loop": loop,
        "start_rad": replay.start,
        "parameters": {
            "axes": AXES,
            **{name: getattr(p, name) for name in PER_AXIS},
            "period_s": p.period,
            "threshold_mode": p.threshold_mode,
            "source": p.source,
        },
        "controllers": [
            {key: getattr(controller, field) for key, field in CONTROLLER.items()}
            for controller in replay.controllers
        ],
        "conventions": CONVENTIONS,
        **log_remarks(logs),
    }
    return envelope(command, list(map(log_entry, logs)), replay.remarks, found)


def render_admittance(found: Replayed, record: Record, title: str) -> str:
    """The page."""
    replay, _, run, examinations = found
    t, p, lost = replay.motion.t, replay.parameters, np.count_nonzero(~replay.path.reached)
    eyebrow = (
        title,
        replay.robot.title or replay.robot.name,
        f"{t[0]:.3f} – {t[-1]:.3f} s",
        str(replay.source),
        f"control period {1e3 * p.period:g} ms",
        f"threshold {p.threshold_mode}",
        f"{lost} poses out of reach" if lost else "",
    )
    controllers = counted(len(replay.controllers), "admittance controller")
    # A variable controller by its name in the charts' legend.
    variable = [c for c in replay.controllers if c.kind == "variable"]
    names = {(axis, c.alpha[k]): c.name for c in variable[::-1] for k, axis in enumerate(AXES)}
    named = [
        row | {"controller": names.get((row["axis"], row["alpha"]), str(row["controller"]))}
        for row in replay.rows
    ]
    return page(
        "admittance.html",
        f"{title}: admittance",
        charts(replay, run),
        {controller.name: (colour, "") for controller, colour in painted(replay)},
        eyebrow=eyebrow,
        headline=f"One force through {controllers}.",
        warnings=[sentence(remark) for remark in replay.remarks if remark.level == "warning"],
        run=run,
        latencies=run and latency_grid(run),
        comparison=comparison_grid(named, TITLE),
        parameters=parameter_grid(replay),
        stability=stability_grid(replay),
        examinations=examinations,
        remarks=replay.remarks,
        record=record,
    )


def painted(replay: Replay) -> list[tuple[Controller, str]]:
    """Every controller with its colour; the traditional is ink."""
    spare = iter(SPARE * len(replay.controllers))
    return [(c, next(spare) if c.kind == "variable" else "ink") for c in replay.controllers]


def charts(replay: Replay, run: ClosedLoop | None = None) -> list[Chart]:
    """The charts, top to bottom, a panel an axis."""
    p = replay.parameters

    def lines(values: Array) -> tuple[ChartLine, ...]:
        return tuple(
            ChartLine(controller.name, values[:, n], colour, DASHES[n % len(DASHES)])
            for n, (controller, colour) in enumerate(painted(replay))
        )

    deviation = lines(replay.motion.x)
    force = [
        ChartLine("force", padded(replay.wrench), GREY, "1.5 2"),
        ChartLine("force that enters the law", padded(replay.phases.force), SPARE[1]),
    ]
    if run is not None:
        deviation += (ChartLine("closed loop", padded(run.moved), GREY, "5 3"),)
        force.insert(0, ChartLine("true force", padded(run.truth), dash="2 2"))
    limit = np.where(np.isfinite(p.speed_limit), p.speed_limit, np.nan)
    w, v = replay.lyapunov
    force_band, speed_band = (x if np.isfinite(x).any() else None for x in (p.threshold, limit))
    return [
        Chart(key, title, (unit,) * 3 + (turning,) * 3, AXES, replay.motion.t, tuple(shown),
              band=band, band_label=label)
        for key, title, unit, turning, shown, band, label in (
            ("x", "Deviation", "m", "rad", deviation, None, ""),
            ("force", "Force on the robot", "N", "N·m", force, force_band, "± threshold"),
            ("v", "Velocity", "m/s", "rad/s", lines(replay.motion.v), speed_band, "± speed limit"),
            ("energy-w", "Lyapunov function W (recovery phases)", "J", "J", lines(w), None, ""),
            ("energy-v", "The printed V (52): it rises", "J", "J", lines(v), None, ""),
        )
    ]  # fmt: skip


def padded(values: Array) -> Array:
    """Rows and an unknown one: deviations follow from the force."""
    return np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])


def replay_figures(replay: Replay, run: ClosedLoop | None = None) -> dict[str, Drawing]:
    """Force and deviation along dragged axes, if any."""
    moved = [k for k in range(len(AXES)) if np.nanmax(np.abs(replay.motion.x[:, :, k])) > 0.0]
    dragged = {row["axis"] for row in replay.rows}
    shown = [k for k in moved if AXES[k] in dragged] or moved

    def draw(width: float) -> "Figure":
        deviation, force, *_ = charts(replay, run)
        columns = min(len(shown), 3 if width > NARROW else 2)
        plots = []
        # The plots of an axis are below one another.
        for k in range(0, len(shown), columns):
            for chart in (force, deviation) if np.any(replay.wrench) else (deviation,):
                plots += plots_of(chart, only=shown[k : k + columns])
        return line_figure(width, plots, columns=columns)

    title = f"Deviation of the flange from its target, {replay.robot.name}, base axes"
    return {"release": Drawing(title, draw)} if shown else {}
