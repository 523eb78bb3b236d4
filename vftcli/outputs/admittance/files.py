"""What `vftcli admit` writes: the page, motion.parquet, the comparison, run.json."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from vftcli.admittance.closed_loop import ClosedLoop
from vftcli.admittance.law import Verdict
from vftcli.admittance.parameters import AXES, PER_AXIS
from vftcli.admittance.replay import Replay
from vftcli.doctor.examination import Examination
from vftcli.outputs.admittance.figures import REPLAY_FIGURES, replay_figures
from vftcli.outputs.admittance.page import padded, render_admittance
from vftcli.outputs.admittance.tables import comparison_csv, latency_rows
from vftcli.outputs.examination import health_record
from vftcli.outputs.figures.paper import figure_files, write_figures
from vftcli.outputs.files import OutputFolder, table_file
from vftcli.outputs.log.run_record import input_record, log_remarks, robot_record, seal, versions
from vftcli.outputs.plain_rows import json_rows
from vftcli.outputs.seals import SEAL
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import AXES as FORCES

FILES = (
    "index.html",
    "motion.parquet",
    "comparison.csv",
    "comparison.json",
    SEAL,
)

CONVENTIONS = {
    "deviation": "X̃ of the flange point from the target pose X_d, base axes; rotation as the "
    "vector log(R R_dᵀ)",
    "force": "force on the robot and moment about the flange point, base axes",
    "row": "a deviation follows from the force of the row before it",
    "units": "s, m, rad, N, N·m, J",
}


def files_of_replay(form: str | None) -> list[str]:
    """Every file that a replay's folder may hold; `form` is what figures are written as."""
    return [*FILES, *figure_files(form, REPLAY_FIGURES)]


def motion_table(replay: Replay) -> pl.DataFrame:
    """Everything along time, flat columns; what is not known is null.

    ``t`` [s]; ``force/fx``… [N, N·m]; ``x/<controller>/x``… [m, rad]; ``v/<controller>/x``…;
    ``q/<controller>/1``… [rad]; ``reached/<controller>`` 1 or 0; ``logged/x``… [m, rad].
    """
    motion, columns = replay.motion, {"t": replay.motion.t}
    for k, name in enumerate(FORCES):
        columns[f"force/{name}"] = padded(replay.wrench[:, k])
    for n, controller in enumerate(replay.controllers):
        # A slash would make one more level of the column's name.
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


def admittance_record(
    replay: Replay,
    recording: Recording | None,
    run: ClosedLoop | None,
    command: str,
    examinations: Sequence[Examination] = (),
) -> dict[str, Any]:
    """Everything that `run.json` of a replay holds."""
    p = replay.parameters
    return {
        "command": command,
        "versions": versions(),
        "examination": health_record(examinations),
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
        "notes": list(replay.remarks),
        **log_remarks([recording] if recording is not None else []),
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
    examinations: Sequence[Examination] = (),
    form: str | None = None,
) -> None:
    """Write the folder of a replay, all or nothing; figures in a form, or none."""
    record = admittance_record(replay, recording, run, command, examinations)
    title = recording.name if recording is not None else "release"
    if run is not None and run.simulation is not None:
        title = f"{run.simulation.scenario.name}, closed loop"
    texts = {
        "index.html": render_admittance(replay, record, title, run, examinations),
        "comparison.csv": comparison_csv(replay.rows),
        "comparison.json": json_rows(replay.rows),
    }
    with OutputFolder(path, force, files_of_replay(form)) as folder:
        for name, text in texts.items():
            folder.write(name, text)
        with table_file(folder / "motion.parquet") as file:
            motion_table(replay).write_parquet(file, compression="zstd")
        if form is not None:
            write_figures(folder, replay_figures(replay, run), form)
        seal(folder, SEAL, record)
