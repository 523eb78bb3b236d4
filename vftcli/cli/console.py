"""Common output of the commands: how much, where, and how wide."""

import os
import shlex
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from vftcli.cli.config import WORDS
from vftcli.cli.progress import STAGES, is_terminal
from vftcli.signals.errors import VftError
from vftcli.signals.packages import PACKAGES, check_installed, installed
from vftcli.signals.parsing import counted, printable
from vftcli.signals.progress import heard_by

if TYPE_CHECKING:
    from vftcli.analysis import Analysis
    from vftcli.doctor import Examination, Examiner
    from vftcli.outputs.screen import Canvas
    from vftcli.readers.reading import Library
    from vftcli.robots.robot import Robot
    from vftcli.signals.recording import Recording
    from vftcli.signals.remarks import Remark

echo, echo_data = STAGES.echo, STAGES.echo_data  #: All output of a command.
QUIET, USUAL, DETAILS = range(3)

_level: ContextVar[int] = ContextVar("level", default=USUAL)


@contextmanager
def speaking(*, details: bool, quiet: bool) -> Iterator[None]:
    """Set how much a block prints, and its progress on a terminal."""
    if details and quiet:
        raise typer.BadParameter("choose one of --details, --quiet")
    token = _level.set(DETAILS if details else QUIET if quiet else USUAL)
    try:
        STAGES.silent = quiet or not is_terminal(sys.stderr)
        with heard_by(STAGES.hear):
            yield
    finally:
        _level.reset(token)


SOME_FAILED = 3  #: Exit code if some logs failed, not all.
#: Remarks that only a part of a file is read, unasked.
PARTS = frozenset({"episode-chosen", "episode-chosen-first", "arm-side-chosen"})


def command_line() -> str:
    """The command line, with words of a file of options."""
    return printable(shlex.join(["vftcli", *WORDS.get()]))


def say(text: str) -> None:
    """Print words to stderr, unless --quiet; results go to stdout."""
    if _level.get() > QUIET:
        echo("\n".join(map(printable, text.split("\n"))), err=True)


def detail(text: str) -> None:
    """Print words to stderr with --details."""
    if _level.get() == DETAILS:
        say(text)


def show(text: str) -> None:
    """Print a result to stdout, unless --quiet: a file holds it."""
    if _level.get() > QUIET:
        echo(text, nl=not text.endswith("\n"), colour=True)


def echo_top(text: str) -> None:
    """Print a result to stdout; without --details what fits."""
    from vftcli.outputs.screen import FILE_LINES, MOST_LINES

    lines = text.rstrip("\n").split("\n")
    if (more := len(lines) + FILE_LINES - MOST_LINES + 1) > 1 and _level.get() < DETAILS:
        lines[-more:] = [f"and {more} lines more: --details"]
    echo("\n".join(lines))


def say_written(
    record: str, folder: Path, names: Sequence[str], *, json: bool, several: bool = False
) -> None:
    """Print the written files and the page, or `run.json`."""
    from vftcli.outputs.screen import written_lines

    if (several or "recording.rrd" in names) and not installed("rerun"):
        say(f"recording.rrd not written: {PACKAGES['rerun'][1]}")
    if json:
        echo_data(record)
    else:
        show("\n".join(["", *written_lines(folder, names, canvas(), several=several)]))


def open_made(path: Path) -> None:
    """Open a page, or a folder's page or recording, and say so."""
    page, recording = path, path / "recording.rrd"
    if path.is_dir():
        page = path / "index.html"
    if page.exists():
        import webbrowser

        if not webbrowser.open(page.resolve().as_uri()):
            say(f"no browser could be started: open {page} in one")
        if recording.exists():
            say(f"the recording: rerun {recording}")
    elif recording.exists():
        import subprocess

        check_installed("rerun", f"the viewer of {recording}")
        words = [sys.executable, "-m", "rerun", str(recording)]
        quiet = subprocess.DEVNULL
        # It outlives the command.
        subprocess.Popen(words, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True)
        say(f"{recording} opens in the Rerun viewer; a click on a time of its log goes there")


def canvas() -> "Canvas":
    """Abilities of stdout: width, letters, colour."""
    from vftcli.outputs.screen import NARROWEST, WIDEST, Canvas

    stream = sys.stdout
    letters = (getattr(stream, "encoding", None) or "utf-8").lower()
    return Canvas(
        width=min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST),
        unicode=letters.startswith("utf"),
        colour=is_terminal(stream) and not os.environ.get("NO_COLOR"),
    )


