"""Structure-aware fuzzing of the command line: python tests/fuzz/run.py --seed 1 --inputs 5000

Seeds are small sound files of every kind that a user may give (made in code, and where VFT_LOGS is
set the heads of the samples beside it). An input is one of them taken apart, one thing changed, and
put together again, with inspect, convert, estimate, compare or simulate on it; or words that an
option does not take. The family "long" has logs of 12 s and a dataset, with the other commands. All
run in forked children of a parent that has everything imported.

An input fails if the command ends in a traceback, a warning of Python or by a signal, takes more
than 5 s of processor time (15 s where it is long) or 1 GiB, prints JSON that is none, writes
numbers that are not finite or that no robot has, loses a joint, reads fewer rows than there are
without a word, says more than one line when it refuses, or leaves something behind then. The same
seed and index make the same input, whatever the number of jobs.
"""

import argparse
import gc
import importlib
import json
import os
import pickle
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2])]

from child import BROKEN, MEMORY, WEIGHTS, Attempt, attempt, clear, command, tried  # noqa: E402
from seeds import make_seeds  # noqa: E402
from tokens import Seed  # noqa: E402

from vftcli.signals.errors import VftError  # noqa: E402

PURE = {"mcap", "bag", "folder", "npz", "npy", "pickle", "records"}
"""Families whose readers start no threads: their caches are filled before the fork."""

READ = ("read", "read with a word", "refused", "usage")
"""Verdicts that are no failure; the last is of typer's own, in several lines."""


class Verdict(NamedTuple):
    """What became of one input: its index, itself, one of `READ` or what went wrong, the words."""

    index: int
    attempt: Attempt
    kind: str
    words: str

    @classmethod
    def parsed(cls, line: str) -> "Verdict":
        """The verdict that a child wrote down."""
        index, made, *found = json.loads(line)
        return cls(index, Attempt(*made), *found)


Seeds = dict[str, list[Seed]]
"""Family → its seeds."""

BATCH = 40
"""Inputs that one child tries: a fork costs as much as refusing a file."""

OF_HEALTH = re.compile(r"(\S.*: )?log health: |MEANINGLESS |note: ")
"""How the lines begin that say what the examination of a log found."""

OF_PYTHON = re.compile(r"Traceback \(most recent|^\S+:\d+: \w*Warning: ", re.MULTILINE)
"""A traceback, or a warning that nobody filtered."""

RESUMED = {"annotate", "batch"}
"""Commands that keep what is done for the next run, and say a line a log."""

ENDED_BY_LIMIT = (signal.SIGXCPU, signal.SIGALRM, signal.SIGKILL)


def forked(work: Any, *arguments: Any) -> int:
    """Run a function in a forked child; its status."""
    sys.stdout.flush()
    if (child := os.fork()) == 0:
        work(*arguments)
        os._exit(0)
    return os.waitpid(child, 0)[1]


def prepared(folder: Path) -> Seeds:
    """The seeds by family, what is needed imported, every seed read once."""

    def make() -> None:
        with (folder / "seeds.pickle").open("wb") as file:
            pickle.dump(make_seeds(folder / "seeds"), file)

    (folder / "seeds").mkdir()
    if forked(make):
        raise SystemExit("the seeds could not be made")
    seeds = pickle.loads((folder / "seeds.pickle").read_bytes())
    import_all(folder, seeds)
    found: Seeds = {}
    for seed in seeds:
        found.setdefault(seed.family, []).append(sound(seed, folder))
    return found


def import_all(folder: Path, seeds: list[Seed]) -> None:
    """Import what the commands import, so that a child need not; nothing is run here."""

    def report(words: tuple[str, ...]) -> None:
        clear(folder / "warm")
        command(words, folder / "warm")
        (folder / "modules").write_text("\n".join(sys.modules), encoding="utf-8")

    modules: set[str] = set()
    table = next(str(seed.path) for seed in seeds if seed.name == "table")
    scenario = next(str(seed.path) for seed in seeds if seed.family == "scenario")
    tried = [("inspect", str(s.path), "--json") for s in {s.family: s for s in seeds}.values()]
    tried += [
        ("estimate", table, "--robot", "ur5", "-o", str(folder / "warm/o"), "--anyway", "--wrench"),
        *[("estimate", table, "--robot", str(next(s.path for s in seeds if s.family == family)),
           "-o", str(folder / "warm/o"), "--anyway") for family in ("urdf", "mjcf")],
        ("convert", table, "-o", str(folder / "warm/o.parquet")),
        ("compare", table, "--robot", "ur5", "--reference", "zero", "--anyway", "--json"),
        ("simulate", scenario, "-o", str(folder / "warm/o.csv"), "--set", "duration=0.1"),
    ]  # fmt: skip
    for words in tried:
        forked(report, words)
        modules |= set((folder / "modules").read_text(encoding="utf-8").split("\n"))
    for name in sorted(modules):
        with suppress(ImportError):  # made by a compiler as it is loaded: not there by name
            importlib.import_module(name)
    keep_what_is_parsed(seeds)
    check_threads()
    gc.collect()
    gc.freeze()


