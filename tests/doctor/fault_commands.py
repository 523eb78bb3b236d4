"""The fault matrix through the commands: whether each of them names a planted fault.

Run by hand; minutes::

    VFT_LOGS=/path/to/logs python tests/doctor/fault_commands.py
    python tests/doctor/fault_commands.py --log ur5 --command compare --fault time_ms

A cell is Y where the command names the fault, R where it refuses the log naming it, s where it says
something else that it does not say of the sound log, and - where it says nothing new.
"""

import argparse
import contextlib
import io
import json
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
from fault_matrix import base_logs
from planted_faults import FAULTS, HARMLESS, READER, Fault, Table, fits_log, truth_path

from vftcli.cli import main as vftcli

COMMANDS = ("inspect", "estimate", "compare", "report")


class Said(NamedTuple):
    """What a command said of a log.

    Attributes:
        code: How it ended.
        error: Its last line where it refused.
        tokens: Codes of findings with their level where it is given, and names of findings.
    """

    code: int
    error: str
    tokens: frozenset[str]


def run(words: Sequence[object]) -> tuple[int, str, str]:
    """Run the command line in this process: exit code, stdout, stderr."""
    out, err = io.StringIO(), io.StringIO()
    code = 0
    with (
        patch.object(sys, "argv", ["vftcli", *map(str, words)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            vftcli()
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
    return code, out.getvalue(), err.getvalue()


def reference_words(log: str, folder: Path) -> list[str]:
    """What a log is compared with: zero, the truth of the simulation, or the vendor's estimate."""
    if log == "ur10e":
        return ["--reference", "zero"]
    truth = f"file:{truth_path('ur5', folder)}"
    return ["--reference", truth if log == "ur5" else "vendor"]


def said_by(command: str, log: str, path: Path, given: str, folder: Path) -> Said:
    """Run a command on a log as the user would, the arm named."""
    words: list[object] = [command, path, "--robot", given]
    made = folder / f"{path.stem}-made"
    if command == "inspect":
        words.append("--json")
    else:
        words += ["--observer", "gmo"]
    if command in {"estimate", "report"}:
        words += ["-o", made]
    if command in {"compare", "report"}:
        words += reference_words(log, folder)
    code, out, err = run(words)
    tokens = set(names_in(err))
    record = made / "run.json"
    if command == "inspect" and code == 0:
        tokens |= set(codes_in(json.loads(out)["findings"]))
    if record.exists():
        for one in json.loads(record.read_text())["examination"]:
            tokens |= set(codes_in(one["findings"]))
    shutil.rmtree(made, ignore_errors=True)
    last = err.strip().splitlines()[-1] if code and err.strip() else ""
    return Said(code, last, frozenset(tokens))


def codes_in(findings: Sequence[Mapping[str, object]]) -> Iterator[str]:
    """Each finding's code and level, and code and joints of it."""
    for finding in findings:
        yield f"{finding['code']} {finding['level']}"


def names_in(text: str) -> Iterator[str]:
    """What might be the name of a finding in a line of words."""
    for line in text.splitlines():
        if "log health" in line or line.startswith("error:"):
            for name in re.findall(r"[a-z]+(?:-[a-z]+)*", line):
                yield f"{name} warning"


def mark(fault: Fault, faulty: Said, sound: Said) -> str:
    """How a command judged a fault."""
    new = {token.split()[0] for token in faulty.tokens - sound.tokens}
    refused = faulty.code == 1 and sound.code == 0
    if refused and READER in fault.codes and "log health" not in faulty.error:
        return "R"
    if new & set(fault.codes):
        return "R" if refused else "Y"
    return "s" if new or refused else "-"


def matrix(
    tables: Mapping[str, Table], faults: Sequence[str], commands: Sequence[str], folder: Path
) -> Iterator[tuple[str, str, str, str]]:
    """Every fault in every log through every command: log, fault, command, mark."""
    for log, table in tables.items():
        path = table.write(folder / "planted.csv")
        sound = {c: said_by(c, log, path, table.given, folder) for c in commands}
        for name in faults:
            if not fits_log(FAULTS[name], table):
                continue
            faulty = FAULTS[name].plant(table)
            faulty.write(path)
            for command in commands:
                said = said_by(command, log, path, faulty.given, folder)
                yield log, name, command, mark(FAULTS[name], said, sound[command])


def main(words: Sequence[str]) -> int:
    """Print the matrix, a row a pair, and how many of the harmful pairs each command names."""
    parser = argparse.ArgumentParser(description="planted faults through the commands")
    parser.add_argument("--log", action="append", help="only this log: ur10e, ur5 or panda")
    parser.add_argument("--fault", action="append", choices=list(FAULTS), help="only this fault")
    parser.add_argument("--command", action="append", choices=COMMANDS, help="only this command")
    parser.add_argument(
        "--folder", type=Path, default=Path(tempfile.gettempdir()) / "vftcli-faults"
    )
    choice = parser.parse_args(words)
    choice.folder.mkdir(exist_ok=True)
    tables = {k: v for k, v in base_logs(choice.folder) if not choice.log or k in choice.log}
    commands = choice.command or COMMANDS
    marks: dict[tuple[str, str], dict[str, str]] = {}
    for log, name, command, judged in matrix(
        tables, choice.fault or list(FAULTS), commands, choice.folder
    ):
        row = marks.setdefault((log, name), {})
        row[command] = judged
        if command == commands[-1]:
            harmless = " (h)" if name in HARMLESS[log] else ""
            print(f"{log:8} {name + harmless:28} {' '.join(row.values())}", flush=True)
    harmful = {pair: row for pair, row in marks.items() if pair[1] not in HARMLESS[pair[0]]}
    for command in commands:
        named = np.sum([row[command] in "YR" for row in harmful.values()])
        print(f"{command}: {named} of {len(harmful)} harmful pairs are named")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
