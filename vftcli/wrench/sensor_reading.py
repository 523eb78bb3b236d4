"""A log's virtual sensor: wrenches, zero drift and its removal, masks, remarks."""

from collections.abc import Mapping
from dataclasses import field, replace
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.lag import time_offset
from vftcli.signals.least_squares import robust_sd
from vftcli.signals.option import interval_text
from vftcli.signals.remarks import Remark, Where, caution, fact, warning
from vftcli.signals.series import covered, runs_of
from vftcli.signals.shown import Shown, record
from vftcli.signals.wrench import AXES, Wrench, unit_of
from vftcli.wrench import SMOOTHER, ZeroChoice
from vftcli.wrench.smoother import SmoothedWrench
from vftcli.wrench.solvers import SCALE, VirtualSensor

#: Null-space threshold, as a multiple of the free part's largest.
MARGIN = 1.25
#: Share of samples above the threshold that chance reaches, hence no remark.
LEAST_SHARE = 0.001
Span = tuple[float, float]  #: First and last time. [s]
#: Start of a log left out of an unloaded start: observers rise from zero. [s]
SETTLING = 1.0
LEAST_SPAN = 0.5  #: Shortest unloaded start. [s]
#: A departure from the start's level that is a load, whatever the noise. [N, N·m]
STEPS = np.repeat([3.0, 0.6], 3)
#: An unloaded start ends this long before a load shows: it began earlier. [s]
BACK = 0.3
SPREADS = 6.0  #: A departure of so many robust SDs counts as load.


class Drift(NamedTuple):
    """Reading of one virtual sensor over one unloaded span."""

    name: str  #: The observer.
    span: Span  #: First and last time. [s]
    mean: Array  #: Mean wrench, the zero drift. (6,) [N, N·m]
    sd: Array  #: SD about it. (6,) [N, N·m]
    samples: int  #: Known samples in the span.
    frame: str  #: Frame of the numbers.
    removed: bool = False  #: Whether it was subtracted.

    @property
    def remark(self) -> Remark:
        """The drift as a remark."""
        return fact(
            "zero-removed" if self.removed else "zero-left-in",
            Where(self.name, span=self.span),
            frame=self.frame,
            force_N=self.mean[:3].tolist(),
            moment_Nm=self.mean[3:].tolist(),
        )


def null_space_limit(wrench: Wrench, free: Mask) -> float | None:
    """`MARGIN` times the largest null-space torque of the free part (T,). [N·m]"""
    if (torque := wrench.null_space) is None:
        return None
    known = torque[free & np.isfinite(torque)]
    # The largest, not a quantile: all of a free part is error.
    return MARGIN * known.max() if len(known) else None


def contact_elsewhere(wrench: Wrench, free: Mask) -> tuple[Remark, ...]:
    """A remark where no wrench at the tip explains the torque of over six joints."""
    limit = null_space_limit(wrench, free)
    if limit is None or wrench.null_space is None:
        return ()
    share = np.mean(np.nan_to_num(wrench.null_space) > limit)
    if not share > LEAST_SHARE:
        return ()
    return (caution("contact-elsewhere", Where(wrench.name), share=share, threshold_Nm=limit),)


@record
class SensorReading(Shown):
    """The virtual sensor's reading of one log."""

    sensor: VirtualSensor  #: Solver, frame and mounting used.
    wrenches: tuple[Wrench, ...]  #: One an observer, drift removed where a zero was given.
    masked: Mask  #: Samples in which the pose hides the wrench. (T,)
    drifts: tuple[Drift, ...] = ()  #: Zero drift, one an unloaded span and observer.
    #: Unloaded samples: of the zero spans, or of the start. (T,)
    free: Mask
    #: The smoother's wrenches, by observer.
    smoothed: Mapping[str, SmoothedWrench] = field(default_factory=dict)
    #: The wrench that the others are compared with, in the same frame, or None.
    reference: Wrench | None = None
    remarks: tuple[Remark, ...] = ()  #: Limits of the numbers.

    @property
    def masked_share(self) -> float:
        """Share of the samples in which the pose hides the wrench."""
        return float(self.masked.mean())

    @property
    def hides(self) -> bool:
        """Whether there are samples in which the pose hides a part of the wrench."""
        return any(wrench.hidden.any() for wrench in self.wrenches)

    @property
    def solver(self) -> str:
        """The solver of the wrenches, in words."""
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
    remarks = list(reading.remarks)
    if reading.zero_span is not None:
        drift = zero_drift(reference, reading.zero_span)._replace(removed=True)
        reference = without_drift(reference, drift)
        remarks.append(drift.remark)
    for wrench in reading.wrenches:
        offset = time_offset(reference.t, wrench.known / SCALE, reference.known / SCALE)
        where, values = Where(wrench.name), {"correlation": offset.correlation}
        remarks.append(fact("lag-behind-sensor", where, lag_ms=offset.lag * 1e3, **values))
    return replace(reading, reference=reference, remarks=tuple(remarks))


