"""What `vftcli admit` shows and writes: tables, motion.parquet, the page, run.json."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vftcli.admittance.closed_loop import ClosedLoop
from vftcli.admittance.latency import latencies
from vftcli.admittance.parameters import AXES, PER_AXIS
from vftcli.admittance.replay import Replay
from vftcli.admittance.stability import Verdict
from vftcli.outputs.files import OutputFolder
from vftcli.outputs.log.run_record import input_record, plain, robot_record, to_json, versions
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

if TYPE_CHECKING:
    import polars as pl

FILES = (
    "index.html",
    "recording.rrd",
    "motion.parquet",
    "comparison.csv",
    "comparison.json",
    "run.json",
)

FORCES = ("fx", "fy", "fz", "mx", "my", "mz")

CONVENTIONS = {
    "deviation": "X̃ of the flange point from the target pose X_d, base axes; rotation as the "
    "vector log(R R_dᵀ)",
    "force": "force on the robot and moment about the flange point, base axes",
    "row": "a deviation follows from the force of the row before it",
    "units": "s, m, rad, N, N·m, J",
}

COLUMNS = (
    ("controller", "controller", "{}"),
    ("alpha", "α", "{:g}"),
    ("xi", "ξ", "{:.3g}"),
    ("axis", "axis", "{}"),
    ("drag", "drag", "{}"),
    ("start_s", "start [s]", "{:.3f}"),
    ("release_s", "release [s]", "{:.3f}"),
    ("peak", "peak [m, rad]", "{:.4f}"),
    ("time_to_peak_s", "to peak [s]", "{:.3f}"),
    ("peak_advance_s", "advance [s]", "{:.3f}"),
    ("overshoot", "overshoot [%]", "{:.1f}"),
    ("return_10_s", "back to 10 % [s]", "{:.3f}"),
    ("return_2_s", "back to 2 % [s]", "{:.3f}"),
    ("idle_s", "idle [s]", "{:.3f}"),
    ("work_J", "work [J]", "{:.3f}"),
)
"""Key of a row, its heading, and how its number is printed."""


def comparison_json(rows: Sequence[Mapping[str, Any]]) -> str:
    """The comparison as a JSON array of rows."""
    return json.dumps(plain(list(rows)), indent=2, ensure_ascii=False, allow_nan=False)


def comparison_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """The comparison as CSV; what is not known is empty."""
    if not rows:
        return ",".join(key for key, _, _ in COLUMNS) + "\n"
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def cells(row: Mapping[str, Any]) -> list[str]:
    """One row's entries as text; an overshoot in per cent."""
    shown = []
    for key, _, form in COLUMNS:
        value = row[key]
        if value is None:
            shown.append("–")
        else:
            scaled = 100.0 * value if key == "overshoot" else value
            shown.append(form.format(scaled).replace("-", "−"))
    return shown


