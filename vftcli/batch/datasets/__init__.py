"""Datasets of episodes (LeRobot, DROID and other HDF5), written back with forces.

A copy is made beside its place and renamed at the end; a killed one goes on.
"""

import os
import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.outputs.files import check_writable, held, unwritable
from vftcli.signals.errors import LogError, OutputError

Single = NDArray[np.float32]  #: Values of a column, as they are written. (frames, width)


class ForceColumn(NamedTuple):
    """A new column."""

    name: str  #: Its name, as external_torque; the dataset decides its place.
    elements: tuple[str, ...]  #: Names of its numbers, empty for a single one.
    #: Unit, sign, frame, observer and whether it is causal.
    about: Mapping[str, Any]

    @property
    def width(self) -> int:
        """Numbers a frame."""
        return max(1, len(self.elements))


ForceColumns = Sequence[ForceColumn]


class DataFile(NamedTuple):
    """One file of a dataset with the episodes in it."""

    place: Path  #: Its path in the dataset's folder.
    log: Path  #: The log to read for an episode: the file, or the dataset's folder.
    episodes: tuple[int, ...]  #: Their numbers, as ``--episode`` takes them.


#: Episode → name of a column → its values, a row a frame of the episode.
Forces = Mapping[int, Mapping[str, Single]]
Statistics = Mapping[str, NDArray[Any]]  #: Key of a statistic, as mean → its values. (width,)
#: Episode → name of a column → its statistics.
OfEpisodes = Mapping[int, Mapping[str, Statistics]]


RECORD = Path("meta", "vftcli.json")  #: The record of a copy.
WORK = ".vftcli"  #: Folder of finished work in an unfinished copy.
#: Endings of large files, linked since nobody edits them in place.
FILMS = frozenset({".mp4", ".svo", ".svo2", ".mkv", ".webm", ".avi", ".png", ".jpg", ".jpeg"})


def check_copy(dataset: Path, copy: Path, *, force: bool) -> None:
    """Raise an OutputError if no copy may be made at a path."""
    source, target = dataset.resolve(), copy.resolve()
    if source == target or source in target.parents or target in source.parents:
        how = "are the same folder" if source == target else "are one inside the other"
        raise OutputError(
            f"-o {copy} and the dataset {dataset} {how}; give another -o, outside of the dataset"
        )
    if copy.is_symlink() or (copy.exists() and not copy.is_dir()):
        raise OutputError(f"{copy} is no folder; -o needs the name of a new one")
    if copy.exists() and any(copy.iterdir()):
        if not (copy / RECORD).is_file():
            raise OutputError(
                f"{copy} is no copy that annotate made (it has no {RECORD}), and --force removes "
                "no other folder; give another -o"
            )
        if not force:
            raise OutputError(f"{copy} exists; give another -o, or --force to overwrite it")
    try:
        check_writable(next(p for p in target.parents if p.exists()))
    except OSError as error:
        raise unwritable(copy, error) from None


@contextmanager
def unfinished(copy: Path, key: str) -> Iterator[Path]:
    """The folder for a new copy: an earlier run's goes on if its key is equal.

    If the block fails after some work the folder stays, for the next run; if it ends well
    the folder takes the copy's place and replaces an earlier copy.
    """
    partial = copy.with_name(f"{copy.name}.partial")
    work = partial / WORK
    try:
        work.mkdir(parents=True, exist_ok=True)
        with held(work, wait=False):
            state = work / "key"
            if not state.is_file() or state.read_text("utf-8") != key:
                emptied(partial, keep=work)
                state.write_text(key, "utf-8")
            try:
                yield partial
            except BaseException:
                if not any(path.is_file() and path != state for path in partial.rglob("*")):
                    shutil.rmtree(partial, ignore_errors=True)
                raise
            shutil.rmtree(work)
            take_place(partial, copy)
    except BlockingIOError:
        raise OutputError(f"another run writes {copy}; wait for it, or give another -o") from None
    except OSError as error:
        if error.filename is None or str(error.filename).startswith(str(copy)):
            raise unwritable(copy, error) from None
        raise


def emptied(folder: Path, keep: Path) -> None:
    """Empty a folder and its folder `keep`, which remains."""
    for path in (*folder.iterdir(), *keep.iterdir()):
        if path == keep:
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


def take_place(partial: Path, copy: Path) -> None:
    """Give a finished copy its name; an earlier copy goes."""
    earlier = copy.with_name(f"{copy.name}.earlier")
    shutil.rmtree(earlier, ignore_errors=True)
    if copy.exists():
        copy.rename(earlier)
    try:
        partial.rename(copy)
    except OSError:
        if earlier.exists():
            earlier.rename(copy)
        raise
    shutil.rmtree(earlier, ignore_errors=True)


@contextmanager
def finished(path: Path) -> Iterator[Path]:
    """Path for a file of a copy, named when the block ends well."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f"{path.name}.partial")
    yield temporary
    temporary.replace(path)


def put_rows(path: Path, **arrays: NDArray[Any]) -> None:
    """Put arrays into a file that is whole or not there."""
    with finished(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def stored_rows(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of such a file."""
    with np.load(path, allow_pickle=False) as held:
        return {name: held[name] for name in held.files}


def copy_others(folder: Path, partial: Path, done: Collection[Path]) -> None:
    """Copy all other files of a dataset; films are linked."""
    for inside, source in files_within(folder):
        if inside in done:
            continue
        target = partial / inside
        target.parent.mkdir(parents=True, exist_ok=True)
        target.unlink(missing_ok=True)
        if target.suffix.lower() in FILMS:
            with suppress(OSError):  # another file system, or one without links
                os.link(source, target)
                continue
        shutil.copyfile(source, target)


def files_within(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Every file of a dataset: its path there, its real path."""
    top = folder.resolve()
    # A hub's cache keeps the files of all snapshots once, beside these.
    tops = (top, top.parents[1] / "blobs") if top.parent.name == "snapshots" else (top,)
    for place, _, names in os.walk(folder, followlinks=True):
        for name in sorted(names):
            path = Path(place, name)
            source = path.resolve()
            if not any(source.is_relative_to(one) for one in tops):
                raise LogError(
                    f"{path} is a link to {source}, outside of the dataset; put the file itself "
                    "there, or remove the link"
                )
            yield path.relative_to(folder), source
