"""Files written whole or not at all, never over an input, nor unasked.

New files are made in a temporary folder beside their places and renamed in
the end; the next process removes such a folder of one that has died. Files
that belong together have a seal: `run.json`, with every other one's digest.
It is removed before the first of them changes and written after the last:
a folder without it is incomplete, whenever a run was killed.
"""

import hashlib
import json
import os
import re
import shutil
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from tempfile import TemporaryFile
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from vftcli.signals.errors import OutputError
from vftcli.signals.parsing import whole

if TYPE_CHECKING:
    import polars as pl

#: A run's last file to be written, first to be removed; or `NAME.run.json`.
SEAL = "run.json"

_inputs: ContextVar[tuple[Path, ...]] = ContextVar("inputs", default=())


@contextmanager
def protected(inputs: Iterable[Path]) -> Iterator[None]:
    """Protect these files and folders from writing in a block."""
    token = _inputs.set(tuple(inputs))
    try:
        yield
    finally:
        _inputs.reset(token)


@contextmanager
def atomic(path: Path, force: bool = False) -> Iterator[Path]:
    """Yield a temporary path that replaces `path` when the block ends well.

    A device or pipe (``/dev/stdout``) is yielded as it is. A failed block leaves nothing.
    """
    path = Path(path)
    if path.is_char_device() or path.is_fifo():
        yield path
        return
    check_file(path, force)
    # A link's target is replaced, not the link.
    target = path.resolve() if path.is_symlink() else path
    with writing(path), partial_folder(target.parent) as folder:
        yield folder / target.name
        to_disk([folder / target.name])
        refuse_existing(path, force)
        (folder / target.name).replace(target)
        to_disk([target.parent])


def check_file(path: Path, force: bool) -> None:
    """Raise an OutputError if a file could not be written."""
    with writing(path):
        check_letters(path)
        refuse_existing(path, force)
        check_writable((path.resolve() if path.is_symlink() else path).parent)


@contextmanager
def table_file(path: Path) -> Iterator[Path]:
    """Yield a path at which Polars or Arrow writes a table."""
    from polars.exceptions import ComputeError

    try:
        yield path
    except (ComputeError, OSError) as error:
        around = r".*IO error: |.*\[[Ee]rrno \d+\] | \(os error \d+\)"
        why = re.sub(around, "", " ".join(str(error).split())[:200])
        raise unwritable(Path(path.name), OSError(why)) from None


def put_table(path: Path, table: "pl.DataFrame", about: Mapping[str, Any] | None = None) -> None:
    """Write a table as Parquet, with what is said about it as the file's metadata."""
    stated = {"vftcli": json.dumps(about)} if about else None
    with table_file(path) as file:
        table.write_parquet(file, compression="zstd", metadata=stated)


def write_text(path: Path, text: str, force: bool = False) -> None:
    """Write UTF-8 text, whole or not at all."""
    with atomic(path, force) as temporary:
        put_text(temporary, text)


def put_text(path: Path, text: str) -> None:
    """Write a text in equal bytes on every system."""
    # Digests are equal on every system. A file name may hold bytes that UTF-8 refuses.
    path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


EARLIER = "earlier"  #: Folder, in the temporary one, for replaced files.


