"""A command's screen on its logs: the answer.

Facts, the answer in a sentence, |F| over time, the contacts, whether it can be believed, the errors
against a reference, and what was written: forty lines at most, whatever the number of logs.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import ContactList
from vftcli.outputs.answer import answer, otherwise
from vftcli.outputs.believability import (
    MARKS,
    Ground,
    grounds,
    headline,
    health,
    log_line,
    own_match,
)
from vftcli.outputs.canvas import Canvas, force_bars, forces_of_list
from vftcli.outputs.contacts import MOST_ROWS, contact_grid, hardest_rows
from vftcli.outputs.error_tables import Block, blocks
from vftcli.outputs.examination import rate_of, refused_codes
from vftcli.outputs.grid import Column, Grid, terminal
from vftcli.outputs.grids import contact_grids
from vftcli.outputs.quantity import DASH, at_least_shown, percent, significant
from vftcli.signals.parsing import printable
from vftcli.signals.remarks import sentence

MOST_LINES = 40  #: Lines of a screen.
FILE_LINES = 4  #: Of them, those that name what was written: a blank one, two of names, the page.

#: Lines of a ground and rows of the table, None for all; then less and less, till it fits.
#:
#: A good ground has a line less than the others, one at least. With none, the good grounds share a
#: line and the others have one each.
FORMS = ((None, None), (3, 20), (2, 20), (1, 20), *((0, rows) for rows in range(20, 2, -1)))

MOST_LOGS, WORST = 20, 3  #: Logs that are shown at most, findings below them.
SUBJECT = 17  #: Columns of what a ground is about.
#: Remarks that the other observers run on the paper's gains.
MEASURED = ("paper-gains-measured", "paper-gains-measured-level")

LEGEND = "± 95 %; force ON the robot, base axes; range: if it touched another possible place"


def short_screen(analysis: Analysis, canvas: Canvas) -> str:
    """Facts and the answer."""
    head = canvas.painted(facts(analysis), "bold")
    lines = [head, *answer_lines(analysis, canvas), *doubt_lines(analysis)]
    return canvas.shown("\n".join(lines)) + "\n"


def log_screen(
    analysis: Analysis, canvas: Canvas, *, most: int = MOST_LINES, every: bool = False
) -> str:
    """The screen of one log, of so many lines at most."""
    head = [canvas.painted(facts(analysis), "bold"), "", *answer_lines(analysis, canvas)]
    bars, found = bar_lines(analysis, canvas), grounds(analysis)
    tail = [*doubt_lines(analysis), *against_lines(analysis, canvas)]
    text = ""
    for each, rows in FORMS[:1] if every else FORMS[1:]:
        believed, listed = belief_lines(found, canvas, each), analysis.contacts
        table = [] if listed is None else list_lines(listed, rows, canvas)
        parts = [part for part in (head, bars, table, [*believed, *tail]) if part]
        text = "\n\n".join("\n".join(block) for block in parts) + "\n"
        if text.count("\n") <= most:
            break
    return canvas.shown(text)


def list_screen(found: ContactList, canvas: Canvas, *, every: bool) -> str:
    """A list that was made earlier: its log, the answer, the rows."""
    head = f"{printable(found.recording)} · {found.duration:.1f} s · as listed when it was written"
    lines = [canvas.painted(head, "bold"), "", f"  {answer(found)}", ""]
    rows = list_lines(found, None if every else MOST_ROWS, canvas)
    end = "Whether it can be believed, and |F| over time: vftcli contacts on the log itself"
    return canvas.shown("\n".join([*lines, *rows, "", end])) + "\n"


def answer_lines(analysis: Analysis, canvas: Canvas) -> list[str]:
    """The answer in a sentence."""
    lines = canvas.wrapped(printable(headline(analysis)), 2)
    return [f"  {line.strip()}" for line in lines]


def facts(analysis: Analysis) -> str:
    """Log, arm and its fit, duration, rate."""
    recording, match = analysis.recording, own_match(analysis)
    fit = ""
    if match is not None:
        left = percent(match.misfit)
        fit = f" (model error {left})" if match.fits else f" (does not fit: model error {left})"
    span = f"{recording.duration:.1f} s"
    if rate := rate_of(recording):
        span += f" at {rate:.0f} Hz" if rate >= 100.0 else f" at {rate:.3g} Hz"
    return " · ".join((printable(recording.name), f"{printable(analysis.robot.name)}{fit}", span))


def doubt_lines(analysis: Analysis) -> list[str]:
    """Warning on meaningless results that are made anyway."""
    codes = ", ".join(refused_codes(analysis.examinations))
    return [f"MEANINGLESS unless this is wrong (--anyway): {codes}"] if codes else []


def written_lines(
    folder: Path,
    names: Iterable[str],
    canvas: Canvas,
    *,
    several: bool = False,
) -> list[str]:
    """Written files, if present, and the page to open."""
    there = [name for name in names if (folder / name).exists()]
    there += ["one folder a log"] * several
    lines = canvas.wrapped(printable(f"{folder}/  {'  '.join(there)}"), 2)
    # A page that this run did not write is another run's.
    if "index.html" in there:
        page = printable(str(folder / "index.html"))
        lines.append(f"Open: {page}        More here: --details")
    return lines


def bar_lines(analysis: Analysis, canvas: Canvas) -> list[str]:
    """|F| over time, none where no force is listed."""
    force, found = forces_of_list(analysis), analysis.contacts
    if force is None or found is None:
        return []
    shown = [] if found.contacts[0].is_load else hardest_rows(found.contacts)
    return force_bars(analysis.t, force, shown, canvas)


def list_lines(found: ContactList, most: int | None, canvas: Canvas) -> list[str]:
    """The rows of a list, and what can be said of the rest of its log."""
    contacts, rest = found.contacts, otherwise(found)
    if not contacts and (most is not None or not found.candidates):
        return [f"  {rest}"] if rest else []
    shown = hardest_rows(contacts, len(contacts) if most is None else most)
    lines = terminal(contact_grid(shown), canvas.shown).splitlines() if shown else []
    if len(shown) < len(contacts):
        lines.append(f"the {len(shown)} hardest of {len(contacts)}; --details shows all")
    if most is None and found.candidates:
        lines += ["", "Candidates, too little evidence to list:"]
        lines += terminal(contact_grid(found.candidates), canvas.shown).splitlines()
    if rest:
        lines.append(rest)
    if found.hardest is not None:
        lines.append(f"({LEGEND})")
    return [f"  {line}" if line else "" for line in lines]


def belief_lines(found: Sequence[Ground], canvas: Canvas, most: int | None) -> list[str]:
    """Whether it can be believed: some lines a ground, one if it is good; its remedy below."""
    lines = ["Can it be believed?"]
    good = [ground for ground in found if ground.standing == "good"]
    if most == 0 and len(good) > 1:
        mark = canvas.painted(canvas.shown(good[0].mark), "good")
        lines.append(f"  {mark} {' · '.join(dict.fromkeys(g.subject for g in good))}")
        found = [ground for ground in found if ground not in good]
    for ground in found:
        less = ground.standing == "good"
        lines += ground_lines(ground, canvas, None if most is None else max(most - less, 1))
    return lines


def ground_lines(
    ground: Ground, canvas: Canvas, most: int | None, about: str = ""
) -> Iterator[str]:
    """One ground: its mark, what it is about, what is known of it; then its remedy."""
    subject = f"{about}: {ground.subject}" if about else ground.subject
    indent = SUBJECT + 5
    first, *more = canvas.wrapped(printable(ground.sentence), indent, most)
    mark = canvas.painted(canvas.shown(ground.mark), ground.standing)
    if len(subject) > SUBJECT:
        yield f"  {mark} {printable(subject)}"
        yield f"{'':{indent}}{first}"
    else:
        yield f"  {mark} {subject:<{SUBJECT}} {first}"
    yield from more
    if ground.remedy:
        # A command is not broken into lines: it is there to be copied.
        room = indent if indent + len(ground.remedy) <= canvas.width else 4
        yield f"{'':{room}}{printable(ground.remedy)}"


def against_lines(analysis: Analysis, canvas: Canvas) -> list[str]:
    """The errors against a reference on one line, and beside a printed table on another."""
    if analysis.errors is None:
        return []
    first = [against(block, analysis) for block in blocks(analysis.errors)[:1]]
    lines = [line for text in first for line in canvas.wrapped(text, 2)]
    for grid in contact_grids(analysis.errors):
        lines += terminal(grid).splitlines()
    if analysis.published is not None:
        told = next((f": {sentence(each)}" for each in analysis.published.remarks), "")
        text = f"Beside {analysis.published.published.title}{told} → --details"
        lines += canvas.wrapped(text, 2)
    return lines


def against(block: Block, analysis: Analysis) -> str:
    """One line on the errors: the observer in the lead, and the range of the others."""
    means = block.means
    if not means.errors:
        return f"Against {block.reference}: no sample in common with the estimates"
    (name, least), *others = means.errors.items()
    floor = f" (floor {significant(means.floor, 2)})" if block.has_floor else ""
    text = f"Against {printable(block.reference)}{means.left_out}{floor}: "
    text += f"{significant(least, 2)} N·m ({name})"
    if others:
        low, high = min(value for _, value in others), max(value for _, value in others)
        paper = any(remark.code in MEASURED for remark in analysis.remarks)
        whose = "the paper's gains" if paper else "the others"
        size = significant(low, 2)
        size += f"–{significant(high, 2)}" if significant(high, 2) != size else ""
        text += f"; {whose} {size}"
    return f"{text} → --details"


def logs_screen(
    analyses: Sequence[Analysis],
    canvas: Canvas,
    failed: Mapping[str, str],
    *,
    every: bool = False,
) -> str:
    """The screen of several logs: one line a log, then the worst findings."""
    found = [(analysis, grounds(analysis)) for analysis in analyses]
    lines = [canvas.painted(logs_facts(analyses, len(failed)), "bold"), ""]
    shown = found
    if not every and len(found) > MOST_LOGS:
        # The worst and hardest, in the order of the logs.
        ranks = sorted(range(len(found)), key=lambda k: log_line(*found[k]).rank)
        shown = [found[k] for k in sorted(ranks[:MOST_LOGS])]
    lines += [f"  {line}" for line in log_table(shown, failed, canvas)]
    if len(shown) < len(found):
        lines.append(f"  the {len(shown)} worst and hardest of {len(found)}; --details shows all")
    findings = [
        (ground, analysis.recording.name)
        for standing in ("bad", "caution")
        for analysis, each in found
        for ground in each
        if ground.of_log and ground.standing == standing
    ]
    if findings:
        lines += ["", "Can it be believed?"]
        for ground, name in findings if every else findings[:WORST]:
            lines += ground_lines(ground, canvas, None if every else 2, name)
        if len(findings) > WORST and not every:
            lines.append(f"  and {len(findings) - WORST} more: --details")
    return canvas.shown("\n".join(lines)) + "\n"


def logs_facts(analyses: Sequence[Analysis], failed: int) -> str:
    """Number of logs, their arms, and the free motion behind the sizes."""
    arms = list(dict.fromkeys(analysis.robot.name for analysis in analyses))
    free = list(dict.fromkeys(r.recording.name for a in analyses for r in a.motion.runs))
    parts = [f"{len(analyses) + failed} logs", " and ".join(arms)]
    if failed:
        parts.append(f"{failed} left out")
    if free:
        parts.append(f"free motion from {', '.join(free)}")
    return printable(" · ".join(part for part in parts if part))


def log_table(
    found: Sequence[tuple[Analysis, tuple[Ground, ...]]],
    failed: Mapping[str, str],
    canvas: Canvas,
) -> list[str]:
    """One line a log: what touched the arm, and whether the log is sound."""
    judged = any(analysis.errors is not None for analysis, _ in found)
    heads = ("log", "span", "contacts", "hardest", "else", *["error"] * judged)
    rows = []
    for analysis, all_grounds in found:
        summary, listed, rest = log_line(analysis, all_grounds), analysis.contacts, DASH
        if listed is not None and listed.detectable_force is not None and listed.tells_untouched:
            rest = at_least_shown(listed.detectable_force)
        errors = [e for block in blocks(analysis.errors)[:1] for e in block.means.errors.values()]
        error = f"{significant(errors[0], 2)} N·m" if errors else DASH
        span = f"{summary.duration:.1f} s"
        row = [summary.name, span, summary.contacts, summary.hardest, rest, error]
        rows.append(row[: len(heads)])
    rows += [[name, *[""] * (len(heads) - 1)] for name in failed]
    columns = tuple(Column(head, words=head in {"log", "hardest"}) for head in heads)
    head, *table = terminal(Grid(columns=columns, rows=tuple(rows)), canvas.shown).splitlines()
    room = max(len(line) for line in (head, *table)) + 2
    worst = [health(each) for _, each in found]
    states = [(g.standing, "sound" if g.standing == "good" else g.subject) for g in worst]
    states += [("bad", "left out")] * len(failed)
    lines = [f"{head:<{room}}health"]
    for line, (standing, words) in zip(table, states, strict=True):
        text = canvas.painted(canvas.shown(f"{MARKS[standing]} {words}"), standing)
        lines.append(f"{line:<{room}}{text}")
    return lines
