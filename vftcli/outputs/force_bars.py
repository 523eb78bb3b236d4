"""|F| over time as bars of text: where the listed contacts are, and how hard they were."""

from collections.abc import Sequence

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact
from vftcli.outputs.canvas import Canvas
from vftcli.signals.arrays import Array

ROWS = 3  #: Lines of the bars.
#: How full a letter is, from empty to full.
STEPS, ASCII_STEPS = " ▁▂▃▄▅▆▇█", " .-=#"
LABELS = 9  #: Seconds that are written below the bars, about.


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
    """The bars, seconds and the contacts' numbers below them.

    Args:
        t: Time. (T,) [s]
        force: |F|. (T,) [N]
        contacts: Those with a number.
        canvas: What the terminal can show.
    """
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
    line = [" "] * (columns + 8)
    for k in range(int(np.floor(span / step + 1e-9)) + 1):
        text = f"{t[0] + k * step:g}"
        put(line, round(k * step / max(span, 1e-9) * columns), text)
    return "".join(line).rstrip() + " s"


def contact_numbers(t: Array, contacts: Sequence[Contact], columns: int) -> str:
    """The line of the contacts' numbers, each below its peak, where there is room."""
    line = [" "] * (columns + 8)
    span = max(float(t[-1] - t[0]), 1e-9)
    for contact in contacts:
        put(line, int((contact.peak - t[0]) / span * columns), str(contact.number))
    return "".join(line).rstrip()


def put(line: list[str], at: int, text: str) -> None:
    """Write a text into a line of letters, unless something is in the way."""
    around = line[max(at - 1, 0) : at + len(text) + 1]
    if at + len(text) < len(line) and set(around) == {" "}:
        line[at : at + len(text)] = text
