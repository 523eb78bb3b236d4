"""The architecture is a test: rooms in one order, no circles, one name for a thing, data not words.

Every rule lists what breaks it, so that a failure names the file.
"""

import ast
import io
import re
import tokenize
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import vftcli
from vftcli.signals.remarks import WORDS

PACKAGE = Path(vftcli.__file__).parent

ORDER = (
    "signals", "readers", "robots", "free_motion", "observers", "wrench", "bias", "evaluation",
    "identification", "simulation", "doctor", "contacts", "admittance", "analysis", "outputs",
    "pipeline", "proposal", "batch", "answering", "notebook", "reproduction", "cli", "__main__",
)  # fmt: skip
"""Rooms, lowest floor first: a room knows those before it."""

APART = {"bias", "evaluation", "identification", "simulation", "doctor", "contacts"}
"""Rooms that do not know each other."""

KNOWN = {("evaluation", "bias"), ("contacts", "bias")}
"""Pairs of those that do, the first the second."""

FILES = (
    "cli/",  # asks before it overwrites
    "batch/datasets/",
    "batch/run.py",  # finds the logs of a folder
    "outputs/",
    "readers/",
    "reproduction/paper.py",  # what a paper prints
    "reproduction/manifest.py",  # a user's manifest
    "robots/robot.py",
    "robots/meshes.py",  # the packages near a description
    "robots/robot_file.py",
    "signals/parsing.py",  # our own tables of TOML, each beside its module
    "signals/remarks.py",  # the catalogue of words
    "simulation/scenario.py",
    "simulation/writers/",
)
"""Who touches files."""

TOUCHES = {
    "open", "read_text", "read_bytes", "write_text", "write_bytes", "mkdir", "unlink", "glob",
    "rglob", "iterdir", "rename", "touch", "read_parquet", "write_parquet", "read_csv",
    "write_csv", "loadtxt", "savetxt",
}  # fmt: skip
"""What a function is called that touches files."""

FUNCTION = (ast.FunctionDef, ast.AsyncFunctionDef)

SENTENCES = {"notes", "remarks", "repairs", "warnings"}
"""Names of what is read aloud; nothing else may be done with one of its items."""

PARSES = {"partition", "rpartition", "removeprefix", "removesuffix", "startswith", "endswith",
          "find", "index", "count"}  # fmt: skip
"""Methods of a text by which code would read a sentence; `split` breaks lines to show them."""


@cache
def modules() -> dict[str, ast.Module]:
    """Every file of the package, parsed, by its path in it."""
    paths = sorted(PACKAGE.rglob("*.py"))
    return {str(p.relative_to(PACKAGE)): ast.parse(p.read_text(encoding="utf-8")) for p in paths}


def room(file: str) -> str:
    """The top-level part of the package that a file belongs to."""
    return Path(file).with_suffix("").parts[0]


def imported(file: str) -> Iterator[str]:
    """The files of the package that a file imports, anywhere in it, for types too."""
    for node in ast.walk(modules()[file]):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            # `from vftcli.robots import kernels` names a file; `… import Robot` its package.
            each = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [name if as_file(name) else node.module for name in each]
        for name in names:
            if (found := as_file(name)) is not None:
                yield found


def as_file(name: str) -> str | None:
    """A dotted name's file in the package, None where it is none."""
    parts = name.split(".")
    if parts[0] != "vftcli":
        return None
    stem = "/".join(parts[1:])
    return next((f for f in (f"{stem}.py", f"{stem}/__init__.py") if f in modules()), None)


def functions(file: str) -> Iterator[ast.FunctionDef]:
    for node in ast.walk(modules()[file]):
        if isinstance(node, ast.FunctionDef):
            yield node


@pytest.mark.slow
def test_every_room_has_a_place() -> None:
    assert {room(file) for file in modules()} - {"__init__"} == set(ORDER)


@pytest.mark.slow
def test_rooms_know_only_those_below_them() -> None:
    wrong = []
    for file in modules():
        own = room(file)
        for other in {room(f) for f in imported(file)} - {own, "__init__"}:
            beside = {own, other} <= APART and (own, other) not in KNOWN
            if own != "__init__" and (beside or ORDER.index(other) > ORDER.index(own)):
                wrong.append(f"{file} knows {other}")
    assert not wrong


@pytest.mark.slow
def test_no_file_leads_back_to_itself() -> None:
    """Strongly connected files (Tarjan) of more than one; imports for types count."""
    graph = {file: set(imported(file)) - {file} for file in modules() if file != "__init__.py"}
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    circles = []

    def visit(file: str) -> None:
        index[file] = low[file] = len(index)
        stack.append(file)
        for other in graph[file] & graph.keys():
            if other not in index:
                visit(other)
            if other in stack:
                low[file] = min(low[file], low[other])
        if low[file] == index[file]:
            circle = stack[stack.index(file) :]
            del stack[stack.index(file) :]
            if len(circle) > 1:
                circles.append(circle)

    for file in graph:
        if file not in index:
            visit(file)
    assert not circles


@pytest.mark.slow
def test_a_class_name_stands_for_one_thing() -> None:
    names = defaultdict(list)
    for file, tree in modules().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                names[node.name].append(file)
    assert not {name: files for name, files in names.items() if len(files) > 1}


@pytest.mark.slow
def test_only_the_command_line_prints_or_exits() -> None:
    calls = (
        (file, node.func.id)
        for file, tree in modules().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    )
    ends = {"print", "exit", "quit"}
    assert not [call for call in calls if call[1] in ends and room(call[0]) != "cli"]


