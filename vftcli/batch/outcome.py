"""Outcome: how a piece of work ended, and what it took; an error is an outcome like any other."""

import os
import socket
import time
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any, Generic, NamedTuple, TypeVar

from vftcli.signals.errors import VftError

Task = TypeVar("Task")

#: What is done with each task; what it returns is small, and can be pickled.
Work = Callable[[Task], Any]
KILLED = "KilledWorker"  #: Error type of a task if its worker died each time.

_stage: ContextVar[str] = ContextVar("stage", default="")


class EngineError(VftError):
    """The engine does not answer, or its workers cannot do the work."""


class Failure(NamedTuple):
    """Reason of a task's failure."""

    stage: str  #: What was being done, as the work called it with `begin`.
    type: str  #: Name of the error's class.
    line: str  #: What it says, on one line.


class Effort(NamedTuple):
    """Cost and place of a task."""

    started: float  #: When it began, on the clock of where it ran. [s since 1970]
    seconds: float  #: Time from then to its end. [s]
    cpu_seconds: float  #: Time of its thread on a processor. [s]
    place: str  #: Host and process.


class Outcome(NamedTuple, Generic[Task]):
    """End of a task."""

    task: Task  #: The task.
    value: Any = None  #: What the work returned, None if it failed.
    failure: Failure | None = None  #: Why it failed, or None.
    effort: Effort | None = None  #: Its effort; None if its worker died.


def begin(stage: str) -> None:
    """Name the work's stage; a failure is reported with it."""
    _stage.set(stage)


def perform(work: Work[Task], task: Task) -> tuple[Any, Failure | None, Effort]:
    """Do the work on one task: what it returned, why it failed or None, what it took."""
    begin("starting")
    started, wall, cpu = time.time(), time.monotonic(), time.thread_time()
    value, failure = None, None
    try:
        value = work(task)
    except Exception as error:  # noqa: BLE001 - one log must not stop the others
        failure = failure_of(error)
    took = Effort(
        started,
        time.monotonic() - wall,
        time.thread_time() - cpu,
        f"{socket.gethostname()}:{os.getpid()}",
    )
    return value, failure, took


def failure_of(error: BaseException) -> Failure:
    """An error's text on one line, with the stage begun last."""
    words = " ".join(str(error).split()) or "no words"
    return Failure(_stage.get(), type(error).__name__, words)