def keep_what_is_parsed(seeds: list[Seed]) -> None:
    """Parse once what every command parses: words, robots, the definitions of known messages.

    One robot of each number of joints stays: inspect fits all there are, most of an input's time.
    """
    from vftcli.readers.reading import read
    from vftcli.robots import PROFILES, profile
    from vftcli.signals import remarks

    load = profile.load_profile
    parsed = {path: load(path) for path in PROFILES.values()}
    profile.load_profile = lambda path: parsed[path] if path in parsed else load(path)
    for name in set(PROFILES) - {"ur5", "panda"}:
        del PROFILES[name]
    for words in remarks.catalogue():
        remarks.parsed(words)
    for seed in seeds:
        if seed.family in PURE:
            with suppress(VftError):
                read(seed.path)


def check_threads() -> None:
    """Refuse a pool of threads: a child has none of them, and would wait for it for ever."""
    names = {path.read_text().strip() for path in Path("/proc/self/task").glob("*/comm")}
    if pools := sorted(name for name in names if re.match(r"polars-\d|rayon", name)):
        raise SystemExit(f"the parent has threads that its children lack: {', '.join(pools)}")


def sound(seed: Seed, folder: Path) -> Seed:
    """The seed with the samples and joints that are read from it."""
    clear(folder / "warm")
    options = ("--columns", seed.columns) if seed.columns else ()
    forked(command, ("inspect", str(seed.path), "--json", *options), folder / "warm")
    try:
        report = json.loads((folder / "warm/stdout").read_text(encoding="utf-8"))
        return seed._replace(samples=report["samples"], joints=report["joints"])
    except (ValueError, OSError):
        return seed


def judged(status: int, index: int, folder: Path) -> Verdict:
    """What became of the input in a folder, whose command ended with a status."""
    made = Attempt(**json.loads(text(folder / "attempt.json")))
    kind, words = failure(status, made, folder, text(folder / "stderr"))
    return Verdict(index, made, kind, words)


def failure(status: int, made: Attempt, folder: Path, said: str) -> tuple[str, str]:
    """The verdict on a command that ended, and the words that show it."""
    if status < 0:
        kind = "hang" if -status in ENDED_BY_LIMIT else "signal"
        return kind, f"signal {-status} {said[-300:]}"
    if status == BROKEN or OF_PYTHON.search(said):
        return "traceback", text(folder / "trace") or said
    if (peak := peak_memory()) > MEMORY or "out of memory" in said:
        return "memory", f"{peak >> 20} MiB {said}"
    if status == 0:
        return of_result(made, folder)
    left = [p.name for p in folder.glob("out*")] + [p.name for p in folder.glob(".*")]
    if left and made.words[0] not in RESUMED:
        return "left behind", f"{left} after: {said}"
    if status == 2:
        return ("usage", said) if made.family == "options" else ("exit code 2", said)
    # The health of a log that was read, and notes on it, stand before what cannot be done with it.
    lines = [line for line in said.splitlines() if line.strip() and not OF_HEALTH.match(line)]
    several = len(lines) != 1 and made.words[0] not in RESUMED
    if several or not lines[0].startswith("error: "):
        return "several lines", said
    return "refused", said


def peak_memory() -> int:
    """Most resident memory of this process so far. [B]"""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def of_result(made: Attempt, folder: Path) -> tuple[str, str]:
    """The verdict on a command that went well: its JSON, its numbers, its rows."""
    out = text(folder / "stdout")
    if "--json" not in made.words:
        numbers = text(folder / "numbers")
        return ("numbers", numbers) if numbers else ("read", "")
    try:
        report = json.loads(out, parse_constant=refuse)
    except ValueError as error:
        return "json", f"{error}: {out[:200]}"
    if numbers := text(folder / "numbers"):
        return "numbers", numbers
    if not isinstance(report, dict):
        return READ[0], ""
    health = "log health: sound" not in text(folder / "stderr") and made.words[0] == "convert"
    said = bool(report.get("repairs") or report.get("warnings") or health)
    if made.rows is not None and report.get("samples", made.rows) < made.rows and not said:
        return "rows lost", f"{report['samples']} of {made.rows}"
    return READ[said], ""


def refuse(word: str) -> None:
    raise ValueError(f"{word} is no JSON")


