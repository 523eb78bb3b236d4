"""Mutants of all rooms, drawn at random, each against its own room's tests.

cosmic-ray makes the mutants; this draws them from a seed, gives each the tests that should notice,
and runs them on as many copies of the checkout as there are workers::

    pip install -e '.[dev,mutation]'
    python tests/mutation/run.py --mutants 100 --seed 1 -o mutants.json

The fast tests run first, those marked `slow` where they notice nothing: the summary has both.
`mutants.json` holds one row a mutant with its diff; a survivor is looked at by hand: it wants a
test, or changes nothing that a user could see.
"""

import argparse
import ast
import compileall
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from difflib import unified_diff
from pathlib import Path
from py_compile import PycInvalidationMode
from queue import Queue
from typing import Any, NamedTuple

ROOT = Path(__file__).parent.parent.parent

ROOMS: Mapping[str, str] = {
    "observers": "observers test_pipeline.py",
    "free_motion": "free_motion bias/test_reference_runs.py evaluation/test_references.py "
    "test_pipeline.py",
    "wrench": "wrench contacts evaluation outputs",
    "evaluation": "evaluation wrench/test_sensor.py test_pipeline.py",
    "identification": "identification cli/test_commands.py",
    "admittance": "admittance cli/test_commands.py",
    "bias": "bias test_pipeline.py outputs",
    "robots": "robots test_pipeline.py",
    "doctor": "doctor cli/test_health.py cli/test_commands.py",
    "readers": "readers evaluation/test_logged_jacobian.py cli/test_written.py",
    "signals": "signals free_motion observers wrench",
    "contacts": "contacts outputs/test_thresholds.py cli/test_commands.py",
    "simulation": "simulation cli/test_benchmark.py",
    "reproduction": "reproduction cli/test_benchmark.py",
    "outputs": "outputs bias/test_outputs.py cli/test_written.py",
    "batch": "batch cli/test_batch.py cli/test_commands.py",
    "cli": "cli test_pipeline.py test_notebook.py",
}
"""Room → the tests, below tests/, that should notice a mutant of it, nearest first.

The file's own test, `tests/ROOM/test_FILE.py`, always goes before them. The files that belong to no
room are mutated with the command line.
"""

SWAPS = (
    "Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "Mod_Mul", "FloorDiv_Mul", "Pow_Mul",
    "BitAnd_BitOr", "BitOr_BitAnd",
)  # fmt: skip
"""Arithmetic, and the and/or of masks: each operator and the one it turns into."""

NO_TESTS = 5  # pytest's exit code where no test has these marks
COMPARISONS = ("Eq", "NotEq", "Lt", "LtE", "Gt", "GtE")


def operator_names() -> list[str]:
    """The operators of cosmic-ray that are drawn from."""
    arithmetic = [f"core/ReplaceBinaryOperator_{swap}" for swap in SWAPS]
    comparisons = [
        f"core/ReplaceComparisonOperator_{a}_{b}"
        for a in COMPARISONS
        for b in COMPARISONS
        if a != b
    ]
    logic = ["core/ReplaceAndWithOr", "core/ReplaceOrWithAnd"]
    signs = ["core/ReplaceUnaryOperator_Delete_USub", "core/ReplaceUnaryOperator_Delete_Not"]
    return [*arithmetic, *comparisons, *logic, *signs, "core/NumberReplacer"]


class Mutant(NamedTuple):
    """One change of one file."""

    room: str  #: A key of `ROOMS`.
    file: str  #: The file, from the top of the checkout.
    operator: str  #: cosmic-ray's name of the change.
    occurrence: int  #: Which of the places where it applies.
    line: int  #: Where that is.


class Verdict(NamedTuple):
    """What became of a mutant."""

    mutant: Mutant
    fate: str  #: "killed" by fast tests, "killed slowly", "timeout" (a kill) or "survived".
    seconds: float  #: How long its tests ran.
    diff: str  #: The changed lines.
    said: str  #: The end of pytest's output.


