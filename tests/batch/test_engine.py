"""The engine, with functions of the standard library as its work: workers can import these."""

import math
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from distributed import LocalCluster

from vftcli.batch import WorkersChoice
from vftcli.batch.cluster import (
    EngineError,
    Failure,
    Workers,
    begin,
    connected,
    failure_of,
    perform,
    run_tasks,
)

HERE = WorkersChoice(jobs=0)


def silent(_words: str) -> None:
    pass


def test_here_every_task_is_done_in_order_and_errors_are_outcomes() -> None:
    ended = list(run_tasks([(4.0,), (-1.0, 9.0)], math.sqrt, HERE, silent))
    assert [outcome.task for outcome in ended] == [4.0, -1.0, 9.0]
    assert [outcome.value for outcome in ended] == [2.0, None, 3.0]
    assert ended[1].failure[:2] == ("starting", "ValueError")
    assert all(outcome.effort is not None for outcome in ended)
    said: list[str] = []
    for choice in (HERE, WorkersChoice()):  # little work is done here, and nothing is said of it
        assert [one.value for one in run_tasks([(9.0,)], math.sqrt, choice, said.append)] == [3.0]
    assert said == []


def test_a_failure_is_one_line_at_the_stage_that_was_begun() -> None:
    begin("reading")
    assert failure_of(ValueError("two\n  lines")) == Failure("reading", "ValueError", "two lines")
    assert failure_of(MemoryError()).line == "no words"
    # The stage of one task is not that of the next.
    failure = perform(math.sqrt, -1.0).failure
    assert failure == Failure("starting", "ValueError", "math domain error")


def test_groups_are_taken_only_as_workers_get_free() -> None:
    taken = []

    def groups():
        for k in range(3):
            taken.append(k)
            yield (float(k),)

    ended = run_tasks(groups(), math.sqrt, HERE, silent)
    next(ended)
    assert taken == [0]


def pid_of(_task: int) -> int:
    return os.getpid()


def test_what_is_asked_to_run_here_runs_here_however_long_it_takes(monkeypatch) -> None:
    monkeypatch.setattr("vftcli.batch.cluster.LITTLE", -1.0)
    ended = list(run_tasks([(0,), (1,)], pid_of, HERE, silent))
    assert [outcome.value for outcome in ended] == [os.getpid()] * 2


@pytest.mark.slow
def test_work_goes_to_workers_once_it_takes_longer_than_they_to_start(monkeypatch) -> None:
    tasks = [(0,), (1,), (2,)]
    own = f"{socket.gethostname()}:{os.getpid()}"

    def places(limit: float) -> list[bool]:
        monkeypatch.setattr("vftcli.batch.cluster.LITTLE", limit)
        ended = run_tasks(iter(tasks), float, WorkersChoice(), silent)
        return [outcome.effort.place == own for outcome in ended]

    assert places(60.0) == [True, True, True]
    assert places(-1.0) == [True, False, False]


@pytest.mark.statistical
def test_a_task_that_kills_its_worker_fails_alone_and_nothing_is_lost() -> None:
    """Eleven tasks that return, in groups too, and one that ends its process each time."""
    groups = [(0,)] * 4 + [(0, signal.SIGKILL, 0)] + [(0, 0)] * 2 + [(0,)]
    # raise(0) does nothing, by POSIX; raise(9) cannot be caught.
    ended = list(run_tasks(groups, signal.raise_signal, WorkersChoice(jobs=2), silent))
    assert len(ended) == 12
    failed = [outcome for outcome in ended if outcome.failure is not None]
    assert [outcome.task for outcome in failed] == [signal.SIGKILL]
    assert failed[0].failure.type == "KilledWorker"


@pytest.mark.slow
def test_workers_are_processes_with_one_thread_a_library() -> None:
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS")
    ended = list(run_tasks([names], os.getenv, WorkersChoice(jobs=1), silent))
    assert {outcome.task: outcome.value for outcome in ended} == dict.fromkeys(names, "1")
    assert all(f":{os.getpid()}" not in outcome.effort.place for outcome in ended)


