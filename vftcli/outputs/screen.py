"""A command's screen on its logs, for any terminal: forty lines at most."""

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.doctor.examination import doubt
from vftcli.observers.table import BEST, PAPER
from vftcli.outputs import Record
from vftcli.outputs.believability import (
    LOG_COLUMNS,
    MARKS,
    Ground,
    LogSummary,
    Standing,
    grounds,
    headline,
    health,
    log_line,
    own_match,
)
from vftcli.outputs.contacts import LEGEND, contact_grid, forces_along, hardest_rows, otherwise
from vftcli.outputs.examination import rate_of, refused_codes
from vftcli.outputs.grid import DASH, GridCell, keyed_grid, percent, significant, terminal
from vftcli.outputs.grids import contact_grids
from vftcli.signals.arrays import Array
from vftcli.signals.parsing import printable

if TYPE_CHECKING:
    from vftcli.outputs.error_tables import Block

MOST_LINES = 40
#: Lines on written files: a blank one, two of names, the page.
FILE_LINES = 4

#: Lines of a ground and rows of the table, None for all; then fewer, until it fits.
#:
#: A good ground has a line less than the others, at least one. At 0 the good grounds
#: share a line and the others have one each.
FORMS = ((None, None), (3, 20), (2, 20), (1, 20), *((0, rows) for rows in range(20, 2, -1)))

MOST_LOGS, WORST = 20, 3  #: Most logs shown, and findings below them.
SUBJECT = 17  #: Columns of a ground's subject.

NARROWEST, WIDEST = 40, 100  #: Least and most columns of a screen.
ROWS = 3  #: Lines of the bars.
#: Letters of a bar, from empty to full.
STEPS, ASCII_STEPS = " ▁▂▃▄▅▆▇█", " .-=#"
LABELS = 9  #: Rough number of times below the bars.
#: Style → ANSI code.
STYLES = {"good": "32", "caution": "33", "bad": "31", "unknown": "2", "bold": "1", "bar": "36"}
#: ASCII for a letter on a terminal without it.
PLAIN = str.maketrans({
    "·": "-", "–": "-", "−": "-", "…": "...", "±": "+/-", "≤": "<=", "→": "->", "°": " deg",
    "✓": "+", "△": "!", "✗": "x", "┤": "|", "ω": "w", "τ": "tau", "×": "x", "≥": ">=", "√": "sqrt",
    "₃": "3", "²": "2", "≈": "~", "’": "'",
})  # fmt: skip


class Canvas(NamedTuple):
    """Abilities of a terminal."""

    width: int = 80  #: Columns that are used.
    unicode: bool = True  #: Whether it has more letters than ASCII.
    colour: bool = False

    def painted(self, text: str, style: str) -> str:
        """A text in a style, unchanged without colours."""
        return f"\x1b[{STYLES[style]}m{text}\x1b[0m" if self.colour and text else text

    def shown(self, text: str) -> str:
        """A text in the terminal's letters."""
        if self.unicode:
            return text
        return text.translate(PLAIN).encode("ascii", "replace").decode()

    def wrapped(self, text: str, indent: int, lines: int | None = None) -> list[str]:
        """A text in at most `lines` lines, with a hanging indent."""
        found = textwrap.wrap(
            text,
            self.width - indent,
            max_lines=lines,
            placeholder=" …",
            break_long_words=False,
            break_on_hyphens=False,
        )
        return [line if k == 0 else " " * indent + line for k, line in enumerate(found or [""])]


def short_screen(analysis: Analysis, canvas: Canvas) -> str:
    """Facts and the answer."""
    lines = [*head_lines(analysis, canvas), *doubt_lines(analysis, canvas)]
    return canvas.shown("\n".join(lines)) + "\n"


