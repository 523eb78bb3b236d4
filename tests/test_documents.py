"""The documents are run: every command and snippet in them works on the repository's fixtures."""

import json
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import typer
from run_notebook import NOTEBOOK, code_cells, run_cells
from typer.testing import CliRunner

from vftcli.cli import COMMANDS, make_app
from vftcli.doctor.examination import REFUSING
from vftcli.observers.table import OBSERVERS
from vftcli.readers.reading import FORMATS
from vftcli.robots import PROFILES
from vftcli.signals.option import settings_by_name
from vftcli.signals.packages import VERSION

app = make_app()

ROOT = Path(__file__).parent.parent
AXES = {"admittance", "position", "rotation", "x", "y", "z", "rx", "ry", "rz"}
"""Groups of an admittance parameter."""
DOCUMENTS = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])


def blocks(path: Path, language: str) -> list[str]:
    return re.findall(rf"(?ms)^```{language}\n(.*?)^```$", path.read_text("utf-8"))


def commands(path: Path, language: str = "sh") -> list[str]:
    """The vftcli commands of a document's shell blocks, in order."""
    text = "\n".join(blocks(path, language)).replace("\\\n", " ")
    return re.findall(r"(?:^|&& (?:\S*/)?)(?:\$ )?(vftcli .*)$", text, re.MULTILINE)


def in_the_menu() -> list[Path]:
    text = (ROOT / "docs" / "index.md").read_text("utf-8")
    listed = dict.fromkeys(re.findall(r"\]\(([\w-]+\.md)\)", text))
    return [ROOT / "README.md", *(ROOT / "docs" / name for name in listed)]


def run(path: Path, *added: str) -> None:
    """Run every command and snippet of a document; outputs get the options that are added."""
    for command in commands(path):
        words = shlex.split(command)[1:]
        if {"-o", "--output"} & set(words):
            words += added
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, f"{command}\n{result.output}\n{result.exception!r}"
    for snippet in blocks(path, "python"):
        exec(compile(snippet, path.name, "exec"), {})


@pytest.fixture
def folder(tmp_path: Path, monkeypatch) -> None:
    """An empty folder from which the fixtures are reached as in the documents."""
    (tmp_path / "fixtures").symlink_to(ROOT / "fixtures")
    monkeypatch.chdir(tmp_path)


TO_RUN = [path for path in DOCUMENTS if commands(path) or blocks(path, "python")]


@pytest.mark.slow
@pytest.mark.parametrize("path", TO_RUN, ids=lambda p: p.name)
@pytest.mark.usefixtures("folder")
def test_every_command_and_snippet_of_a_document_runs(path: Path) -> None:
    run(path, "--force")


@pytest.mark.statistical  # minutes
@pytest.mark.usefixtures("folder")
def test_all_documents_run_one_after_another_in_one_folder() -> None:
    for path in in_the_menu():
        run(path)


def test_citation_and_changelog_state_the_version() -> None:
    citation = (ROOT / "docs" / "paper.md").read_text("utf-8")
    assert re.findall(r"^ *version\W+([\d.]+)", citation, re.MULTILINE) == [VERSION]
    changelog = (ROOT / "docs" / "changelog.md").read_text("utf-8")
    assert re.findall(r"^## (.*)$", changelog, re.MULTILINE)[0] == VERSION


def test_every_page_is_in_the_index() -> None:
    pages = set((ROOT / "docs").glob("*.md")) - {ROOT / "docs" / "index.md"}
    assert pages == set(in_the_menu()[1:])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_the_pages_build_as_a_site_without_a_warning(tmp_path: Path) -> None:
    for package in ("sphinx", "myst_parser", "furo"):
        pytest.importorskip(package, reason="no site is built: the extra docs is not installed")
    build = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "docs", str(tmp_path)]
    result = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")
    menu = (tmp_path / "index.html").read_text("utf-8")
    assert all(f'href="{page.stem}.html"' in menu for page in in_the_menu()[1:])


@pytest.mark.slow
@pytest.mark.usefixtures("logs")
def test_the_notebook_shows_what_is_kept_in_it() -> None:
    """Its tables and words; a picture's bytes go with matplotlib's version."""
    pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")
    found = run_cells(notebook := json.loads(NOTEBOOK.read_text("utf-8")))
    kept = [cell["outputs"] for cell in code_cells(notebook)]
    texts, expected = (
        [[o.get("text") or o["data"]["text/plain"] for o in outputs] for outputs in cells]
        for cells in (found, kept)
    )
    assert texts == expected
    assert sum("image/png" in output.get("data", ()) for cell in found for output in cell) == 2


