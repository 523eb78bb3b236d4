"""Reading in one thread while the other loads the code that will use what is read."""

import threading
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import Generic, TypeVar

Result = TypeVar("Result")


class Background(Generic[Result]):
    """A piece of work that runs beside the caller until its result is asked for.

    Parsing a large table holds no lock of the interpreter, importing does; together they take as
    long as the longer of the two.
    """

    def __init__(self, work: Callable[[], Result]) -> None:
        self._work = work
        self._made: list[Result] = []
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._made.append(self._work())
        except BaseException as error:  # noqa: BLE001 - it is raised again where it belongs
            self._error = error

    def result(self) -> Result:
        """Wait for the work and return what it made, or raise what it raised."""
        self._thread.join()
        if self._error is not None:
            raise self._error
        return self._made[0]


def load(*modules: str) -> None:
    """Load what a command needs later, while something else takes its time; what is there of it."""
    for name in modules:
        with suppress(ImportError):
            import_module(name)