def comparison_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """The comparison for a terminal."""
    if not rows:
        return "no axis was dragged"
    table = [[heading for _, heading, _ in COLUMNS], *(cells(row) for row in ordered(rows))]
    widths = [max(len(line[k]) for line in table) for k in range(len(COLUMNS))]
    lines = [
        "  ".join(
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        for line in table
    ]
    return "\n".join(lines)


def ordered(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Rows by axis and drag, so that controllers stand under each other."""
    return sorted(rows, key=lambda row: (AXES.index(row["axis"]), row["drag"]))


def parameter_text(replay: Replay) -> str:
    """The parameters in use, one line."""
    p = replay.parameters
    words = [
        f"{label} {short(getattr(p, name))}"
        for label, name in (
            ("M", "mass"),
            ("B", "damping"),
            ("K", "stiffness"),
            ("ξ", "damping_ratio"),
            ("F_tsd", "threshold"),
            ("limit", "speed_limit"),
        )
    ]
    return f"{', '.join(words)}; Ts {1e3 * p.period:g} ms, {p.threshold_mode} threshold"


def short(values: Array) -> str:
    """Six numbers, those of equal neighbours once: position / rotation."""
    halves = [list(dict.fromkeys(f"{v:.3g}" for v in part)) for part in (values[:3], values[3:])]
    return " / ".join(
        half[0] if len(half) == 1 else ",".join(f"{v:.3g}" for v in part)
        for half, part in zip(halves, (values[:3], values[3:]), strict=True)
    )


def motion_table(replay: Replay) -> "pl.DataFrame":
    """Everything along time, flat columns; what is not known is null.

    ``t`` [s]; ``force/fx``… [N, N·m]; ``x/<controller>/x``… [m, rad]; ``v/<controller>/x``…;
    ``q/<controller>/1``… [rad]; ``reached/<controller>`` 1 or 0; ``logged/x``… [m, rad].
    """
    import polars as pl

    motion, columns = replay.motion, {"t": replay.motion.t}
    for k, name in enumerate(FORCES):
        columns[f"force/{name}"] = padded(replay.wrench[:, k])
    for n, controller in enumerate(replay.controllers):
        label = controller.name.replace(" ", "").replace("/", "-")
        for k, axis in enumerate(AXES):
            columns[f"x/{label}/{axis}"] = motion.x[:, n, k]
            columns[f"v/{label}/{axis}"] = motion.v[:, n, k]
        for j in range(replay.robot.joints):
            columns[f"q/{label}/{j + 1}"] = replay.path.q[:, n, j]
        columns[f"reached/{label}"] = replay.path.reached[:, n].astype(np.float64)
    if replay.logged is not None:
        for k, axis in enumerate(AXES):
            columns[f"logged/{axis}"] = padded(replay.logged[:, k])
    return pl.DataFrame({k: np.ascontiguousarray(v) for k, v in columns.items()}).fill_nan(None)


def padded(column: Array) -> Array:
    """A column with one unknown row more: the last deviation follows from the force before it."""
    return np.append(column, np.nan)


def title_of(recording: Recording | None, run: ClosedLoop | None) -> str:
    """What the page is called."""
    if run is not None and run.simulation is not None:
        return f"{run.simulation.scenario.name}, closed loop"
    return recording.name if recording is not None else "release"


def latency_rows(run: ClosedLoop) -> list[dict[str, Any]]:
    """The latencies of a closed loop as rows, None where something did not happen."""
    return [
        {
            "axis": AXES[entry.axis],
            "force_s": entry.force,
            "detection_s": entry.detection,
            "motion_s": entry.motion,
            "withdrawal_s": entry.withdrawal,
            "at_rest_before": entry.rested,
        }
        for entry in latencies(run)
    ]


def latency_text(run: ClosedLoop) -> str:
    """The latencies of a closed loop in words, one line a contact."""
    if not run.stable:
        return f"closed loop: the arm ran away at {run.t[-1]:.2f} s"
    lines = []
    for row in latency_rows(run):
        detection, motion, withdrawal = (
            "never" if row[name] is None else f"{row[name]:.3f} s"
            for name in ("detection_s", "motion_s", "withdrawal_s")
        )
        moving = "" if row["at_rest_before"] else " (the arm was moving already)"
        lines.append(
            f"closed loop: force past the threshold of {row['axis']} at {row['force_s']:.2f} s, "
            f"detected after {detection}, moved after {motion}{moving}, "
            f"withdrawal seen after {withdrawal}"
        )
    return "\n".join(lines) or "closed loop: no force passed a threshold"


def admittance_record(
    replay: Replay, recording: Recording | None, run: ClosedLoop | None, command: str
) -> dict[str, Any]:
    """Everything `run.json` holds."""
    p = replay.parameters
    return {
        "command": command,
        "versions": versions(),
        "input": input_record(recording) if recording is not None else None,
        "robot": robot_record(replay.robot),
        "force": replay.source,
        "closed_loop": None if run is None else loop_record(run),
        "start_rad": replay.start,
        "parameters": {
            "axes": AXES,
            **{name: getattr(p, name) for name in PER_AXIS},
            "xi_used": p.damping_ratio,
            "period_s": p.period,
            "threshold_mode": p.threshold_mode,
            "source": p.source,
        },
        "controllers": [verdict_record(verdict) for verdict in replay.verdicts],
        "conventions": CONVENTIONS,
        "notes": list(replay.notes),
        "repairs": list(recording.source.repairs) if recording is not None else [],
    }


def loop_record(run: ClosedLoop) -> dict[str, Any]:
    """What a closed loop was and how fast it was."""
    about: dict[str, Any] = {
        "controller": run.controller.name,
        "stable": run.stable,
        "zero_removed": run.zero,
        "poses_out_of_reach": int(np.count_nonzero(~run.reached)),
    }
    if run.simulation is not None:
        about |= {"scenario": run.simulation.scenario.name, "seed": run.simulation.seed}
    return about | {"latencies": latency_rows(run)}


def verdict_record(verdict: Verdict) -> dict[str, Any]:
    """A controller and its stability numbers."""
    return {
        "name": verdict.controller.name,
        "kind": verdict.controller.kind,
        "alpha": verdict.controller.alpha,
        "xi": verdict.controller.xi,
        "recovery_damping": verdict.controller.damping,
        "discrete_number_drag": verdict.drag,
        "discrete_number_recovery": verdict.recovery,
        "escape_bound": verdict.escape,
    }


def write_admittance(
    path: Path,
    replay: Replay,
    recording: Recording | None,
    run: ClosedLoop | None = None,
    command: str = "",
    force: bool = False,
) -> None:
    """Write the folder of a replay, all or nothing.

    Args:
        path: The folder.
        replay: What to show.
        recording: The log it was made from, None without one.
        run: The closed loop it was made from, None without one.
        command: The command line, as the user typed it.
        force: Whether existing files may be replaced.

    Raises:
        OutputError: If the folder cannot be written, or a file exists and `force` is not set.
    """
    from vftcli.outputs.admittance.page import render_admittance
    from vftcli.outputs.admittance.recording import write_ghosts

    record = admittance_record(replay, recording, run, command)
    title = title_of(recording, run)
    texts = {
        "index.html": render_admittance(replay, record, title, run),
        "comparison.csv": comparison_csv(replay.rows),
        "comparison.json": comparison_json(replay.rows) + "\n",
        "run.json": to_json(record),
    }
    with OutputFolder(path, force, FILES) as folder:
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
        motion_table(replay).write_parquet(folder / "motion.parquet", compression="zstd")
        write_ghosts(folder / "recording.rrd", replay, title)
