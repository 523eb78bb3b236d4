"""ExternalTorque: an observer's estimate or the reference it is judged by. The same type."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vftcli.signals.arrays import (
    Array,
    Mask,
    check_clock,
    check_series,
    check_shape,
    frozen_mask,
    seal,
)
from vftcli.signals.remarks import Remark
from vftcli.signals.shown import Shown, frame_of, joined, per_joint

if TYPE_CHECKING:
    import polars as pl

ALL = slice(None)  #: All rows.
COVERS = 1.96  #: Half width of a 95 % band, in standard deviations.


@dataclass(frozen=True, kw_only=True, repr=False)
class ExternalTorque(Shown):
    """Torque the environment exerts on the robot, positive along each joint axis."""

    #: Short name of the observer or of the reference, as used in tables and column names.
    name: str
    t: Array  #: Time on the recording's clock. (T,) [s]
    tau: Array  #: External torque; NaN where it is not known. (T, n) [N·m]
    #: One standard deviation of `tau` by the estimator's own account. (T, n) [N·m]
    sd: Array | None = None
    #: Root-mean-square error that the estimate itself is known to have. (n,) [N·m]
    floor: Array | None = None
    #: One standard deviation of the error of `tau` as the log itself shows it, model error and lag
    #: included; None where no free part is known to measure it on. (T, n) [N·m]
    error_sd: Array | None = None
    #: Whether the joint moves, so that the sample may be relied on; where it stands, stiction hides
    #: what `tau` cannot know. None where that was not looked at. (T, n)
    moving: Mask | None = None
    remarks: tuple[Remark, ...] = ()  #: What a reader of the numbers should know.

    def __post_init__(self) -> None:
        seal(self, "t", "tau", "sd", "floor", "error_sd")
        if self.moving is not None:
            object.__setattr__(self, "moving", frozen_mask(self.moving))
        check_series(self.tau, None, "tau", self.name)
        check_clock(self.t, self.name)
        check_shape(self.tau, (len(self.t), self.tau.shape[1]), "tau", self.name)
        for name in ("sd", "error_sd", "moving"):
            if (value := getattr(self, name)) is not None:
                check_shape(value, self.tau.shape, name, self.name)
        if self.floor is not None:
            check_shape(self.floor, self.tau.shape[1:], "floor", self.name)

    def _headline(self) -> str:
        rms = np.sqrt(np.nanmean(np.where(self.known.any(axis=0), self.tau, 0.0) ** 2, axis=0))
        return f"of {self.name}: rms {joined(rms)} N·m over {len(self.t)} samples"

    def _rows(self) -> Iterator[Sequence[object]]:
        yield "joint", "rms [N·m]", "largest [N·m]", "95 % band [N·m]", "known"
        for j, known in enumerate(self.known.T):
            tau = self.tau[known, j]
            sd = None if self.error_sd is None else self.error_sd[known, j]
            sizes: tuple[float | None, float | None] = (None, None)
            if len(tau):
                sizes = float(np.sqrt(np.mean(tau**2))), float(np.abs(tau).max())
            band = None if sd is None or not len(sd) else COVERS * float(np.sqrt(np.mean(sd**2)))
            yield f"J{j + 1}", *sizes, band, f"{known.mean():.0%}"

    def columns(self, rows: slice = ALL) -> Iterator[tuple[str, Array]]:
        """Name and values of every joint, as ``tau_ext/gmo/1``, and of its deviations."""
        yield from per_joint(f"tau_ext/{self.name}", self.tau[rows])
        if self.sd is not None:
            yield from per_joint(f"sd/{self.name}", self.sd[rows])
        if self.error_sd is not None:
            yield from per_joint(f"band/{self.name}", self.error_sd[rows])

    def to_polars(self) -> "pl.DataFrame":
        """Time ``t`` and every joint, named as in ``estimates.parquet``; unknown is null."""
        return frame_of([("t", self.t), *self.columns()])

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.tau.shape[1])

    @property
    def known(self) -> Mask:
        """Whether a joint's torque is known, sample by sample. (T, n)"""
        return np.isfinite(self.tau)
