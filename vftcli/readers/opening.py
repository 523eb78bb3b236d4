"""Opening files: gzip and zstd taken off within bounds, whole files as memory, digests beside."""

import hashlib
import mmap
import re
import threading
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Literal

from vftcli.signals.errors import LogError

HEAD_BYTES = 64 * 1024  #: Bytes that recognition looks at.

Wrapping = Literal["gzip", "zstd"]

MAGICS: dict[bytes, Wrapping] = {b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd"}

UNPACKED_LIMIT = 128 * 1024 * 1024
#: A wrapped file may unpack to 128 MiB or to fifty times its size, whichever is more.
#:
#: Recorded numbers shrink by 3 to 15; a log that shrinks a hundredfold is not a recorded log.
UNPACKED_RATIO = 50


def unpacked_limit(size: int) -> int:
    """Bytes that a file of a size, or a part of it, may unpack to."""
    return max(UNPACKED_LIMIT, UNPACKED_RATIO * size)


def check_unpacked(what: object, claimed: int, size: int) -> None:
    """Raise a LogError if a file of a size claims to unpack to more than a log of it can."""
    if not 0 <= claimed <= unpacked_limit(size):
        raise LogError(
            f"{what}: unpacks to more than {unpacked_limit(size) >> 20} MiB, more than a log of "
            "this size can hold. It is damaged or made to fill memory."
        )


#: A log of no more rows is read in one piece: there is memory for all that is done with it.
WHOLE_ROWS = 100_000

CHUNK = 1024 * 1024
#: zstd is fed in pieces so small that even a bomb yields only some tens of megabytes at a time.
ZSTD_BYTES = 1024


def head_of(path: Path) -> tuple[bytes, Wrapping | None]:
    """Return the first bytes of a file's content, unwrapped, and what it was wrapped in."""
    if not path.exists():
        raise LogError(f"{path}: no such file or folder. Check the path.")
    if not path.is_file():
        raise LogError(f"{path}: neither a file nor a folder. Save the log to a file first.")
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise LogError(f"{path}: cannot be opened ({error.strerror})") from None
    if not head:
        raise LogError(f"{path}: the file is empty; nothing was recorded into it.")
    for magic, wrapping in MAGICS.items():
        if head.startswith(magic):
            found = b""
            for piece in Unpacker(path, wrapping).pieces():
                found += piece
                if len(found) >= HEAD_BYTES:
                    break
            if not found:
                raise LogError(
                    f"{path}: the {wrapping} file unpacks to nothing; it is empty or damaged."
                )
            return found[:HEAD_BYTES], wrapping
    return head, None


def unwrapped(path: Path, wrapping: Wrapping | None) -> tuple[memoryview, bool]:
    """Return a file's whole content, mapped if plain, unpacked into memory if wrapped.

    Returns:
        The content, and whether a wrapped file ends before its packed data does.
    """
    if wrapping is not None:
        unpacker = Unpacker(path, wrapping)
        return memoryview(b"".join(unpacker.pieces())), not unpacker.ended
    # Mapping costs more than copying where there is little to copy.
    if path.stat().st_size < CHUNK:
        return memoryview(path.read_bytes()), False
    with path.open("rb") as file:
        return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)), False


class Unpacker:
    """Unpacks a file piece by piece: a cut end yields what there is, a bomb is refused.

    Attributes:
        ended: After the last piece: whether the packed data was whole.
    """

    def __init__(self, path: Path, wrapping: Wrapping) -> None:
        self.path = path
        self.wrapping = wrapping
        self.limit = unpacked_limit(path.stat().st_size)
        self.ended = False

    def pieces(self) -> Iterator[bytes]:
        """The content, piece by piece: members of gzip, or frames of zstd, one after another."""
        new: Callable[[], Any]
        damage: type[Exception]
        if gzip := self.wrapping == "gzip":
            new, damage, size = partial(zlib.decompressobj, wbits=31), zlib.error, CHUNK // 16
        else:
            import zstandard

            new = zstandard.ZstdDecompressor(max_window_size=1 << 27).decompressobj
            damage, size = zstandard.ZstdError, ZSTD_BYTES
        unpacker, total = new(), 0
        with self.path.open("rb") as file:
            while packed := file.read(size):
                while packed:
                    try:
                        piece = unpacker.decompress(packed, *[CHUNK] * gzip)
                    except damage as error:
                        told = f"{self.path}: the {self.wrapping} file is damaged ({error})"
                        raise LogError(told) from None
                    total += len(piece)
                    if total > self.limit:
                        raise LogError(
                            f"{self.path}: unpacks to more than {self.limit >> 20} MiB, more than "
                            "a log this small can hold. If it is genuine, unpack it "
                            f"({self.wrapping} -d) and give the unpacked file."
                        )
                    yield piece
                    packed = unpacker.unconsumed_tail if gzip else b""
                    if unpacker.eof and (packed := unpacker.unused_data.lstrip(b"\0" * gzip)):
                        unpacker = new()
        self.ended = unpacker.eof


def natural(name: str) -> list[tuple[int, int, str]]:
    """A key that puts demo_2 before demo_10."""
    parts = re.split(r"(\d{1,9})", name)
    return [(1, int(p), "") if p.isdecimal() else (0, 0, p) for p in parts]


def files_of(path: Path) -> list[Path]:
    """A file, or all files of a folder in name order."""
    return sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]


class Digest:
    """SHA-256 of files, of a folder all in name order, computed beside other work.

    It keeps a core busy, so it should start while the reader's own libraries are being imported,
    or else when the reader is done with the cores.
    """

    def __init__(self, paths: Iterable[Path]) -> None:
        self._paths = [file for path in paths for file in files_of(path)]
        self._sum = hashlib.sha256()
        # hashlib releases the interpreter for large pieces, so a thread is enough.
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._started = False

    def start(self) -> None:
        """Start computing, if that has not begun."""
        if not self._started:
            self._started = True
            self._thread.start()

    def _run(self) -> None:
        """Sum up the files' bytes; what cannot be opened is told by whoever reads it."""
        buffer = bytearray(CHUNK)
        view = memoryview(buffer)
        for path in self._paths:
            with suppress(OSError), path.open("rb", buffering=0) as file:
                while count := file.readinto(view):
                    self._sum.update(view[:count])

    def hexdigest(self) -> str:
        """Wait for the end and return the digest."""
        self.start()
        self._thread.join()
        return self._sum.hexdigest()
