"""Score lists of contacts on logs of other engines and of real arms, through the pipeline.

Takes the folder of logs from VFT_LOGS. Example: VFT_LOGS=… python tests/contacts/score_logs.py push
"""

import argparse
import gzip
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time

import numpy as np
import polars as pl

sys.path.insert(0, str(Path(__file__).parent))

from contact_logs import UR10E
from contact_scores import score, touched, true_contacts

from vftcli.contacts.contact_list import ContactList
from vftcli.evaluation.reference_choice import ReferenceChoice
from vftcli.free_motion.choice import FreeChoice
from vftcli.observers.choice import ObserverChoice
from vftcli.pipeline import AnalysisChoice, analyse_logs, list_touches
from vftcli.readers.reader import ReadChoice
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.choice import RobotChoice
from vftcli.wrench.choice import WrenchChoice

LOGS = Path(os.environ.get("VFT_LOGS", "."))
FREE = ("free_12harm.csv", "free_12harm_40s.csv.gz", "free_10harm.csv.gz", "free_repeat_a.csv",
        "free_repeat_b.csv", "free_repeat_c.csv", "jointwise_2.csv", "jointwise_4.csv")  # fmt: skip
HANDS = ((1.95, 2.75), (4.6, 5.75), (8.4, 9.4), (11.8, 13.1))
"""The pushes of push_pose by eye. [s]"""


def ur10e(*names: str, free: str | None = None) -> list[ContactList]:
    """The lists of UR10e logs, noise from another one."""
    folder = LOGS / "ur10e"
    choice = AnalysisChoice(
        read=ReadChoice(columns=UR10E),
        robot=RobotChoice(name="ur10e"),
        free=FreeChoice.parsed(free=[folder / free] if free else None),
    )
    logs = analyse_logs([folder / name for name in names], choice, work=list_touches)
    return [made.contacts for made in logs if made.contacts is not None]


def shown(found: ContactList) -> None:
    """One line a row."""
    reported = found.smallest_force
    print(f"{found.recording}: {len(found.contacts)} rows in {found.duration:.1f} s, "
          f"{found.method}, smallest {reported if reported is None else round(reported, 1)} N, "
          f"stops {[round(at, 2) for at in found.stops]}, "
          f"{[remark.code for remark in found.remarks]}")  # fmt: skip
    for row in found.contacts:
        force = row.mean_force if row.is_load else None if row.wrench is None else row.wrench[:3]
        band = None if row.wrench_sd is None else (1.96 * row.wrench_sd[:3]).round(1)
        print(f"  {row.start:6.2f}-{row.stop:6.2f} {row.peak_force:6.1f} ± {row.peak_band:5.1f} N "
              f"anywhere {row.anywhere[0]:.0f}-{row.anywhere[1]:.0f} {row.where} {row.places} "
              f"{row.evidence:.0f} nats {row.trust} {np.round(force, 2)} ± {band}")  # fmt: skip


def push() -> None:
    """Four hands on a held pose, with a free log and without."""
    for free in ("free_14harm.csv", None):
        (found,) = ur10e("push_pose.csv", free=free)
        shown(found)
        met = [any(r.start < b and r.stop > a for r in found.contacts) for a, b in HANDS]
        print(f"hands met {sum(met)} of 4")


def load() -> None:
    """2.805 kg that nobody named: (0, 0, −27.52) N."""
    (found,) = ur10e("load_14harm.csv", free="free_14harm.csv")
    shown(found)


def free() -> None:
    """Free motion: noise of another log, and none."""
    rows = 0
    for found in ur10e(*FREE, free="free_14harm.csv"):
        shown(found)
        rows += len(found.contacts)
    print(f"noise from free_14harm: {rows} rows in eight logs")
    rows, seconds = 0, 0.0
    for found in ur10e(*FREE, "free_14harm.csv"):
        shown(found)
        rows, seconds = rows + len(found.contacts), seconds + found.duration
    print(f"without a free log: {rows} rows in {seconds:.0f} s")


MUJOCO = "t=time,q=q{i},dq=qd{i},tau=tau{i},tau_ext=tau_ext{i},wrench[base]=Fx|Fy|Fz|Mx|My|Mz"


