"""HDF5 episodes written back to a copy: new data sets beside the positions."""

import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

from vftcli.batch.datasets import DataFile, ForceColumns, Forces, OfEpisodes
from vftcli.readers.hdf5 import episode_places
from vftcli.readers.opening import open_log
from vftcli.readers.reading import FORMATS
from vftcli.signals.errors import LogError

ENDINGS = (".h5", ".hdf5")  #: Names that files of episodes end with.


def files_below(folder: Path) -> list[Path]:
    """Files with these endings below a folder, sorted."""
    walked = os.walk(folder, followlinks=True)
    names = [Path(place) / name for place, _, each in walked for name in each]
    return sorted(path for path in names if path.suffix.lower() in ENDINGS)


class Hdf5Dataset:
    """HDF5 files of episodes (DROID, ALOHA, any), or their folder."""

    has_statistics = False

    def __init__(
        self, folder: Path, only: Path | None = None, columns: str | None = None
    ) -> None:
        self.folder, self._only, self._columns = folder, only, columns

    def files(self) -> Iterator[DataFile]:
        """The files with their episodes, by name."""
        for path in [self._only] if self._only else files_below(self.folder):
            numbers = FORMATS["hdf5"].numbers(open_log(path))
            yield DataFile(path.relative_to(self.folder), path, numbers)

    def _places(self, file: DataFile) -> tuple[Path, Mapping[int, str]]:
        """A data file, and the place of each episode in it."""
        path = self.folder / file.place
        return path, episode_places(open_log(path), self._columns)

    def frames(self, file: DataFile, number: int) -> int:
        """Number of an episode's frames, by a set beside positions."""
        import h5py

        path, places = self._places(file)
        group = places[number]
        with h5py.File(path, "r") as content:
            there = content[group or "/"].values()
            return next(int(each.shape[0]) for each in there if isinstance(each, h5py.Dataset))

    def check_new(self, file: DataFile, columns: ForceColumns) -> None:
        """Refuse a file that has such data sets already."""
        import h5py

        path, places = self._places(file)
        with h5py.File(path, "r") as content:
            for name in (places[k] + c.name for k in file.episodes for c in columns):
                if name in content:
                    raise LogError(f"{path}: has {name} already; annotate the original dataset")

    def write(self, file: DataFile, columns: ForceColumns, forces: Forces, target: Path) -> None:
        """Copy a file and add the data sets to the copy."""
        import h5py

        path, places = self._places(file)
        shutil.copyfile(path, target)
        target.chmod(0o644)
        with h5py.File(target, "r+") as content:
            for number, own in forces.items():
                for column in columns:
                    values = own[column.name]
                    data = content.create_dataset(
                        places[number] + column.name,
                        data=values[:, 0] if column.width == 1 else values,
                        compression="gzip",
                        shuffle=True,
                    )
                    for key, value in column.about.items():
                        data.attrs[key] = value
                    if column.elements:
                        data.attrs["names"] = list(column.elements)

    def finish(self, columns: ForceColumns, statistics: OfEpisodes, copy: Path) -> None:
        """Nothing: the files describe themselves."""
