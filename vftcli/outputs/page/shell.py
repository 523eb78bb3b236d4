"""What every page shares: its frame, its small parts, and what the script is given.

Every word that comes from outside is escaped here or in `vftcli.outputs.grid`.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from vftcli.doctor import Examination, in_words
from vftcli.outputs.examination import warnings_of
from vftcli.signals.remarks import Remark, explanation

HERE = Path(__file__).parent

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
"""The browser loads nothing from anywhere."""


def document(title: str, body: str, data: Mapping[str, Any] | None = None) -> str:
    """A whole HTML page with its style: self-contained, nothing is loaded from anywhere.

    Args:
        title: What the browser's tab is called.
        body: HTML of all sections.
        data: What the script draws, None for a page without charts.
    """
    script = ""
    # JSON in an element of its own cannot run, so that a name in a log cannot either.
    if data is not None:
        script = (
            f'<script type="application/json" id="data">{script_json(data)}</script>'
            f"<script>{asset('page.js')}</script>"
        )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="generator" content="vftcli">'
        f"<title>{escape(title)}</title><style>{asset('page.css')}</style></head>"
        f"<body>{body}{script}</body></html>\n"
    )


def asset(name: str) -> str:
    """The text of a style sheet or script that comes with the package."""
    return (HERE / name).read_text(encoding="utf-8")


def script_json(data: Mapping[str, Any]) -> str:
    """JSON for a ``<script type="application/json">``: nothing in it can end the element."""
    # "<" could begin "</script>"; the two separators end a line in JavaScript but not in JSON.
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", " ").replace("\u2029", " ")


def headline(name: str, text: str) -> str:
    """The top of a report: its name, one sentence, the button for dark pages."""
    return (
        f'<header><h1>{escape(name)}</h1><p class="soft">{escape(text)}</p>'
        '<button type="button" id="theme">dark page</button></header>'
    )


def fact_list(facts: Mapping[str, str]) -> str:
    """Terms and their short descriptions, side by side below the headline."""
    items = (
        f"<div><dt>{escape(name)}</dt><dd>{escape(text)}</dd></div>" for name, text in facts.items()
    )
    return f'<dl class="facts">{"".join(items)}</dl>'


def pairs(table: Mapping[str, Any]) -> str:
    """Names and their values, one below the other."""
    rows = "".join(f"<dt>{escape(str(k))}</dt><dd>{escape(str(v))}</dd>" for k, v in table.items())
    return f'<dl class="pairs">{rows}</dl>'


def bullets(lines: Iterable[Remark | str]) -> str:
    """A bullet list; of a remark it shows the long words."""
    items = "".join(
        f"<li>{escape(explanation(x) if isinstance(x, Remark) else x)}</li>" for x in lines
    )
    return f'<ul class="plain">{items}</ul>'


def remarks(lines: Sequence[Remark]) -> str:
    """What the reader should know before believing a number, "" where there is nothing."""
    if not lines:
        return ""
    return f'<section class="remarks"><h2>Read this first</h2>{bullets(lines)}</section>'


def health(examinations: Sequence[Examination], *, fitting: bool = True) -> str:
    """What is wrong with the logs: evidence, consequence and remedy of every finding.

    Warnings stand open, above everything that they may make wrong; what only informs is folded.
    """
    if not examinations:
        return ""
    several = len(examinations) > 1
    parts = [log_health(one, named=several, fitting=fitting) for one in examinations]
    kind = "remarks" if any(map(warnings_of, examinations)) else "soft"
    return f'<section class="{kind}" id="health"><h2>Log health</h2>{"".join(parts)}</section>'


def log_health(examination: Examination, *, named: bool, fitting: bool) -> str:
    """One log's warnings, each with what it does and what to do, and its notes folded."""
    warnings = warnings_of(examination)
    count = f"{len(warnings)} warning{'s' if len(warnings) > 1 else ''}" if warnings else "sound"
    head = f"{examination.recording.name}: {count}" if named else count
    refused = {finding.code for finding in examination.refusals(fitting=fitting)}
    alarm = (
        '<p class="alarm">MEANINGLESS unless the finding is wrong: these results were made with '
        f"--anyway in spite of {escape(', '.join(sorted(refused)))}.</p>"
        if refused
        else ""
    )
    notes = [finding for finding in examination.findings if finding.level != "warning"]
    return (
        f'<p class="verdict">{escape(head)}</p>{alarm}{"".join(map(finding_block, warnings))}'
        + folded(f"{len(notes)} more noted", "".join(map(finding_block, notes)))
    )


