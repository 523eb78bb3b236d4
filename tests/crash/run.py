"""Kills of every command that writes, at random moments and before every change of a file's place.

Each command writes over the result of an earlier run with another input, in a folder of its own,
and is killed with SIGKILL at moments drawn from a seed. What a kill just before its k-th rename,
removal or making of a file or folder would leave is copied in one run, for every k: a kill loses
nothing that is written. Then the earlier result is whole, or the new one, or nothing says that it
is whole (no `run.json`); a run after that succeeds and clears what is left::

    python tests/crash/run.py --seed 1 --moments 8

Exit 1 if a folder holds files of two runs under a seal, or a file of a run is cut or lost.
"""

import argparse
import hashlib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent.parent
FIXTURE = ROOT / "fixtures" / "ur5_circle.csv"

CHILD = """
import os, shutil, sys
from itertools import count
from pathlib import Path
places = os.environ["CRASH_COPIES"]
numbers, busy = count(), False
def watch(event, words):
    global busy
    here = event in ("os.rename", "os.remove", "os.rmdir", "os.mkdir") and not busy
    if here and places and Path("out").absolute() in Path(os.fsdecode(words[0])).absolute().parents:
        busy = True
        shutil.copytree("out", Path(places) / str(next(numbers)))
        busy = False
sys.addaudithook(watch)
sys.argv[0] = "vftcli"
from vftcli.cli import launch
launch()
"""
"""The program; copies `out` before each change of a file's place if CRASH_COPIES is a folder."""

COMMANDS = {
    "report": "report {0}.csv --robot ur5 --reference zero --anyway -o out",
    "reports": "report {0}.csv {1}.csv --robot ur5 --observer gmo --anyway -o out",
    "estimate": "estimate {0}.csv --robot ur5 --csv --mcap --rrd --anyway -o out",
    "convert": "convert {0}.csv -o out/log.parquet",
    "identify": "identify {0}.csv --robot ur5 --anyway -o out/arm.toml",
    "simulate": "simulate ur5-circle --set duration=1 --seed {2} --as rosbag2 -o out/bag",
    "admit": "admit {0}.csv --robot ur5 --alpha 1 --anyway -o out",
    "gains": "identify {0}.csv --method gains --robot ur5 --free 0:2 --anyway -o out/gains.toml",
}
"""Name → the command: {0} the log, {1} another, {2} a seed."""

SINGLE = {"convert", "gains"}
"""Commands that write one file, which needs no seal."""


class Outcome(NamedTuple):
    """What a kill left: "old", "new", "incomplete" or what is wrong; whether temporary files.

    Whether they are still there after a good run, and whether that run succeeded and is whole;
    None if there was none.
    """

    state: str
    left: bool
    kept: bool | None
    again: bool | None


