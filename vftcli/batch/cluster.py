"""Outcomes of pieces of work here or on a Dask cluster; an error is one, too.

The caller gives a function of one task, at the top of a module. It writes its result
itself (a temporary file, then a rename) before it returns: a worker that dies loses all
else, and Dask does its tasks again. So the function first looks for a result. A task is
small, and can be pickled.
"""

import hashlib
import logging
import os
import signal
import socket
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from itertools import chain, count, islice
from multiprocessing import resource_tracker
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from vftcli.batch import EXTRA, MEMORY, MOST_WORKERS, WorkersChoice
from vftcli.signals.errors import VftError
from vftcli.signals.packages import VERSION
from vftcli.signals.parsing import counted
from vftcli.signals.progress import heard_by, nobody

if TYPE_CHECKING:
    from distributed import Client, Future

LITTLE = 20.0  #: Work of this process before workers start. [s]
ANSWER = 10.0  #: Time for a scheduler to answer and to have a worker. [s]
SETTLED = 0.5  #: Time from a worker's first task until its nanny knows of it. [s]
LOOK = 5.0  #: Time between counts of the workers while nothing ends. [s]
SHORT = 15.0  #: A local cluster gets new workers after lacking some so long. [s]
WITHOUT = 60.0  #: A cluster is given up after so long without a worker. [s]
REPLACED = 10  #: Most times a local cluster gets new workers.
DEATHS = 3  #: A task is given up after ending its worker so often.
#: A worker has one core: threads of a library would wait for each other.
THREADS = {
    f"{library}_THREADS": "1"
    for library in ("OPENBLAS_NUM", "OMP_NUM", "MKL_NUM", "POLARS_MAX", "RAYON_NUM")
}

CONFIG: Mapping[str, object] = {
    "distributed.scheduler.worker-saturation": 1.0,  # else a neighbour is blamed for a death
    "distributed.scheduler.allowed-failures": DEATHS - 1,
    "distributed.worker.memory.target": False,  # results are small: nothing to spill
    "distributed.worker.memory.spill": False,
    "distributed.comm.timeouts.connect": f"{ANSWER:g}s",
    "distributed.nanny.pre-spawn-environ": THREADS,
}

#: Packages that make the numbers, or write them.
PACKAGES = ("numpy", "scipy", "polars", "pin")
HEAD = 4096  #: First bytes of a file that are compared. [B]


Task = TypeVar("Task")

#: Function of one task; its result is small and can be pickled.
Work = Callable[[Task], Any]
Tell = Callable[[str], None]  #: Receives a sentence on each step.
KILLED = "KilledWorker"  #: Error type of a task if its worker died each time.

_stage: ContextVar[str] = ContextVar("stage", default="")


class EngineError(VftError):
    """The engine does not answer, or its workers cannot do the work."""


class Failure(NamedTuple):
    """Reason of a task's failure."""

    stage: str  #: Stage of the work, as named by `begin`.
    type: str  #: Name of the error's class.
    line: str  #: Its text, on one line.


class Effort(NamedTuple):
    """Cost and place of a task."""

    started: float  #: Begin, by the clock of its host. [s since 1970]
    seconds: float  #: Time from then to its end. [s]
    cpu_seconds: float  #: Time of its thread on a processor. [s]
    place: str  #: Host and process.


class Outcome(NamedTuple, Generic[Task]):
    """End of a task."""

    task: Task
    value: Any = None  #: Value of the work, None if it failed.
    failure: Failure | None = None  #: Why it failed, or None.
    effort: Effort | None = None  #: Its effort; None if its worker died.


def begin(stage: str) -> None:
    """Name the work's stage; a failure is reported with it."""
    _stage.set(stage)


def perform(work: Work[Task], task: Task) -> Outcome[Task]:
    """Outcome of the work on one task: value, failure, effort."""
    begin("starting")
    started, wall, cpu = time.time(), time.monotonic(), time.thread_time()
    value, failure = None, None
    try:
        with heard_by(nobody):
            value = work(task)
    except Exception as error:  # noqa: BLE001 - one log must not stop the others
        failure = failure_of(error)
    seconds, cpu_seconds = time.monotonic() - wall, time.thread_time() - cpu
    place = f"{socket.gethostname()}:{os.getpid()}"
    return Outcome(task, value, failure, Effort(started, seconds, cpu_seconds, place))


def failure_of(error: BaseException) -> Failure:
    """An error's text on one line, with the stage begun last."""
    words = " ".join(str(error).split()) or "no words"
    return Failure(_stage.get(), type(error).__name__, words)


