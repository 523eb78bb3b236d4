"""What a log's virtual sensor measured: wrenches, zero drift, masks, contacts, and remarks."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from vftcli.signals.arrays import Mask
from vftcli.signals.lag import time_offset
from vftcli.signals.remarks import Remark, Where, fact
from vftcli.signals.shown import Shown
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.choice import SMOOTHER
from vftcli.virtual_sensor.null_space import NullSpaceVerdict
from vftcli.virtual_sensor.smoother.smoothing import SmoothedWrench
from vftcli.virtual_sensor.solvers import SCALE
from vftcli.virtual_sensor.vendor import VendorCheck
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor
from vftcli.virtual_sensor.zero import Drift, without_drift, zero_drift


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
