"""Tables and lines on an admittance replay: the comparison, latencies, parameters."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from vftcli.admittance.closed_loop import ClosedLoop, latencies
from vftcli.admittance.law import AXES
from vftcli.admittance.replay import Replay
from vftcli.outputs import Record
from vftcli.outputs.grid import Column, Grid, Rows, keyed_grid, latex, terminal
from vftcli.outputs.quantity import minus

TITLE = "The same force through every controller"  #: Of the comparison.


def number_form(form: str) -> Callable[[float], str]:
    """How a number is printed with a true minus sign."""
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
#: What is timed of a contact → its heading.
LATENCIES = {
    "force": "force [s]",
    "detection": "detected [s]",
    "motion": "moved [s]",
    "withdrawal": "withdrawal [s]",
    "reaction": "detection to motion [s]",
    "turn": "withdrawal to turn [s]",
}
#: What the headings of the LaTeX table mean.
RETURNS = (
    "t10, t2: from the release until the deviation stays within 10 % and 2 % of its value there",
)


def comparison_text(rows: Sequence[Record]) -> str:
    """The comparison of all controllers as text for a terminal."""
    return terminal(comparison_grid(rows)).rstrip("\n") if rows else "no axis was dragged"


def comparison_grid(rows: Sequence[Record], title: str = "") -> Grid:
    """Every controller on one force (Figs 7 and 10), below each other by axis and drag."""
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
    """The latencies of a closed loop, from the true force and as the paper times them."""
    columns = {
        "axis": "axis",
        **{f"{name}_s": Column(head, form=".3f") for name, head in LATENCIES.items()},
        "at_rest_before": Column("at rest before"),
    }
    return keyed_grid(
        columns,
        latency_rows(run),
        "From the true force past its threshold to the estimate's, to 5 mm (0.02 rad) of the "
        "flange; from its fall below to the estimate's; as the paper times, from the estimate past "
        "its threshold to 5 mm, from its fall below to where the flange goes no farther",
    )


def latency_text(run: ClosedLoop) -> str:
    """The latencies of a closed loop in words, one line a contact."""
    if not run.stable:
        return f"closed loop: the arm ran away at {run.t[-1]:.2f} s"
    lines = []
    for row in latency_rows(run):
        said = {
            k: "never" if x is None else f"{x:.3f} s" for k, x in row.items() if k[-2:] == "_s"
        }
        moving = "" if row["at_rest_before"] else " (the arm was moving already)"
        lines.append(
            f"closed loop: force past the threshold of {row['axis']} at {row['force_s']:.2f} s, "
            f"detected after {said['detection_s']}, moved after {said['motion_s']}{moving}, "
            f"withdrawal seen after {said['withdrawal_s']}; from detection to motion "
            f"{said['reaction_s']}, from withdrawal to turn {said['turn_s']}"
        )
    return "\n".join(lines) or "closed loop: no force passed a threshold"


def parameter_text(replay: Replay) -> str:
    """Mass, damping, stiffness, threshold and control period in use, on one line."""
    p, words = replay.parameters, []
    values = (p.mass, p.damping, p.stiffness, p.xi, p.threshold, p.speed_limit)
    for label, each in zip(("M", "B", "K", "ξ", "F_tsd", "limit"), values, strict=True):
        # Six numbers as position / rotation, three equal ones once.
        texts = [f"{value:.3g}" for value in np.broadcast_to(each, 6)]
        halves = (half[:1] if len(set(half)) == 1 else half for half in (texts[:3], texts[3:]))
        words.append(f"{label} {' / '.join(map(','.join, halves))}")
    return f"{', '.join(words)}; Ts {1e3 * p.period:g} ms, {p.threshold_mode} threshold"


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
    return Grid(columns, rows, f"Values used; {p.source or 'the command line'}")


def stability_grid(replay: Replay) -> Grid:
    """The numbers that decide before anything moves: the worst of the axes of each kind."""
    rows: Rows = []
    kinds = (("position", slice(0, 3), "m"), ("rotation", slice(3, 6), "rad"))
    for controller in replay.controllers:
        for axes, part, unit in kinds:
            bound = float(np.min(controller.escape[part]))
            each = controller.drag, controller.recovery
            numbers = (float(np.max(values[part])) for values in each)
            escape = f"{bound:.3g} {unit}" if np.isfinite(bound) else "none"
            rows.append((controller.name, axes, *numbers, escape))
    phases = (Column(head, form=".3g") for head in ("drag phase", "recovery, at the limit"))
    columns = "controller", "axes", *phases, Column("escape bound")
    return Grid(columns, rows, "2TsB/M + Ts²K/M, stable below 4", swatches=True)


def latex_text(replay: Replay) -> str:
    """The parameters (Tables III and IV of the paper) and the comparison as LaTeX tables."""
    grids = [parameter_grid(replay)]
    if replay.rows:
        grids.append(replace(comparison_grid(replay.rows, TITLE), notes=RETURNS))
    return "\n".join(map(latex, grids))
