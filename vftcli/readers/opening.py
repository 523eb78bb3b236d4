"""Opening files: gzip and zstd unpacked within bounds, memory maps, digests."""

import hashlib
import math
import mmap
import re
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any, Literal

from vftcli.signals.arrays import release
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark, warning

HEAD_BYTES = 64 * 1024  #: Bytes that recognition looks at.

Wrapping = Literal["gzip", "zstd"]

MAGICS: dict[bytes, Wrapping] = {b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd"}

UNPACKED_LIMIT = 128 * 1024 * 1024
#: Most that a file unpacks to, beside 128 MiB: numbers shrink 3 to 15 times, never 100.
UNPACKED_RATIO = 50

CHUNK = 1024 * 1024
#: A piece of zstd so small that even a bomb yields some ten MB.
ZSTD_BYTES = 1024


def unpacked_limit(size: int) -> int:
    """Bytes that a file of a size, or a part of it, may unpack to."""
    return max(UNPACKED_LIMIT, UNPACKED_RATIO * size)


def check_unpacked(what: object, claimed: int, size: int) -> None:
    """Raise a LogError if a file claims to unpack to more than a log of its size."""
    if not 0 <= claimed <= unpacked_limit(size):
        raise LogError(
            f"{what}: unpacks to more than {unpacked_limit(size) >> 20} MiB, more than a log of "
            "this size can hold. It is damaged or made to fill memory."
        )


#: What libraries raise on a damaged file, whatever it holds.
DAMAGE = (
    ArithmeticError, AttributeError, EOFError, LookupError, MemoryError, OSError, RuntimeError,
    SyntaxError, SystemError, TypeError, ValueError,
)  # fmt: skip


@contextmanager
def naming_damage(
    path: Path, what: str, *own: type[Exception], remedy: str = ""
) -> Iterator[None]:
    """Turn a library's errors, and `own` kinds, into one naming the file."""
    errors: tuple[type[Exception], ...] = (*DAMAGE, *own)
    try:
        yield
    except errors as error:
        raise LogError(f"{path}: {what} ({reason_of(error)}){remedy}") from None


def reason_of(error: Exception) -> str:
    """The beginning of an error's first line."""
    return str(error).split("\n", maxsplit=1)[0][:120]


@dataclass(frozen=True, kw_only=True)
class LogFile:
    """A file or folder as the readers see it: its first bytes already unwrapped."""

    path: Path
    #: The first bytes of the content, unpacked; empty for a folder.
    head: bytes = b""
    entries: tuple[str, ...] = ()  #: Names in the folder, sorted.
    #: What the file is compressed with as a whole, or None.
    wrapping: Wrapping | None = None

    @property
    def is_folder(self) -> bool:
        """Whether the path is a folder."""
        return self.path.is_dir()

    @property
    def direct(self) -> Path | None:
        """The path, if it is a plain file with a name in UTF-8."""
        try:
            str(self.path).encode("utf-8")
        except UnicodeEncodeError:
            return None
        return self.path if self.wrapping is None else None

    @property
    def content(self) -> memoryview:
        """The whole content, unwrapped; a plain file is mapped, not read."""
        return self._unwrapped[0]

    def release(self) -> None:
        """Release the touched pages of a mapped file; they can be read again."""
        release(self.content)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """A warning if the file is cut."""
        cut = self.wrapping is not None and self._unwrapped[1]
        return (warning("file-cut", wrapping=self.wrapping),) if cut else ()

    @cached_property
    def _unwrapped(self) -> tuple[memoryview, bool]:
        """The content, and whether a wrapped file ends before its packed data does."""
        if self.is_folder:
            raise LogError(
                f"{self.path}: a folder, and the chosen format is of files. Give the file, or "
                "leave log.format out."
            )
        if self.wrapping is not None:
            content, whole = unpacked(self.path, self.wrapping)
            return memoryview(content), not whole
        # Mapping costs more than copying where there is little to copy.
        if self.path.stat().st_size < CHUNK:
            return memoryview(self.path.read_bytes()), False
        with self.path.open("rb") as file:
            return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)), False

    @cached_property
    def lines(self) -> list[bytes]:
        """The non-empty lines of the head; [] if it is no text."""
        # No text in UTF-8 or an eight-bit encoding holds one of these.
        if any(bytes([c]) in self.head for c in (*range(7), *range(14, 20), 127)):
            return []
        return [line for line in self.head.replace(b"\r", b"\n").split(b"\n") if line.strip()]

    @property
    def first_line(self) -> bytes:
        """The first non-empty line without a byte-order mark, or nothing."""
        return self.lines[0].removeprefix(b"\xef\xbb\xbf") if self.lines else b""