class OutputFolder:
    """A folder that gets all of its files at once, when the block ends well.

    Until then they are in a temporary folder on its file system; a failed block leaves
    neither it nor other new folders. ``folder / "name"`` is a file's path. With `force`,
    files of an earlier run that this one does not write are removed, those in `names` and
    those in the earlier seal, so that all files of the folder belong together.
    """

    def __init__(self, path: Path, force: bool = False, names: Iterable[str] = ()) -> None:
        self.path = Path(path)
        self.force = force
        self.names = tuple(names)
        self.made: list[Path] = []
        self.temporary = self.path
        self._partial = ExitStack()

    def __truediv__(self, name: str) -> Path:
        """Path for the file `name`, with its folder."""
        path = self.temporary / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def write(self, name: str, text: str) -> None:
        """Write a text file."""
        put_text(self / name, text)

    def digests(self, place: str = "") -> dict[str, str]:
        """The sha256 of every file below `place`, by its name."""
        return digests(self.temporary / place)

    def check(self) -> None:
        """Raise an OutputError if a file must not be overwritten."""
        with writing(self.path):
            if self.path.exists() and not self.path.is_dir():
                raise OutputError(f"{self.path} is a file; -o needs the name of a folder")
            for name in self.names:
                check_letters(self.path / name)
                refuse_existing(self.path / name, self.force)
            for path in self._earlier():
                refuse_input(path)
            check_writable(next(p for p in (self.path, *self.path.parents) if p.exists()))

    def __enter__(self) -> Self:
        """Check the files, and make the temporary folder."""
        self.check()
        try:
            # Outermost first, to be removed again if nothing comes of it.
            self.made = [p for p in (self.path, *self.path.parents) if not p.exists()][::-1]
            self.path.mkdir(parents=True, exist_ok=True)
            check_writable(self.path)
            # Inside the folder, so that moving is renaming.
            self.temporary = self._partial.enter_context(partial_folder(self.path))
        except OSError as error:
            self._discard()
            raise unwritable(self.path, error) from None
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Move the files into place, or leave nothing."""
        try:
            if error is None:
                with writing(self.path):
                    self._move()
        finally:
            self._partial.__exit__(kind, error, trace)
            self._discard()
        # An error elsewhere explains itself.
        if isinstance(error, OSError) and (
            error.filename is None or str(error.filename).startswith(str(self.path))
        ):
            raise unwritable(self.path, error) from None

    def _earlier(self) -> set[Path]:
        """Files of an earlier run that must be replaced or removed."""
        declared = {self.path / name for name in self.names}
        listed = [sealed_files(path) for path in declared if is_seal(path)]
        # A killed run may have moved the earlier seal away.
        killed = self.path.glob(f"{PARTIAL}/{EARLIER}/0")
        return declared.union(*listed, *(sealed_files(path, self.path) for path in killed))

    def _move(self) -> None:
        """Put every file into place, if nothing is in the way."""
        files = [p for p in self.temporary.rglob("*") if not p.is_dir()]
        places = {self.path / file.relative_to(self.temporary): file for file in files}
        to_disk([*files, self.temporary])
        # Runs move one after the other, or a folder would mix their files.
        with held(self.path, wait=True):
            earlier = self._earlier()
            for path in places:
                refuse_existing(path, self.force)
            (aside := self.temporary / EARLIER).mkdir()
            # Seals are written last, the folder's own after all, and removed first.
            paths = sorted({*places, *earlier}, key=lambda p: (is_seal(p), -len(p.parts), str(p)))
            there = [p for p in paths[::-1] if p.exists() or p.is_symlink()]
            kept = [(path, aside / str(k)) for k, path in enumerate(there)]
            try:
                for path, place in kept:
                    path.replace(place)
                to_disk([self.path])
                for path in (p for p in paths if p in places):
                    path.parent.mkdir(parents=True, exist_ok=True)
                    if is_seal(path):
                        to_disk({p.parent for p in places})
                    # Renaming within a file system is atomic for each file.
                    places[path].replace(path)
            except BaseException:
                for path in (p for p in paths[::-1] if p not in there):
                    path.unlink(missing_ok=True)
                for path, place in kept[::-1]:
                    # A file that could not be moved is where it was.
                    if place.exists() or place.is_symlink():
                        place.replace(path)
                raise
            to_disk([self.path])
            for folder in sorted({path.parent for path in earlier} - {self.path}, reverse=True):
                with suppress(OSError):
                    folder.rmdir()

    def _discard(self) -> None:
        """Remove the new folders that are empty."""
        for folder in reversed(self.made):
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def is_seal(path: Path) -> bool:
    """Whether a file is the seal of a run."""
    return path.name == SEAL or path.name.endswith(f".{SEAL}")


def digest(path: Path) -> str:
    """The sha256 of a file's bytes, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digests(folder: Path) -> dict[str, str]:
    """The sha256 of every file below a folder, by name, in order."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    return {path.relative_to(folder).as_posix(): digest(path) for path in files}


def sealed_files(seal: Path, at: Path | None = None) -> Iterator[Path]:
    """Files listed by an earlier run's seal that are still as that run left them.

    Paths outside its folder are ignored: anyone may edit a seal.
    """
    try:
        files = json.loads(seal.read_text(encoding="utf-8"))["files"]
        listed = {str(name): str(sha) for name, sha in files.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return  # an earlier version's, or none of ours
    top = at or seal.parent
    for path, sha in ((top / name, sha) for name, sha in listed.items()):
        with suppress(OSError, ValueError):
            inside = path.resolve().is_relative_to(top.resolve())
            if inside and path.is_file() and digest(path) == sha:
                yield path


def refuse_existing(path: Path, force: bool) -> None:
    """Raise an OutputError if `path` must not be overwritten."""
    if path.is_dir():
        raise OutputError(f"{path} is a folder; give the name of a file")
    refuse_input(path)
    if not force and (path.exists() or path.is_symlink()):
        raise OutputError(f"{path} exists; give another -o, or --force to overwrite it")


def refuse_input(path: Path) -> None:
    """Raise an OutputError if this command reads the file at `path` under any name.

    Links count: the content would be lost under every name.
    """
    for given in _inputs.get() if path.exists() else ():
        is_read = False
        with suppress(OSError, ValueError):
            is_read = given.samefile(path)
            if given.is_dir() and not is_read:
                files = [file for file in given.iterdir() if file.is_file()]
                inside = path.resolve().is_relative_to(given.resolve())
                if inside or any(path.samefile(file) for file in files):
                    # A report may be in the folder of its own log.
                    own = is_seal(path) or path in sealed_files(path.with_name(SEAL))
                    is_read = not own
        if is_read:
            raise OutputError(
                f"{path} is what this command reads, and --force does not overwrite that either; "
                "give another -o"
            )


def check_letters(path: Path) -> None:
    """Raise for a name that is not UTF-8: libraries refuse it."""
    if whole(str(path)) != str(path):
        raise OutputError(f"{path} is no name in UTF-8; give another -o")


def numbered(names: Iterable[str]) -> list[str]:
    """Names that all differ: a repeated one gets a number."""
    found: list[str] = []
    for name in names:
        free, number = name, 2
        while free in found:
            free, number = f"{name}-{number}", number + 1
        found.append(free)
    return found


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Raise a block's system errors as one-line errors on `path`."""
    try:
        yield
    except OSError as error:
        raise unwritable(path, error) from None


