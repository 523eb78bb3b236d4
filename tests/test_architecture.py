"""The architecture is a test: imports point one way, and nothing prints or exits but the CLI."""

import ast
from pathlib import Path

import pytest

import vftcli

PACKAGE = Path(vftcli.__file__).parent

LAYERS = [
    ("signals",),
    ("readers",),
    ("robots",),
    ("repetition",),
    ("observers",),
    ("virtual_sensor",),
    ("refinement", "evaluation", "identification", "simulation", "doctor"),
    ("admittance",),
    ("analysis",),
    ("outputs",),
    ("pipeline", "benchmark"),
    ("cli",),
]
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}


def modules() -> list[Path]:
    return sorted(p for p in PACKAGE.rglob("*.py") if p.parent != PACKAGE or p.stem != "__init__")


def room(path: Path) -> str:
    """The top-level part of the package a module belongs to."""
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imported(path: Path) -> set[str]:
    """Top-level parts of the package that a module imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names = [node.module]
            if node.module == "vftcli":
                names = [f"vftcli.{alias.name}" for alias in node.names]
        parts = [name.split(".") for name in names]
        found |= {p[1] for p in parts if p[0] == "vftcli" and len(p) > 1}
    return found - {"__version__"}


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_one_way(path: Path) -> None:
    own = room(path)
    assert own in LEVEL, f"{own} has no place in the layers"
    wrong = {n for n in imported(path) if n != own and LEVEL.get(n, 99) >= LEVEL[own]}
    assert not wrong, f"{own} imports {wrong}, which lie above or beside it"


SILENT = [path for path in modules() if room(path) != "cli"]


@pytest.mark.parametrize("path", SILENT, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_only_the_command_line_prints_or_exits(path: Path) -> None:
    calls = {
        node.func.id
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    assert not calls & {"print", "exit", "quit"}


def test_the_command_line_starts_without_heavy_packages() -> None:
    import subprocess
    import sys

    script = (
        "import sys, vftcli.cli\n"
        "heavy = {'numpy', 'scipy', 'polars', 'pinocchio', 'rerun', 'rich'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
