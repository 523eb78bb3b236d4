"""What is being done, on one line of stderr that goes again."""

import atexit
import threading
import time

import typer

QUICK = 1.0
"""Work that is done within this time shows nothing. [s]"""

WIDTH = 78
"""Columns of the line. [characters]"""


class Stages:
    """One line on stderr that names the stage of the work, once that takes more than `QUICK`."""

    def __init__(self) -> None:
        self._begun: float | None = None
        self._stage = ""
        self._shown = False

    def begin(self, stage: str) -> None:
        """Say what is done now."""
        self._stage = stage
        if self._begun is None:
            self._begun = time.monotonic()
            atexit.register(self.end)
            timer = threading.Timer(QUICK, self._show)
            timer.daemon = True
            timer.start()
        elif time.monotonic() - self._begun > QUICK:
            self._show()

    def end(self) -> None:
        """Show nothing any more."""
        self._stage = ""
        self.clear()

    def clear(self) -> None:
        """Take the line away, before something else is printed."""
        if self._shown:
            self._shown = False
            typer.echo("\r" + " " * WIDTH + "\r", err=True, nl=False)

    def _show(self) -> None:
        if self._stage:
            self._shown = True
            typer.echo(f"\r{self._stage[:WIDTH]:<{WIDTH}}", err=True, nl=False)


STAGES = Stages()
"""The one line that a program has."""