def unwritable(path: Path, error: OSError) -> OutputError:
    """The one-line error on an operating system's error."""
    why = error.strerror or str(error)
    return OutputError(f"{path} cannot be written: {why[0].lower()}{why[1:]}; give another -o")


if sys.platform != "win32":
    import fcntl

PARTIAL = ".vftcli-*.partial"  #: Every temporary folder's name, as a pattern of paths.
#: Name of a temporary folder, with the number of its process.
NAME = re.compile(r"\.vftcli-(\d+)-[0-9a-f]{8}\.partial")
#: Age of an unheld folder that is cleared though its process number is in use. [s]
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
    """Hold a folder for a block; a dead process holds nothing."""
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
    """Flush files and folders to the disk, before a rename."""
    for path in paths:
        # A folder cannot be opened everywhere, nor flushed on every file system.
        with suppress(*([OSError] if path.is_dir() else [])):
            place = os.open(path, os.O_RDONLY)
            try:
                os.fsync(place)
            finally:
                os.close(place)


def check_writable(folder: Path) -> None:
    """Raise the system's error if no file can be made in `folder`."""
    if not folder.is_dir():
        raise FileNotFoundError(2, "there is no such folder", str(folder))
    try:  # permissions do not tell on every file system
        TemporaryFile(dir=folder).close()
    except PermissionError:
        raise PermissionError(13, "no permission to write there", str(folder)) from None
