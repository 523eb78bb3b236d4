"""Score the band of the wrench of `best`, every sample, on logs that know their true wrench.

The other engines' and the real logs are read from the folder VFT_LOGS; without it they are left
out. Example: python tests/contacts/score_bands.py --seeds 71,72 --only ur5
"""

import argparse
import gzip
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl

sys.path.insert(0, str(Path(__file__).parent))

from contact_logs import FIXTURES, UR10E

from vftcli.analysis import Analysis
from vftcli.evaluation.reference_choice import ReferenceChoice
from vftcli.free_motion.choice import FreeChoice
from vftcli.observers.choice import ObserverChoice
from vftcli.pipeline import AnalysisChoice, analyse, analyse_logs, run_of
from vftcli.readers.reader import ReadChoice
from vftcli.robots.choice import RobotChoice
from vftcli.robots.kernels import load_wrench
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.series import resample_columns
from vftcli.simulation import load_scenario, simulate
from vftcli.wrench.choice import WrenchChoice

LOGS = Path(os.environ.get("VFT_LOGS", "."))
AXES = "Fx|Fy|Fz|Mx|My|Mz"
MUJOCO = f"t=time,q=q{{i}},dq=qd{{i}},tau=tau{{i}},tau_ext=tau_ext{{i}},wrench[base]={AXES}"
PANDA = f"t=t,q=q{{i}},dq=dq{{i}},tau=tau{{i}},tau_ext=tau_ext{{i}},wrench[base]={AXES}"
FORGOTTEN = ("payload.mass=2.0", "payload.com=[0.0,0.0,0.05]")


class Case(NamedTuple):
    """A log with what nobody touched of it, and where its true wrench is.

    Attributes:
        name: What to print, and to choose by.
        analysed: Analyses it, given the free part or None for none.
        free: The free part, as `--free` has it. [s]
    """

    name: str
    analysed: Callable[[str | None], tuple[Analysis, Array]]
    free: str | None


def asked(free: str | None, robot: str | None = None, **more: object) -> AnalysisChoice:
    """What a user asks, the wrench in base axes."""
    return AnalysisChoice(
        robot=RobotChoice(name=robot),
        observers=ObserverChoice(names=("best",)),
        free=FreeChoice.parsed(free=[free] if free else ()),
        wrench=WrenchChoice(frame="base"),
        **more,  # type: ignore[arg-type]
    )


def compared(
    log: Path, robot: str, free: str | None, truth: str, columns: str | None = None
) -> tuple[Analysis, Array]:
    """A log of a file with the true wrench that its reference holds."""
    read = ReadChoice(columns=columns) if columns else ReadChoice()
    reference = ReferenceChoice(name=truth)
    analysis = next(analyse_logs([log], asked(free, robot, read=read, reference=reference)))
    assert analysis.virtual_sensor is not None
    assert analysis.virtual_sensor.reference is not None
    return analysis, analysis.virtual_sensor.reference.values


def simulated(
    scenario: str, seed: int, settings: Sequence[str], free: str | None
) -> tuple[Analysis, Array]:
    """A scenario with its true wrench, the weight of a forgotten payload in it."""
    made = simulate(load_scenario(scenario, list(settings)), seed)
    truth = made.truth.wrench[np.unique(np.array(made.measured.rows))].copy()
    load = made.scenario.payload
    if load is not None and not load.known:
        carried = np.array([load.mass, *(load.mass * np.array(load.com))])
        truth += load_wrench(made.robot.chain, made.recording.q) @ carried
    choice = asked(free)
    return analyse(run_of(made.recording, made.robot, choice), choice), truth


def libfranka(free: str | None) -> tuple[Analysis, Array]:
    """A simulated FR3 behind libfranka's own client."""
    folder = LOGS / "libfranka_sim"
    with tempfile.TemporaryDirectory() as made:
        for name in ("pushes.csv", "pushes_truth.csv"):
            (Path(made) / name).write_bytes(gzip.decompress((folder / f"{name}.gz").read_bytes()))
        truth = f"file:{Path(made) / 'pushes_truth.csv'}"
        return compared(Path(made) / "pushes.csv", str(folder / "robot.toml"), free, truth)


def planted(free: str | None) -> tuple[Analysis, Array]:
    """Real motion of a UR10e with pushes planted in its currents; free motion of another log."""
    folder = LOGS / "ur10e_planted"
    other = [LOGS / "ur10e" / "free_14harm.csv"] if free else None
    choice = replace(
        asked(None, "ur10e", read=ReadChoice(columns=UR10E)), free=FreeChoice.parsed(free=other)
    )
    analysis = next(analyse_logs([folder / "planted_12harm.csv.gz"], choice))
    table = pl.read_csv(folder / "planted_12harm.truth.csv.gz", infer_schema_length=None)
    true = table.select(AXES.split("|")).to_numpy()
    return analysis, resample_columns(analysis.recording.t, table["t"].to_numpy(), true)