@contextmanager
def without_interrupt() -> Iterator[None]:
    """Hold back Ctrl-C for a block, and for good in what it starts.

    A terminal sends it to every process, but the main one ends its workers.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # it lets Ctrl-C through again, once
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def run_tasks(
    groups: Iterable[Sequence[Task]],
    work: Work[Task],
    choice: WorkersChoice,
    tell: Tell,
    seen: Sequence[str] = (),
) -> Iterator[Outcome[Task]]:
    """Outcomes of some work on every task, in the order in which they end.

    A task runs again if its worker dies. Closing the iterator ends what has not begun.
    """
    rest, begun = iter(groups), time.monotonic()
    if choice.in_process or (choice.jobs is None and choice.address is None):
        if choice.in_process and choice.jobs is None:
            tell(f"one log after the other; to use every core: {EXTRA}")
        # Little work ends sooner here than workers start.
        for group in rest:
            for task in group:
                yield perform(work, task)
            if not choice.in_process and time.monotonic() - begun > LITTLE:
                break
    if left := list(islice(rest, 1)):
        with connected(choice, seen, tell) as client:
            every = chain(left, rest)
            yield from outcomes(client, every, work, standing=choice.address is not None)


@contextmanager
def connected(choice: WorkersChoice, seen: Sequence[str], tell: Tell) -> Iterator["Client"]:
    """A new cluster on this machine for a block, or a running one."""
    import dask.config
    import distributed  # noqa: F401 - its settings, which are changed here for a block

    logging.getLogger("distributed").setLevel(logging.CRITICAL + 1)  # outcomes report who dies
    cluster = local if choice.address is None else standing
    with dask.config.set(dict(CONFIG)), cluster(choice, tell) as client:
        if choice.address is not None:
            check_workers(client, seen)
        yield client


@contextmanager
def local(choice: WorkersChoice, tell: Tell) -> Iterator["Client"]:
    """A cluster on this machine, behind a certificate of this run."""
    from dask.system import CPU_COUNT
    from distributed import Client, Security
    from distributed.system import MEMORY_LIMIT

    from vftcli.batch.nodes import closed_cluster

    most = max(1, min(int(CPU_COUNT), int(MEMORY_LIMIT / MEMORY), MOST_WORKERS))
    workers = choice.jobs or most
    memory = int(1e9 * (choice.memory_gb or 0.0)) or int(MEMORY_LIMIT / workers)
    try:
        security = Security.temporary()
    except ImportError as error:
        raise EngineError(
            f"workers need a certificate, which cannot be made here ({error}); --jobs 0 does "
            "one log after the other"
        ) from None
    tell(f"{counted(workers, 'worker')} of {memory / 1e9:.1f} GB")
    with without_interrupt():
        cluster = closed_cluster(workers, memory, security, logging.CRITICAL + 1)
    with cluster, Client(cluster, security=security) as client:
        yield client


@contextmanager
def standing(choice: WorkersChoice, tell: Tell) -> Iterator["Client"]:
    """The scheduler's cluster at this address, with a worker at least."""
    from distributed import Client, Security

    names = ("tls_ca_file", "tls_client_cert", "tls_client_key")
    files = dict(zip(names, map(str, choice.tls), strict=False))
    security = Security(**files, require_encryption=True) if files else None
    try:
        client = Client(choice.address, security=security, timeout=ANSWER)
    except Exception as error:  # noqa: BLE001 - what answers there may be anything
        raise EngineError(
            f"no Dask scheduler answers at {choice.address} within {ANSWER:g} s "
            f"({failure_of(error).line[:120]}); start one with `dask scheduler`, or leave "
            "cluster.address out"
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=ANSWER)
        except TimeoutError:
            raise EngineError(
                f"the scheduler at {choice.address} has no worker; start some with `dask worker "
                f"{choice.address} --nthreads 1`"
            ) from None
        tell(f"{len(client.nthreads())} workers of {choice.address}")
        yield client


def check_workers(client: "Client", seen: Sequence[str]) -> None:
    """Check that every worker has this code and sees its files."""
    here = surroundings(seen)
    for address, there in client.run(surroundings, seen, on_error="return").items():
        if not isinstance(there, dict):
            raise EngineError(
                f"worker {address} cannot run vftcli ({failure_of(there).line[:120]}); install "
                f"vftcli {VERSION} there"
            )
        for name, state in here.items():
            if there.get(name) == state:
                continue
            if name in seen:
                raise EngineError(
                    f"worker {address} does not see {name} as it is here; share the folder with it"
                )
            raise EngineError(
                f"worker {address} has {name} {there.get(name) or 'not at all'}, here it is "
                f"{state}: results would differ. Install equal versions there"
            )