def finding_block(finding: Remark) -> str:
    """A finding: its name and evidence, then what it does and what to do about it."""
    said = in_words(finding)
    rest = "".join(f" {escape(x)}." for x in (said.consequence,) if x)
    remedy = f" <strong>What to do:</strong> {escape(said.remedy)}." if said.remedy else ""
    then = f'<p class="then">{rest}{remedy}</p>' if rest or remedy else ""
    evidence = f"<strong>{escape(said.name)}</strong>: {escape(said.evidence)}."
    return f'<div class="finding"><p>{evidence}</p>{then}</div>'


def soft(text: str) -> str:
    """A paragraph in small type: words that explain what stands beside them. Taken as HTML."""
    return f'<p class="soft">{text}</p>'


def folded(summary: str, html: str) -> str:
    """Something the reader opens with a click, "" where there is nothing."""
    return f"<details><summary>{escape(summary)}</summary>{html}</details>" if html else ""


def chart_places(chosen: str = "Joint", series: str = "Series") -> str:
    """Where the script puts the charts over time, with the buttons that steer them.

    Args:
        chosen: What is chosen by a button: a joint or an axis.
        series: What the legend lists.
    """
    return (
        '<p class="soft help">Drag to zoom in, double-click to see all, shift and drag to pan; '
        f"keys + − ← → Home. Click a small chart to choose its {chosen.lower()}.</p>"
        f'<div id="toolbar"><div class="buttons" id="joints" role="group" aria-label="{chosen}">'
        f'<span class="name">{chosen}</span></div>'
        f'<div id="legend" role="group" aria-label="{series}"><span class="name">{series}</span>'
        '</div><div class="buttons"><button type="button" id="all">Whole span</button></div></div>'
        '<div id="overview"></div><div id="detail"></div>'
        "<noscript><p>The charts need JavaScript; the tables do not.</p></noscript>"
    )


def provenance(record: Mapping[str, Any]) -> str:
    """Command, versions, input, robot and what was repaired: enough to make it again."""
    versions = ", ".join(f"{name} {number}" for name, number in record.get("versions", {}).items())
    command = str(record.get("command") or "through the Python interface")
    robot, source = record.get("robot") or {}, record.get("input")
    table = {}
    if source is not None:
        table = {
            "Log": f"{source.get('path') or 'in memory'} ({source.get('format')})",
            "Log sha256": source.get("sha256") or "–",
            "Clock": source.get("clock"),
            "Rows": f"{source.get('rows')} in the file, {source.get('duplicates')} repeated stamps "
            f"dropped, {source.get('samples')} used",
        }
    table |= {
        "Robot": f"{robot.get('name')} ({robot.get('file') or 'built in'})",
        "Robot sha256": robot.get("sha256") or "–",
        "Versions": versions,
    }
    parts = [f"<h2>Provenance</h2><pre>{escape(command)}</pre>", pairs(table)]
    for name in ("repairs", "warnings", "notes"):
        lines = record.get(name) or ()
        parts.append(f"<h3>{name.capitalize()}</h3>")
        parts.append(bullets(lines) if lines else soft("none"))
    if notes := robot.get("notes"):
        parts.append(f"<h3>Notes on the robot file</h3>{bullets(notes)}")
    return "".join(parts)
