"""What is being done and how far it is, on one line of stderr that goes again."""

import atexit
import threading
import time

import typer

QUICK = 1.0  #: Work that is done within this time shows nothing. [s]
EVERY = 1.0  #: Time after which the line is shown anew, whatever happens. [s]
WIDTH = 78  #: Columns of the line. [characters]


class Stages:
    """One line on stderr: stage, share of the work and time, once that takes more than `QUICK`."""

    def __init__(self) -> None:
        self._begun: float | None = None
        self._stage = ""
        self._share = 0.0
        self._shown = False

    def begin(self, stage: str, begin: float = 0.0, end: float = 1.0) -> None:
        """Say what is done now, and which part of the whole work that is."""
        from vftcli.signals.progress import enter, watch

        self._stage = stage
        if self._begun is None:
            self._begun = time.monotonic()
            watch(self._told)
            atexit.register(self.end)
            self._wait(QUICK)
        enter(begin, end)
        if time.monotonic() - self._begun > QUICK:
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

    def _told(self, share: float) -> None:
        self._share = share

    def _wait(self, seconds: float) -> None:
        # A thread of its own: what takes long may tell nothing meanwhile.
        timer = threading.Timer(seconds, self._tick)
        timer.daemon = True
        timer.start()

    def _tick(self) -> None:
        if self._stage:
            self._show()
            self._wait(EVERY)

    def _show(self) -> None:
        if self._stage and self._begun is not None:
            self._shown = True
            tail = f" {100.0 * self._share:3.0f} % {time.monotonic() - self._begun:4.0f} s"
            room = WIDTH - len(tail)
            typer.echo(f"\r{self._stage[:room]:<{room}}{tail}", err=True, nl=False)


STAGES = Stages()  #: The one line that a program has.
