"""DROID's raw release: a folder of episodes, each a trajectory.h5 with its metadata beside it."""

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from vftcli.readers import hdf5_layouts
from vftcli.readers.formats import LogFormat
from vftcli.readers.reader import LogFile, RawLog, ReadChoice, episode_of, open_log
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact

TRAJECTORY = "trajectory.h5"

DEEPEST = 8  #: Folders inside folders; the release has five: version, lab, success, date, episode.
MOST_LOOKED_AT = 2000  #: Folders that are looked at to recognise a release.


def trajectories(folder: Path) -> Iterator[Path | None]:
    """Every episode below a folder in the order of their names; None for a folder without one."""
    for place, below, names in os.walk(folder):
        below.sort()
        if len(Path(place).relative_to(folder).parts) >= DEEPEST:
            below.clear()
        yield Path(place) / TRAJECTORY if TRAJECTORY in names else None


def recognises(file: LogFile, _: LogFormat) -> bool:
    """Whether a folder holds DROID's episodes, at any depth."""
    is_lerobot = (file.path / "meta" / "info.json").is_file()
    if "metadata.yaml" in file.entries or is_lerobot:
        return False
    looked_at = zip(range(MOST_LOOKED_AT), trajectories(file.path), strict=False)
    return any(path is not None for _, path in looked_at)


def episodes_below(file: LogFile) -> list[Path]:
    """The episodes of a folder, by name."""
    found = [path for path in trajectories(file.path) if path is not None]
    if not found:
        raise LogError(f"{file.path}: no {TRAJECTORY} in it or below.")
    return found


def read(file: LogFile, request: ReadChoice, _: LogFormat) -> RawLog:
    """Read one episode of a release."""
    paths = episodes_below(file)
    number, part, remarks = episode_of(file.path, request, range(len(paths)))
    path = paths[number]
    raw = hdf5_layouts.read(open_log(path), replace(request, episode=None))
    place = fact("episode-place", place=str(path.parent.relative_to(file.path)))
    return replace(
        raw,
        part=part,
        files=(path,),
        remarks=(*remarks, *((place,) if part else ()), *raw.remarks),
    )


def episodes_in(file: LogFile) -> range:
    """The numbers of its episodes, counted from 0."""
    return range(len(episodes_below(file)))
