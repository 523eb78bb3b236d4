"""Reading files where a hang or a flood of memory ends a child and nothing else.

As a program it reads each file that it is given in a child of its own and prints what came of it,
one JSON object a line. `read_apart` runs it: a test process has threads of libraries in it, and
must not be forked.
"""

import json
import os
import resource
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

CPU_LIMIT_S = 20
"""A guard against hangs, far above what any reading takes."""

ADDRESS_LIMIT = 3 << 30
"""A guard for the machine; what is tested is the memory that was used."""


class Reading(NamedTuple):
    """What came of a file: its samples or -1, all that was said, and the memory it took. [MiB]"""

    samples: int
    said: str
    peak_mib: float


def read_apart(paths: Iterable[Path]) -> dict[str, Reading]:
    """Read files, each in a child of its own. Name → what came of it."""
    command = [sys.executable, __file__, *map(str, paths)]
    same = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}  # the package that is tested
    lines = subprocess.run(command, capture_output=True, check=True, text=True, env=same).stdout
    found = map(json.loads, lines.splitlines())
    return {name: Reading(*reading) for name, *reading in found}


def outcome(path: str) -> tuple[int, str]:
    """Samples of a file that is read in this process, and what is said of it or of its refusal."""
    from vftcli.readers.reading import read
    from vftcli.signals.errors import VftError

    try:
        recording = read(path)
    except VftError as error:
        return -1, str(error)
    except BaseException as error:  # noqa: BLE001 - whatever it is, it is reported
        return -2, f"{type(error).__name__}: {error}"
    reported = (str(r) for r in recording.source.remarks if r.level == "warning")
    return recording.samples, "; ".join(reported)


def peak_mib() -> float:
    """The most memory that this process has held; what rusage tells is its parent's too. [MiB]"""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def main() -> None:
    import pyarrow.parquet  # noqa: F401 - once, not in every child
    import rosbags.typesys  # noqa: F401

    import vftcli.readers  # noqa: F401

    for path in sys.argv[1:]:
        inlet, outlet = os.pipe()
        child = os.fork()
        if child == 0:
            resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT_S, CPU_LIMIT_S))
            resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_LIMIT, ADDRESS_LIMIT))
            reported = json.dumps([Path(path).name, *outcome(path), peak_mib()])
            os.write(outlet, reported.encode())
            os._exit(0)
        os.close(outlet)
        with os.fdopen(inlet, "rb") as pipe:
            line = pipe.read().decode()
        _, status = os.waitpid(child, 0)
        ended = f"ended by {os.waitstatus_to_exitcode(status)}"
        sys.stdout.write((line or json.dumps([Path(path).name, -3, ended, 0.0])) + "\n")


if __name__ == "__main__":
    main()
