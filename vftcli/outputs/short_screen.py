"""What every command says on the terminal at least: the log, the answer, what was written."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from vftcli.analysis import Analysis
from vftcli.outputs.believability import headline, own_match, percent_words
from vftcli.outputs.canvas import Canvas
from vftcli.signals.letters import printable


def short_screen(analysis: Analysis, below: Sequence[str], canvas: Canvas) -> str:
    """Facts, the answer and what was written."""
    head = canvas.painted(facts(analysis), "bold")
    lines = [head, *answer_lines(analysis, canvas), *doubt_lines(analysis), *below]
    return canvas.shown("\n".join(lines)) + "\n"


def answer_lines(analysis: Analysis, canvas: Canvas) -> list[str]:
    """The answer in a sentence."""
    lines = canvas.wrapped(printable(headline(analysis)), 2)
    return [f"  {line.strip()}" for line in lines]


def facts(analysis: Analysis) -> str:
    """Which log, which arm and how well it fits, how long, how fast."""
    recording, match = analysis.recording, own_match(analysis)
    fit = ""
    if match is not None:
        left = percent_words(match.misfit)
        fit = f" (fits {left})" if match.fits else f" (does not fit: {left} unexplained)"
    span = f"{recording.duration:.1f} s"
    if recording.samples > 1:
        rate = 1.0 / recording.median_step
        span += f" at {rate:.0f} Hz" if rate >= 100.0 else f" at {rate:.3g} Hz"
    return " · ".join((printable(recording.name), f"{printable(analysis.robot.name)}{fit}", span))


def doubt_lines(analysis: Analysis) -> list[str]:
    """What is said where results mean nothing and are made anyway."""
    codes = [f.code for one in analysis.examinations for f in one.refusals()]
    if not codes:
        return []
    return [f"MEANINGLESS unless this is wrong (--anyway): {', '.join(dict.fromkeys(codes))}"]


def written_lines(
    folder: Path,
    names: Iterable[str],
    canvas: Canvas,
    open_with: str = "",
    *,
    several: bool = False,
) -> list[str]:
    """What was written, as far as it is there, and how to open it."""
    there = [name for name in names if (folder / name).exists()]
    there += ["one folder a log"] * several
    lines = canvas.wrapped(printable(f"{folder}/  {'  '.join(there)}"), 2)
    # A page that this run did not write is another run's.
    if open_with or "index.html" in there:
        what = f"{open_with} {folder}" if open_with else str(folder / "index.html")
        lines.append(f"Open: {printable(what)}        More here: --details")
    return lines