def sites() -> dict[tuple[str, str, tuple[int, int]], list[Mutant]]:
    """Every mutant there is, by the place in the code that it changes."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator

    found: dict[tuple[str, str, tuple[int, int]], list[Mutant]] = {}
    operators = {name: get_operator(name)() for name in operator_names()}
    for room in ROOMS:
        globs = (f"{room}/**/*.py", "*.py") if room == "cli" else (f"{room}/**/*.py",)
        for path in (p for glob in globs for p in sorted((ROOT / "vftcli").glob(glob))):
            source = path.read_text(encoding="utf-8")
            nodes = list(ast_nodes(get_ast(source)))
            quiet, products = types_and_decorators(source), products_of(source)
            file = str(path.relative_to(ROOT))
            for name, operator in operators.items():
                places = [p for node in nodes for p in operator.mutation_positions(node)]
                starred = name.startswith(
                    ("core/ReplaceBinaryOperator_Mul", "core/ReplaceBinaryOperator_Pow")
                )
                for occurrence, (start, _) in enumerate(places):
                    computes = not starred or any(a <= start < b for a, b in products)
                    if computes and not any(first <= start <= last for first, last in quiet):
                        mutant = Mutant(room, file, name, occurrence, start[0])
                        found.setdefault((room, file, start), []).append(mutant)
    return found


Span = tuple[tuple[int, int], tuple[int, int]]  # Line and column of a beginning and an end.


def products_of(source: str) -> list[Span]:
    """Between the operands of products and powers: any other star unpacks or parts arguments."""
    return [
        (
            (n.left.end_lineno or 0, n.left.end_col_offset or 0),
            (n.right.lineno, n.right.col_offset),
        )
        for n in ast.walk(ast.parse(source))
        if isinstance(n, ast.BinOp) and isinstance(n.op, ast.Mult | ast.Pow)
    ]


def types_and_decorators(source: str) -> list[Span]:
    """Spans in which an operator or number computes nothing: annotations, aliases, decorators."""
    tree = ast.parse(source)
    quiet: list[ast.expr | None] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.arg | ast.AnnAssign):
            quiet.append(node.annotation)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            quiet += [*node.decorator_list, getattr(node, "returns", None)]
    for node in tree.body:
        # `Flags = Mask | None`, `Spans = tuple[...]`: names and brackets, no number in them.
        if (
            isinstance(node, ast.Assign)
            and isinstance(node.value, ast.BinOp | ast.Subscript)
            and not any(isinstance(n, ast.Constant) and n.value for n in ast.walk(node.value))
        ):
            quiet.append(node.value)
    return [
        ((n.lineno, n.col_offset), (n.end_lineno or 0, n.end_col_offset or 0))
        for n in quiet
        if n is not None
    ]


def drawn(count: int, seed: int, rooms: Sequence[str]) -> list[Mutant]:
    """Mutants at places drawn at random, at each one of the changes that fit it."""
    rng = random.Random(seed)
    places = {key: value for key, value in sites().items() if not rooms or key[0] in rooms}
    chosen = rng.sample(sorted(places), min(count, len(places)))
    return [rng.choice(places[place]) for place in chosen]


def tests_of(mutant: Mutant) -> list[str]:
    """The tests that should notice, the file's own first."""
    path = Path(mutant.file)
    own = Path("tests", path.parent.relative_to("vftcli"), f"test_{path.name}")
    listed = [str(own)] if (ROOT / own).exists() else []
    return [*listed, *(f"tests/{test}" for test in ROOMS[mutant.room].split())]


def absent_tests() -> list[str]:
    """The tests of `ROOMS` that are not there: their room's mutants would survive for it."""
    named = dict.fromkeys(test for tests in ROOMS.values() for test in tests.split())
    return [test for test in named if not (ROOT / "tests" / test).exists()]


