"""Canvas: what a terminal can show, text that fits it, and |F| over time as bars of text."""

import textwrap
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact
from vftcli.signals.arrays import Array

NARROWEST, WIDEST = 72, 100  #: Columns that a screen uses at least, and at most.
ROWS = 3  #: Lines of the bars.
#: How full a letter is, from empty to full.
STEPS, ASCII_STEPS = " ▁▂▃▄▅▆▇█", " .-=#"
LABELS = 9  #: Seconds that are written below the bars, about.
#: Style → ANSI code.
STYLES = {"good": "32", "caution": "33", "bad": "31", "unknown": "2", "bold": "1", "bar": "36"}
#: ASCII for a letter on a terminal without it.
PLAIN = {
    "·": "-", "–": "-", "−": "-", "…": "...", "±": "+/-", "≤": "<=", "→": "->", "°": " deg",
    "✓": "+", "△": "!", "✗": "x", "┤": "|", "ω": "w", "τ": "tau", "×": "x", "≥": ">=", "√": "sqrt",
    "₃": "3", "²": "2", "≈": "~", "’": "'",
}  # fmt: skip


class Canvas(NamedTuple):
    """Abilities of a terminal."""

    width: int = 80  #: Columns that are used.
    unicode: bool = True  #: Whether it has more letters than ASCII.
    colour: bool = False  #: Whether it has colours.

    @classmethod
    def of(cls, *, columns: int, unicode: bool, colour: bool) -> Self:
        """The canvas of a terminal with so many columns."""
        return cls(min(max(columns, NARROWEST), WIDEST), unicode, colour)

    def painted(self, text: str, style: str) -> str:
        """A text in a style, as it is where there are no colours."""
        return f"\x1b[{STYLES[style]}m{text}\x1b[0m" if self.colour and text else text

    def shown(self, text: str) -> str:
        """A text in letters that the terminal has."""
        if self.unicode:
            return text
        plain = "".join(PLAIN.get(letter, letter) for letter in text)
        return plain.encode("ascii", "replace").decode()

    def wrapped(self, text: str, indent: int, lines: int | None = None) -> list[str]:
        """A text in lines behind an indent, cut behind so many of them; the first has none."""
        found = textwrap.wrap(
            text,
            self.width - indent,
            max_lines=lines,
            placeholder=" …",
            break_long_words=False,
            break_on_hyphens=False,
        )
        return [line if k == 0 else " " * indent + line for k, line in enumerate(found or [""])]


def forces_of_list(analysis: Analysis) -> Array | None:
    """|F| of the listed contacts along a log, zero outside of them; None without any. (T,) [N]"""
    if analysis.contacts is None or analysis.contacts.hardest is None:
        return None
    t, force = analysis.t, np.zeros(len(analysis.t))
    for contact in analysis.contacts.contacts:
        if (course := contact.course) is not None:
            inside = (t >= contact.start) & (t <= contact.stop)
            force[inside] = np.interp(t[inside], course.t, course.force)
    return force


def force_bars(t: Array, force: Array, contacts: Sequence[Contact], canvas: Canvas) -> list[str]:
    """|F| [N] over time [s] as bars, seconds and the contacts' numbers below them. (T,)"""
    top = float(force.max())
    labels = [f"{top * row / (ROWS - 1):.0f}" for row in range(ROWS)]
    left = max(map(len, labels))
    columns = canvas.width - left - 8
    levels = column_peaks(t, force, columns) / max(top, 1e-9)
    steps = STEPS if canvas.unicode else ASCII_STEPS
    full = len(steps) - 1
    # The lowest step is the line on which nothing touches.
    height = np.maximum(np.ceil(levels * ROWS * full), 1).astype(int)
    lines = [f"  {'N':>{left}}"]
    for row in range(ROWS - 1, -1, -1):
        letters = "".join(steps[k] for k in np.clip(height - row * full, 0, full))
        bar = canvas.painted(letters.rstrip(), "bar")
        lines.append(f"  {labels[row]:>{left}} {canvas.shown('┤')}{bar}")
    indent = " " * (left + 4)
    lines.append(f"{indent}{seconds(t, columns)}")
    if numbers := contact_numbers(t, contacts, columns):
        lines.append(f"  {'#':>{left}}{' ' * 2}{numbers}")
    return lines


def column_peaks(t: Array, force: Array, columns: int) -> Array:
    """The largest |F| in each of so many equal spans of time. (columns,) [N]"""
    edges = np.linspace(t[0], t[-1], columns + 1)
    # A span without a sample gets the line between its neighbours.
    peaks = np.interp(0.5 * (edges[1:] + edges[:-1]), t, force)
    place = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, columns - 1)
    np.maximum.at(peaks, place, force)
    return peaks


def seconds(t: Array, columns: int) -> str:
    """The line of seconds below so many columns."""
    span = float(t[-1] - t[0])
    raw = span / LABELS
    decade = 10.0 ** np.floor(np.log10(raw)) if raw > 0 else 1.0
    step = next(decade * m for m in (1, 2, 5, 10) if decade * m >= raw)
    each = [k * step for k in range(int(np.floor(span / step + 1e-9)) + 1)]
    share = columns / max(span, 1e-9)
    return placed(((round(x * share), f"{t[0] + x:g}") for x in each), columns) + " s"


def contact_numbers(t: Array, contacts: Sequence[Contact], columns: int) -> str:
    """The line of the contacts' numbers, each below its peak, where there is room."""
    share = columns / max(float(t[-1] - t[0]), 1e-9)
    return placed(((int((c.peak - t[0]) * share), str(c.number)) for c in contacts), columns)


def placed(texts: Iterable[tuple[int, str]], columns: int) -> str:
    """A line with texts at their places, but for those that something is in the way of."""
    line = [" "] * (columns + 8)
    for at, text in texts:
        around = line[max(at - 1, 0) : at + len(text) + 1]
        if at + len(text) < len(line) and set(around) == {" "}:
            line[at : at + len(text)] = text
    return "".join(line).rstrip()