@pytest.mark.slow
def test_an_interrupt_ends_no_worker() -> None:
    """A terminal sends it to every process; the main one ends the others."""
    ended = run_tasks([(signal.SIGINT,)], signal.raise_signal, WorkersChoice(jobs=1), silent)
    assert [outcome.failure for outcome in ended] == [None]


class Losing:
    """A client of a cluster of two workers that loses them: what `Workers` sees of one."""

    def __init__(self, *, own: bool) -> None:
        self.there, self.specified, self.asked = 2, [0, 1], 0
        self.cluster = self if own else None

    worker_spec = property(lambda self: self.specified)

    def nthreads(self) -> dict[int, int]:
        self.asked += 1
        return dict.fromkeys(range(self.there), 1)

    def scale(self, size: int) -> None:
        self.specified = list(range(size))


@pytest.mark.parametrize(("own", "started"), [(True, 10), (False, 0)])
def test_workers_that_stay_away_are_replaced_so_often_and_only_on_this_machine(
    monkeypatch, own: bool, started: int
) -> None:
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    client = Losing(own=own)
    workers = Workers(client)  # type: ignore[arg-type]
    for now[0] in (1.0, 4.9):  # they were counted when it began
        workers.look()
    assert client.asked == 1
    client.there = 1
    for now[0] in range(0, 600, 5):
        workers.look()
    assert len(client.specified) == 2 + started
    client.there = 0
    for now[0] in range(600, 650, 5):
        workers.look()
    now[0] = 655
    with pytest.raises(EngineError, match="no worker is left for 60 s"):
        workers.look()


ATTACK = """
import os, sys
from distributed import Client
from distributed.security import Security
if sys.argv[1] == "nobody":
    os.setuid(65534)  # as any other user of this machine
for address in sys.argv[2:]:
    security = Security.temporary() if address.startswith("tls") else None
    try:
        with Client(address, security=security, timeout=1) as client:
            print("ran as", client.submit(os.getuid, pure=False).result(timeout=5))
    except OSError:
        print("refused")
"""
"""What another user of the machine tries: without a certificate, or with one of their own."""


def answer_to_http(port: int) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=5) as connection:
        connection.sendall(b"GET /health HTTP/1.0\r\n\r\n")
        try:
            return connection.recv(100)
        except ConnectionError:
            return b""


@pytest.mark.slow
def test_nobody_without_the_run_s_certificate_reaches_its_workers() -> None:
    """Every port that the processes of a run listen on; the attack itself works on an open one."""
    own = psutil.Process()
    before = {where.laddr for where in own.net_connections("tcp")}
    with (
        connected(WorkersChoice(jobs=1), (), silent) as client,
        LocalCluster(
            n_workers=1, processes=False, protocol="tcp://", dashboard_address="127.0.0.1:0"
        ) as opened,
    ):
        place = client.scheduler.address.removeprefix("tls://")
        attack = [f"tcp://{place}", f"tls://{place}", opened.scheduler_address]
        # Another user may be tried by root alone, and where others may read this Python.
        places = (Path(sys.prefix), *Path(sys.prefix).parents)
        readable = all(place.stat().st_mode & 0o005 == 0o005 for place in places)
        other = readable and os.getuid() == 0
        script = [sys.executable, "-c", ATTACK, "nobody" if other else "me", *attack]
        said = subprocess.run(script, capture_output=True, text=True, timeout=60, check=False)
        assert said.stdout.splitlines() == ["refused", "refused", f"ran as {os.getuid()}"]
        # The one who has the certificate works on.
        assert client.submit(math.sqrt, 4.0).result(timeout=20) == 2.0
        opened.close()
        ports = {
            where.laddr
            for process in (own, *own.children(recursive=True))
            for where in process.net_connections("tcp")
            if where.status == "LISTEN"
        } - before
        assert {port.ip for port in ports} == {"127.0.0.1"}
        # The scheduler, the worker and its nanny.
        assert len(ports) == 3
        assert not any(b"HTTP" in answer_to_http(port.port) for port in ports)
