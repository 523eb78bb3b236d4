"""Datasets: episodes of LeRobot, DROID and other HDF5, written back with forces in them."""

from pathlib import Path

from vftcli.batch.datasets.episodes import Dataset
from vftcli.batch.datasets.hdf5 import Hdf5Dataset, files_below
from vftcli.batch.datasets.lerobot import LeRobotDataset
from vftcli.readers import FORMATS
from vftcli.readers.reader import open_log
from vftcli.signals.errors import LogError


def open_dataset(path: Path, columns: str | None = None) -> Dataset:
    """The dataset at a path.

    Args:
        path: A folder, or an HDF5 file.
        columns: What ``--columns`` says of its columns, or None.

    Raises:
        LogError: If it is none that forces can be written into.
    """
    file = open_log(path)
    if FORMATS["lerobot"].recognises(file):
        return LeRobotDataset(path)
    if FORMATS["hdf5"].recognises(file):
        return Hdf5Dataset(path.parent, path, columns)
    if path.is_dir() and files_below(path):
        return Hdf5Dataset(path, None, columns)
    raise LogError(
        f"{path}: neither a LeRobot dataset (a folder with meta/info.json), nor HDF5 files "
        "(DROID's trajectory.h5, *.hdf5); of another log `vftcli estimate` writes the torques"
    )


__all__ = ["Dataset", "open_dataset"]
