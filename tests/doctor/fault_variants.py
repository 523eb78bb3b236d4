"""Logs of the folder VFT_LOGS as tables that faults can be planted in, and what a fault costs."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from planted_faults import Table, robot_named, simulated
from sound_logs import LOGS, SoundLog, recording_of

from vftcli.observers import MomentumObserver
from vftcli.readers.reading import read
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.arrays import Array
from vftcli.signals.errors import VftError
from vftcli.signals.recording import Recording


def table_from(recording: Recording, robot: str) -> Table:
    """The table of a recording; currents go before torques."""
    signal, effort = "current", recording.current
    if effort is None:
        signal, effort = "tau", recording.require("torque")
    return Table(
        t=recording.t,
        q=recording.q,
        dq=recording.require("dq"),
        effort=effort,
        signal=signal,
        tau_ext=recording.tau_ext if signal == "tau" else None,
        robot=robot,
        given=robot,
    )


SPANS: dict[str, tuple[str, float, float]] = {
    "ur10e/free_14harm": ("ur10e/free_14harm.csv", 30, 50),
    "ur10e/free_12harm": ("ur10e/free_12harm.csv", 5, 30),
    "ur10e/free_10harm": ("ur10e/free_10harm.csv.gz", 5, 30),
    "link4": ("ur10_link4/link4.csv.gz", 0, 20),
    "fr3": ("fr3/run_b.npy", 0, 20),
    "panda_exciting": ("panda_exciting", 0, 14),
    "mujoco": ("mujoco_ur5e/circle.csv", 0, 16),
    "libfranka": ("libfranka_sim/pushes.csv.gz", 0, 20),
    "bullet": ("bullet_ur5/free_5.csv.gz", 0, 20),
    "bullet_pushed": ("bullet_ur5/pushed_7_const.csv.gz", 0, 20),
}
"""Base log → its file and the span that is used. [s]"""


def base_tables(folder: Path, names: Sequence[str]) -> Iterator[tuple[str, Table]]:
    """The logs that faults are planted in, at 250 Hz at most."""
    logs = Path(os.environ["VFT_LOGS"])
    for name, (path, start, stop) in SPANS.items():
        if not names or name in names:
            log = next(log for log in LOGS if log.path == path)
            yield (
                name,
                thinned(table_from(span_of(log, logs, start, stop), robot_word(log, logs))),
            )
    for name in ("ur5", "panda"):
        if not names or name in names:
            yield name, thinned(simulated(name, folder))


def span_of(log: SoundLog, folder: Path, start: float, stop: float) -> Recording:
    recording = recording_of(log, folder)
    first = float(recording.t[0])
    return recording.between(first + start, first + stop)


def robot_word(log: SoundLog, folder: Path) -> str:
    return str(folder / log.robot) if log.robot.endswith(".toml") else log.robot


def thinned(table: Table, rate: float = 250.0) -> Table:
    step = max(1, round(1 / (rate * float(np.median(np.diff(table.t))))))
    return table.selected(np.arange(0, len(table.t), step))


def estimate(table: Table, path: Path) -> Array | None:
    """External torque by a momentum observer of 10 1/s, None where the log is refused. (T, n)"""
    table.write(path)
    try:
        recording = read(path)
        terms = dynamics_terms(recording, robot_named(table.given))
    except VftError:
        return None
    return np.asarray(MomentumObserver(gain=10.0).estimate(terms).tau)


def harm(faulty: Array | None, sound: Array, table: Table) -> tuple[float, float]:
    """Mean over joints of what a fault moves the estimate by: [N·m], and as share of the effort."""
    if faulty is None:
        return np.inf, np.inf
    count = min(len(faulty), len(sound))
    moved = np.sqrt(np.mean((faulty[:count] - sound[:count]) ** 2, axis=0))
    effort = np.sqrt(np.mean(table.torque**2, axis=0))
    return float(np.mean(moved)), float(np.mean(moved) / np.mean(effort))
