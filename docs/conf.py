"""Builds these pages as a site: python -m sphinx -W docs OUT (the extra docs)."""

import re
from pathlib import Path

from sphinx.application import Sphinx

DOCS = Path(__file__).parent
VERSION = (DOCS.parent / "vftcli" / "signals" / "version.py").read_text(encoding="utf-8")

project = "vftcli"
author = "the vftcli developers"
release = re.findall(r'"(.*)"', VERSION)[-1]
html_title = f"vftcli {release}"
html_theme = "furo"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
smartquotes = False  # it makes one dash of the two before an option
extensions = ["myst_parser"]
myst_heading_anchors = 3


def navigation(text: str) -> str:
    """The page that lists all pages, with the README above it and its own sections as the menu."""
    menu = []
    for title, section in re.findall(r"^## (.*)\n((?:(?!## ).*\n)*)", text, re.MULTILINE):
        pages = re.findall(r"\[(\w)([^]]*)\]\(([\w-]+)\.md\)", section)
        lines = "".join(f"{first.upper()}{rest} <{page}>\n" for first, rest, page in pages)
        menu.append(f"```{{toctree}}\n:hidden:\n:caption: {title}\n\n{lines}```")
    readme = "```{include} ../README.md\n:relative-docs: docs/\n:relative-images:\n```"
    return "\n\n".join([readme, re.sub(r"^#", "##", text, flags=re.MULTILINE), *menu])


def read(app: Sphinx, page: str, source: list[str]) -> None:
    """Take a page's text before it is parsed: what lies outside of docs/ is named, not linked."""
    del app
    source[0] = re.sub(r"\[([^]]*)\]\(\.\./[^)]*\)", r"\1", source[0])
    if page == "index":
        source[0] = navigation(source[0])


def setup(app: Sphinx) -> None:
    """Register what is done to the text of pages."""
    app.connect("source-read", read)
