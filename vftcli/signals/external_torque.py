"""ExternalTorque: an observer's estimate or the reference it is judged by. The same type."""

from dataclasses import dataclass

import numpy as np

from vftcli.signals.arrays import Array, Mask, check_clock, check_shape, frozen_mask, seal
from vftcli.signals.errors import ShapeError
from vftcli.signals.remarks import Remark

COVERS = 1.96
"""Half width of a 95 % band, in standard deviations."""


@dataclass(frozen=True, kw_only=True)
class ExternalTorque:
    """Torque the environment exerts on the robot, positive along each joint axis.

    Attributes:
        name: Short name of the observer or of the reference, as used in tables and column names.
        t: Time on the recording's clock. (T,) [s]
        tau: External torque; NaN where it is not known. (T, n) [N·m]
        sd: One standard deviation of `tau` by the estimator's own account. (T, n) [N·m]
        floor: Root-mean-square error that the estimate itself is known to have. (n,) [N·m]
        error_sd: One standard deviation of the error of `tau` as the log itself shows it, model
            error and lag included; None where no free part is known to measure it on. (T, n) [N·m]
        moving: Whether the joint moves, so that the sample may be relied on; where it stands,
            stiction hides what `tau` cannot know. None where that was not looked at. (T, n)
        remarks: What a reader of the numbers should know.
    """

    name: str
    t: Array
    tau: Array
    sd: Array | None = None
    floor: Array | None = None
    error_sd: Array | None = None
    moving: Mask | None = None
    remarks: tuple[Remark, ...] = ()

    def __post_init__(self) -> None:
        seal(self, "t", "tau", "sd", "floor", "error_sd")
        if self.moving is not None:
            object.__setattr__(self, "moving", frozen_mask(self.moving))
        if self.tau.ndim != 2:
            raise ShapeError(f"tau of {self.name} has shape {self.tau.shape}; expected (T, n)")
        check_clock(self.t, self.name)
        check_shape(self.tau, (len(self.t), self.tau.shape[1]), "tau", self.name)
        for name in ("sd", "error_sd", "moving"):
            if (value := getattr(self, name)) is not None:
                check_shape(value, self.tau.shape, name, self.name)
        if self.floor is not None:
            check_shape(self.floor, self.tau.shape[1:], "floor", self.name)

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.tau.shape[1])

    @property
    def mostly_rests(self) -> tuple[bool, ...]:
        """Whether a joint moves in less than half of its known samples, joint by joint."""
        if self.moving is None:
            return (False,) * self.joints
        known = np.maximum(np.count_nonzero(self.known, axis=0), 1)
        used = np.count_nonzero(self.moving & self.known, axis=0)
        return tuple(bool(rests) for rests in used < 0.5 * known)

    @property
    def known(self) -> Mask:
        """Whether a joint's torque is known, sample by sample. (T, n)"""
        return np.isfinite(self.tau)
