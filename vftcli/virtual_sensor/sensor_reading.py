"""What a log's virtual sensor measured: wrenches, zero drift, masks, contacts, and remarks."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Mask
from vftcli.signals.lag import time_offset
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.signals.shown import Shown
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.choice import SMOOTHER
from vftcli.virtual_sensor.smoother.smoothing import SmoothedWrench
from vftcli.virtual_sensor.solvers import SCALE
from vftcli.virtual_sensor.vendor import VendorCheck
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor
from vftcli.virtual_sensor.zero import Drift, without_drift, zero_drift

#: The threshold of the null-space torque is so far above the largest value of the free part.
MARGIN = 1.25
#: Share of samples above the threshold up to which nothing is said: chance reaches it.
LEAST_SHARE = 0.001


class NullSpaceVerdict(NamedTuple):
    """Where the torque of an arm of more than six joints is no tip wrench's."""

    name: str  #: The observer.
    threshold: float  #: `MARGIN` times the largest norm in the free part. [N·m]
    share: float  #: Share of the samples above it: contact elsewhere on the arm, or a wrong model.

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What it says, nothing where next to no sample lies above the threshold."""
        if not self.share > LEAST_SHARE:
            return ()
        values = {"share": self.share, "threshold_Nm": self.threshold}
        return (caution("contact-elsewhere", Where(self.name), **values),)


def contact_elsewhere(wrench: Wrench, free: Mask) -> NullSpaceVerdict | None:
    """Judge a wrench's null-space channel by its free part, None for an arm of six joints.

    None too where the channel is not known in any sample of the free part.

    Args:
        wrench: A virtual sensor's wrench.
        free: Samples of the unloaded part. (T,)
    """
    if wrench.null_space is None:
        return None
    known = wrench.null_space[free & np.isfinite(wrench.null_space)]
    if not len(known):
        return None
    # The largest, not a quantile: the free part holds no contact, so all of it is error.
    threshold = MARGIN * float(known.max())
    share = float(np.mean(np.nan_to_num(wrench.null_space) > threshold))
    return NullSpaceVerdict(wrench.name, threshold, share)


@dataclass(frozen=True, kw_only=True, repr=False)
class SensorReading(Shown):
    """Everything the virtual sensor says of one log."""

    sensor: VirtualSensor  #: Solver, frame and mounting used.
    wrenches: tuple[Wrench, ...]  #: One an observer, drift removed where a zero was given.
    masked: Mask  #: Samples in which the pose cannot tell a wrench, whoever observes it. (T,)
    drifts: tuple[Drift, ...] = ()  #: Zero drift, one an unloaded span and observer.
    #: Samples known to be unloaded: those of the zero spans, or of the unloaded start. (T,)
    free: Mask
    #: What convention the log's own wrench is in, None if it has none.
    vendor: VendorCheck | None = None
    #: What the smoother found, by the observer whose wrench it is.
    smoothed: Mapping[str, SmoothedWrench] = field(default_factory=dict)
    #: The null-space channel's verdicts, for arms of more than six joints.
    elsewhere: tuple[NullSpaceVerdict, ...] = ()
    #: The wrench the others are judged by, in the same frame, or None.
    reference: Wrench | None = None
    remarks: tuple[Remark, ...] = ()  #: What the reader of the numbers should know.

    @property
    def masked_share(self) -> float:
        """Share of the samples in which the pose cannot tell the wrench."""
        return float(np.mean(self.masked))

    @property
    def hides(self) -> bool:
        """Whether there are samples in which a wrench is not told for the pose."""
        return any(bool(wrench.hidden.any()) for wrench in self.wrenches)

    @property
    def solver(self) -> str:
        """Which solver made which wrench."""
        names = [wrench.name for wrench in self.wrenches if wrench.name in self.smoothed]
        if not names:
            return self.sensor.solver
        if len(names) == len(self.wrenches):
            return SMOOTHER
        return f"{SMOOTHER} for {', '.join(names)}, {self.sensor.solver} for the others"

    @property
    def zero_span(self) -> tuple[float, float] | None:
        """The span whose mean was removed, None if none was. [s]"""
        return next((drift.span for drift in self.drifts if drift.removed), None)


def with_reference(
    reading: SensorReading, reference: Wrench, *, of_sensor: bool = False
) -> SensorReading:
    """The reading with a reference beside it."""
    if not of_sensor:
        return replace(reading, reference=reference)
    told: list[Remark] = []
    if reading.zero_span is not None:
        drift = replace(zero_drift(reference, reading.zero_span), removed=True)
        reference = without_drift(reference, drift)
        told.append(drift.remark)
    for wrench in reading.wrenches:
        offset = time_offset(reference.t, wrench.known / SCALE, reference.known / SCALE)
        where, values = Where(wrench.name), {"correlation": offset.correlation}
        told.append(fact("lag-behind-sensor", where, lag_ms=offset.lag * 1e3, **values))
    return replace(reading, reference=reference, remarks=(*reading.remarks, *told))
