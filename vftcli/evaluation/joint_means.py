"""One number for several joints: the mean of the errors that can be trusted."""

from typing import NamedTuple

import numpy as np
import polars as pl


class JointMeans(NamedTuple):
    """Means over the joints of one log."""

    #: Observer → mean RMSE; those of which one is known, in the table's order. [N·m]
    errors: dict[str, float]
    floor: float  #: Mean of the reference's own error, NaN where it is not known. [N·m]
    #: Joints that are left out, because the reference is not to be trusted there.
    without: tuple[int, ...]

    @property
    def least(self) -> tuple[str, float] | None:
        """The observer with the smallest mean and that mean, None without any. [N·m]"""
        return min(self.errors.items(), key=lambda item: item[1], default=None)

    @property
    def left_out(self) -> str:
        """The joints that are left out, as " without J5"; "" for none."""
        return f" without {', '.join(f'J{j}' for j in self.without)}" if self.without else ""


def joint_means(errors: pl.DataFrame) -> JointMeans:
    """The mean RMSE of every observer, over the joints with a reference to be trusted.

    Where none can, over all: a mean is wanted, and every joint of it is marked.
    """
    rows = errors.filter(pl.col("joint").is_not_null())
    joints = set(rows["joint"])
    doubted = set[int]()
    if "reference_trusted" in rows.columns:
        doubted = set(rows.filter(~pl.col("reference_trusted").fill_null(value=True))["joint"])
    without = doubted if joints - doubted else set[int]()
    used = rows.filter(~pl.col("joint").is_in(list(without)))
    known = used.filter(pl.col("rmse_Nm").is_finite())
    means = known.group_by("observer", maintain_order=True).agg(pl.col("rmse_Nm").mean())
    floor = float("nan")
    if "reference_floor_Nm" in used.columns:
        floors = used.unique("joint")["reference_floor_Nm"].drop_nulls().to_numpy()
        floors = floors[np.isfinite(floors)]
        floor = float(floors.mean()) if len(floors) else floor
    return JointMeans(dict(means.iter_rows()), floor, tuple(sorted(without)))
