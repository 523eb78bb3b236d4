"""ExternalTorque: an observer's estimate or the reference it is judged by. The same type."""

from dataclasses import dataclass

import numpy as np

from vftcli.signals.arrays import Array, check_clock, check_shape, frozen
from vftcli.signals.errors import ShapeError
from vftcli.signals.remarks import Note

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
        trusted: 1 where a sample may be relied on, 0 where it is shown but may not, as the
            two-cycle difference of a joint at rest; None where nothing speaks against any. (T, n)
        band: One standard deviation of the error of `tau` as the log itself shows it, model error
            and lag included; None where no free part is known to measure it on. (T, n) [N·m]
        remarks: What a reader of the numbers should know.
    """

    name: str
    t: Array
    tau: Array
    sd: Array | None = None
    floor: Array | None = None
    trusted: Array | None = None
    band: Array | None = None
    remarks: tuple[Note, ...] = ()

    def __post_init__(self) -> None:
        for name in ("t", "tau", "sd", "floor", "trusted", "band"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, frozen(getattr(self, name)))
        if self.tau.ndim != 2:
            raise ShapeError(f"tau of {self.name} has shape {self.tau.shape}; expected (T, n)")
        check_clock(self.t, self.name)
        check_shape(self.tau, (len(self.t), self.tau.shape[1]), "tau", self.name)
        if self.sd is not None:
            check_shape(self.sd, self.tau.shape, "sd", self.name)
        if self.trusted is not None:
            check_shape(self.trusted, self.tau.shape, "trusted", self.name)
        if self.band is not None:
            check_shape(self.band, self.tau.shape, "band", self.name)
        if self.floor is not None:
            check_shape(self.floor, self.tau.shape[1:], "floor", self.name)

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.tau.shape[1])

    @property
    def mostly_rests(self) -> tuple[bool, ...]:
        """Whether less than half of a joint's known samples may be relied on, joint by joint."""
        if self.trusted is None:
            return (False,) * self.joints
        known = np.maximum(np.sum(self.finite, axis=0), 1.0)
        return tuple(bool(x) for x in np.sum(self.trusted * self.finite, axis=0) < 0.5 * known)

    @property
    def finite(self) -> Array:
        """1 where a sample is known for a joint, 0 elsewhere. (T, n)"""
        return np.isfinite(self.tau).astype(np.float64)
