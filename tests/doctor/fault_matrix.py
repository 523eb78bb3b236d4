"""The fault matrix: every planted fault in every log, and what names it.

Run by hand; it simulates two logs once and keeps them in a folder::

    VFT_LOGS=/path/to/logs python tests/doctor/fault_matrix.py
    python tests/doctor/fault_matrix.py --log ur5 --fault one_sign_J2 --verbose
    VFT_LOGS=/path/to/logs python tests/doctor/fault_matrix.py --variants 3 --log fr3 --fault tilt

A cell holds the codes that a log has with the fault and not without it: `*` before a code that
names the fault, `!` before one about other joints; `(h)` is behind a pair in which the fault moves
the estimate by less than 0.1 N·m and 2 % of the effort, and which is not counted. Variants are
other joints, other amounts and other logs, with contact at the same time: one in so many of a kind.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from fault_variants import base_tables, estimate, harm
from planted_faults import (
    FAULTS,
    HARMLESS,
    READER,
    Fault,
    Table,
    fits_log,
    robot_named,
    simulated,
    ur10e_log,
    variants,
)

from vftcli.doctor import examine
from vftcli.readers.reading import read
from vftcli.signals.errors import VftError
from vftcli.signals.remarks import Remark, fact


class Cell(NamedTuple):
    """What is said of one fault in one log, and not of the sound log."""

    findings: tuple[Remark, ...]  # a refusal by the reader is one with the code ""
    fault: Fault

    @property
    def named(self) -> bool:
        """Whether a finding names the fault, on its joints where it tells any."""
        return any(names(finding, self.fault) for finding in self.findings)

    @property
    def wrong(self) -> tuple[str, ...]:
        """Codes of warnings that name something else."""
        return tuple(
            finding.code
            for finding in self.findings
            if finding.level == "warning" and not names(finding, self.fault)
        )

    def __str__(self) -> str:
        return " ".join(shown(finding, self.fault) for finding in self.findings) or "-"


def names(finding: Remark, fault: Fault) -> bool:
    """Whether a finding has a code of the fault and is about its joints, or about none."""
    about = finding.where.joints
    return finding.code in fault.codes and (
        not about or not fault.joints or set(about) == set(fault.joints)
    )


def shown(finding: Remark, fault: Fault) -> str:
    """A finding in a cell: its code, its joints, and whether it names the fault."""
    sign = "*" if names(finding, fault) else "!" if finding.code in fault.codes else ""
    joints = ",".join(f"J{j}" for j in finding.where.joints)
    level = {"fact": "f", "caution": "c", "warning": ""}[finding.level]
    return sign + (finding.code or "REFUSED") + (f"[{joints}]" if joints else "") + level


def base_logs(folder: Path, names: Sequence[str] = ()) -> Iterator[tuple[str, Table]]:
    """The logs that faults are planted in; the real one where VFT_LOGS is set."""
    if (logs := os.environ.get("VFT_LOGS")) and (not names or "ur10e" in names):
        yield "ur10e", ur10e_log(Path(logs) / "ur10e" / "free_14harm.csv")
    for name in ("ur5", "panda"):
        if not names or name in names:
            yield name, simulated(name, folder)


def said_of(table: Table, path: Path) -> tuple[Remark, ...]:
    """The findings on a table once it is a file, a refusal by the reader as one of them."""
    table.write(path)
    try:
        recording = read(path)
    except VftError as error:
        return (fact(READER, message=str(error)),)
    finally:
        path.unlink()
    return examine(recording, robot_named(table.given)).findings + recording.source.remarks


def cell_of(fault: Fault, table: Table, sound: Sequence[Remark], path: Path) -> Cell:
    """Plant a fault and examine; `sound` are the findings on the table without it."""
    known = {(finding.code, finding.level, finding.where.joints) for finding in sound}
    said = said_of(fault.plant(table), path)
    new = tuple(f for f in said if (f.code, f.level, f.where.joints) not in known)
    return Cell(new, fault)


def matrix(
    table: Table, faults: Mapping[str, Fault], folder: Path
) -> Iterator[tuple[str, Fault, Cell]]:
    """Every fault that can be planted in a log, with its name and what is said."""
    path = folder / f"planted-{os.getpid()}.csv"
    sound = said_of(table, path)
    for name, fault in faults.items():
        if fits_log(fault, table):
            yield name, fault, cell_of(fault, table, sound, path)


def drawn(table: Table, step: int) -> dict[str, Fault]:
    """One in `step` variants of each kind, at random, the same every time for a log."""
    draw, found = np.random.default_rng(len(table.t)), {}
    for kind, faults in variants(table).items():
        for k in np.sort(draw.choice(len(faults), -(-len(faults) // step), replace=False)):
            label, fault = faults[k]
            found[f"{kind} {label}".strip()] = fault
    return found


def is_harmless(log: str, name: str, fault: Fault, table: Table, path: Path) -> bool:
    """Whether a fault hardly moves the estimate: as is known of the list, else as it is found."""
    if name in FAULTS or fault.signal == "tau_ext":
        return name in HARMLESS.get(log, ())
    before = estimate(table, path)
    assert before is not None
    moved, share = harm(estimate(fault.plant(table), path), before, table)
    return moved <= 0.1 and share <= 0.02


def main(words: Sequence[str]) -> int:
    """Print the matrix and how many of the harmful pairs are named."""
    parser = argparse.ArgumentParser(
        description="plant faults in sound logs; see what names them"
    )
    parser.add_argument("--log", action="append", help="only this log: ur10e, ur5 or panda")
    parser.add_argument("--fault", action="append", help="only faults with this in their name")
    parser.add_argument("--variants", type=int, metavar="K", help="one in K variants of a kind")
    parser.add_argument(
        "--folder", type=Path, default=Path(tempfile.gettempdir()) / "vftcli-faults"
    )
    parser.add_argument("-v", "--verbose", action="store_true", help="the words of each finding")
    choice = parser.parse_args(words)
    choice.folder.mkdir(exist_ok=True)
    counted = named = 0
    bases = base_tables if choice.variants else base_logs
    for log, table in bases(choice.folder, choice.log or ()):
        said = said_of(table, choice.folder / f"sound-{os.getpid()}.csv")
        print(f"{log:8} (sound) {' '.join(shown(f, Fault(lambda t: t, ())) for f in said)}")
        every = drawn(table, choice.variants) if choice.variants else FAULTS
        faults = {
            name: fault
            for name, fault in every.items()
            if not choice.fault or any(word in name for word in choice.fault)
        }
        for name, fault, cell in matrix(table, faults, choice.folder):
            harmless = is_harmless(log, name, fault, table, choice.folder / "harm.parquet")
            counted += not harmless
            named += not harmless and cell.named
            mark = "Y" if cell.named else "s" if cell.findings else "-"
            print(f"{log:8} {name + ' (h)' * harmless:28} {mark} {cell}", flush=True)
            for finding in cell.findings if choice.verbose else ():
                text = finding.values["message"] if finding.code == READER else str(finding)
                print(f"{'':12}{finding.level}: {text}")
    print(f"{named} of {counted} harmful pairs are named")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