def zero_drift(wrench: Wrench, span: Span) -> Drift:
    """Mean and spread of the known samples in a span."""
    start, stop = max(span[0], wrench.t[0]), min(span[1], wrench.t[-1])
    where = f"zero interval {interval_text(*span)}"
    if not start < stop:
        raise ParameterError(
            f"{where} is outside the log, which runs from {wrench.t[0]:g} to {wrench.t[-1]:g} s"
        )
    inside = wrench.between(start, stop)
    if len(inside) < 2:
        raise ParameterError(
            f"{where}: no two of its samples have a known wrench (σ_min too "
            "small); choose a span in a regular pose"
        )
    mean, sd = inside.mean(axis=0), inside.std(axis=0)
    return Drift(wrench.name, (start, stop), mean, sd, len(inside), wrench.frame)


def without_drift(wrench: Wrench, drift: Drift) -> Wrench:
    """The wrench less the drift, a constant in the wrench's own frame."""
    removed = drift._replace(removed=True)
    return replace(
        wrench, values=wrench.values - drift.mean, remarks=(*wrench.remarks, removed.remark)
    )


def without_zero(wrench: Wrench, choice: ZeroChoice) -> Wrench:
    """A wrench less its mean over a choice's first span or its unloaded start."""
    spans, _ = zero_spans(choice, wrench)
    return without_drift(wrench, zero_drift(wrench, spans[0])) if spans else wrench


def zero_moved(first: Drift, last: Drift) -> Remark:
    """The change of the zero between two unloaded spans."""
    force, moment = np.split(last.mean - first.mean, 2)
    values = {"force_N": force.tolist(), "moment_Nm": moment.tolist()}
    where = Where(first.name, span=last.span)
    return fact("zero-moved", where, first_s=list(first.span), **values)


def zero_spans(choice: ZeroChoice, wrench: Wrench) -> tuple[tuple[Span, ...], tuple[Span, ...]]:
    """The chosen spans, zero first; and the unloaded ones, else the start. [s]"""
    if choice.spans:
        return choice.spans, choice.spans
    start = unloaded_start(wrench)
    found = () if start is None else (start,)
    if choice.start and start is None:
        raise ParameterError(
            "--zero start: the log has no unloaded start of half a second in a regular pose; give "
            "the unloaded span as --zero A:B"
        )
    return found if choice.start else (), found


def unloaded_start(wrench: Wrench) -> Span | None:
    """The span at the start with the wrench at its first level, None if short. [s]

    That level is the median of the first half second after `SETTLING`; the span ends
    where a median over 0.1 s departs by `SPREADS` robust standard deviations and at least
    `STEPS`. A load from the first sample on looks like drift.
    """
    t = wrench.t - wrench.t[0]
    known = np.isfinite(wrench.known).all(axis=1)
    first = known & (t >= SETTLING) & (t <= SETTLING + LEAST_SPAN)
    if np.count_nonzero(first) < 3:
        return None
    # Medians: a knock at first moves neither level nor spread.
    level = np.median(wrench.values[first], axis=0)
    spread = robust_sd(wrench.values[first] - level)
    away = np.any(abs(wrench.values - level) > np.maximum(STEPS, SPREADS * spread), axis=1)
    last = len(t) - 1
    runs = [(a, b) for a, b in runs_of(away & known) if t[min(b, last)] - t[a] >= 0.1]
    loaded = covered(runs, len(t)) & (t >= SETTLING)
    stop = t[loaded.argmax()] - BACK if loaded.any() else t[-1]
    if stop - SETTLING < LEAST_SPAN:
        return None
    start = wrench.t[0]
    return start + SETTLING, start + stop


def zero_warning(wrench: Wrench, drift: Drift) -> tuple[Remark, ...]:
    """A warning if a zero interval looks like a contact."""
    inside, start, tried = wrench.between(*drift.span), unloaded_start(wrench), []
    if start is not None:
        level = zero_drift(wrench, start)
        away = abs(drift.mean - level.mean) - SPREADS * level.sd
        tried.append(("zero-far-from-start", away, STEPS, {"start_s": list(start)}))
    swing = np.subtract(*np.percentile(inside, [95, 5], axis=0))
    for code, value, limit, more in (*tried, ("zero-swings", swing, 4.0 * STEPS, {})):
        k = int(np.argmax(value / limit))
        if value[k] > limit[k]:
            values = {"axis": AXES[k], "size": value[k], "unit": unit_of(k), **more}
            return (warning(code, Where(wrench.name, span=drift.span), **values),)
    return ()