def mutated(source: str, mutant: Mutant) -> str:
    """The file with the change."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    changed = mutate_code(source, get_operator(mutant.operator)(), mutant.occurrence)
    if changed is None:
        raise LookupError(f"{mutant} is nowhere")
    return str(changed)


def tried(copy: Path, mutant: Mutant, limit: float) -> Verdict:
    """Run the mutant's tests on a copy of the checkout that has the change."""
    path = copy / mutant.file
    source = path.read_text(encoding="utf-8")
    changed = mutated(source, mutant)
    lines = unified_diff(source.splitlines(), changed.splitlines(), lineterm="", n=0)
    diff = "\n".join(line for line in lines if not line.startswith(("---", "+++", "@@")))
    path.write_text(changed, encoding="utf-8")
    start, fate, said = time.monotonic(), "survived", ""
    try:
        for marks, kill in (("not slow", "killed"), ("slow", "killed slowly")):
            done = pytest(copy, tests_of(mutant), marks, limit)
            said = done.stdout[-600:]
            if done.returncode not in (0, NO_TESTS):
                fate = kill
                break
    except subprocess.TimeoutExpired:
        fate = "timeout"
    finally:
        path.write_text(source, encoding="utf-8")
    return Verdict(mutant, fate, time.monotonic() - start, diff, said)


def pytest(
    copy: Path, tests: Sequence[str], marks: str, limit: float
) -> subprocess.CompletedProcess[str]:
    """Run the tests with these marks on a copy, on one core, until the first that fails."""
    words = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    words += ["-m", f"not statistical and ({marks})", *tests]
    one = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS"), "1")
    env = os.environ | one | {"PYTHONPATH": str(copy)}
    return subprocess.run(
        words, cwd=copy, env=env, timeout=limit, capture_output=True, text=True, check=False
    )


def copies(count: int, folder: Path) -> Queue[Path]:
    """As many copies of the checkout as there are workers."""
    free: Queue[Path] = Queue()
    for k in range(count):
        copy = folder / f"copy{k}"
        quiet = shutil.ignore_patterns(".git", "__pycache__", ".venv", ".mypy_cache")
        shutil.copytree(ROOT, copy, ignore=quiet)
        # Bytecode that is valid by the source's hash: by its time, a file that changes twice
        # within a second would be taken from the cache; without any, each run compiles the house.
        compileall.compile_dir(
            copy / "vftcli", quiet=1, invalidation_mode=PycInvalidationMode.CHECKED_HASH
        )
        free.put(copy)
    return free


def run(mutants: Sequence[Mutant], workers: int, limit: float) -> Iterator[Verdict]:
    """The verdict on every mutant, in the order in which they were drawn."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as pool:
        free = copies(workers, Path(folder))

        def one(mutant: Mutant) -> Verdict:
            copy = free.get()
            try:
                return tried(copy, mutant, limit)
            finally:
                free.put(copy)

        yield from pool.map(one, mutants)


def summary(verdicts: Sequence[Verdict]) -> str:
    """Killed of tried room by room, and the share that the fast tests kill."""
    lines = []
    for room in (*ROOMS, "all"):
        here = [v for v in verdicts if room in {v.mutant.room, "all"}]
        if here:
            killed = sum(v.fate != "survived" for v in here)
            fast = sum(v.fate == "killed" for v in here)
            lines.append(
                f"{room:<16}{killed:>4} / {len(here):<4}{killed / len(here):>6.0%}"
                f"   by fast tests {fast / len(here):>6.0%}"
            )
    return "\n".join(lines)


def as_row(verdict: Verdict) -> dict[str, Any]:
    """A verdict as JSON holds it."""
    return {**verdict.mutant._asdict(), **verdict._asdict(), "mutant": None}


def main() -> None:
    """Draw, try, and tell."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--mutants", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--room", action="append", default=[], choices=list(ROOMS))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--limit", type=float, default=300.0, help="seconds a mutant")
    parser.add_argument("-o", "--output", type=Path, default=Path("mutants.json"))
    asked = parser.parse_args()
    if absent := absent_tests():
        parser.error(f"ROOMS names tests that are not there: {', '.join(absent)}")
    verdicts = []
    for verdict in run(drawn(asked.mutants, asked.seed, asked.room), asked.workers, asked.limit):
        verdicts.append(verdict)
        asked.output.write_text(json.dumps([as_row(v) for v in verdicts], indent=1))
        where = f"{verdict.mutant.file}:{verdict.mutant.line}"
        print(f"{verdict.fate:<14}{verdict.seconds:6.1f} s  {where}  {verdict.mutant.operator}")
        if verdict.fate == "survived":
            print(verdict.diff)
        sys.stdout.flush()
    print(summary(verdicts))


if __name__ == "__main__":
    main()