def say_json(
    logs: "Sequence[dict[str, Any] | Recording]",
    remarks: "Iterable[Remark]" = (),
    **found: Any,  # noqa: ANN401 - whatever JSON can hold
) -> None:
    """Print a command's results as JSON to stdout; null if not finite."""
    from vftcli.outputs.run_record import envelope, log_entry, to_json

    entries = [log if isinstance(log, dict) else log_entry(log) for log in logs]
    echo_data(to_json(envelope(command_line(), entries, remarks, found)))


class LeftOut:
    """The logs that a command cannot analyse, one line each."""

    def __init__(self, library: "Library", logs: Sequence[Path]) -> None:
        self._library, self._several = library, len(logs) > 1
        self.reasons: dict[str, str] = {}  #: Label of such a log → why.

    def add(self, log: Path, error: VftError) -> None:
        """Say that a log is left out, and why; raise it for the only one."""
        if not self._several:
            raise error
        label = self._library.label(log)
        self.reasons[label] = " ".join(str(error).split()).removeprefix(f"{label}: ")
        echo(printable(f"error: {label} left out: {self.reasons[label]}"), err=True)

    def end(self, done: int) -> None:
        """Stop with exit code 3 if any was left out, 1 if all were."""
        if self.reasons and not done:
            echo("error: none of the logs can be analysed", err=True)
        if self.reasons:
            raise typer.Exit(SOME_FAILED if done else 1)


def say_recording(recording: "Recording") -> None:
    """In details: one line on the log, then repairs and oddities."""
    source = recording.source
    rate = f", {1.0 / recording.median_step:.4g} Hz" if recording.samples > 1 else ""
    detail(
        f"{recording.name}: {source.format}, {recording.joints} joints, "
        f"{counted(recording.samples, 'sample')}, {recording.duration:.1f} s{rate}"
    )
    # The part of a file is printed with the log's health.
    others = [remark for remark in source.remarks if remark.code not in PARTS]
    for remark in sorted(others, key=lambda remark: remark.level != "fact"):
        detail(f"  note: {remark}")


def health_of(
    library: "Library", *, anyway: bool, fitting: bool = True, on_screen: bool = False
) -> "Examiner":
    """The examiner of a command's logs, printing a line on each."""
    from vftcli.doctor.examination import Examiner, doubt
    from vftcli.outputs.examination import health_line

    def tell(examination: "Examination") -> None:
        recording = examination.recording
        for remark in recording.source.remarks:
            if remark.code in PARTS:
                say(f"note: {recording.name}: {remark}")
        if codes := dict.fromkeys(f.code for f in examination.refusals(fitting=fitting)):
            say(doubt(", ".join(codes)))
        line = health_line(examination, named=len(library) > 1 or bool(recording.source.part))
        if on_screen and not codes:
            detail(line)
        elif _level.get() > QUIET:
            STAGES.waiting.append(line)
        for assumption in examination.assumptions:
            detail(f"note: {recording.name}: {assumption}")

    return Examiner(anyway=anyway, fitting=fitting, tell=tell)


def say_robots(robots: "Iterable[Robot]") -> None:
    """Print the limits of the robots' numbers, each once."""
    say_remarks({str(remark): remark for arm in robots for remark in arm.remarks}.values())


def say_analysis(analysis: "Analysis") -> None:
    """In details: the log, and the limits of its numbers."""
    say_recording(analysis.recording)
    reference = analysis.reference.remarks if analysis.reference is not None else ()
    own = [f"{e.name}: {note}" for e in analysis.estimates for note in e.remarks]
    for note in (*analysis.robot.remarks, *analysis.remarks, *own):
        detail(f"note: {note}")
    say_remarks(reference)
    if (sensed := analysis.virtual_sensor) is not None:
        from vftcli.outputs.grid import terminal
        from vftcli.outputs.grids import drift_grid
        from vftcli.wrench.solvers import FRAMES

        detail(
            f"note: wrench: force on the robot, {FRAMES[sensed.sensor.frame]}; {sensed.solver}"
        )
        if sensed.drifts:
            detail(terminal(drift_grid(sensed.drifts)).rstrip())
        say_remarks(sensed.remarks)


def say_remarks(remarks: "Iterable[Remark]") -> None:
    """Print warnings; in details all remarks."""
    for remark in remarks:
        if remark.level == "warning":
            say(f"warning: {remark}")
        else:
            detail(f"note: {remark}")