@pytest.mark.slow
def test_only_readers_outputs_and_loaders_touch_files() -> None:
    wrong = []
    for file, tree in modules().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and not file.startswith(FILES):
                # A method `open` may open anything; the others beside it show a Path.open.
                bare = getattr(node.func, "id", None)
                name = bare or getattr(node.func, "attr", None)
                if name in TOUCHES and (bare or name != "open"):
                    wrong.append(f"{file}:{node.lineno} {name}")
    assert not wrong


@pytest.mark.slow
def test_no_code_reads_a_sentence() -> None:
    assert not [
        f"{file}: {ast.unparse(node)}"
        for file, tree in modules().items()
        for node in ast.walk(tree)
        if reads_a_sentence(node)
    ]


def reads_a_sentence(node: ast.AST) -> bool:
    """Whether an expression looks into the words of an error or a remark."""
    if isinstance(node, ast.Compare):
        holds = any(isinstance(op, ast.In | ast.NotIn) for op in node.ops)
        return holds and any(is_text(x) for x in node.comparators)
    if isinstance(node, ast.Subscript):
        name = getattr(node.value, "attr", None) or getattr(node.value, "id", None)
        value = node.slice.operand if isinstance(node.slice, ast.UnaryOp) else node.slice
        return name in SENTENCES and isinstance(value, ast.Constant | ast.Name)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        return node.func.attr in PARSES and is_text(node.func.value)
    return False


def is_text(node: ast.AST) -> bool:
    """Whether it is the text of an error or a remark: `str(error)`, `str(note)`, `note`."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "str":
        node = node.args[0] if node.args else node
        return isinstance(node, ast.Name) and node.id in {"error", "note", "remark", "warning"}
    return isinstance(node, ast.Name) and node.id in {"note", "remark"}


@pytest.mark.slow
def test_a_function_is_asked_for_a_dozen_things_at_most() -> None:
    """Parameters written by hand: 12 in commands, 10 elsewhere; those of classes are fields."""
    wrong = []
    for file in modules():
        most = 12 if room(file) == "cli" else 10
        for function in functions(file):
            a = function.args
            count = len(a.posonlyargs) + len(a.args) + len(a.kwonlyargs)
            if count > most:
                wrong.append(f"{file} {function.name}: {count}")
    assert not wrong


def test_a_file_fits_a_few_screens() -> None:
    lines = {file: (PACKAGE / file).read_text("utf-8").count("\n") for file in modules()}
    assert not {file: count for file, count in lines.items() if count > 500}


MOST = {
    "lines of Python": 48_715,
    "files": 204,
    "functions": 2591,
    "functions over 60 lines": 6,
    "names, operators, numbers": 355_350,
    "characters a line that is not blank": 50.01,
    "noqa": 67,
    "lines of TOML, JavaScript, CSS": 7184,
}
"""The size of the package: whoever makes it smaller lowers these, nobody raises them."""


def words_of(text: str) -> int:
    """How many names, operators and numbers code has, those inside of f-strings left out."""
    code, depth, count = {tokenize.NAME, tokenize.OP, tokenize.NUMBER}, 0, 0
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        kind = tokenize.tok_name[token.type]
        depth += (kind == "FSTRING_START") - (kind == "FSTRING_END")
        count += token.type in code and not depth
    return count


@pytest.mark.slow
def test_the_package_does_not_grow() -> None:
    texts = {file: (PACKAGE / file).read_text("utf-8") for file in modules()}
    filled = [line for text in texts.values() for line in text.split("\n") if line.strip()]
    every = [f for tree in modules().values() for f in ast.walk(tree) if isinstance(f, FUNCTION)]
    data = [p for p in PACKAGE.rglob("*") if p.suffix in {".toml", ".js", ".css", ".html"}]
    size = {
        "lines of Python": sum(text.count("\n") for text in texts.values()),
        "files": len(texts),
        "functions": len(every),
        "functions over 60 lines": sum(f.end_lineno - f.lineno >= 60 for f in every),
        "names, operators, numbers": sum(map(words_of, texts.values())),
        "characters a line that is not blank": sum(map(len, filled)) / len(filled),
        "noqa": sum(text.count("# noqa") for text in texts.values()),
        "lines of TOML, JavaScript, CSS": sum(p.read_text("utf-8").count("\n") for p in data),
    }
    assert not {name: size[name] for name, most in MOST.items() if size[name] > most}


def codes() -> Counter[str]:
    """The code of every remark that the package makes."""
    return Counter(
        node.args[0].value
        for tree in modules().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in {"fact", "caution", "warning", "Remark"}
        and node.args
        and isinstance(node.args[0], ast.Constant)
    )


def catalogue() -> Counter[str]:
    each = (tomllib.loads(p.read_text("utf-8")) for p in sorted(WORDS.glob("*.toml")))
    return Counter(code for words in each for code in words)


@pytest.mark.slow
def test_every_remark_has_its_words_once() -> None:
    assert not codes().keys() - catalogue().keys()
    assert not [code for code, count in catalogue().items() if count > 1]


def patterns() -> Iterator[str]:
    """What an f-string that may put a code together can give, as a regular expression."""
    for tree in modules().values():
        for node in ast.walk(tree):
            if isinstance(node, ast.JoinedStr):
                parts = [p.value if isinstance(p, ast.Constant) else None for p in node.values]
                text = "".join(str(part or "") for part in parts)
                if len(text) > 3 and re.fullmatch("[a-z-]+", text):
                    yield "".join("[a-z-]*" if part is None else str(part) for part in parts)


@pytest.mark.slow
def test_no_words_are_left_over() -> None:
    text = "\n".join((PACKAGE / file).read_text("utf-8") for file in modules())
    made = re.compile("|".join(patterns()))
    assert not [c for c in catalogue() if f'"{c}"' not in text and not made.fullmatch(c)]
