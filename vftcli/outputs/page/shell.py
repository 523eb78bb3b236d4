"""Templates of every page, their parts as functions, and drawing for SVG.

Charts without a script are SVG: places of values, ticks and the text of paths.
"""

import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vftcli.doctor import in_words
from vftcli.outputs import Record
from vftcli.outputs.believability import MARKS
from vftcli.outputs.charts import QUIET, Chart, ChartLine, LineStyle, Span, drawn_line, paint
from vftcli.outputs.contacts import direction, place_words, reason
from vftcli.outputs.error_tables import RESTS
from vftcli.outputs.examination import overridden_lines, warnings_of
from vftcli.outputs.grid import at_least_shown, minus, ranged
from vftcli.outputs.page.packing import PageClock, page_data
from vftcli.signals.arrays import Array, runs_of
from vftcli.signals.parsing import counted, printable
from vftcli.signals.remarks import Remark, sentence

if TYPE_CHECKING:
    from jinja2 import Environment

HERE = Path(__file__).parent
LEVELS = ("warning", "caution", "fact")  #: Levels of a remark, the most serious first.
TICKS = 1.0, 2.0, 5.0, 10.0  #: Leading digits of a tick's distance.
PLAIN = re.compile(r"[a-z]+([-’'][a-z]+)*[,:;]?").fullmatch  #: A word that may have a capital.
TICK_ROOM = 1.4  #: Factor by which a tick's distance may be too small.


def capital(text: str) -> str:
    """A text with a capital, unless a file or an option begins it."""
    first, space, rest = text.partition(" ")
    return f"{first.capitalize()}{space}{rest}" if PLAIN(first) else text


def worst_first(remarks: Iterable[Remark]) -> list[str]:
    """The words of every remark once, the most serious first."""
    texts = {sentence(remark, "long"): LEVELS.index(remark.level) for remark in remarks}
    return sorted(texts, key=lambda text: texts[text])


