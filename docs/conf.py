"""Builds these pages as a site: python -m sphinx -W docs OUT (the extra docs)."""

import re
import tomllib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from shutil import copytree

from sphinx.application import Sphinx

from vftcli.cli import help as topics
from vftcli.doctor.examination import REFUSING
from vftcli.readers.reading import FORMATS
from vftcli.signals.packages import VERSION

DOCS = Path(__file__).parent
WORDS = DOCS.parent / "vftcli" / "signals" / "words"

project = "vftcli"
author = "the vftcli developers"
release = VERSION
html_title = f"vftcli {release}"
html_theme = "furo"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
smartquotes = False  # it makes one dash of the two before an option
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_heading_anchors = 3
autodoc_typehints = "none"  # the signature of a call is long enough without
autodoc_member_order = "bysource"

CALLS = ("read", "load_robot", "inspect", "notebook.contacts", "estimate", "report", "compare",
         "thresholds", "identify", "simulate", "admit")  # fmt: skip
"""What a notebook calls, in the order of the table above their reference."""
HELD = ("Analysis", "contacts.contact_list.ContactList", "contacts.contact_list.Contact",
        "ExternalTorque", "Recording", "FilteredDynamicsObserver", "MomentumObserver",
        "KalmanObserver")  # fmt: skip
"""Classes of which the reference lists every field."""


def navigation(text: str) -> str:
    """The page that lists all pages, with the README above it and its own sections as the menu."""
    menu = []
    for title, section in re.findall(r"^## (.*)\n((?:(?!## ).*\n)*)", text, re.MULTILINE):
        pages = re.findall(r"\[(\w)([^]]*)\]\(([\w-]+)\.md\)", section)
        lines = "".join(f"{first.upper()}{rest} <{page}>\n" for first, rest, page in pages)
        menu.append(f"```{{toctree}}\n:hidden:\n:caption: {title}\n\n{lines}```")
    readme = "```{include} ../README.md\n:relative-docs: docs/\n:relative-images:\n```"
    return "\n\n".join([readme, re.sub(r"^#", "##", text, flags=re.MULTILINE), *menu])


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [list(heads), ["---"] * len(heads), *map(list, rows)]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines
    )


def findings() -> str:
    """What the tool says of each finding, from the catalogue of its words."""
    rows = [
        (("✗ " if code in REFUSING else "") + f"`{entry.get('name', code)}`",
         re.sub(r"{[^}]*}", "…", entry["short"]),
         entry.get("consequence", ""), entry.get("remedy", ""))
        for path in sorted(WORDS.glob("doctor*.toml"))
        for code, entry in tomllib.loads(path.read_text(encoding="utf-8")).items()
    ]  # fmt: skip
    return table(["finding", "what is printed", "what it does", "what to do"], rows)


def formats() -> str:
    """How to record each format, what is read of it, and its pitfalls."""
    rows = [
        (f"`{name}`: {each.title}", each.recording, each.takes, each.pitfalls)
        for name, each in FORMATS.items()
    ]
    return table(["format", "how to record it", "what is read", "pitfalls"], rows)


def settings() -> str:
    """Every setting, as `vftcli help settings` prints it."""
    lines = "\n".join(topics.settings())
    return f"```text\n{lines}\n```"


def reference() -> str:
    """The calls and what they return, from their docstrings."""
    calls = "".join(f".. autofunction:: vftcli.{name}\n" for name in CALLS)
    held = "".join(f".. autoclass:: vftcli.{name}\n   :members:\n" for name in HELD)
    return f"## Every call\n\n```{{eval-rst}}\n{calls}{held}```"


MADE: dict[str, Callable[[], str]] = {
    f"<!-- {made.__name__} -->": made for made in (findings, formats, settings, reference)
}
"""Mark in a page → what the site has in its place, made of the code."""


def linked(text: str) -> str:
    """A text with what lies outside of docs/ named, not linked, and the example where it is put."""
    text = re.sub(r"\[([^]]*)\]\((?:docs/)?(example/[^)]*)\)", r'<a href="\2">\1</a>', text)
    return re.sub(r"\[([^]]*)\]\(\.\./[^)]*\)", r"\1", text)


def read(app: Sphinx, page: str, source: list[str]) -> None:
    """Take a page's text before it is parsed: links, and what is made of the code."""
    del app
    source[0] = linked(source[0])
    for mark, made in MADE.items():
        if mark in source[0]:
            source[0] = source[0].replace(mark, made())
    if page == "index":
        source[0] = navigation(source[0])


def include(app: Sphinx, path: Path, page: str, source: list[str]) -> None:
    """Take the README's text before it is parsed."""
    del app, path, page
    source[0] = linked(source[0])


def put_example(app: Sphinx, error: Exception | None) -> None:
    """Copy the example page with its recording beside the site's pages."""
    if error is None:
        copytree(DOCS / "example", Path(app.outdir) / "example", dirs_exist_ok=True)


def plain(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Keep a size such as |F| of a docstring from being read as a name to replace."""
    del app, what, name, obj, options
    lines[:] = [line.replace("|", "\\|") for line in lines]


def setup(app: Sphinx) -> None:
    """Register what is done to the text of pages and of docstrings."""
    app.connect("source-read", read)
    app.connect("include-read", include)
    app.connect("build-finished", put_example)
    app.connect("autodoc-process-docstring", plain)
