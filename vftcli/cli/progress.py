"""Progress on one line of stderr, and printing over it."""

import atexit
import os
import shutil
import sys
import textwrap
import threading
import time
from typing import TextIO

import typer

from vftcli.signals.parsing import COLOUR

QUICK = 1.0  #: Shorter work shows nothing. [s]
EVERY = 1.0  #: Time between updates of the line. [s]
WIDTH = 79  #: Most columns of the line, one less than a terminal's. [characters]
BAR = 20  #: Length of the bar. [characters]
#: Share of the work from which the rest is predicted.
ENOUGH = 0.02


class Stages:
    """One line on stderr after `QUICK`: share, stage, time left."""

    def __init__(self) -> None:
        self._begun: float | None = None
        self._stage = ""
        self.silent = False  # whether the line is not shown
        self.stopped: BaseException | None = None  # a library that loads may swallow it
        self.waiting: list[str] = []  # words for stderr before whatever is printed next
        self._share = 0.0
        self._from = (0.0, 0.0)  # time and share since which the speed is measured
        self._shown = 0  # characters of the line
        self._lock = threading.RLock()  # printing and the line take turns

    def hear(self, stage: str, share: float) -> None:
        """Note the stage, "" if unchanged, and the share that is done."""
        if self.stopped is not None:
            raise self.stopped
        if not stage or self.silent:
            self._share = share
            return
        is_new, self._stage = stage != self._stage, stage
        now = time.monotonic()
        if self._begun is None:
            self._begun = now
            atexit.register(self.end)
            self._wait(QUICK)
            self._from = (now, share)
        if share < self._share:  # of the next log
            self._from = (now, share)
        self._share = share
        if is_new and now - self._begun > QUICK:
            self._show()

    def end(self) -> None:
        """Show nothing any more."""
        self._stage = ""
        self.clear()

    def clear(self) -> None:
        """Clear the line, before something else is printed."""
        with self._lock:
            if self._shown:
                typer.echo("\r" + " " * self._shown + "\r", err=True, nl=False)
                self._shown = 0
            while self.waiting:
                self.echo(self.waiting.pop(0), err=True)

    def echo(
        self, text: str, *, err: bool = False, nl: bool = True, colour: bool | None = None
    ) -> None:
        """Print over the line, fitted to the terminal or 80 columns.

        The line comes again below. Words to no terminal stay one line, for programs.
        """
        if not err or is_terminal(sys.stderr):
            text = fitted(text, shutil.get_terminal_size().columns)
        with self._lock:
            self.clear()
            typer.echo(text, err=err, nl=nl, color=colour)

    def echo_data(self, text: str) -> None:
        """Print a result for other programs as it is."""
        with self._lock:
            self.clear()
            typer.echo(text.rstrip("\n"))

    def _wait(self, seconds: float) -> None:
        # In its own thread: long work may be silent.
        timer = threading.Timer(seconds, self._tick)
        timer.daemon = True
        timer.start()

    def _tick(self) -> None:
        if self._stage:
            self._show()
            self._wait(EVERY)

    def _show(self) -> None:
        with self._lock:
            if self._stage:
                done = round(BAR * self._share)
                letters = getattr(sys.stderr, "encoding", None) or ""
                rest = "·" if letters.lower().startswith("utf") else "."
                bar = f"[{'#' * done}{rest * (BAR - done)}] {100.0 * self._share:2.0f} %"
                since, first = self._from
                gained, left = self._share - first, ""
                if gained > ENOUGH:
                    seconds = (time.monotonic() - since) * (1.0 - self._share) / gained
                    left = f"  {clock(seconds)} left"
                wide = min(WIDTH, shutil.get_terminal_size().columns - 1)
                room = wide - len(bar) - len(left) - 2
                line = f"{bar}  {self._stage[: max(room, 0)]}{left}"
                typer.echo(f"\r{line:<{self._shown}}", err=True, nl=False)
                self._shown = len(line)


def clock(seconds: float) -> str:
    """A time as minutes and seconds, from an hour on with hours."""
    minutes, second = divmod(round(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02}:{second:02}" if hours else f"{minute}:{second:02}"


def is_terminal(stream: TextIO | None) -> bool:
    """Whether a stream is a terminal that can clear a line."""
    seen = stream is not None and stream.isatty()  # None where the caller closed it
    return seen and os.environ.get("TERM") != "dumb"


COMMAND = "vftcli "  #: Head of words to copy.


def fitted(text: str, width: int) -> str:
    """A text in lines of a width; commands and long paths stay whole."""
    lines: list[str] = []
    for line in text.split("\n"):
        words = line.lstrip()
        is_short = len(COLOUR.sub("", line)) <= width
        if is_short or words.startswith(COMMAND) or max(map(len, words.split())) > width:
            lines.append(line)
            continue
        indent = " " * (len(line) - len(words) + 2)
        lines += textwrap.wrap(
            line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        )
    return "\n".join(lines)


STAGES = Stages()
echo = STAGES.echo  #: Prints over the line.
