"""WorkersChoice: where many pieces of work are done."""

import re
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from vftcli.signals.errors import ParameterError
from vftcli.signals.option import Choice, Option

ADDRESS = re.compile(r"(tcp|tls)://[^\s/]+:[0-9]{1,5}")  #: tcp://host:8786
MEMORY = 1.5e9  #: What a worker needs of the machine's memory at least. [B]
MOST_WORKERS = 8  #: Workers that are started unasked.
EXTRA = "pip install 'vftcli[cluster]'"  #: How Dask comes in.


@dataclass(frozen=True, kw_only=True)
class WorkersChoice(Choice):
    """Place of many pieces of work."""

    #: How many processes of this machine; 0 for this process alone, None for as many as it has
    #: cores and memory for.
    workers: Annotated[
        int | None,
        Option(
            "--workers",
            "N",
            "Processes of this machine. Default: one a core, at most 8. 0 does one log after the "
            "other in this process, and needs no Dask.",
            least=0,
            most=4096,
        ),
    ] = None
    #: Address of a running Dask scheduler, or None.
    scheduler: Annotated[
        str | None,
        Option(
            "--scheduler",
            "ADDRESS",
            "A running Dask cluster. As tls://host:8786; tcp://, open to everyone, needs --anyway.",
        ),
    ] = None
    #: What a worker of this machine may take before it is ended, None for its share. [GB]
    worker_memory: Annotated[
        float | None,
        Option(
            "--worker-memory",
            "GB",
            "What a process of this machine may take before it is ended; default: its share.",
            seldom=True,
            least=0.1,
        ),
    ] = None
    tls_ca: Annotated[
        Path | None,
        Option("--tls-ca", "FILE", "Certificate of the authority, for tls://.", seldom=True),
    ] = None
    tls_cert: Annotated[
        Path | None,
        Option("--tls-cert", "FILE", "Own certificate, for tls://.", seldom=True),
    ] = None
    tls_key: Annotated[
        Path | None, Option("--tls-key", "FILE", "Its key, for tls://.", seldom=True)
    ] = None

    def __post_init__(self) -> None:
        if len(self.tls) in {1, 2}:
            raise ParameterError("--tls-ca, --tls-cert and --tls-key are given together")
        if self.scheduler is not None:
            self._check_address(self.scheduler)
        elif self.tls:
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
        if address.startswith("tls") != bool(self.tls):
            raise ParameterError(
                "tls:// and --tls-ca, --tls-cert, --tls-key (all three) belong together"
            )
        if self.workers is not None:
            raise ParameterError("--scheduler has its own workers; leave --workers out")

    @property
    def tls(self) -> tuple[Path, ...]:
        """The files of the authority's certificate, the own certificate and its key, or none."""
        given = (self.tls_ca, self.tls_cert, self.tls_key)
        return tuple(path for path in given if path is not None)

    @property
    def memory(self) -> int | None:
        """Bytes that a worker of this machine may take before it is ended, None for its share."""
        return None if self.worker_memory is None else int(self.worker_memory * 1e9)

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