def engine(log: Path, folder: Path, read: ReadChoice, span: str, reference: str) -> None:
    """A log of another engine against its true wrench in base axes about the flange point."""
    choice = AnalysisChoice(
        read=read,
        robot=RobotChoice(name=str(folder / "robot.toml")),
        free=FreeChoice.parsed(free=[span] if span else ()),
        observers=ObserverChoice(names=("best",)),
        wrench=WrenchChoice(frame="base"),
        reference=ReferenceChoice(name=reference),
    )
    begin = process_time()
    analysis = next(analyse_logs([log], choice))
    took = process_time() - begin
    assert analysis.contacts is not None
    assert analysis.virtual_sensor is not None
    assert analysis.virtual_sensor.reference is not None
    t, wrench = analysis.recording.t, analysis.virtual_sensor.reference.values
    shown(analysis.contacts)
    found = score(analysis.contacts.contacts, true_contacts(t, wrench))
    for row, met in found.pairs:
        share = np.linalg.norm(row.impulse - met.impulse) / np.linalg.norm(met.impulse)
        held = abs(row.peak_force - met.size) <= row.peak_band
        print(f"  true {met.start:.2f}-{met.stop:.2f} {met.size:.1f} N, band holds {held}, "
              f"impulse off by {100 * share:.1f} %")  # fmt: skip
    print(f"found {len(found.pairs)}, missed {len(found.missed)}, false {len(found.false)}")
    (best,) = analysis.virtual_sensor.wrenches
    assert best.sd is not None
    error = best.values - wrench
    inside = touched(wrench)
    held = (np.abs(error) <= 1.96 * best.sd)[inside].mean(axis=0)
    print("rms of best", np.sqrt((error**2).mean(axis=0)).round(3), "in contact", np.sqrt(
        (error[inside] ** 2).mean(axis=0)).round(3), "bands hold", held.round(2),
        f"analysed in {60 * took / analysis.recording.duration:.1f} s for 60 s")  # fmt: skip


def mujoco() -> None:
    """A UR5e by MuJoCo."""
    folder = LOGS / "mujoco_ur5e"
    engine(folder / "circle.csv", folder, ReadChoice(columns=MUJOCO), "0.3:3.9", "sensor")


def libfranka() -> None:
    """A simulated FR3 behind libfranka's own client."""
    folder = LOGS / "libfranka_sim"
    with tempfile.TemporaryDirectory() as made:
        for name in ("pushes.csv", "pushes_truth.csv"):
            (Path(made) / name).write_bytes(gzip.decompress((folder / f"{name}.gz").read_bytes()))
        truth = f"file:{Path(made) / 'pushes_truth.csv'}"
        engine(Path(made) / "pushes.csv", folder, ReadChoice(), "0.3:5", truth)


def bullet() -> None:
    """An injected torque: one row each, and the torque of its wrench."""
    from typer.testing import CliRunner

    from vftcli.cli import make_app

    folder = LOGS / "bullet_ur5"
    columns = "t=t,q=q{i},dq=dq{i},-tau=tau{i}"
    with tempfile.TemporaryDirectory() as made:
        model = Path(made) / "arm.toml"
        words = ["identify", *(str(folder / f"free_{k}.csv.gz") for k in (5, 6)), "--robot", "ur5",
                 "--method", "base", "--columns", columns, "-o", str(model)]  # fmt: skip
        done = CliRunner().invoke(make_app(), words)
        print(done.output[-300:] if done.exit_code else "identified")
        for kind in ("const", "vary"):
            log = folder / f"pushed_7_{kind}.csv.gz"
            choice = AnalysisChoice(
                read=ReadChoice(columns=columns),
                robot=RobotChoice(name=str(model)),
                free=FreeChoice.parsed(free=["0.3:7.8"]),
                observers=ObserverChoice(names=("best",)),
                wrench=WrenchChoice(frame="base"),
            )
            analysis = next(analyse_logs([log], choice))
            assert analysis.contacts is not None
            assert analysis.virtual_sensor is not None
            shown(analysis.contacts)
            table = pl.read_csv(log, infer_schema_length=None)
            # The file's torque has its sign turned.
            true = -table.select([f"tau_ext{i}" for i in range(1, 7)]).to_numpy()
            J = flange_jacobian(analysis.robot.loaded_chain, analysis.recording.q)
            (best,) = analysis.virtual_sensor.wrenches
            tau = np.einsum("tij,ti->tj", J, best.values)
            print("J^T w rmse", np.sqrt(((tau - true) ** 2).mean(axis=0)).round(3),
                  "mean", np.sqrt(((tau - true) ** 2).mean(axis=0)).mean().round(3))  # fmt: skip


CHECKS: dict[str, Callable[[], None]] = {
    "push": push, "load": load, "free": free, "mujoco": mujoco, "libfranka": libfranka,
    "bullet": bullet,
}  # fmt: skip

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("check", nargs="*", default=list(CHECKS))
    for name in parser.parse_args().check:
        CHECKS[name]()
