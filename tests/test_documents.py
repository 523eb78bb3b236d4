"""The documents are run: every command and snippet in them works on the repository's fixtures."""

import ast
import json
import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vftcli.cli import COMMANDS, app

ROOT = Path(__file__).parent.parent
DOCUMENTS = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])


def blocks(path: Path, language: str) -> list[str]:
    return re.findall(
        rf"^```{language}\n(.*?)^```$", path.read_text("utf-8"), re.MULTILINE | re.DOTALL
    )


def commands(path: Path) -> list[str]:
    """The vftcli commands of a document's shell blocks, in order."""
    text = "\n".join(blocks(path, "sh")).replace("\\\n", " ")
    return re.findall(r"(?:^|&& (?:\S*/)?)(vftcli .*)$", text, re.MULTILINE)


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """An empty folder from which the fixtures are reached as in the documents."""
    (tmp_path / "fixtures").symlink_to(ROOT / "fixtures")
    before = Path.cwd()
    os.chdir(tmp_path)
    yield tmp_path
    os.chdir(before)


TO_RUN = [path for path in DOCUMENTS if commands(path) or blocks(path, "python")]


@pytest.mark.parametrize("path", TO_RUN, ids=lambda p: p.name)
@pytest.mark.usefixtures("folder")
def test_every_command_and_snippet_of_a_document_runs(path: Path) -> None:
    for command in commands(path):
        words = shlex.split(command)[1:]
        if {"-o", "--output"} & set(words):
            words.append("--force")
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, f"{command}\n{result.output}\n{result.exception!r}"
    for snippet in blocks(path, "python"):
        exec(compile(snippet, path.name, "exec"), {})


@pytest.mark.usefixtures("folder")
def test_the_notebook_runs_and_shows_every_result() -> None:
    notebook = json.loads((ROOT / "docs" / "notebook.ipynb").read_text("utf-8"))
    names: dict[str, object] = {}
    shown = 0
    for cell in notebook["cells"]:
        if cell["cell_type"] != "code":
            continue
        assert not cell["outputs"], "the notebook is kept without what it printed"
        body = ast.parse("".join(cell["source"])).body
        last = body.pop() if isinstance(body[-1], ast.Expr) else None
        exec(compile(ast.Module(body, []), "notebook.ipynb", "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), "notebook.ipynb", "eval"), names)
            assert "<table" in value._repr_html_(), ast.unparse(last)
            shown += 1
    assert shown >= 10


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda p: p.name)
def test_links_lead_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", path.read_text("utf-8")):
        if not target.startswith(("http:", "https:")):
            assert (path.parent / target).exists(), f"{path.name} links to {target}"


def test_every_command_is_documented_and_has_an_example() -> None:
    text = "\n".join(path.read_text("utf-8") for path in DOCUMENTS)
    for command in app.registered_commands:
        assert command.callback is not None
        words = command.callback.__doc__ or ""
        assert f"Example: vftcli {command.name}" in " ".join(words.split()), command.name
        assert f"vftcli {command.name}" in text, command.name


def test_the_summaries_of_help_are_the_commands_own() -> None:
    for command in app.registered_commands:
        assert command.callback is not None
        first = (command.callback.__doc__ or "").strip().splitlines()[0]
        assert COMMANDS[str(command.name)].summary == first


def test_every_observer_and_robot_is_documented() -> None:
    from vftcli.observers import OBSERVERS
    from vftcli.robots import PROFILES

    observers = (ROOT / "docs" / "observers.md").read_text("utf-8")
    robots = (ROOT / "docs" / "robots.md").read_text("utf-8")
    assert not [name for name in OBSERVERS if f"`{name}`" not in observers]
    assert not [name for name in PROFILES if f"`{name}`" not in robots]


def test_every_finding_is_documented() -> None:
    import tomllib

    text = (ROOT / "docs" / "trust.md").read_text("utf-8")
    for path in (ROOT / "vftcli" / "signals" / "words").glob("doctor*.toml"):
        for code, entry in tomllib.loads(path.read_text("utf-8")).items():
            assert f"`{entry.get('name', code)}`" in text, code


def test_the_readme_names_every_dependency() -> None:
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    readme = (ROOT / "README.md").read_text("utf-8")
    needed = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    for requirement in needed:
        name = re.match(r"[a-z-]+", requirement)
        assert name is not None
        assert f"{name[0]}" in readme, requirement