def log_screen(
    analysis: Analysis, canvas: Canvas, *, most: int = MOST_LINES, every: bool = False
) -> str:
    """The screen of one log, of so many lines at most."""
    head, listed, found = first_lines(analysis, canvas), analysis.contacts, grounds(analysis)
    tail, text = doubt_lines(analysis, canvas), ""
    if analysis.errors is not None:
        # Polars takes a tenth of the time of a list without a reference.
        from vftcli.outputs.error_tables import blocks

        for block in blocks(analysis.errors)[:1]:
            tail += canvas.wrapped(against(block, analysis), 2)
    for grid in contact_grids(analysis.errors):
        tail += terminal(grid).splitlines()
    if (printed := analysis.published) is not None:
        tail += canvas.wrapped(f"Beside {printed.published.title} → --details", 2)
    for each, rows in FORMS[:1] if every else FORMS[1:]:
        table = [] if listed is None else list_lines(listed, rows, canvas)
        believed = belief_lines(found, canvas, each)
        text = head + canvas.shown(paragraphs(table, believed + tail)) + "\n"
        if text.count("\n") <= most:
            break
    return text


def first_lines(analysis: Analysis, canvas: Canvas) -> str:
    """Facts, answer and |F| as bars: what needs no observer."""
    first, *answered = head_lines(analysis, canvas)
    bars = list[str]()
    if sized := [contact for contact in analysis.listed if contact.size_known]:
        shown = [] if analysis.listed[0].is_load else hardest_rows(analysis.listed)
        force, _ = forces_along(sized, analysis.t)
        bars = force_bars(analysis.t, np.nan_to_num(force), shown, canvas)
    return canvas.shown(paragraphs([first, "", *answered], bars)) + "\n\n"


def paragraphs(*parts: Sequence[str]) -> str:
    """Lines of paragraphs, an empty one between two."""
    return "\n\n".join("\n".join(part) for part in parts if part)


def head_lines(analysis: Analysis, canvas: Canvas) -> list[str]:
    """The facts, and the answer in a sentence."""
    lines = canvas.wrapped(printable(headline(analysis)), 2)
    return [canvas.painted(facts(analysis), "bold"), *(f"  {line.strip()}" for line in lines)]


def facts(analysis: Analysis) -> str:
    """Log, arm and its fit, duration, rate."""
    recording, match, fit = analysis.recording, own_match(analysis), ""
    if match is not None:
        fit = f" ({'' if match.fits else 'does not fit: '}model error {percent(match.misfit)})"
    span = f"{recording.duration:.1f} s"
    if rate := rate_of(recording):
        span += f" at {rate:{'.0f' if rate >= 100.0 else '.3g'}} Hz"
    return printable(f"{recording.name} · {analysis.robot.name}{fit} · {span}")


def doubt_lines(analysis: Analysis, canvas: Canvas) -> list[str]:
    """Warning on meaningless results made anyway."""
    codes = ", ".join(refused_codes(analysis.examinations))
    return canvas.wrapped(doubt(codes), 2) if codes else []


def written_lines(
    folder: Path, names: Iterable[str], canvas: Canvas, *, several: bool = False
) -> list[str]:
    """Written files, if present, and the page to open."""
    there = [name for name in names if (folder / name).exists()]
    there += ["one folder a log"] * several
    lines = canvas.wrapped(printable(f"{folder}/  {'  '.join(there)}"), 2)
    # A page of another run is not shown.
    if "index.html" in there:
        page = printable(str(folder / "index.html"))
        lines.append(f"Open: {page}        More here: --details")
    return lines


def list_lines(found: ContactList, most: int | None, canvas: Canvas) -> list[str]:
    """The rows of a list, and the rest of its log."""
    contacts, rest = found.contacts, otherwise(found, most is None)
    if not contacts and (most is not None or not found.candidates):
        return [f"  {rest}"] if rest else []
    shown = hardest_rows(contacts, len(contacts) if most is None else most)
    lines = terminal(contact_grid(shown), canvas.shown, 2).splitlines() if shown else []
    if len(shown) < len(contacts):
        lines.append(f"the {len(shown)} hardest of {len(contacts)}; --details shows all")
    if most is None and found.candidates:
        lines += ["", "Candidates, with too little evidence or force to be listed:"]
        lines += terminal(contact_grid(found.candidates), canvas.shown, 2).splitlines()
    below = [rest] * bool(rest) + [f"({LEGEND})"] * (found.hardest is not None)
    lines += (line for text in below for line in canvas.wrapped(text, 2))
    return [f"  {line}" if line else "" for line in lines]