def surroundings(paths: Sequence[str]) -> dict[str, str | None]:
    """Versions of Python and of the packages used, and the state of each path.

    That is the digest of size and first bytes, "folder", or "nothing".
    """
    import platform
    from importlib.metadata import PackageNotFoundError, version

    found: dict[str, str | None] = {"python": platform.python_version(), "vftcli": VERSION}
    for name in PACKAGES:
        found[name] = None
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    for path in paths:
        found[path] = "folder" if os.path.isdir(path) else "nothing"  # noqa: PTH112
        with suppress(OSError), Path(path).open("rb") as file:
            size = str(os.fstat(file.fileno()).st_size).encode()
            found[path] = hashlib.sha256(size + file.read(HEAD)).hexdigest()
    return found


def outcomes(
    client: "Client", groups: Iterable[Sequence[Task]], work: Work[Task], *, standing: bool
) -> Iterator[Outcome[Task]]:
    """Outcomes on a cluster; only the workers' next groups are sent."""
    sent: dict[Future[Any], Sequence[Task]] = {}
    waiting, again, number = iter(groups), list[Sequence[Task]](), count()
    most, workers = 2 * sum(client.nthreads().values()) + 2, Workers(client)

    def send(group: Sequence[Task]) -> None:
        key = f"vftcli-{os.getpid()}-{next(number)}"
        sent[client.submit(perform_there, work, group, key=key, pure=False, retries=0)] = group

    try:
        while True:
            for group in islice(waiting, max(0, most - len(sent))):
                send(group)
            if not sent and again:
                # Alone, so that nobody else is blamed.
                standing = False
                send(again.pop())
            if not sent:
                return
            for future in first_done(list(sent), workers):
                group, ended = sent.pop(future), result_of(future)
                if ended is None:
                    sent[future] = group  # its worker died with the result: it is done again
                elif not isinstance(ended, Failure):
                    yield from ended
                elif len(group) > 1 or standing:
                    again += [(task,) for task in group]
                else:  # only one of a single task can have ended its worker
                    yield Outcome(group[0], failure=ended)
    finally:
        with suppress(Exception):  # the cluster may be gone
            client.cancel(list(sent))


def perform_there(work: Work[Task], tasks: Sequence[Task]) -> list[Outcome[Task]]:
    """Outcomes of a group's tasks; runs in a worker."""
    settle()
    return [perform(work, task) for task in tasks]


@cache
def settle() -> None:
    """Once in a worker, wait for its nanny, which looks every 50 ms.

    Dask does not start a process again that ended before.
    """
    time.sleep(SETTLED)


class Workers:
    """Count of a cluster's workers, on this machine kept."""

    def __init__(self, client: "Client") -> None:
        self._client, self._wanted = client, len(client.nthreads())
        self._left = 0 if client.cluster is None else REPLACED
        self._looked = self._enough = self._some = time.monotonic()

    def look(self) -> None:
        """Count them, once every `LOOK` seconds, and start missing ones."""
        now = time.monotonic()
        if now - self._looked < LOOK:
            return
        self._looked, there = now, len(self._client.nthreads())
        self._some = now if there else self._some
        if there >= self._wanted:
            self._enough = now
        elif self._left and now - self._enough >= SHORT:
            cluster: Any = self._client.cluster
            cluster.scale(len(cluster.worker_spec) + self._wanted - there)
            self._left, self._enough = self._left - 1, now
        if now - self._some >= WITHOUT:
            raise EngineError(
                f"no worker is left for {WITHOUT:g} s; what is done is kept: run the command again "
                "when there are some"
            )


def first_done(futures: "list[Future[Any]]", workers: Workers) -> "list[Future[Any]]":
    """Futures that ended, at least one; waits for it."""
    from concurrent.futures import CancelledError

    from distributed import wait

    while True:
        try:
            workers.look()
            return list(wait(futures, timeout=LOOK, return_when="FIRST_COMPLETED").done)
        except TimeoutError:
            continue
        except (CancelledError, OSError):
            raise EngineError(
                "the connection to the scheduler is lost; what is done is kept: run the command "
                "again"
            ) from None


def result_of(future: "Future[Any]") -> "list[Any] | Failure | None":
    """Results of a group, its failure, or None if unknown yet."""
    from distributed.scheduler import KilledWorker

    if future.status not in {"finished", "error"}:
        return None
    try:
        made: list[Any] = future.result(timeout=LOOK)
    except TimeoutError:
        return None  # it died with its worker, and there is none to make it again
    except KilledWorker:
        why = f"its worker died {DEATHS} times: memory, or a crash of a library"
        return Failure("working", KILLED, why)
    except Exception as error:  # noqa: BLE001 - that of a worker that cannot even begin
        return failure_of(error)._replace(stage="starting")
    return made
