"""Datasets of episodes (LeRobot, DROID and other HDF5), written back with forces."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

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


ForceColumns = Sequence[ForceColumn]  #: The new columns.


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
