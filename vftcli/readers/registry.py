"""Every format by name; each reader is imported when it is first asked for."""

from collections.abc import Iterator, Mapping
from importlib import import_module

from vftcli.readers.reader import Reader

#: Texts that begin as those of one program and no other: the others need not be looked at.
TEXTS_OF_MAKERS = {
    "ur-csv": "rtde:OFFICIAL",
    "ur-binary": "rtde:BINARY",
    "ur-rtde": "rtde:UR_RTDE",
    "libfranka-csv": "libfranka:NEW",
    "libfranka-csv-old": "libfranka:OLD",
    "libfranka-json": "libfranka:STATES",
    "bagpy": "ros_text:BAGPY",
    "rostopic": "ros_text:ROSTOPIC",
    "ros2-echo": "ros_text:ROS2_ECHO",
}
#: Format → the module of this room that reads it, and its `Reader` there: one format, one line.
HOMES = {
    **TEXTS_OF_MAKERS,
    "table": "tables:HEADED",
    "headerless": "tables:HEADERLESS",
    "npy": "tables:NPY",
    "npz": "arrays_file:NPZ",
    "pickle": "pickles:PICKLE",
    "json": "json_file:JSON",
    "parquet": "parquet:PARQUET",
    "arrow": "arrow:ARROW",
    "mat": "matlab:MATLAB",
    "hdf5": "hdf5_layouts:HDF5",
    "lerobot": "lerobot:LEROBOT",
    "droid": "droid:DROID",
    "rosbag1": "bags.formats:ROS1",
    "rosbag2": "bags.formats:ROS2",
    "db3": "bags.formats:DB3",
    "mcap": "bags.formats:MCAP",
}


class Registry(Mapping[str, Reader]):
    """The readers by the names of their formats."""

    def __getitem__(self, name: str) -> Reader:
        """The reader of a format."""
        module, _, reader = HOMES[name].partition(":")
        found: Reader = getattr(import_module(f"vftcli.readers.{module}"), reader)
        return found

    def __iter__(self) -> Iterator[str]:
        """The names of the formats."""
        return iter(HOMES)

    def __len__(self) -> int:
        """How many formats there are."""
        return len(HOMES)


READERS = Registry()
