"""How much the packed chunks of an HDF5 dataset unpack to, told before HDF5 unpacks them.

HDF5 holds one unpacked chunk at a time, and inflates it whole whatever size the chunk should have.
"""

import zlib
from typing import Any

from vftcli.signals.errors import LogError

#: Filters by HDF5's numbers; those of h5py, MATLAB and the common recorders.
DEFLATE, SHUFFLE, FLETCHER32, LZF = 1, 2, 3, 32000
DEFLATE_RATIO = 1032  #: The most that deflate unpacks a byte to (zlib, algorithm.txt).


def check_chunks(told: str, dataset: Any, limit: int) -> None:  # noqa: ANN401 - h5py
    """Check that no chunk unpacks to more than a log's may."""
    if dataset.chunks is None:
        return
    size = dataset.dtype.itemsize
    for length in dataset.chunks:
        size *= length
    if size > limit:
        raise LogError(f"{told}: its chunks unpack to {size >> 20} MiB each, more than its rows.")
    settings = dataset.id.get_create_plist()
    filters = [settings.get_filter(k)[0] for k in range(settings.get_nfilters())]
    # Each unpacks what the next has unpacked: two of a kind are a thousandfold of a thousandfold.
    if set(filters) - {DEFLATE, SHUFFLE, FLETCHER32, LZF} or len(set(filters)) < len(filters):
        raise LogError(
            f"{told}: packed by HDF5's filters {filters}, of which deflate, shuffle, fletcher32 "
            "and lzf are read, once each; repack it: h5repack -f GZIP=4 OLD NEW"
        )
    if DEFLATE in filters and DEFLATE_RATIO * dataset.id.get_storage_size() > limit:
        inflate_suspects(told, dataset, size, limit)


def inflate_suspects(told: str, dataset: Any, size: int, limit: int) -> None:  # noqa: ANN401
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
            raise LogError(f"{told}: a chunk unpacks to more than the {size} bytes that it holds.")