def belief_lines(found: Sequence[Ground], canvas: Canvas, most: int | None) -> list[str]:
    """Lines of grounds, one for a good one; remedies below."""
    lines = ["Can it be believed?"]
    good = [ground for ground in found if ground.standing == "good"]
    if most == 0 and len(good) > 1:
        mark = canvas.painted(canvas.shown(MARKS["good"]), "good")
        lines.append(f"  {mark} {' · '.join(dict.fromkeys(g.subject for g in good))}")
        found = [ground for ground in found if ground not in good]
    for ground in found:
        room = None if most is None else max(most - (ground in good), 1)
        lines += ground_lines(ground, canvas, room)
    return lines


def ground_lines(
    ground: Ground, canvas: Canvas, most: int | None, about: str = ""
) -> Iterator[str]:
    """Lines of one ground, then its remedy."""
    subject, indent = f"{about}: {ground.subject}" if about else ground.subject, SUBJECT + 5
    first, *more = canvas.wrapped(printable(ground.sentence), indent, most)
    mark = canvas.painted(canvas.shown(MARKS[ground.standing]), ground.standing)
    if len(subject) > SUBJECT:
        yield f"  {mark} {printable(subject)}"
        yield f"{'':{indent}}{first}"
    else:
        yield f"  {mark} {subject:<{SUBJECT}} {first}"
    yield from more
    if ground.remedy:
        # A command stays on one line, to be copied.
        room = indent if indent + len(ground.remedy) <= canvas.width else 4
        yield f"{'':{room}}{printable(ground.remedy)}"


def against(block: "Block", analysis: Analysis) -> str:
    """One line on the errors: the least, and the others' range."""
    means = block.means
    if not means.errors:
        return f"Against {block.reference}: no sample in common with the estimates"
    (name, least), *others = means.errors.items()
    floor = f" (own error {significant(means.floor, 2)} N·m)" if block.has_floor else ""
    text = f"Against {printable(block.reference)}{means.left_out}{floor}: "
    text += f"RMSE {significant(least, 2)} N·m ({name})"
    if others:
        paper = name == BEST and any(other in PAPER for other, _ in others)
        sizes = sorted(value for _, value in others)
        ends = dict.fromkeys(significant(sizes[k], 2) for k in (0, -1))
        group = "the paper's gains" if paper and analysis.of_robot_file else "the others"
        text += f"; {group} {'–'.join(ends)} N·m"
    return f"{text} → --details"


def logs_screen(
    analyses: Sequence[Analysis],
    canvas: Canvas,
    failed: Mapping[str, str],
    *,
    every: bool = False,
) -> str:
    """The screen of several logs: a line each, then findings."""
    lines = [log_line(analysis) for analysis in analyses]
    free = dict.fromkeys(r.recording.name for a in analyses for r in a.motion.runs)
    parts = (
        f"{len(lines) + len(failed)} logs",
        " and ".join(dict.fromkeys(line.robot for line in lines)),
        f"{len(failed)} left out" if failed else "",
        f"free motion from {', '.join(free)}" if free else "",
    )
    texts = [canvas.painted(printable(" · ".join(filter(None, parts))), "bold"), ""]
    shown = lines
    if not every and len(lines) > MOST_LOGS:
        # The worst and hardest, in the order of the logs.
        ranks = sorted(range(len(lines)), key=lambda k: lines[k].rank)
        shown = [lines[k] for k in sorted(ranks[:MOST_LOGS])]
    texts += [f"  {text}" for text in log_table(shown, failed, canvas)]
    if len(shown) < len(lines):
        texts.append(f"  the {len(shown)} worst and hardest of {len(lines)}; --details shows all")
    findings = [
        (ground, line.log)
        for standing in ("bad", "caution")
        for line in lines
        for ground in line.grounds
        if ground.of_log and ground.standing == standing
    ]
    if findings:
        texts += ["", "Can it be believed?"]
        for ground, name in findings if every else findings[:WORST]:
            texts += ground_lines(ground, canvas, None if every else 2, name)
        if len(findings) > WORST and not every:
            texts.append(f"  and {len(findings) - WORST} more: --details")
    return canvas.shown("\n".join(texts)) + "\n"


