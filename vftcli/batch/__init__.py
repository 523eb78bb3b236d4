"""Many logs: one work on each, in this process, on its cores, or on a cluster."""

import re
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from vftcli.signals.errors import ParameterError
from vftcli.signals.option import Choice, Option

ADDRESS = re.compile(r"(tcp|tls)://[^\s/]+:[0-9]{1,5}")  #: tcp://host:8786
MEMORY = 1.5e9  #: Least memory of a worker. [B]
MOST_WORKERS = 8  #: Workers that are started unasked.
EXTRA = "pip install 'vftcli[cluster]'"  #: Command to install Dask.


class WorkersChoice(Choice):
    """Place of many pieces of work."""

    #: Processes; 0 for this one alone, None by cores and memory.
    jobs: Annotated[
        int | None,
        Option(
            "--jobs", "N", "Use N processes; default: one a core, at most 8.", least=0, most=4096
        ),
    ] = None
    #: Address of a running Dask scheduler, or None.
    address: Annotated[
        str | None,
        Option("cluster.address", "ADDRESS", "A running Dask cluster, as tls://host:8786."),
    ] = None
    #: Memory of a worker before it is ended; None for its share. [GB]
    memory_gb: Annotated[
        float | None,
        Option(
            "cluster.memory-gb",
            "GB",
            "Memory of a process of this machine; default: its share.",
            least=0.1,
        ),
    ] = None
    ca: Annotated[
        Path | None, Option("cluster.ca", "FILE", "Certificate of the cluster's authority.", Path)
    ] = None
    cert: Annotated[Path | None, Option("cluster.cert", "FILE", "Own certificate.", Path)] = None
    key: Annotated[Path | None, Option("cluster.key", "FILE", "Its key.", Path)] = None

    def __post_init__(self) -> None:
        if len(self.tls) in {1, 2}:
            raise ParameterError("cluster.ca, cluster.cert and cluster.key are given together")
        if self.address is None and self.tls:
            raise ParameterError(
                "cluster.ca, cert and key are for a cluster; add --set cluster.address=ADDRESS"
            )
        if self.address is not None and not ADDRESS.fullmatch(self.address):
            raise ParameterError(
                f"cluster.address={self.address} is no address, as tcp://host:8786 or "
                "tls://host:8786"
            )
        if self.address is not None and self.address.startswith("tls") != bool(self.tls):
            raise ParameterError(
                "tls:// and cluster.ca, cluster.cert, cluster.key (all three) belong together"
            )
        if self.address is not None and self.jobs is not None:
            raise ParameterError("a cluster has its own workers; leave --jobs out")
        if not self.in_process and not is_installed():
            raise ParameterError(
                f"--jobs and cluster.address need Dask and cryptography: {EXTRA}, or --jobs 0"
            )

    @property
    def tls(self) -> tuple[Path, ...]:
        """Files of authority, own certificate and key, or none."""
        return tuple(path for path in (self.ca, self.cert, self.key) if path is not None)

    def check_closed(self, *, anyway: bool) -> None:
        """Refuse a cluster open to anyone, unless `anyway`."""
        if self.address is not None and self.address.startswith("tcp") and not anyway:
            raise ParameterError(
                f"cluster.address={self.address}: anyone who reaches a tcp:// cluster can run code "
                "as you; use tls:// with cluster.ca, cert and key, or --anyway where you "
                "trust everyone on its network"
            )

    @property
    def in_process(self) -> bool:
        """Whether the work is done here, one piece after the other."""
        if self.address is not None:
            return False
        return self.jobs == 0 or (self.jobs is None and not is_installed())


def is_installed() -> bool:
    """Whether Dask and cryptography, for certificates, are installed."""
    return all(find_spec(module) is not None for module in ("distributed", "cryptography"))