SIMULATED = (
    ("ur5-circle", (), "0.3:4"),
    ("ur5-circle", ("contacts.hand.style=taps",), "0.3:4"),
    ("ur5-table1", (), "0.3:4"),
    ("ur5-sensor", (), "0.3:3"),
    ("panda-bearing", (), "0.3:3.9"),
)
"""Scenario, settings, and the span that nobody touches. [s]"""

MADE = (
    ("ur5_circle.csv", "ur5", "0.3:4"),
    ("ur5_table1.csv", "ur5", "0.3:4"),
    ("ur5_taps_ur_rtde.csv", "ur5", "0.3:4"),
    ("panda_bearing.csv", "panda", "0.3:3.9"),
    ("ur5_sensor.parquet", "ur5", "0.3:3"),
)
"""Fixture, robot, and the span that nobody touches. [s]"""


def cases(seeds: Sequence[int]) -> Iterator[Case]:
    """Every log that there is a true wrench of."""
    for scenario, settings, free in SIMULATED:
        for seed, more in product(seeds, ((), FORGOTTEN)):
            name = " ".join([scenario, str(seed), *settings, *(["+2 kg"] if more else [])])
            yield Case(name, partial(simulated, scenario, seed, (*settings, *more)), free)
    for name, robot, free in MADE:
        truth = f"file:{FIXTURES / name}.truth.parquet"
        yield Case(name, partial(of_fixture, FIXTURES / name, robot, truth), free)
    if not (LOGS / "mujoco_ur5e").is_dir():
        return
    folder = LOGS / "mujoco_ur5e"
    arm = str(folder / "robot.toml")
    mujoco = partial(of_sensor, folder / "circle.csv", arm, MUJOCO)
    yield Case("mujoco_ur5e", mujoco, "0.3:3.9")
    yield Case("libfranka_sim", libfranka, "0.3:5")
    for name in (*(f"press_{k}" for k in range(1, 6)), "traj"):
        log = LOGS / "panda_press" / f"{name}.csv.gz"
        press = partial(of_sensor, log, "panda", PANDA)
        yield Case(f"panda_press {name}", press, "0.3:1.6")
    yield Case("ur10e_planted", planted, "free_14harm.csv")


def of_fixture(log: Path, robot: str, truth: str, free: str | None) -> tuple[Analysis, Array]:
    """A log with its truth in a file."""
    return compared(log, robot, free, truth)


def of_sensor(log: Path, robot: str, columns: str, free: str | None) -> tuple[Analysis, Array]:
    """A log with its truth in its own wrench columns."""
    return compared(log, robot, free, "sensor", columns)


def line(name: str, analysis: Analysis, truth: Array) -> str:
    """Share of the samples that each axis' 95 % band holds, the error, and the median sd."""
    assert analysis.virtual_sensor is not None
    (wrench,) = analysis.virtual_sensor.wrenches
    assert wrench.sd is not None
    known = np.isfinite(truth).all(axis=1)
    error, sd = wrench.values[known] - truth[known], wrench.sd[known]
    held = np.abs(error) <= 1.96 * sd
    listed: Mask = np.zeros(len(known), dtype=bool)
    for row in analysis.contacts.contacts if analysis.contacts is not None else ():
        listed |= (wrench.t >= row.start) & (wrench.t <= row.stop)
    inside = listed[known]
    parts = {"all": held.mean(axis=0)}
    parts |= {"in rows": held[inside].mean(axis=0)} if inside.any() else {}
    parts |= {"elsewhere": held[~inside].mean(axis=0)} if not inside.all() else {}
    parts |= {"rms": np.sqrt((error**2).mean(axis=0)), "sd": np.median(sd, axis=0)}
    shown = (f"{key} {' '.join(f'{x:.2f}' for x in each)}" for key, each in parts.items())
    gated = any(found.gate for found in analysis.virtual_sensor.smoothed.values())
    return f"{name}, {'gated' if gated else 'not gated'}: {'; '.join(shown)}"


def main() -> None:
    """Print a line a log."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="71,72")
    parser.add_argument("--only", default="", help="part of the names")
    parser.add_argument("--alone", action="store_true", help="name no free motion")
    chosen = parser.parse_args()
    for case in cases([int(seed) for seed in chosen.seeds.split(",")]):
        if chosen.only in case.name:
            analysis, truth = case.analysed(None if chosen.alone else case.free)
            print(line(case.name, analysis, truth), flush=True)


if __name__ == "__main__":
    main()
