"""One input: a file with one thing changed, and a command on it, in a process of its own."""

import json
import os
import resource
import shutil
import signal
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import container_mutants as containers
import numpy as np
from long_mutants import long_mutant, long_words
from message_mutants import bag_mutant, folder_mutant, mcap_mutant
from option_mutants import option_words
from robot_mutants import urdf_mutant
from text_mutants import lines_mutant, settings_mutant, table_mutant
from tokens import Mutant, Rng, Seed, pick

CPU_SECONDS, LONG_CPU_SECONDS = 5, 15
"""What an input may take, and what one of the family "long"."""

WALL_SECONDS = 180
"""A process that waits takes no processor time, and the machine may be busy."""

MEMORY = 1 << 30
"""Most resident memory, and what an input may map beyond what the parent has. [B]"""

BROKEN = 70
"""Exit code of a command that ended in an exception."""

MUTATORS: dict[str, Callable[[Seed, Rng, Path], Mutant]] = {
    "table": table_mutant, "lines": lines_mutant, "parquet": containers.parquet_mutant,
    "arrow": containers.arrow_mutant, "json": containers.json_mutant,
    "mat": containers.matlab_mutant, "hdf5": containers.hdf5_mutant,
    "npz": containers.archive_mutant, "npy": containers.archive_mutant,
    "pickle": containers.pickle_mutant, "records": containers.record_mutant,
    "mcap": mcap_mutant, "bag": bag_mutant, "folder": folder_mutant,
    "dataset": containers.dataset_mutant, "robot": settings_mutant, "gains": settings_mutant,
    "scenario": settings_mutant, "urdf": urdf_mutant, "mjcf": urdf_mutant, "long": long_mutant,
}  # fmt: skip
WEIGHTS = {
    "table": 15, "lines": 5, "parquet": 8, "npz": 6, "npy": 2, "pickle": 5, "records": 4,
    "mcap": 10, "bag": 6, "folder": 6, "arrow": 5, "json": 3, "mat": 4, "hdf5": 6,
    "dataset": 5, "robot": 5, "urdf": 3, "mjcf": 1, "gains": 1, "scenario": 1, "options": 4,
    "long": 2,
}  # fmt: skip
"""Family → inputs of a hundred."""

COMMANDS = (*["inspect"] * 9, *["convert"] * 7, *["estimate"] * 3, "compare")
ANALYSES = {"estimate", "compare"}
REFERENCES = ("zero", "vendor", "two-cycle", "sensor", "zero", "x")

ENDINGS = {"robot": ".toml", "gains": ".toml", "scenario": ".toml", "urdf": ".urdf",
           "mjcf": ".xml"}  # fmt: skip
LARGEST_TORQUE = 1e9
"""An external torque beyond it, from a sound log and a robot file, is none that a robot has."""


class Attempt(NamedTuple):
    """One input: its family or "options", what it started from, what was changed, its command."""

    family: str
    seed: str
    how: str
    words: tuple[str, ...]
    rows: int | None
    """Rows of the file, None where they are not known."""


def attempt(
    number: int, index: int, families: Sequence[str], seeds: dict[str, list[Seed]], folder: Path
) -> Attempt:
    """Write the input of an index into a folder, and say how it is tried.

    The same for the same number of a run, index, families to draw from and seeds.
    """
    rng = np.random.default_rng([number, index])
    there = [family for family in families if family in seeds or family == "options"]
    family = pick(rng, [family for family in there for _ in range(WEIGHTS[family])])
    command = pick(rng, COMMANDS)
    if family == "options":
        seed = pick(rng, seeds["table"])
        words = [command, str(seed.path), *option_words(rng, command)]
        how = " ".join(words[2:])
        rows = None
    else:
        seed = pick(rng, seeds[family])
        # A batch knows a file again by its name: that of each input is its own.
        number = index if family == "long" else ""
        place = folder / f"in{number}{ENDINGS.get(family, '')}"
        mutant = MUTATORS[family](seed, rng, place)
        place, how, rows = mutant.path or place, mutant.how, mutant.rows
        if family == "long":
            words = long_words(seed, place, rng, folder)
        elif family in ENDINGS:
            words = on_robot(family, seed, place, seeds)
        else:
            options = ["--columns", seed.columns] if seed.columns else []
            robot = ["--robot", "ur5" if seed.joints == 6 else "panda"]
            if family == "dataset" and rng.random() < 0.5:
                options += ["--episode", pick(rng, ("0", "1", "2", "9", "all", "-1", "x"))]
            if seed.name == "jacobian":
                command, robot = pick(rng, ("estimate", "compare")), ["--wrench"]
            words = [command, str(place), *options, *(robot if command in ANALYSES else [])]
    words += {
        "inspect": ["--json"],
        "convert": ["-o", str(folder / "out.parquet"), "--json"],
        "estimate": ["-o", str(folder / "out"), "--anyway"],
        "compare": ["--reference", pick(rng, REFERENCES), "--anyway", "--json"],
        "simulate": ["-o", str(folder / "out.csv"), "--json"],
    }.get(words[0], [])
    return Attempt(family, seed.name, how, tuple(words), rows)


