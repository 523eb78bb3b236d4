"""The engine: pieces of work done here or on a Dask cluster, each told as soon as it ended.

What is done is the caller's: a function of one task, at the top of a module, that writes its result
itself (a temporary file, then a rename) before it returns. Results that only live in the engine are
lost with a worker, and Dask then does the task again: the function looks first whether its result
is there. A task is small, and can be pickled.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

from vftcli.batch.choice import EXTRA, WorkersChoice
from vftcli.batch.cluster import connected, outcomes
from vftcli.batch.outcome import (
    Effort,
    EngineError,
    Failure,
    Outcome,
    Task,
    Work,
    begin,
    perform,
)


def run_tasks(
    groups: Iterable[Sequence[Task]],
    work: Work[Task],
    choice: WorkersChoice,
    tell: Callable[[str], None],
    seen: Sequence[str] = (),
) -> Iterator[Outcome[Task]]:
    """Do some work on every task and tell how each ended, in the order in which they end.

    An error of the work is an outcome like any other. A task whose worker dies is done again, three
    times in all. Closing the iterator ends what has not begun.
    """
    if choice.in_process:
        if choice.workers is None:
            tell(f"one log after the other; to use every core: {EXTRA}")
        for group in groups:
            for task in group:
                yield Outcome(task, *perform(work, task))
        return
    with connected(choice, seen, tell) as client:
        yield from outcomes(client, groups, work, standing=choice.scheduler is not None)


__all__ = ["Effort", "EngineError", "Failure", "Outcome", "Work", "begin", "run_tasks"]
