"""The paper's printed error table beside a log's errors."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import check_known


class Published(NamedTuple):
    """An RMSE table from print."""

    title: str  #: Its name and content.
    source: str  #: Paper and number.
    #: Observer's name here → printed RMSE of each joint. [N·m]
    rmse: Mapping[str, tuple[float, ...]]


TABLE_1 = Published(
    title="Table I of the paper: RMSE of the observers on a UR5",
    source="Huang et al., IEEE/ASME T-Mech 2025, doi 10.1109/TMECH.2025.3595612, Table I",
    rmse={
        "fdo": (5.6601, 4.2443, 4.6620, 1.5379, 1.2137, 0.9443),
        "gmo": (5.2106, 3.8767, 5.1080, 1.2939, 1.1976, 0.9322),
        "kfo-fe": (4.7472, 3.6219, 4.0874, 1.3828, 1.3221, 0.9355),
        "kfo-zoh": (4.8555, 3.6475, 4.1538, 1.3345, 1.3164, 0.9440),
    },
)
TABLES = {"table1": TABLE_1}  #: Name at the command line → printed table.


class Comparison(NamedTuple):
    """Printed numbers beside computed ones."""

    published: Published  #: The printed table.
    recording: str  #: The log's name.
    #: Observer → computed RMSE of each joint, NaN if unknown. (n,) [N·m]
    ours: Mapping[str, Array]
    floor: Array  #: The reference's own error. (n,) [N·m]

    @property
    def names(self) -> tuple[str, ...]:
        """Observers that are both printed and computed."""
        return tuple(name for name in self.published.rmse if name in self.ours)

    def printed(self, name: str) -> Array:
        """Printed RMSE of an observer. (n,) [N·m]"""
        return np.array(self.published.rmse[name])


def check_published(name: str, reference: str | None) -> None:
    """Raise unless the table exists and a reference is chosen."""
    check_known(name, TABLES, f"no published table {name!r}")
    if reference is None:
        raise ParameterError(
            f"report.published={name} sets errors beside the paper's; add --reference two-cycle"
        )


def compare_with(name: str, errors: pl.DataFrame) -> Comparison:
    """A printed table beside computed errors."""
    published = TABLES[name]
    rows = errors.filter(pl.col("joint").is_not_null())
    joints = int(str(rows["joint"].max()))
    wanted = len(next(iter(published.rmse.values())))
    if joints != wanted:
        raise ParameterError(
            f"report.published={name} is of an arm with {wanted} joints, the log has {joints}"
        )
    ours: dict[str, Array] = {}
    floor = np.full(joints, np.nan)
    for (observer,), own in rows.group_by("observer", maintain_order=True):
        at = own["joint"].to_numpy() - 1
        ours[str(observer)] = np.full(joints, np.nan)
        ours[str(observer)][at] = own["rmse_Nm"].to_numpy()
        floor[at] = own["reference_floor_Nm"].to_numpy()
    return Comparison(published, str(rows["recording"][0]), ours, floor)
