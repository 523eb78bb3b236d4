"""Faults beyond the list: other joints, other amounts, other logs, and contact at the same time.

Run by hand; it prints for each kind of fault how many of the harmful ones are named, then every
harmful one that is missed and every one that is called by another name::

    VFT_LOGS=/path/to/logs python tests/doctor/fault_variants.py
    VFT_LOGS=/path/to/logs python tests/doctor/fault_variants.py --log fr3 --kind tilt --every 1
"""

import argparse
import os
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import planted_faults as plant
from fault_matrix import Cell, cell_of, said_of
from planted_faults import READER, Fault, Table, fits_log, simulated
from sound_logs import LOGS, SoundLog, recording_of

from vftcli.observers import MomentumObserver
from vftcli.readers.reading import read
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.arrays import Array
from vftcli.signals.errors import VftError
from vftcli.signals.recording import Recording

Kinds = dict[str, list[tuple[str, Fault]]]


def swaps(joints: int) -> list[tuple[int, int]]:
    """Pairs of joints that a wrong order of columns exchanges."""
    return [(1, 2), (2, 3), (1, 3), (2, 4), (4, 5), (5, joints)]


def variants(table: Table) -> Kinds:
    """Kind → its variants in a log, each with what it is."""
    n = table.joints
    each = range(1, n + 1)

    def joints_of(
        make: Callable[..., Table], codes: tuple[str, ...], joints: Sequence[int] = tuple(each)
    ) -> list[tuple[str, Fault]]:
        return [(f"J{j}", Fault(partial(make, joint=j), codes, (j,))) for j in joints]

    def amounts(
        make: Callable[..., Table], key: str, values: Sequence[float], *codes: str
    ) -> list[tuple[str, Fault]]:
        return [(f"{v:g}", Fault(partial(make, **{key: v}), codes)) for v in values]

    def pairs(make: Callable[..., Table], *codes: str) -> list[tuple[str, Fault]]:
        return [
            (f"J{a}-J{b}", Fault(partial(make, first=a, second=b), codes, (a, b)))
            for a, b in swaps(n)
        ]

    def once(
        make: Callable[[Table], Table], *codes: str, signal: str = ""
    ) -> list[tuple[str, Fault]]:
        return [("", Fault(make, codes, (), signal))]

    kinds: Kinds = {
        "one sign": joints_of(plant.one_sign, ("joint-sign",)),
        "all signs": once(plant.all_signs, "effort-sign"),
        "effort swapped": pairs(plant.effort_swapped, "effort-order"),
        "all swapped": pairs(plant.all_swapped, "joint-order", "effort-order"),
        "velocity swapped": pairs(plant.velocity_swapped, "velocity-order"),
        "velocity turned": [
            (f"J{j}", Fault(partial(plant.velocity_turned, joints=(j,)),
                            ("velocity-mismatch", "velocity-sign"), (j,))) for j in each
        ],
        "position turned": joints_of(plant.position_turned, ("velocity-mismatch", "velocity-sign")),
        "position and velocity turned": joints_of(plant.joint_turned, ("joint-sign",)),
        "degrees": once(plant.degrees, "degrees", READER),
        "positions in degrees": once(
            plant.positions_in_degrees, "degrees", "velocity-unit", READER
        ),
        "velocities in degrees": once(plant.velocities_in_degrees, "velocity-unit", READER),
        "milliseconds": once(plant.milliseconds, "time-unit"),
        "velocity lag": amounts(plant.velocity_lag, "samples", (2, 3, 5, 10, 20), "velocity-lag"),
        "velocity filtered": amounts(
            plant.velocity_filtered, "cut_off", (0.5, 1, 2, 5), "velocity-filtered", "velocity-lag"
        ),
        "velocity held": amounts(plant.velocity_held, "samples", (4, 8, 16), "velocity-held"),
        "effort lag": amounts(plant.effort_lag, "samples", (2, 5, 10, 20), "effort-lag"),
        "load": amounts(plant.payload, "mass", (0.5, 1, 2, 4, 8), "unmodelled-load"),
        "gravity": once(plant.without_gravity, "torque-without-gravity"),
        "torque as current": once(
            plant.torque_called_current, "current-as-torque", signal="current"
        ),
        "current as torque": once(
            plant.current_called_torque, "torque-as-current", signal="current"
        ),
        "mA": once(plant.milliamperes, "milliamperes", signal="current"),
        "clock": amounts(
            plant.clock_skew, "share", (-0.2, -0.05, -0.02, 0.02, 0.1, 0.2), "clock-rate"
        ),
        "time reset": amounts(plant.time_reset, "start", (0.3, 0.7), "time-reset", READER),
        "tilt": [
            (f"{a:g}° about {b:g}°",
             Fault(partial(plant.mounted, angle=a, about=b), ("tilted-base",)))
            for a in (15.0, 30.0, 60.0, 90.0) for b in (0.0, 90.0, 225.0)
        ],
        "upside down": once(partial(plant.mounted, angle=180.0), "upside-down"),
        "offset": [
            (f"J{j} {share:g}", Fault(partial(plant.effort_offset, joint=j, share=share),
                                      ("effort-offset",), (j,)))
            for j in each for share in (-0.2, 0.1, 0.5)
        ],
        "zero effort": joints_of(plant.effort_zero, ("zero-effort",)),
        "saturated": [
            (f"J{j} {share:g}", Fault(partial(plant.saturated, joint=j, share=share),
                                      ("saturation",), (j,)))
            for j in (1, 2, 3, 4) for share in (0.4, 0.6, 0.8)
        ],
        "tau_ext": once(plant.tau_ext_inverted, "vendor-sign", signal="tau_ext"),
        "wrong robot": [
            (name, Fault(partial(replace, given=name), ("other-robot", "no-robot-fits")))
            for name in ("ur5", "ur5e", "ur10e", "panda", "fr3")
            if plant.robot_named(name).joints == n and name != table.robot
        ],
    }  # fmt: skip
    for signal, code in (("q", "position"), ("dq", "velocity"), ("effort", "effort")):
        kinds[f"stuck {code}"] = [
            (f"J{j} from {share:g}",
             Fault(partial(plant.stuck, signal=signal, joint=j, start=share),
                   (f"stuck-{code}",), (j,)))
            for j in each for share in (0.3, 0.7)
        ]  # fmt: skip
    return kinds


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
        terms = dynamics_terms(recording, plant.robot_named(table.given))
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


