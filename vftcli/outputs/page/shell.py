"""The templates of every page, their parts as functions, and what the page's script is given."""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vftcli.doctor import in_words
from vftcli.outputs.answer import direction, force_size, place_words, reason
from vftcli.outputs.examination import overridden_lines, warnings_of
from vftcli.outputs.page import svg
from vftcli.outputs.page.charts import QUIET, Chart, LineStyle, packed_charts
from vftcli.outputs.quantity import at_least_shown, counted, ranged
from vftcli.signals.parsing import printable
from vftcli.signals.remarks import Remark, explanation

if TYPE_CHECKING:
    from jinja2 import Environment

HERE = Path(__file__).parent
LEVELS = ("warning", "caution", "fact")  #: Levels of a remark, the most serious first.


@cache
def templates() -> "Environment":
    """The templates: what comes from outside is printable and escaped, what is missing an error."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    def shown(value: object) -> object:
        """A value as HTML."""
        return value if hasattr(value, "__html__") else Markup(escape(printable(str(value))))

    made = Environment(
        loader=FileSystemLoader(HERE / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=shown,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals |= {
        "asset": lambda name: Markup(asset(name)),
        "is_plain": re.compile(r"[\w.,=× -]+").fullmatch,
        "QUIET": QUIET,
    }
    functions = (
        overridden_lines,
        in_words,
        direction,
        force_size,
        place_words,
        ranged,
        reason,
        at_least_shown,
    )
    drawing = (svg.ticks, svg.decades, svg.label, svg.scales_of, svg.stripes, svg.strokes)
    made.globals |= {each.__name__: each for each in (*functions, svg.polyline, *drawing)}
    made.filters |= {
        "counted": counted,
        "f1": "{:.1f}".format,
        "known": np.isfinite,
        "polyline": svg.polyline,
        "said": lambda line: explanation(line) if isinstance(line, Remark) else line,
        "warnings_of": warnings_of,
        "worst_first": worst_first,
    }
    return made


def worst_first(remarks: Iterable[Remark]) -> list[str]:
    """The words of every remark once, the most serious first."""
    texts = {explanation(remark): LEVELS.index(remark.level) for remark in remarks}
    return sorted(texts, key=lambda text: texts[text])


def part(name: str, /, *values: object, **named: object) -> str:
    """HTML of a small part of the pages: a macro of a template, as ``parts/top``."""
    file, macro = name.split("/")
    module = templates().get_template(f"{file}.html").module
    return str(getattr(module, macro)(*values, **named)).strip()


def page(
    template: str,
    title: str,
    charts: Sequence[Chart] = (),
    styles: Mapping[str, LineStyle] | None = None,
    scripts: Sequence[str] = (),
    **view: object,
) -> str:
    """A whole HTML page with its style: self-contained, nothing is loaded from anywhere."""
    data = script_json(packed_charts(charts)) if charts else ""
    frame = {"title": title, "styles": styles or {}, "scripts": scripts, "data": data}
    return templates().get_template(template).render(**frame, **view) + "\n"


def asset(name: str) -> str:
    """The text of a style sheet or script that comes with the package."""
    return (HERE / name).read_text(encoding="utf-8")


def script_json(data: object) -> str:
    """JSON for a ``<script type="application/json">``: nothing in it can end the element."""
    # "<" could begin "</script>"; the two separators end a line in JavaScript but not in JSON.
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", " ").replace("\u2029", " ")
