"""Tables and lines on an admittance replay: the comparison, latencies, parameters."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from vftcli.admittance.closed_loop import ClosedLoop, latencies
from vftcli.admittance.law import AXES
from vftcli.admittance.replay import Replay
from vftcli.outputs import Record
from vftcli.outputs.grid import Column, Grid, Rows, keyed_grid, latex
from vftcli.outputs.quantity import minus

TITLE = "The same force through every controller"  #: Of the comparison.


def number_form(form: str) -> Callable[[float], str]:
    """Format of a number with a true minus sign."""
    return lambda value: minus(format(value, form))


THIRD = number_form(".3f")

#: Key of a row → its column.
COLUMNS = {
    "controller": "controller",
    "alpha": Column("α", form=number_form("g")),
    "xi": Column("ξ", form=number_form(".3g")),
    "axis": Column("axis"),
    "drag": Column("drag"),
    "start_s": Column("start", "s", THIRD, seldom=True),
    "release_s": Column("release", "s", THIRD, seldom=True),
    "peak": Column("peak", "m, rad", number_form(".4f")),
    "time_to_peak_s": Column("to peak", "s", THIRD),
    "peak_advance_s": Column("advance", "s", THIRD, seldom=True),
    "overshoot": Column("overshoot", "%", lambda share: number_form(".1f")(100.0 * share)),
    "return_10_s": Column("back to 10 %", "s", THIRD, symbol="$t_{10}$"),
    "return_2_s": Column("back to 2 %", "s", THIRD, symbol="$t_2$"),
    "idle_s": Column("idle", "s", THIRD, seldom=True),
    "work_J": Column("work", "J", THIRD, seldom=True),
}
#: Latency of a contact → its heading.
LATENCIES = {
    "force": "force",
    "detection": "detected",
    "motion": "moved",
    "withdrawal": "withdrawal",
    "reaction": "detection to motion",
    "turn": "withdrawal to turn",
}
#: Meaning of headings in LaTeX.
RETURNS = (
    "t10, t2: from the release until the deviation stays within 10 % and 2 % of its value there",
)


def comparison_grid(rows: Sequence[Record], title: str = "") -> Grid:
    """Every controller on one force (Figs 7 and 10), sorted by axis and drag."""
    # Sorting keeps the order of the controllers within a drag.
    ordered = sorted(rows, key=lambda row: (AXES.index(row["axis"]), row["drag"]))
    return keyed_grid(COLUMNS, ordered, title, swatches=True)


def latency_rows(run: ClosedLoop) -> list[Record]:
    """The latencies of a closed loop as rows, None where something did not happen."""
    return [
        {
            "axis": AXES[entry.axis],
            **{f"{name}_s": getattr(entry, name) for name in LATENCIES},
            "at_rest_before": entry.rested,
        }
        for entry in latencies(run)
    ]


def latency_grid(run: ClosedLoop) -> Grid:
    """The latencies of a closed loop, from the true force and as in the paper."""
    columns = {
        "axis": "axis",
        **{f"{name}_s": Column(head, "s", ".3f") for name, head in LATENCIES.items()},
        "at_rest_before": Column("at rest before"),
    }
    return keyed_grid(columns, latency_rows(run), "Latencies of the closed loop")


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
    """Stability numbers before any motion: the worst axis of each kind."""
    rows: Rows = []
    kinds = (("position", slice(0, 3), "m"), ("rotation", slice(3, 6), "rad"))
    for controller in replay.controllers:
        for axes, part, unit in kinds:
            bound = np.min(controller.escape[part])
            each = controller.drag, controller.recovery
            numbers = (np.max(values[part]) for values in each)
            escape = f"{bound:.3g} {unit}" if np.isfinite(bound) else "none"
            rows.append((controller.name, axes, *numbers, escape))
    phases = (Column(head, form=".3g") for head in ("drag phase", "recovery, at the limit"))
    columns = "controller", "axes", *phases, Column("escape bound")
    return Grid(columns, rows, "2TsB/M + Ts²K/M, stable below 4", swatches=True)


def latex_text(replay: Replay) -> str:
    """Parameters (Tables III and IV of the paper) and comparison as LaTeX tables."""
    grids = [parameter_grid(replay)]
    if replay.rows:
        grids.append(replace(comparison_grid(replay.rows, TITLE), notes=RETURNS))
    return "\n".join(map(latex, grids))
