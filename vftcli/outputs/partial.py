"""Temporary folders, each of a living process; those of dead ones are cleared."""

import os
import re
import shutil
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

if sys.platform != "win32":
    import fcntl

PARTIAL = ".vftcli-*.partial"  #: Every temporary folder's name, as a pattern of paths.
#: Name of a temporary folder, with the number of its process.
NAME = re.compile(r"\.vftcli-(\d+)-[0-9a-f]{8}\.partial")
#: Age at which an unheld folder is cleared though its process number is in use again. [s]
UNSURE = 60.0


@contextmanager
def partial_folder(parent: Path) -> Iterator[Path]:
    """Make a folder in `parent` for a block; it is removed with its content.

    After a block that ends well, folders of killed runs in `parent` are removed, too.
    """
    path = parent / f".vftcli-{os.getpid()}-{os.urandom(4).hex()}.partial"
    path.mkdir()
    try:
        # Held as long as the process lives, so that others know.
        with held(path, wait=False):
            yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
    for other in parent.glob(PARTIAL):
        found = NAME.fullmatch(other.name)
        if found is None or other.is_symlink() or not other.is_dir():
            continue
        with suppress(OSError), held(other, wait=False):
            gone = time.time() - other.stat().st_mtime > UNSURE
            if sys.platform != "win32":  # where asking would end it
                try:
                    os.kill(int(found[1]), 0)
                except (ProcessLookupError, OverflowError):
                    gone = True
                except PermissionError:
                    pass  # another user's
            if gone:
                shutil.rmtree(other, ignore_errors=True)


@contextmanager
def held(folder: Path, *, wait: bool) -> Iterator[None]:
    """Hold a folder for a block against others; a dead process holds nothing."""
    if sys.platform == "win32":
        yield
        return
    place = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(place, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            raise
        except OSError:
            pass  # a file system without locks: nothing holds, nothing waits
        yield
    finally:
        os.close(place)


def to_disk(paths: Iterable[Path]) -> None:
    """Flush files and folders to the disk, so that a later rename cannot overtake."""
    for path in paths:
        # A folder cannot be opened everywhere, nor flushed on every file system.
        with suppress(*([OSError] if path.is_dir() else [])):
            place = os.open(path, os.O_RDONLY)
            try:
                os.fsync(place)
            finally:
                os.close(place)


def check_writable(folder: Path) -> None:
    """Raise the operating system's error if no file can be made in `folder`."""
    if not folder.is_dir():
        raise FileNotFoundError(2, "there is no such folder", str(folder))
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(13, "no permission to write there", str(folder))
