"""HDF5 files as tables: their datasets of numbers by path, read within bounds by h5py."""

import re
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

from vftcli.readers.opening import check_unpacked, unpacked_limit
from vftcli.readers.reader import LogFile
from vftcli.readers.table import Column, listed
from vftcli.readers.tables import ArrayTable
from vftcli.signals.errors import LogError
from vftcli.signals.packages import needed

#: Filters by HDF5's numbers; those of h5py, MATLAB and the common recorders.
DEFLATE, SHUFFLE, FLETCHER32, LZF = 1, 2, 3, 32000
DEFLATE_RATIO = 1032  #: The most that deflate unpacks a byte to (zlib, algorithm.txt).


def check_chunks(name: str, dataset: Any, limit: int) -> None:  # noqa: ANN401 - h5py
    """Check that no chunk unpacks to more than a log's may."""
    if dataset.chunks is None:
        return
    size = dataset.dtype.itemsize
    for length in dataset.chunks:
        size *= length
    if size > limit:
        raise LogError(f"{name}: its chunks unpack to {size >> 20} MiB each, more than its rows.")
    settings = dataset.id.get_create_plist()
    filters = [settings.get_filter(k)[0] for k in range(settings.get_nfilters())]
    # Each unpacks what the next has unpacked: two of a kind are a thousandfold of a thousandfold.
    if set(filters) - {DEFLATE, SHUFFLE, FLETCHER32, LZF} or len(set(filters)) < len(filters):
        raise LogError(
            f"{name}: packed by HDF5's filters {filters}, of which deflate, shuffle, fletcher32 "
            "and lzf are read, once each; repack it: h5repack -f GZIP=4 OLD NEW"
        )
    if DEFLATE in filters and DEFLATE_RATIO * dataset.id.get_storage_size() > limit:
        inflate_suspects(name, dataset, size, limit)


def inflate_suspects(name: str, dataset: Any, size: int, limit: int) -> None:  # noqa: ANN401
    """Inflate chunks that could unpack to more than `limit`, no further than to their `size`."""
    suspects: list[tuple[int, ...]] = []

    def look(chunk: Any) -> None:  # noqa: ANN401 - h5py
        if DEFLATE_RATIO * chunk.size > limit:
            suspects.append(chunk.chunk_offset)

    dataset.id.chunk_iter(look)
    for offset in suspects:
        _, packed = dataset.id.read_direct_chunk(offset)
        try:
            unpacked = zlib.decompressobj().decompress(packed, size + 1)
        except zlib.error:
            continue  # no more than this was unpacked; HDF5 says where it breaks off
        if len(unpacked) > size:
            raise LogError(f"{name}: a chunk unpacks to more than the {size} bytes that it holds.")


#: Groups and datasets that are looked at, and groups inside groups; a log has some hundred.
MOST_OBJECTS, DEEPEST = 100_000, 32


@contextmanager
def opened(file: LogFile) -> Iterator[Any]:
    """The file as h5py opens it, its errors turned into one that names the file."""
    h5py = needed("h5py", f"{file.path}: an HDF5 file", error=LogError)
    try:
        with h5py.File(file.direct or BytesIO(file.content), "r") as content:
            yield content
    except (
        OSError, RuntimeError, ValueError, KeyError, TypeError, MemoryError, OverflowError,
        NotImplementedError, AttributeError, SystemError,
    ) as error:  # fmt: skip
        reason = str(error).split("\n")[0][:120]
        raise LogError(f"{file.path}: a damaged HDF5 file ({reason})") from None


class Hdf5Table(ArrayTable):
    """The datasets of numbers in an open HDF5 file, or in one group of it, each a column.

    Images, texts, references, links to other files and what claims more than it stores are left
    out; nothing is read before it is asked for.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self.lists = {k: width for k, width in self.lists.items() if width != 1}

    def within(self, group: str, also: Sequence[str] = ()) -> "Hdf5Table":
        """The datasets below a group, by their paths from there on, and others by theirs."""
        below = {n.removeprefix(group): d for n, d in self.columns.items() if n.startswith(group)}
        return Hdf5Table(self.path, {name: self.columns[name] for name in also} | below)

    def load(self, columns: Sequence[int], clock: int | None) -> dict[int, Column]:
        """Read datasets as float64; whole stamps stay whole."""
        self.check_size(columns)
        return super().load(columns, clock)

    def check_size(self, columns: Sequence[int]) -> None:
        """Check that datasets may be read: a kilobyte may claim any size, and costs nothing."""
        names, datasets = list(self.columns), list(self.columns.values())
        stored = sum(datasets[c].id.get_storage_size() for c in columns)
        what = f"{self.path}: {listed([names[c] for c in columns])}"
        check_unpacked(what, 8 * sum(datasets[c].size for c in columns), stored)
        for c in columns:
            check_chunks(f"{self.path}: {names[c]}", datasets[c], unpacked_limit(stored))


def table_of(path: Path, content: Any, fewest_rows: int = 2) -> Hdf5Table:  # noqa: ANN401 - h5py
    """The datasets of numbers of an open file that have some rows."""
    found = {name: d for name, d in datasets_of(path, content) if is_signal(d, fewest_rows)}
    if not found:
        raise LogError(f"{path}: an HDF5 file without datasets of numbers, so no log.")
    return Hdf5Table(path, dict(sorted(found.items(), key=lambda item: natural(item[0]))))


def datasets_of(path: Path, content: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401 - h5py
    """Every dataset of an open file by its path, links to elsewhere and second ways left out."""
    h5py = needed("h5py", "an HDF5 file")

    seen: set[int] = set()
    waiting = [("", content["/"], 0)]
    while waiting:
        prefix, group, depth = waiting.pop()
        for name in group:
            # Soft and external links may lead anywhere, also out of the file.
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                continue
            item = group.get(name)
            address = h5py.h5o.get_info(item.id).addr
            if address in seen:
                continue
            seen.add(address)
            if len(seen) > MOST_OBJECTS:
                raise LogError(f"{path}: more than {MOST_OBJECTS} groups and datasets; no log is.")
            if isinstance(item, h5py.Dataset):
                yield f"{prefix}{name}", item
            elif isinstance(item, h5py.Group) and depth < DEEPEST:
                waiting.append((f"{prefix}{name}/", item, depth + 1))


def is_signal(dataset: Any, fewest_rows: int) -> bool:  # noqa: ANN401 - h5py
    """Whether a dataset may be a signal: numbers of the file's own, one or many a row."""
    if dataset.dtype.kind not in "fiub" or dataset.shape is None or dataset.ndim not in {1, 2}:
        return False
    if dataset.shape[0] < fewest_rows or not all(dataset.shape):
        return False
    return not dataset.is_virtual and not dataset.external


def natural(name: str) -> list[tuple[int, int, str]]:
    """A key that puts demo_2 before demo_10."""
    parts = re.split(r"(\d{1,9})", name)
    return [(1, int(p), "") if p.isdecimal() else (0, 0, p) for p in parts]