def test_the_notebook_is_small_and_its_words_quote_its_cells() -> None:
    cells = json.loads(text := NOTEBOOK.read_text("utf-8"))["cells"]
    prose = "".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    shown = json.dumps([cell.get("outputs") for cell in cells], ensure_ascii=False)
    forces = re.findall(r"\d+ (?:±|to) \d+ N", prose)
    assert forces == ["10 to 253 N", "75 ± 19 N"]
    assert all(force in shown for force in forces)
    assert len(text) < 100_000


def test_the_notebook_says_that_it_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("VFT_LOGS", raising=False)
    with pytest.raises(SystemExit, match="VFT_LOGS names no folder of logs"):
        run_cells(json.loads(NOTEBOOK.read_text("utf-8")))


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda p: p.name)
def test_every_command_as_typed_is_one_of_the_program(path: Path) -> None:
    """Name, options and settings; the changelog also names those that are gone."""
    if path.name == "changelog.md":
        return
    group: Any = typer.main.get_command(make_app())
    text = path.read_text("utf-8").replace("\\\n", " ").replace("\\|", "|")
    within = re.findall(r"`(vftcli [^`]+)`", text)  # its sentences
    for line in (*commands(path, "(?:sh|bash|text|console)"), *within):
        words = shlex.split(line.partition(" # ")[0])[1:]
        name = next((word for word in words if word in COMMANDS), "contacts")
        given = [word.partition("=")[0] for word in words if word.startswith("-")]
        there = {opt for param in group.commands[name].params for opt in param.opts}
        assert set(given) <= there | {"--version", "--install-completion", "-h", "--help"}, line
        kinds = vars(group.commands[name].callback)["choices"]
        groups = {n.partition(".")[0] for n in settings_by_name(kinds)} | {*OBSERVERS, "kfo"}
        for word, value in pairwise(words):
            if word == "--set" and name != "simulate":
                assert value.partition(".")[0] in groups | AXES, line


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda p: p.name)
def test_links_lead_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", path.read_text("utf-8")):
        if not target.startswith(("http:", "https:")):
            assert (path.parent / target).exists(), f"{path.name} links to {target}"


def test_every_command_observer_and_robot_is_documented() -> None:
    text = "\n".join(path.read_text("utf-8") for path in DOCUMENTS)
    assert [name for name in COMMANDS if f"vftcli {name}" not in text] == []
    observers = (ROOT / "docs" / "observers.md").read_text("utf-8")
    robots = (ROOT / "docs" / "robots.md").read_text("utf-8")
    assert not [name for name in OBSERVERS if f"`{name}`" not in observers]
    assert not [name for name in PROFILES if f"`{name}`" not in robots]


def test_the_site_has_a_row_of_every_finding_and_format() -> None:
    """Its tables are made of the catalogues; docs/formats.md names every format."""
    pytest.importorskip("sphinx", reason="no site is built: the extra docs is not installed")
    site = runpy.run_path(str(ROOT / "docs" / "conf.py"))
    findings, formats = site["findings"](), site["formats"]()
    for path in (ROOT / "vftcli" / "signals" / "words").glob("doctor*.toml"):
        for code, entry in tomllib.loads(path.read_text("utf-8")).items():
            mark = "✗ " if code in REFUSING else ""
            assert f"| {mark}`{entry.get('name', code)}` |" in findings, code
            assert entry.get("remedy", "").replace("|", "\\|") in findings, code
    text = (ROOT / "docs" / "formats.md").read_text("utf-8")
    for name, each in FORMATS.items():
        assert f"`{name}`" in text, name
        cells = (f"`{name}`: {each.title}", each.recording, each.takes, each.pitfalls)
        assert " | ".join(cell.replace("|", "\\|") for cell in cells) in formats, name


def test_every_sentence_of_the_page_on_troubles_is_printed() -> None:
    """Its pieces, between what differs from log to log, are in the code or its words."""
    page = (ROOT / "docs" / "troubleshooting.md").read_text("utf-8")
    files = (path for path in ROOT.glob("vftcli/**/*") if path.suffix in {".py", ".toml"})
    source = "".join(path.read_text("utf-8") for path in files)
    source = re.sub(r'"\s*\n\s*f?"', "", source)  # a sentence over several lines
    rows = re.findall(r"^\| (`[^|]*)\|", page[: page.index("## Questions")], re.MULTILINE)
    assert len(rows) > 20
    for quoted in re.findall("`([^`]+)`", "".join(rows)):
        for piece in quoted.split("…"):
            assert piece.strip() in source, quoted


def test_the_page_for_contributors_gives_a_reason_for_every_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    page = (ROOT / "docs" / "contributing.md").read_text("utf-8")
    needed = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    for requirement in needed:
        assert re.match(r"[a-z-]+", requirement)[0] in page, requirement