def log_table(
    lines: Sequence[LogSummary], failed: Mapping[str, str], canvas: Canvas
) -> list[str]:
    """One line a log: its contacts and its health."""

    def painted(how: Standing, state: str) -> GridCell:
        return GridCell("", mark=canvas.painted(canvas.shown(f"{MARKS[how]} {state}"), how))

    left = {"robot"} if any(line.error != DASH for line in lines) else {"robot", "error"}
    columns = {key: column for key, column in LOG_COLUMNS.items() if key not in left}
    rows = list[Record]()
    for line in lines:
        state = "sound" if line.health == "good" else health(line.grounds).subject
        rows.append(line.row(health=painted(line.health, state)))
    empty, out = dict.fromkeys(columns, ""), painted("bad", "left out")
    rows += [empty | {"log": name, "health": out} for name in failed]
    return terminal(keyed_grid(columns, rows), canvas.shown, 2).splitlines()


def force_bars(t: Array, force: Array, contacts: Sequence[Contact], canvas: Canvas) -> list[str]:
    """|F| [N] as bars, above seconds and contacts' numbers. (T,)"""
    top = force.max()
    labels = [f"{top * row / (ROWS - 1):.0f}" for row in range(ROWS)]
    left = max(map(len, labels))
    columns = canvas.width - left - 8
    levels = column_peaks(t, force, columns) / max(top, 1e-9)
    steps = STEPS if canvas.unicode else ASCII_STEPS
    full = len(steps) - 1
    # The lowest step is no contact.
    height = np.maximum(np.ceil(levels * ROWS * full), 1).astype(int)
    lines = [f"  {'N':>{left}}"]
    for row in range(ROWS - 1, -1, -1):
        letters = "".join(steps[k] for k in np.clip(height - row * full, 0, full))
        bar = canvas.painted(letters.rstrip(), "bar")
        lines.append(f"  {labels[row]:>{left}} {canvas.shown('┤')}{bar}")
    lines.append(f"{'':{left + 4}}{seconds(t, columns)}")
    share = columns / max(t[-1] - t[0], 1e-9)
    each = ((int((c.peak - t[0]) * share), str(c.number)) for c in contacts)
    if numbers := placed(each, columns):
        lines.append(f"  {'#':>{left}}  {numbers}")
    return lines


def column_peaks(t: Array, force: Array, columns: int) -> Array:
    """The largest |F| in equal spans of time. (columns,) [N]"""
    edges = np.linspace(t[0], t[-1], columns + 1)
    # A span without a sample is interpolated.
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
    each = step * np.arange(np.ceil(t[0] / step - 1e-9) + 0.0, t[-1] / step + 1e-9)
    share = columns / max(span, 1e-9)
    texts = ((round((x - t[0]) * share), f"{x:g}") for x in each.tolist())
    # The last one and its unit end where the screen does.
    return (
        placed(((min(at, columns + 2 - len(text)), text) for at, text in texts), columns) + " s"
    )


def placed(texts: Iterable[tuple[int, str]], columns: int) -> str:
    """A line with texts at their places, none over another."""
    line = [" "] * (columns + 8)
    for at, text in texts:
        around = line[max(at - 1, 0) : at + len(text) + 1]
        if at + len(text) < len(line) and set(around) == {" "}:
            line[at : at + len(text)] = text
    return "".join(line).rstrip()