def judged(
    table: Table, kinds: Sequence[str], step: int, folder: Path
) -> Iterator[tuple[str, str, Cell, tuple[float, float]]]:
    """Kind, variant, what is said of it and its harm, of one in `step` variants of each kind.

    They are drawn at random, the same every time for a log.
    """
    draw = np.random.default_rng(len(table.t))
    path = folder / f"variant-{os.getpid()}.parquet"
    sound = said_of(table, path)
    before = estimate(table, path)
    assert before is not None
    for kind, faults in variants(table).items():
        if kinds and kind not in kinds:
            continue
        count = -(-len(faults) // step)
        drawn = draw.choice(len(faults), count, replace=False)
        for label, fault in [faults[k] for k in np.sort(drawn)]:
            if fits_log(fault, table):
                cell = cell_of(fault, table, sound, path)
                after = estimate(fault.plant(table), path)
                yield kind, label, cell, harm(after, before, table)
    path.unlink(missing_ok=True)


def main(words: Sequence[str]) -> int:
    """Print the rates, the misses and the wrong names."""
    parser = argparse.ArgumentParser(description="plant faults beyond the list")
    parser.add_argument("--log", action="append", help="only this base log")
    parser.add_argument("--kind", action="append", help="only this kind of fault")
    parser.add_argument("--every", type=int, default=3, help="take one in K variants of a kind")
    parser.add_argument(
        "--folder", type=Path, default=Path(tempfile.gettempdir()) / "vftcli-faults"
    )
    choice = parser.parse_args(words)
    choice.folder.mkdir(exist_ok=True)
    rates: dict[str, list[bool]] = defaultdict(list)
    misses, wrong = [], []
    for log, table in base_tables(choice.folder, choice.log or ()):
        for kind, label, cell, (moved, share) in judged(
            table, choice.kind or (), choice.every, choice.folder
        ):
            line = f"{kind:22} {label:14} {log:18} {moved:7.2f} N·m {100 * share:5.1f} %  {cell}"
            harmful = moved > 0.1 or share > 0.02 or kind == "tau_ext"
            if harmful:
                rates[kind].append(cell.named)
            if harmful and not cell.named:
                misses.append(line)
            if cell.wrong:
                wrong.append(line)
    for kind, named in rates.items():
        print(f"{kind:30} {sum(named)} of {len(named)}")
    total = [name for named in rates.values() for name in named]
    print(f"{'all':30} {sum(total)} of {len(total)}")
    print("\nmissed:", *misses, sep="\n  ")
    print("\nother names, alone or beside the right one:", *wrong, sep="\n  ")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
