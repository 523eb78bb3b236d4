"""What every page shares: its frame, its small parts, and what the script is given.

Every word that comes from outside is escaped here or in `vftcli.outputs.grid`.
"""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from vftcli.doctor import Examination, in_words
from vftcli.outputs.examination import overridden_lines, warnings_of
from vftcli.outputs.page.charts import INK, Chart, LineStyle, packed_charts
from vftcli.outputs.quantity import counted
from vftcli.signals.remarks import Remark, explanation

HERE = Path(__file__).parent

#: The browser loads nothing from anywhere.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


def document(
    title: str,
    body: str,
    charts: Sequence[Chart] = (),
    styles: Mapping[str, LineStyle] | None = None,
    scripts: Sequence[str] = (),
) -> str:
    """A whole HTML page with its style: self-contained, nothing is loaded from anywhere."""
    script = "".join(f"<script>{asset(name)}</script>" for name in scripts)
    style = asset("page.css") + swatch_rules(styles or {})
    # JSON in an element of its own cannot run, so that a name in a log cannot either.
    if charts:
        style += asset("uplot.css")
        script += (
            f'<script type="application/json" id="data">{script_json(packed_charts(charts))}'
            f"</script><script>/*{asset('uplot_licence.txt')}*/{asset('uplot.js')}</script>"
            f"<script>{asset('page.js')}</script>"
        )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="generator" content="vftcli">'
        f"<title>{escape(title)}</title><style>{style}</style></head>"
        f"<body>{body}{script}</body></html>\n"
    )


def swatch_rules(styles: Mapping[str, LineStyle]) -> str:
    """Style of the short line before a name that heads a row: the line's own colour and dash."""
    rules = []
    for name, (colour, dash) in styles.items():
        # A name from a file could end the rule: it goes without a colour.
        if re.fullmatch(r"[\w.,=× -]+", name):
            kind = "solid" if not dash else "dashed" if float(dash.split()[0]) > 3 else "dotted"
            paint = "var(--ink)" if colour == INK else colour
            rules.append(f'[data-swatch="{name}"]::before{{border-top:3px {kind} {paint}}}')
    return "".join(rules)


def asset(name: str) -> str:
    """The text of a style sheet or script that comes with the package."""
    return (HERE / name).read_text(encoding="utf-8")


def script_json(data: object) -> str:
    """JSON for a ``<script type="application/json">``: nothing in it can end the element."""
    # "<" could begin "</script>"; the two separators end a line in JavaScript but not in JSON.
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", " ").replace("\u2029", " ")


def top(eyebrow: Sequence[str], headline: str, lead: str = "") -> str:
    """The top of a page: what it is about, the answer in words, and what follows from it."""
    facts = " · ".join(escape(part) for part in eyebrow if part)
    return f'<header><p class="eyebrow">{facts}</p><h1>{escape(headline)}</h1>{lead}</header>'


def lead(*sentences: str) -> str:
    """A paragraph below a headline, "" without a word."""
    text = " ".join(escape(sentence) for sentence in sentences if sentence)
    return f'<p class="lead">{text}</p>' if text else ""


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


def all_remarks(lines: Iterable[Remark]) -> str:
    """Every remark once, the most serious first; "" without any."""
    texts = {explanation(remark): remark.level for remark in lines}
    order = ("warning", "caution", "fact")
    found = sorted(texts, key=lambda text: order.index(texts[text]))
    return section("Remarks", bullets(found), f"{len(found)}") if found else ""


def alarms(examinations: Sequence[Examination], *, fitting: bool = True) -> str:
    """What stands above everything where results were wanted in spite of a finding."""
    lines = overridden_lines(examinations, fitting=fitting)
    return "".join(f'<p class="alarm">{escape(line)}</p>' for line in lines)


def health(examinations: Sequence[Examination], *, opened: bool = False) -> str:
    """What is wrong with the logs: evidence, consequence and remedy of every finding."""
    if not examinations:
        return ""
    named = len(examinations) > 1
    parts, count = [], 0
    for one in examinations:
        warnings = warnings_of(one)
        count += len(warnings)
        notes = [finding for finding in one.findings if finding.level != "warning"]
        head = f"<h3>{escape(one.recording.name)}</h3>" if named else ""
        found = "".join(map(finding_block, (*warnings, *notes)))
        parts.append(head + (found or soft("Nothing was found.")))
    state = counted(count, "warning") if count else "sound"
    return section("Log health", "".join(parts), state, name="health", opened=opened and count > 0)


def finding_block(finding: Remark) -> str:
    """A finding: its name and evidence, then what it does and what to do about it."""
    said = in_words(finding)
    rest = f" {escape(said.consequence)}." if said.consequence else ""
    remedy = f" <strong>What to do:</strong> {escape(said.remedy)}." if said.remedy else ""
    then = f'<p class="then">{rest}{remedy}</p>' if rest or remedy else ""
    evidence = f"<strong>{escape(said.name)}</strong>: {escape(said.evidence)}."
    return f'<div class="finding"><p>{evidence}</p>{then}</div>'


def soft(text: str) -> str:
    """A paragraph in small type: words that explain what stands beside them. Taken as HTML."""
    return f'<p class="soft">{text}</p>'


def section(title: str, html: str, state: str = "", *, name: str = "", opened: bool = False) -> str:
    """A part of the details that the reader opens with a click, "" where there is nothing."""
    if not html:
        return ""
    words = f" <span>· {escape(state)}</span>" if state else ""
    mark = f' id="{name}"' if name else ""
    head = f"<summary>{escape(title)}{words}</summary>"
    return f"<details{mark}{' open' * opened}>{head}{html}</details>"


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
    notes = robot.get("notes")
    more = f"<h3>Notes on the robot file</h3>{bullets(notes)}" if notes else ""
    return section(
        "Conventions and provenance",
        "".join(
            (
                pairs(record.get("conventions", {})),
                f"<pre>{escape(command)}</pre>",
                pairs(table),
                more,
            )
        ),
        name="provenance",
    )
