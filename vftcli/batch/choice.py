"""WorkersChoice: where many pieces of work are done."""

import re
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from vftcli.signals.errors import ParameterError

ADDRESS = re.compile(r"(tcp|tls)://[^\s/]+:[0-9]{1,5}")  #: tcp://host:8786
MEMORY = 1.5e9  #: What a worker needs of the machine's memory at least. [B]
MOST_WORKERS = 8  #: Workers that are started unasked.
EXTRA = "pip install 'vftcli[cluster]'"  #: How Dask comes in.


@dataclass(frozen=True, kw_only=True)
class WorkersChoice:
    """Place of many pieces of work."""

    #: How many processes of this machine; 0 for this process alone, None for as many as it has
    #: cores and memory for.
    workers: int | None = None
    scheduler: str | None = None  #: Address of a running Dask scheduler, or None.
    #: Files of the authority's certificate, the own certificate and its key, or None.
    tls: tuple[Path, Path, Path] | None = None
    #: Bytes that a worker of this machine may take before it is ended, None for its share.
    memory: int | None = None

    def __post_init__(self) -> None:
        if self.scheduler is not None:
            self._check_address(self.scheduler)
        elif self.tls is not None:
            raise ParameterError(
                "--tls-… are for the workers of a cluster; add --scheduler ADDRESS"
            )
        if not self.in_process and not is_installed():
            raise ParameterError(
                f"--workers and --scheduler need Dask and cryptography: {EXTRA}, or --workers 0"
            )

    def _check_address(self, address: str) -> None:
        if not ADDRESS.fullmatch(address):
            raise ParameterError(
                f"--scheduler {address!r} is no address, as tcp://host:8786 or tls://host:8786"
            )
        if address.startswith("tls") != (self.tls is not None):
            raise ParameterError(
                "tls:// and --tls-ca, --tls-cert, --tls-key (all three) belong together"
            )
        if self.workers is not None:
            raise ParameterError("--scheduler has its own workers; leave --workers out")

    @classmethod
    def parsed(
        cls,
        *,
        workers: int | None = None,
        scheduler: str | None = None,
        worker_memory: float | None = None,
        tls_ca: Path | None = None,
        tls_cert: Path | None = None,
        tls_key: Path | None = None,
    ) -> "WorkersChoice":
        """The choice that ``--workers``, ``--scheduler`` and what goes with them state."""
        given = [path for path in (tls_ca, tls_cert, tls_key) if path is not None]
        if len(given) in {1, 2}:
            raise ParameterError("--tls-ca, --tls-cert and --tls-key are given together")
        return cls(
            workers=workers,
            scheduler=scheduler,
            tls=(given[0], given[1], given[2]) if given else None,
            memory=None if worker_memory is None else int(worker_memory * 1e9),
        )

    def check_closed(self, *, anyway: bool) -> None:
        """Refuse a cluster that does not ask who connects to it, unless the user accepts that."""
        if self.scheduler is not None and self.scheduler.startswith("tcp") and not anyway:
            raise ParameterError(
                f"--scheduler {self.scheduler}: anyone who reaches a tcp:// cluster can run code "
                "as you; use tls:// with --tls-ca, --tls-cert and --tls-key, or --anyway where "
                "you trust everyone on its network"
            )

    @property
    def in_process(self) -> bool:
        """Whether the work is done here, one piece after the other."""
        if self.scheduler is not None:
            return False
        return self.workers == 0 or (self.workers is None and not is_installed())


def is_installed() -> bool:
    """Whether Dask is there, and what makes the certificates of its workers."""
    return all(find_spec(module) is not None for module in ("distributed", "cryptography"))
