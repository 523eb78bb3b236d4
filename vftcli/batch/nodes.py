"""Dask nodes for a cluster of this machine, without Dask's HTTP servers."""

from typing import Any

import distributed


class Closed:
    """A node that answers only to the run's certificate."""

    def start_http_server(self, *_routes: object, **_where: object) -> None:
        """Start none: it answers whoever asks."""


class Scheduler(Closed, distributed.Scheduler):  # type: ignore[misc, unused-ignore]
    """Dask's scheduler."""


class Worker(Closed, distributed.Worker):  # type: ignore[misc, unused-ignore]
    """Dask's worker."""


def closed_cluster(workers: int, memory: int, security: Any, silence: int) -> Any:  # noqa: ANN401
    """Workers with `memory` [B], for the run's certificate."""
    where = {"host": "127.0.0.1", "protocol": "tls://", "security": security}
    worker = {
        "cls": distributed.Nanny,
        "options": {
            **where,
            "nthreads": 1,
            "memory_limit": memory,
            "worker_class": Worker,
            "silence_logs": silence,
        },
    }
    return distributed.SpecCluster(
        workers=dict.fromkeys(range(workers), worker),
        scheduler={"cls": Scheduler, "options": {**where, "port": 0, "dashboard": False}},
        worker=worker,
        security=security,
        silence_logs=silence,
    )