@cache
def templates() -> "Environment":
    """The templates: texts are escaped, an undefined name raises."""
    from jinja2 import Environment, FileSystemBytecodeCache, FileSystemLoader, StrictUndefined
    from jinja2.bccache import Bucket
    from markupsafe import Markup

    class Kept(FileSystemBytecodeCache):
        """Compiled templates beside their texts."""

        def dump_bytecode(self, bucket: Bucket) -> None:
            """Keep one if the package's folder can be written."""
            with suppress(OSError):
                Path(self.directory).mkdir(exist_ok=True)
                super().dump_bytecode(bucket)

    def shown(value: object) -> object:
        return value if hasattr(value, "__html__") else Markup(escape(printable(str(value))))

    def asset(name: str) -> Markup:
        return Markup((HERE / name).read_text(encoding="utf-8"))

    def options(text: str) -> Markup:
        whole = r'<span class="option">\g<0></span>'
        return Markup(re.sub(r"(?<![\w-])--?[a-z][\w-]*", whole, str(shown(text))))

    made = Environment(
        loader=FileSystemLoader(texts := HERE / "templates"),
        bytecode_cache=None if sys.dont_write_bytecode else Kept(f"{texts}/__pycache__"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=shown,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    drawing = (ticks, label, scales_of, stripes, strokes, paint)
    words = (overridden_lines, in_words, direction, place_words, ranged, reason)
    functions = (*drawing, *words, at_least_shown, asset, Box)
    made.globals |= {each.__name__: each for each in functions}
    made.globals |= {
        "is_plain": re.compile(r"[\w.,=×+ -]+").fullmatch,
        "QUIET": QUIET,
        "RESTS": RESTS,
        "MARKS": MARKS,
    }
    filters = (counted, warnings_of, worst_first, options, capital)
    made.filters |= {each.__name__: each for each in filters}
    made.filters |= {
        "f1": "{:.1f}".format,
        # A number stays on one line with its band and its unit.
        "unbroken": partial(re.sub, r"(?<=[\d±]) (?=[\d±]|k?[Ngs]\b)", "\u00a0"),
        "known": np.isfinite,
        "said": lambda line: sentence(line, "long") if isinstance(line, Remark) else line,
    }
    return made


def part(name: str, /, *values: object, **named: object) -> str:
    """HTML of a part of the pages: a macro, as ``parts/top``."""
    file, macro = name.split("/")
    module = templates().get_template(f"{file}.html").module
    return str(getattr(module, macro)(*values, **named)).strip()


def page(
    template: str,
    title: str,
    charts: Sequence[Chart] = (),
    styles: Mapping[str, LineStyle] | None = None,
    stage: Callable[[PageClock], Record] | None = None,
    about: str = "",
    **view: object,
) -> str:
    """A whole HTML page with its style: self-contained, nothing is loaded.

    `stage` makes the script's other data, by the first chart's clock; `about` is the first
    line of the page's CSV files.
    """
    data = script_json({"about": about} | page_data(charts, stage)) if charts else ""
    frame = {"title": title, "styles": styles or {}, "data": data}
    return templates().get_template(template).render(**frame, drawn=charts, **view) + "\n"


def script_json(data: object) -> str:
    """JSON for a ``<script>`` element that it cannot end."""
    # "<" could begin "</script>"; two separators end JavaScript's lines.
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", " ").replace("\u2029", " ")


class Box(NamedTuple):
    """A chart's size and margins, in units of the drawing."""

    width: float = 460.0
    height: float = 132.0
    left: float = 38.0  #: Room for the numbers beside the vertical axis.
    bottom: float = 18.0  #: Room for the numbers below.
    top: float = 8.0
    right: float = 8.0


class Scales(NamedTuple):
    """Places of values in the drawing."""

    box: Box
    x: Span  #: Ends of the horizontal axis.
    y: Span  #: Ends of the vertical axis.

    def across(self, x: Array | float) -> Array:
        """Horizontal places."""
        share = (np.asarray(x) - self.x.low) / ((self.x.high - self.x.low) or 1.0)
        return self.box.left + share * (self.side - self.box.left)

    def up(self, y: Array | float) -> Array:
        """Vertical places, which count downwards."""
        share = (np.asarray(y) - self.y.low) / ((self.y.high - self.y.low) or 1.0)
        return self.floor - share * (self.floor - self.box.top)

    def near(self, y: Array) -> Array:
        """Vertical places; those far outside are moved near the chart."""
        height = self.y.high - self.y.low
        return self.up(np.clip(y, self.y.low - height, self.y.high + height))

    def inside(self, span: Sequence[float]) -> Array:
        """Horizontal places of times, clipped to the chart."""
        return self.across(np.clip(span, *self.x))

    @property
    def floor(self) -> float:
        """Lower end of the plot."""
        return self.box.height - self.box.bottom

    @property
    def side(self) -> float:
        """Right end of the plot."""
        return self.box.width - self.box.right


def ticks(span: Span, count: int) -> list[float]:
    """Round numbers along an axis, about as many as wanted."""
    width = (span.high - span.low) / max(count, 1)
    if not np.isfinite(width) or width <= 0.0:
        return [span.low]
    power = 10.0 ** np.floor(np.log10(width))
    # Rather a few numbers too many.
    step = next(s for s in TICKS if width <= TICK_ROOM * s * power) * power
    first, last = np.ceil(span.low / step - 1e-9), np.floor(span.high / step + 1e-9)
    found = [float(k * step) for k in np.arange(first, last + 1)]
    # One or two numbers do not show the scale.
    return found if len(found) >= min(count, 3) else ticks(span, count + 2)


def label(value: float) -> str:
    """A tick's number, with an exponent only if needed."""
    return minus(f"{value + 0.0:.6g}")


def scales_of(chart: Chart, box: Box) -> Iterator[Scales]:
    """The scales of every panel's picture."""
    families = chart.families or chart.units
    ends = {family: chart.ends(families.index(family)) for family in set(families)}
    x = Span(float(chart.x[0]), float(chart.x[-1]))
    return (Scales(box, x, ends[family]) for family in families)


def strokes(scales: Scales, chart: Chart, line: ChartLine, panel: int) -> tuple[str, str, str]:
    """Paths of a line in a panel: ribbon, grey part, line; "" for none."""
    t, y, halves = drawn_line(chart, line, panel)
    own, quiet = (
        (ribbon(scales, t, y - half, y + half) for half in halves) if halves else ("", "")
    )
    return own, quiet, path_of(scales, t, y)


def path_of(scales: Scales, t: Array, y: Array) -> str:
    """A line as an SVG path, broken at unknown values."""
    points = np.column_stack([scales.across(t), scales.near(y)])
    runs = runs_of(np.isfinite(points.sum(axis=1)))
    return "".join(polyline(points[start:stop]) for start, stop in runs)


def polyline(points: Array | Sequence[Array]) -> str:
    """Points as an SVG path, to a tenth; a single one is a dot. (K, 2)"""
    tenths = np.rint(10.0 * np.asarray(points)).astype(int)
    first, *moves = np.vstack([tenths[:1], np.diff(tenths, axis=0)]).tolist()
    # From point to point: "l.5-1.1.6.2" is shorter than two places.
    text = "".join(f"{tenth(x)}{tenth(y)}" for x, y in moves)
    return f"M{first[0] / 10:g} {first[1] / 10:g}" + (f"l{text.lstrip()}" if moves else "h.01")


def tenth(number: int) -> str:
    """A number of tenths in a path, behind a sign or a space."""
    whole, rest = divmod(abs(number), 10)
    text = f"{whole or ''}.{rest}" if rest else f"{whole}"
    return f"-{text}" if number < 0 else f" {text}"


def ribbon(scales: Scales, t: Array, low: Array, high: Array) -> str:
    """The area between two lines as an SVG path."""
    above, below = (
        np.column_stack([scales.across(t), scales.near(edge)]) for edge in (high, low)
    )
    spans = (slice(*run) for run in runs_of(np.isfinite(low) & np.isfinite(high)))
    return "".join(f"{polyline(np.vstack([above[s], below[s][::-1]]))}Z" for s in spans)


def stripes(scales: Scales, spans: Sequence[tuple[float, float]]) -> str:
    """Many stretches of time from top to floor as one path."""
    top, height, path = scales.box.top, scales.floor - scales.box.top, ""
    for left, right in scales.across(np.reshape(spans, (-1, 2))):
        width = max(right - left, 0.5)
        path += f"M{left:.1f} {top:g}h{width:.1f}v{height:g}h{-width:.1f}z"
    return path