class Trial:
    """One command in a folder of its own, with the result of an earlier run to write over."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.folder = name, folder
        folder.mkdir()
        head, *rows = FIXTURE.read_text(encoding="utf-8").splitlines(keepends=True)
        for k, log in enumerate(("one", "two", "three")):
            part = "".join([head, *rows[100 * k : 100 * k + 500]])
            (folder / f"{log}.csv").write_text(part, encoding="utf-8")
        self.old_words = COMMANDS[name].format("one", "three", 1).split()
        self.new_words = [*COMMANDS[name].format("two", "one", 2).split(), "--force"]
        (folder / "out").mkdir()
        self.finish(self.old_words)
        self.old = contents(folder / "out")
        shutil.copytree(folder / "out", folder / "kept")
        begun = time.monotonic()
        self.finish(self.new_words)
        self.length = time.monotonic() - begun
        self.new = contents(folder / "out")

    def start(self, words: list[str], copies: str = "") -> subprocess.Popen[bytes]:
        """Start the command; it copies what there is before every change into `copies`."""
        environment = os.environ | {
            "CRASH_COPIES": copies, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }  # fmt: skip
        command, quiet = [sys.executable, "-c", CHILD, *words], subprocess.DEVNULL
        return subprocess.Popen(
            command, cwd=self.folder, env=environment, stdout=quiet, stderr=subprocess.PIPE
        )

    def finish(self, words: list[str], copies: str = "") -> None:
        """Run the command to its end, which must be a good one."""
        child = self.start(words, copies)
        said = child.communicate()[1].decode()
        if child.returncode != 0:
            raise RuntimeError(f"{' '.join(words)}: {said}")

    def reset(self, copy: str = "kept") -> None:
        """Put the result of the earlier run back, or a copy of another moment."""
        shutil.rmtree(self.folder / "out")
        shutil.copytree(self.folder / copy, self.folder / "out")

    def after_moment(self, share: float) -> Outcome:
        """What a kill leaves after a share of the time that the command takes."""
        while True:
            self.reset()
            child, begun = self.start(self.new_words), time.monotonic()
            try:
                child.communicate(timeout=share * self.length)
            except subprocess.TimeoutExpired:
                child.kill()
                child.communicate()
                return self.outcome(child.returncode)
            # It was quicker than before and is over.
            self.length = time.monotonic() - begun

    def after_changes(self, draw: random.Random, runs: int = 3) -> Iterator[Outcome]:
        """What a kill leaves before every change of a file's place; some of them run again."""
        self.reset()
        (self.folder / "copies").mkdir()
        self.finish(self.new_words, "copies")
        copies = sorted((self.folder / "copies").iterdir(), key=lambda path: int(path.name))
        chosen = draw.sample(range(len(copies)), min(runs, len(copies)))
        for k in range(len(copies)):
            self.reset(f"copies/{k}")
            yield self.outcome(-9, runs=k in chosen)

    def outcome(self, code: int, runs: bool = True) -> Outcome:
        """Look at what there is, and run again."""
        out = self.folder / "out"
        state = f"exit {code}" if code not in {0, -9} else self.state()
        left = bool(leftovers(out))
        if not runs:
            return Outcome(state, left, None, None)
        try:
            self.finish(self.new_words)
            again = self.state() == "new"
        except RuntimeError as error:
            print(error)
            again = False
        return Outcome(state, left, bool(leftovers(out)), again)

    def state(self) -> str:
        """Whose files are in the folder."""
        found = contents(self.folder / "out")
        if found == self.old:
            return "old"
        if self.name in SINGLE:
            return "new" if found == self.new else "wrong"
        seals = [name for name in found if name.endswith("run.json")]
        top = min(seals, key=lambda name: name.count("/"), default=None)
        if top is None or top.count("/") > min(name.count("/") for name in self.new):
            return "incomplete"
        listed = json.loads((self.folder / "out" / top).read_text(encoding="utf-8"))["files"]
        whole = listed == {name: sha for name, sha in found.items() if name != top}
        # Recordings differ from run to run, and so do the seals that hold their digests.
        fixed = (name for name in self.new if not name.endswith((".rrd", "run.json")))
        alike = all(found.get(name) == self.new[name] for name in fixed)
        return "new" if whole and alike and found.keys() == self.new.keys() else "mixed"


def contents(folder: Path) -> dict[str, str]:
    """Name → sha256 of every file, temporary ones left out."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and ".partial" not in str(path.relative_to(folder))
    }


def leftovers(folder: Path) -> list[Path]:
    """Temporary files and folders."""
    return [path for path in folder.rglob("*") if path.name.startswith(".")]


def reported(name: str, kind: str, outcomes: list[Outcome]) -> bool:
    """Print a line on what the kills of one command left; return whether all is well."""
    states: Mapping[str, int] = Counter(outcome.state for outcome in outcomes)
    wrong = len(outcomes) - sum(states.get(s, 0) for s in ("old", "new", "incomplete"))
    left, kept = sum(o.left for o in outcomes), sum(bool(o.kept) for o in outcomes)
    again = [outcome.again for outcome in outcomes if outcome.again is not None]
    print(
        f"| {name} | {kind} | {len(outcomes)} | {states.get('old', 0)} | {states.get('new', 0)} "
        f"| {states.get('incomplete', 0)} | {wrong} | {left} | {kept} "
        f"| {sum(again)} of {len(again)} |",
        flush=True,
    )
    return wrong == 0 and kept == 0 and all(again)


def main() -> None:
    """Kill as asked, print a table, and exit 1 if anything is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--moments", type=int, default=8, help="random kills a command")
    parser.add_argument("--only", nargs="*", default=list(COMMANDS), choices=list(COMMANDS))
    asked = parser.parse_args()
    draw = random.Random(asked.seed)
    fine = True
    print("| command | killed | kills | old | new | incomplete | wrong | left | kept | again |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name in asked.only:
            trial = Trial(name, Path(folder) / name)
            # Half of them in the last quarter, where files come into their places.
            spans = [(0.0, 1.0), (0.75, 1.0)]
            shares = [draw.uniform(*spans[k % 2]) for k in range(asked.moments)]
            outcomes = [trial.after_moment(share) for share in shares]
            fine &= reported(name, "at random", outcomes) if outcomes else True
            fine &= reported(name, "at each change", list(trial.after_changes(draw)))
    sys.exit(not fine)


if __name__ == "__main__":
    main()
