"""The fault matrix: every planted fault in every log, and what names it.

Run by hand; it simulates two logs once and keeps them in a folder::

    VFT_LOGS=/path/to/logs python tests/doctor/fault_matrix.py
    python tests/doctor/fault_matrix.py --log ur5 --fault one_sign_J2 --verbose
    python tests/doctor/fault_matrix.py --commands inspect estimate compare report

A cell holds the codes that a log has with the fault and not without it: `*` before a code that
names the fault, `!` before one about other joints; `(h)` is behind a pair in which the fault moves
the estimate by less than 0.1 N·m and 2 % of the effort, and which is not counted.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

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
)

from vftcli.doctor import examine
from vftcli.readers.reading import read
from vftcli.signals.errors import VftError
from vftcli.signals.remarks import Remark, fact


class Cell(NamedTuple):
    """What is said of one fault in one log, and not of the sound log.

    Attributes:
        findings: The findings; a refusal by the reader is one with the code "".
        fault: The fault.
    """

    findings: tuple[Remark, ...]
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


def base_logs(folder: Path) -> Iterator[tuple[str, Table]]:
    """The logs that faults are planted in; the real one where VFT_LOGS is set."""
    if logs := os.environ.get("VFT_LOGS"):
        yield "ur10e", ur10e_log(Path(logs) / "ur10e" / "free_14harm.csv")
    for name in ("ur5", "panda"):
        yield name, simulated(name, folder)


def said_of(table: Table, path: Path, given: bool = True) -> tuple[Remark, ...]:
    """The findings on a table once it is a file, a refusal by the reader as one of them."""
    table.write(path)
    try:
        recording = read(path)
    except VftError as error:
        return (fact(READER, message=str(error)),)
    finally:
        path.unlink()
    robot = robot_named(table.given) if given else None
    return examine(recording, robot).findings + recording.source.remarks


def cell_of(fault: Fault, table: Table, sound: Sequence[Remark], path: Path) -> Cell:
    """Plant a fault and examine; `sound` are the findings on the table without it."""
    known = {(finding.code, finding.level, finding.where.joints) for finding in sound}
    said = said_of(fault.plant(table), path)
    new = tuple(f for f in said if (f.code, f.level, f.where.joints) not in known)
    return Cell(new, fault)


def matrix(
    tables: Mapping[str, Table], faults: Sequence[str], folder: Path
) -> Iterator[tuple[str, str, Cell]]:
    """Every fault in every log that it can be planted in: log, fault, what is said."""
    path = folder / f"planted-{os.getpid()}.csv"
    for log, table in tables.items():
        sound = said_of(table, path)
        for name in faults:
            if fits_log(FAULTS[name], table):
                yield log, name, cell_of(FAULTS[name], table, sound, path)


def main(words: Sequence[str]) -> int:
    """Print the matrix and how many of the harmful pairs are named."""
    parser = argparse.ArgumentParser(
        description="plant faults in sound logs; see what names them"
    )
    parser.add_argument("--log", action="append", help="only this log: ur10e, ur5 or panda")
    parser.add_argument("--fault", action="append", choices=list(FAULTS), help="only this fault")
    parser.add_argument(
        "--folder", type=Path, default=Path(tempfile.gettempdir()) / "vftcli-faults"
    )
    parser.add_argument("-v", "--verbose", action="store_true", help="the words of each finding")
    choice = parser.parse_args(words)
    choice.folder.mkdir(exist_ok=True)
    tables = {k: v for k, v in base_logs(choice.folder) if not choice.log or k in choice.log}
    for log, table in tables.items():
        path = choice.folder / f"sound-{os.getpid()}.csv"
        said = said_of(table, path)
        print(f"{log:8} (sound) {' '.join(shown(f, Fault(lambda t: t, ())) for f in said)}")
    counted = named = 0
    for log, name, cell in matrix(tables, choice.fault or list(FAULTS), choice.folder):
        harmless = name in HARMLESS[log]
        counted += not harmless
        named += not harmless and cell.named
        mark = "Y" if cell.named else "s" if cell.findings else "-"
        print(f"{log:8} {name + (' (h)' if harmless else ''):28} {mark} {cell}")
        if choice.verbose:
            for finding in cell.findings:
                text = finding.values["message"] if finding.code == READER else str(finding)
                print(f"{'':12}{finding.level}: {text}")
    print(f"{named} of {counted} harmful pairs are named")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