def on_robot(family: str, seed: Seed, place: Path, seeds: dict[str, list[Seed]]) -> list[str]:
    """The command that takes a robot file, gains or a scenario."""
    if family == "scenario":
        return ["simulate", str(place), "--set", "duration=0.2"]
    joints = 7 if "panda" in seed.name else 6
    sound = {s.name: s for s in seeds["table"]}["libfranka-csv" if joints == 7 else "table"]
    if family == "gains":
        return ["estimate", str(sound.path), "--robot", "ur5", "--gains", str(place)]
    return ["estimate", str(sound.path), "--robot", str(place)]


def tried(made: Attempt, folder: Path) -> int:
    """Run the command of an input, what it says kept in the folder; its code."""
    (folder / "attempt.json").write_text(json.dumps(made._asdict()), encoding="utf-8")
    limit(LONG_CPU_SECONDS if made.family == "long" else CPU_SECONDS)
    try:
        code = command(made.words, folder)
    except BaseException:  # noqa: BLE001 - whatever it is, it is what is looked for
        (folder / "trace").write_text(traceback.format_exc(), encoding="utf-8", errors="replace")
        return BROKEN
    if code == 0 and made.words[0] in {"estimate", "convert", "report"}:
        (folder / "numbers").write_text(odd_numbers(made, folder), encoding="utf-8")
    return code


def limit(seconds: int) -> None:
    """Bound what the next command may take. [s]"""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    spent = resource.getrusage(resource.RUSAGE_SELF)
    used = int(spent.ru_utime + spent.ru_stime)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (used + seconds, hard))
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    most = pages * os.sysconf("SC_PAGE_SIZE") + 2 * MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))
    signal.alarm(WALL_SECONDS)


def command(words: tuple[str, ...], folder: Path) -> int:
    """Run a command of vftcli, what it says kept in the folder; its exit code."""
    import vftcli.cli

    for number, name in ((1, "stdout"), (2, "stderr")):
        file = os.open(folder / name, os.O_WRONLY | os.O_CREAT, 0o644)
        os.dup2(file, number)
        os.close(file)
    os.environ["TMPDIR"] = str(folder / "TMP")
    sys.argv = ["vftcli", *words]
    code: Any = 0
    try:
        vftcli.cli.main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) or end.code is None else 1
    sys.stdout.flush()
    sys.stderr.flush()
    return code or 0


def odd_numbers(made: Attempt, folder: Path) -> str:
    """What is wrong with the numbers that were written, "" where nothing is."""
    import pyarrow.parquet as pq

    path = folder / ("out.parquet" if made.words[0] == "convert" else "out/estimates.parquet")
    table = pq.read_table(path, use_threads=False)
    for name in table.column_names:
        values = np.asarray(table.column(name).to_numpy(), dtype=float)
        unknown = np.isnan(values) & name.startswith("tau_ext/")
        # A long log may have gaps; none of its joints may vanish.
        vanishes = unknown.all() if made.family == "long" else unknown.any()
        if np.isinf(values).any() or vanishes:
            return f"not finite: {name}"
        beyond = bool(np.any(np.abs(values) > LARGEST_TORQUE)) and name.startswith("tau_ext/")
        if beyond and made.family in {"robot", "urdf", "mjcf", "gains"}:
            return f"beyond any robot: {name} {np.nanmax(np.abs(values)):.3g}"
    return ""


def clear(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
