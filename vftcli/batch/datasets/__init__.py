"""Datasets: episodes of LeRobot, DROID and other HDF5, written back with forces in them."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Single = NDArray[np.float32]  #: Values of a column, as they are written. (frames, width)


class ForceColumn(NamedTuple):
    """A column that is added."""

    name: str  #: Its name, as external_torque; the dataset decides its place.
    elements: tuple[str, ...]  #: What each of its numbers is, empty for a single one.
    #: Unit, sign, frame, observer and whether it is causal, for who reads the dataset.
    told: Mapping[str, Any]

    @property
    def width(self) -> int:
        """Numbers a frame."""
        return max(1, len(self.elements))


class DataFile(NamedTuple):
    """One file of a dataset with the episodes in it."""

    place: Path  #: Its path in the dataset's folder.
    log: Path  #: What is read to get an episode: the file, or the folder of the whole dataset.
    episodes: tuple[int, ...]  #: Their numbers, as ``--episode`` takes them.


#: Episode → name of a column → its values, a row a frame of the episode.
Forces = Mapping[int, Mapping[str, Single]]
Statistics = Mapping[str, NDArray[Any]]  #: Key of a statistic, as mean → its values. (width,)
OfEpisodes = Mapping[int, Mapping[str, Statistics]]  #: Episode → name of a column → its statistics.


class Dataset(Protocol):
    """A folder of episodes that a copy is made of."""

    folder: Path
    has_statistics: bool

    def files(self) -> Iterator[DataFile]:
        """The data files with their episodes."""

    def frames(self, file: DataFile, number: int) -> int:
        """Number of frames of an episode, even of one unreadable as a log."""

    def check_new(self, file: DataFile, columns: Sequence[ForceColumn]) -> None:
        """Refuse a file that has such columns already."""

    def write(
        self, file: DataFile, columns: Sequence[ForceColumn], forces: Forces, target: Path
    ) -> None:
        """Write a data file with the columns added."""

    def finish(self, columns: Sequence[ForceColumn], statistics: OfEpisodes, copy: Path) -> None:
        """Write the descriptions of the copy, where everything else is, that name its columns."""
