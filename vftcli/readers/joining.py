"""Parts of a log joined: long signals lie in a file, so that memory does not grow with a log."""

from collections.abc import Iterable, Mapping
from mmap import ACCESS_READ, mmap
from tempfile import TemporaryFile
from typing import Any
from weakref import finalize

import numpy as np

from vftcli.readers.table import Column
from vftcli.signals.arrays import Array, release
from vftcli.signals.errors import LogError

#: Bytes of a signal that wait in memory. A longer one lies in a nameless file in the system's
#: folder for temporary files, and is an array all the same.
HELD = 1 << 22


class JoinedRows:
    """The rows of a signal, part by part.

    Attributes:
        count: How many there are so far.
        shapes: The shapes of single rows.
    """

    def __init__(self) -> None:
        self.count, self.shapes = 0, set[tuple[int, ...]]()
        self._held: list[Column] = []
        self._size = 0
        self._file: Any = None

    def add(self, rows: Column) -> None:
        """Take up the next rows. (N, k) or (N,)

        Raises:
            LogError: If they have no room.
        """
        self.count += len(rows)
        self.shapes.add(rows.shape[1:])
        self._kind = rows.dtype
        self._held.append(rows)
        self._size += rows.nbytes
        if self._size > HELD and self.count > len(rows):
            self._write()

    def _write(self) -> None:
        """Write the rows that wait behind those in the file."""
        try:
            if self._file is None:
                self._file = TemporaryFile()  # noqa: SIM115 - open until all rows are there
                finalize(self, self._file.close)
            for rows in self._held:
                self._file.write(np.ascontiguousarray(rows))
                release(rows)
            self._file.flush()
        except OSError as error:
            raise LogError(
                f"a long log has no room in the folder of temporary files ({error.strerror}). "
                "Name another: TMPDIR=FOLDER"
            ) from None
        self._held, self._size = [], 0

    def whole(self) -> Column:
        """All rows, where they have one shape; nothing can be added any more."""
        if self._file is None:
            return np.concatenate(self._held) if len(self._held) > 1 else self._held[0]
        self._write()
        mapped = mmap(self._file.fileno(), 0, access=ACCESS_READ)  # stays when the file is closed
        return np.frombuffer(mapped, self._kind).reshape(-1, *min(self.shapes))


def joined(parts: Iterable[Mapping[str, Array]]) -> dict[str, Array]:
    """Signals that come part by part, each as one array.

    Args:
        parts: Signal → its next rows (N, k); all parts have the same signals.

    Raises:
        LogError: If there are no parts, or no room for them.
    """
    found: dict[str, JoinedRows] = {}
    for part in parts:
        for name, rows in part.items():
            found.setdefault(name, JoinedRows()).add(rows)
    if not found:
        raise LogError("the log has no rows; nothing was recorded into it")
    return {name: rows.whole() for name, rows in found.items()}