def text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def batch(
    pipe: int, indices: range, asked: argparse.Namespace, seeds: Seeds, folder: Path
) -> None:
    """Be the child of a batch: try one input after the other, a line through the pipe for each."""
    for index in indices:
        clear(folder)
        (folder / "TMP").mkdir()
        made = attempt(asked.seed, index, asked.family or list(WEIGHTS), seeds, folder)
        status = tried(made, folder)
        verdict = judged(status, index, folder)
        keep(verdict, asked, folder)
        os.write(pipe, (json.dumps(verdict) + "\n").encode())
        if verdict.kind == "memory":  # the peak would be that of all that follow
            return


def keep(verdict: Verdict, asked: argparse.Namespace, folder: Path) -> None:
    if verdict.kind not in READ and asked.keep is not None:
        target = asked.keep / f"{asked.seed}-{verdict.index}"
        shutil.copytree(folder, target, dirs_exist_ok=True)


def verdicts(
    indices: range, asked: argparse.Namespace, seeds: Seeds, folder: Path
) -> Iterator[Verdict]:
    """Try the inputs of some indices, in as many children as that takes."""
    while indices:
        read, write = os.pipe()
        sys.stdout.flush()
        if (child := os.fork()) == 0:
            os.close(read)
            batch(write, indices[:BATCH], asked, seeds, folder)
            os._exit(0)
        os.close(write)
        with os.fdopen(read, encoding="utf-8") as lines:
            done = [Verdict.parsed(line) for line in lines]
        yield from done
        _, status = os.waitpid(child, 0)
        if status:
            code = -os.WTERMSIG(status) if os.WIFSIGNALED(status) else BROKEN
            verdict = judged(code, indices[len(done)], folder)
            keep(verdict, asked, folder)
            yield verdict
        indices = indices[len(done) + (status != 0) :]


def run(asked: argparse.Namespace, top: Path) -> list[Verdict]:
    """Try the inputs, every job-th of them in a process of its own; what became of each."""
    seeds = prepared(top)
    children = []
    for job in range(asked.jobs):
        if (child := os.fork()) == 0:
            indices = range(asked.first + job, asked.first + asked.inputs, asked.jobs)
            with (top / f"verdicts{job}").open("w", encoding="utf-8") as file:
                for verdict in verdicts(indices, asked, seeds, top / f"job{job}"):
                    file.write(json.dumps(verdict) + "\n")
            os._exit(0)
        children.append(child)
    for child in children:
        os.waitpid(child, 0)
    lines = (text(path).splitlines() for path in top.glob("verdicts*"))
    found = sorted(Verdict.parsed(line) for each in lines for line in each)
    if len(found) != asked.inputs:
        raise SystemExit(f"{len(found)} of {asked.inputs} inputs were tried: a job ended early")
    return found


def table(found: list[Verdict]) -> str:
    """The counts as a table: a line a family, a column a verdict."""
    counts = Counter((verdict.attempt.family, verdict.kind) for verdict in found)
    counts.update(("all", verdict.kind) for verdict in found)
    kinds = [*READ, *sorted({kind for _, kind in counts} - set(READ))]
    rows = [["family", "inputs", *kinds]]
    for family in [*sorted({family for family, _ in counts} - {"all"}), "all"]:
        own = [counts[family, kind] for kind in kinds]
        rows.append([family, str(sum(own)), *map(str, own)])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    padded = ([c.rjust(w) for c, w in zip(row, widths, strict=True)] for row in rows)
    return "\n".join("  ".join(row) for row in padded)


def main() -> int:
    """Fuzz from the command line; exit 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--inputs", type=int, default=5000)
    parser.add_argument("--first", type=int, default=0, help="index of the first input")
    parser.add_argument("--family", action="append", choices=WEIGHTS, help="of these only")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for the inputs that failed")
    asked = parser.parse_args()
    for name in ("POLARS_MAX", "RAYON_NUM", "OPENBLAS_NUM", "OMP_NUM"):
        os.environ[f"{name}_THREADS"] = "1"
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="vftcli-fuzz-") as name:
        found = run(asked, Path(name))
    failures = [verdict for verdict in found if verdict.kind not in READ]
    lines = [table(found), ""]
    for verdict in failures[:500]:
        about = " ".join([*verdict.attempt[:3], "·", verdict.attempt.words[0]])
        words = " ".join(verdict.words.split())[-300:]
        lines.append(f"{verdict.index}: {verdict.kind}: {about}: {words}")
    took = f"{time.perf_counter() - start:.0f} s"
    counted = f"{asked.inputs} inputs of seed {asked.seed}"
    lines.append(f"{counted} in {took}, {len(failures)} failures")
    sys.stdout.write("\n".join(lines) + "\n")
    return 1 if failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