def open_log(path: Path) -> LogFile:
    """Open a path for recognition: unwrap the head of a file, list a folder."""
    if path.is_dir():
        return LogFile(path=path, entries=tuple(sorted(p.name for p in path.iterdir())))
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
    wrapping = next((w for magic, w in MAGICS.items() if head.startswith(magic)), None)
    if wrapping is not None:
        head = unpacked(path, wrapping, HEAD_BYTES)[0][:HEAD_BYTES]
        if not head:
            raise LogError(
                f"{path}: the {wrapping} file unpacks to nothing; it is empty or damaged."
            )
    return LogFile(path=path, head=head, wrapping=wrapping)


def unpacked(path: Path, wrapping: Wrapping, enough: float = math.inf) -> tuple[bytes, bool]:
    """The unpacked file or its first bytes, and whether its packed data is whole.

    gzip's members and zstd's frames are joined; a cut file gives its part, a bomb is refused.
    """
    new: Callable[[], Any]
    damage: type[Exception]
    if gzip := wrapping == "gzip":
        new, damage, size = partial(zlib.decompressobj, wbits=31), zlib.error, CHUNK // 16
    else:
        import zstandard

        new = zstandard.ZstdDecompressor(max_window_size=1 << 27).decompressobj
        damage, size = zstandard.ZstdError, ZSTD_BYTES
    limit = unpacked_limit(path.stat().st_size)
    unpacker, total, pieces = new(), 0, list[bytes]()
    with path.open("rb") as file:
        while packed := file.read(size):
            while packed:
                try:
                    pieces.append(unpacker.decompress(packed, *[CHUNK] * gzip))
                except damage as error:
                    raise LogError(f"{path}: the {wrapping} file is damaged ({error})") from None
                total += len(pieces[-1])
                if total > limit:
                    raise LogError(
                        f"{path}: unpacks to more than {limit >> 20} MiB, more than a log this "
                        f"small can hold. If it is genuine, unpack it ({wrapping} -d)."
                    )
                if total >= enough:
                    return b"".join(pieces), False
                packed = unpacker.unconsumed_tail if gzip else b""
                if unpacker.eof and (packed := unpacker.unused_data.lstrip(b"\0" * gzip)):
                    unpacker = new()
    return b"".join(pieces), unpacker.eof


def natural(name: str) -> list[tuple[int, int, str]]:
    """A key that puts demo_2 before demo_10."""
    parts = re.split(r"(\d{1,9})", name)
    return [(1, int(p), "") if p.isdecimal() else (0, 0, p) for p in parts]


def files_of(path: Path) -> list[Path]:
    """A file, or all files of a folder in name order."""
    return sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]


def sha256_of(*paths: Path) -> str:
    """SHA-256 of files, of a folder all in name order."""
    files = [(file, file.stat()) for path in paths for file in files_of(path)]
    return _digest(*((file, at.st_mtime_ns, at.st_size) for file, at in files))


@lru_cache
def _digest(*states: tuple[Path, int, int]) -> str:
    """Digest of files with time and size, taken once for all episodes of a file."""
    total = hashlib.sha256()
    for file, *_ in states:
        with suppress(OSError), file.open("rb", buffering=0) as content:
            hashlib.file_digest(content, lambda: total)
    return total.hexdigest()
