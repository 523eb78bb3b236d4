"""Writing files whole or not at all, and never over something without being told to."""

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self

from vftcli.signals.errors import OutputError


@contextmanager
def atomic(path: Path, force: bool = False) -> Iterator[Path]:
    """Yield a temporary path beside `path`, which takes its place when the block ends well.

    A device or pipe (``/dev/stdout``) is yielded as it is. If the block fails nothing is left.

    Args:
        path: Where the file shall be.
        force: Whether a file that is there may be replaced.

    Raises:
        OutputError: If the file exists and `force` is not set, or it cannot be written.
    """
    path = Path(path)
    # A device cannot be replaced: `-o /dev/stdout` is written to as it is.
    if path.is_char_device() or path.is_fifo():
        yield path
        return
    refuse_existing(path, force)
    # What a link points to is replaced, not the link.
    target = path.resolve() if path.is_symlink() else path
    temporary = target.with_name(f".{os.urandom(4).hex()}.{target.name}")
    try:
        check_writable(target.parent)
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise unwritable(path, error) from None
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str, force: bool = False) -> None:
    """Write UTF-8 text, whole or not at all.

    Raises:
        OutputError: As `atomic` does.
    """
    with atomic(path, force) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


class OutputFolder:
    """A folder that gets all of its files at once, when the block ends well.

    Until then they are in a temporary folder on the same file system; if the block fails, it goes,
    and with it every folder that was made for it. ``folder / "name"`` is where to write a file.
    With `force`, those of `names` that an earlier run left and this one does not write are removed,
    so that all files of the folder belong together.

    Raises:
        OutputError: If the folder is a file or cannot be written, or holds one of `names` and
            `force` is not set.
    """

    def __init__(self, path: Path, force: bool = False, names: Iterable[str] = ()) -> None:
        self.path = Path(path)
        self.force = force
        self.names = tuple(names)
        self.made: list[Path] = []
        self.temporary = self.path

    def __truediv__(self, name: str) -> Path:
        """Where to write the file `name`, its folder made if need be."""
        path = self.temporary / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def write(self, name: str, text: str) -> None:
        """Write a text file, with the same bytes on every system."""
        # On Windows the same bytes as elsewhere: digests of outputs can be compared.
        (self / name).write_text(text, encoding="utf-8", newline="\n")

    def __enter__(self) -> Self:
        """Refuse what must not be overwritten, and make the temporary folder."""
        if self.path.exists() and not self.path.is_dir():
            raise OutputError(f"{self.path} is a file; -o needs the name of a folder")
        for name in self.names:
            refuse_existing(self.path / name, self.force)
        try:
            # Outermost first, to be removed again if nothing comes of it.
            self.made = [p for p in (self.path, *self.path.parents) if not p.exists()][::-1]
            self.path.mkdir(parents=True, exist_ok=True)
            check_writable(self.path)
            # Inside the folder, so that the files only change their names when they are moved.
            self.temporary = self.path / f".{os.urandom(4).hex()}.partial"
            self.temporary.mkdir()
        except OSError as error:
            self._discard()
            raise unwritable(self.path, error) from None
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        """Move the files into place, or leave nothing."""
        try:
            if error is None:
                self._move()
        except OSError as failure:
            raise unwritable(self.path, failure) from None
        finally:
            self._discard()
        # Of an error elsewhere its own words say more.
        if isinstance(error, OSError) and (
            error.filename is None or str(error.filename).startswith(str(self.path))
        ):
            raise unwritable(self.path, error) from None

    def _move(self) -> None:
        """Put every file where it belongs, after a last look that nothing is in the way."""
        files = sorted(p for p in self.temporary.rglob("*") if not p.is_dir())
        for file in files:
            refuse_existing(self.path / file.relative_to(self.temporary), self.force)
        targets = [self.path / file.relative_to(self.temporary) for file in files]
        stale = {self.path / name for name in self.names}.difference(targets)
        with kept_aside([*targets, *stale], self.temporary / "earlier"):
            # Renaming within a file system is atomic for each file.
            for file, target in zip(files, targets, strict=True):
                target.parent.mkdir(parents=True, exist_ok=True)
                file.replace(target)

    def _discard(self) -> None:
        """Remove the temporary folder and the folders that were made, if they are empty."""
        if self.temporary != self.path:
            shutil.rmtree(self.temporary, ignore_errors=True)
        for folder in reversed(self.made):
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


@contextmanager
def kept_aside(paths: Iterable[Path], aside: Path) -> Iterator[None]:
    """Move files out of the way for a block; put them back, and only them, if the block fails.

    Args:
        paths: Files that are there or will be.
        aside: A folder that is made for them, and goes with them when the block ends well.
    """
    paths = list(paths)
    aside.mkdir()
    moved = [path for path in paths if path.exists() or path.is_symlink()]
    places = [aside / str(k) for k in range(len(moved))]
    try:
        for path, place in zip(moved, places, strict=True):
            path.replace(place)
        yield
    except BaseException:
        for path in set(paths).difference(moved):
            path.unlink(missing_ok=True)
        for path, place in zip(moved, places, strict=True):
            # A file that could not be moved is where it was.
            if place.exists() or place.is_symlink():
                place.replace(path)
        raise
    shutil.rmtree(aside)


def refuse_existing(path: Path, force: bool) -> None:
    """Raise an OutputError if something is at `path` that must not be overwritten."""
    if path.is_dir():
        raise OutputError(f"{path} is a folder; give the name of a file")
    if not force and (path.exists() or path.is_symlink()):
        raise OutputError(f"{path} exists; give another -o, or --force to overwrite it")


def numbered(names: Iterable[str]) -> list[str]:
    """Names that all differ: one that is taken already gets the next number behind it."""
    found: list[str] = []
    for name in names:
        free, number = name, 2
        while free in found:
            free, number = f"{name}-{number}", number + 1
        found.append(free)
    return found


def check_writable(folder: Path) -> None:
    """Raise the operating system's error if no file can be made in `folder`."""
    if not folder.is_dir():
        raise FileNotFoundError(2, "there is no such folder", str(folder))
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(13, "no permission to write there", str(folder))


def unwritable(path: Path, error: OSError) -> OutputError:
    """The one-line error for what the operating system refused."""
    why = error.strerror or str(error)
    return OutputError(f"{path} cannot be written: {why[0].lower()}{why[1:]}; give another -o")


def one_line(error: Exception) -> str:
    """What an error of a library says, on one line."""
    return " ".join(str(error).split())
