"""A log's virtual sensor, its zero and drift; a real force/torque sensor beside it."""

from collections.abc import Mapping
from dataclasses import field, replace
from itertools import permutations
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain, link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import (
    Array,
    Mask,
    covered,
    resample_columns,
    root_mean_square,
    runs_of,
)
from vftcli.signals.errors import ParameterError
from vftcli.signals.estimation import robust_sd
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.lag import bridge_unknown, time_offset
from vftcli.signals.option import interval_text
from vftcli.signals.pose import Pose, rpy_angles, skew
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Where, caution, fact, warning
from vftcli.signals.shown import Shown, record
from vftcli.signals.wrench import AXES, Wrench, unit_of
from vftcli.wrench import FIT, SMOOTHER, WrenchChoice, ZeroChoice
from vftcli.wrench.smoother import SmoothedWrench
from vftcli.wrench.solvers import SCALE, UNSTATED, Mounting, VirtualSensor

#: Second to first singular value of the forces below which they lie on one line.
LEAST_DIRECTIONS = 0.02
#: Correlation of a field that is made from the torques.
DERIVED = 0.9995
RESEMBLES = 0.5  #: Below this correlation no convention explains the field.


class PoseFit(NamedTuple):
    """A sensor's pose on the flange, estimated from both sensors' readings."""

    pose: Pose  #: Orientation and origin of the sensor in the flange frame.
    force_rms: float  #: Force that the pose leaves unexplained, rms over axes and samples. [N]
    moment_rms: float  #: The same of the moment. [N·m]
    position_sd: Array  #: SD of the origin. (3,) [m]


def fit_pose(flange: Array, sensor: Array) -> PoseFit:
    """R and p of (56) from readings of flange and sensor. (T, 6) each [N, N·m]

    R solves Wahba's problem on the forces (Kabsch), p the linear least squares of N_F − R
    N_S = p × F_F, both about the mean: constant offsets do not matter.
    """
    ours, theirs = centred(flange, sensor)
    if len(ours) < 4:
        raise ParameterError(
            "the sensor's pose: too few samples in which both wrenches are known"
        )
    U, s, Vt = np.linalg.svd(theirs[:, :3].T @ ours[:, :3])
    if not s[1] > LEAST_DIRECTIONS * s[0]:
        raise ParameterError(
            "the sensor's pose cannot be found: the forces lie on one line; push in two "
            "directions, or give the pose with --set virtual-sensor.sensor=x,y,z,roll,pitch,yaw"
        )
    # A reflection may fit better than a rotation: the smallest direction gives way.
    R = Vt.T @ np.diag([1.0, 1.0, np.sign(np.linalg.det(Vt.T @ U.T))]) @ U.T
    lever = skew(-ours[:, :3]).reshape(-1, 3)
    excess = (ours[:, 3:] - theirs[:, 3:] @ R.T).ravel()
    p = np.linalg.lstsq(lever, excess, rcond=None)[0]
    left = excess - lever @ p
    variance = np.mean(left**2)
    force_rms = root_mean_square(ours[:, :3] - theirs[:, :3] @ R.T)
    position_sd = np.sqrt(variance * np.diag(np.linalg.pinv(lever.T @ lever)))
    return PoseFit(Pose(R, p), force_rms, np.sqrt(variance), position_sd)


def find_mounting(
    recording: Recording, robot: Robot, disturbance: ExternalTorque, choice: WrenchChoice
) -> tuple[Mounting, tuple[Remark, ...]]:
    """Tool and sensor poses as asked, with remarks; ``fit`` estimates the sensor's."""
    mounting = choice.mounting(robot)
    if choice.sensor_pose != FIT:
        return mounting, ()
    reading, frame = recording.require("wrench"), recording.wrench_frame or UNSTATED
    if frame.axes != "sensor":
        raise ParameterError(
            f"virtual-sensor.sensor=fit: the log's wrench is in {frame}, not in sensor axes; name "
            "it with --columns wrench[sensor]=…, or leave the setting out"
        )
    ours = VirtualSensor(frame="flange").wrench(disturbance, recording.q, robot.chain)
    fit = fit_pose(ours.known, frame.factor * reading)
    remark = fact(
        "sensor-pose-fitted",
        position_mm=(fit.pose.translation * 1e3).tolist(),
        position_sd_mm=(fit.position_sd * 1e3).tolist(),
        angles_deg=np.degrees(rpy_angles(fit.pose.rotation)).tolist(),
        force_rms_N=fit.force_rms,
        moment_rms_Nm=fit.moment_rms,
    )
    return mounting._replace(sensor=fit.pose), (remark,)


class AxesFit(NamedTuple):
    """One force in terms of another: theirs ≈ gain · matrix · ours."""

    matrix: Array  #: The signed permutation of axes that fits best. (3, 3)
    gain: float  #: Factor on top of it.
    correlation: float  #: Their correlation, all axes together.

    @property
    def words(self) -> str:
        """Their axes in ours, as "+x +z −y"."""
        places = abs(self.matrix).argmax(axis=1)
        signs = np.where(self.matrix.sum(axis=1) > 0, "+", "−")
        return " ".join(f"{sign}{'xyz'[k]}" for sign, k in zip(signs, places, strict=True))


def fit_axes(ours: Array, theirs: Array) -> AxesFit:
    """Signed permutation of axes from our force to theirs; offsets do not matter.

    The best orthogonal matrix (improper ones allowed: loggers swap axes freely), rounded
    to the signed permutation with the largest sum of matching entries.
    """
    x, y = centred(ours, theirs)
    U, _, Vt = np.linalg.svd(y.T @ x)
    Q, rows = U @ Vt, np.arange(3)
    order = max(permutations(range(3)), key=lambda order: abs(Q[rows, order]).sum())
    matrix = np.zeros((3, 3))
    matrix[rows, order] = np.sign(Q[rows, order])
    z = x @ matrix.T
    power, both = np.sum(z**2), np.sum(z * y)
    scale = np.sqrt(power * np.sum(y**2))
    gain, correlation = (both / size if size > 0 else np.nan for size in (power, scale))
    return AxesFit(matrix, gain, correlation)


def centred(ours: Array, theirs: Array) -> tuple[Array, Array]:
    """Departures from the means of two readings (T, k), both known. (S, k) each"""
    known = np.all(np.isfinite(ours) & np.isfinite(theirs), axis=1)
    x, y = ours[known], theirs[known]
    return (x - x.mean(axis=0), y - y.mean(axis=0)) if len(x) else (x, y)


def vendor_remarks(recording: Recording, ours: Wrench, chain: Chain) -> list[Remark]:
    """Convention of the log's own wrench against ours, in base and flange axes."""
    theirs = recording.wrench
    if theirs is None:
        return []
    empty = ~theirs.any(axis=1)
    share, remarks = empty.mean(), list[Remark]()
    norm = np.linalg.norm(ours.force[empty & ~ours.hidden], axis=1)
    force = root_mean_square(norm) if len(norm) else np.nan
    if share == 1.0:
        return [caution("log-wrench-all-zero", force_N=force)]
    if share:
        remarks.append(caution("log-wrench-zero", share=share, force_N=force))
    # Zeros may mean "not known", and would bias every fit.
    t, usable = recording.t, ~(empty | ours.hidden)[:, None]
    if np.count_nonzero(usable) < 10:
        return [*remarks, caution("log-wrench-unlike")]
    flange = link_poses(chain, recording.q).rotation[:, -1]
    forces = {"base": ours.force, "flange": np.einsum("tji,tj->ti", flange, ours.force)}
    given = np.where(usable, theirs[:, :3], np.nan)
    fits = {name: fit_axes(force, given) for name, force in forces.items()}
    frame, fit = max(fits.items(), key=lambda item: item[1].correlation)
    turned = forces[frame] @ fit.matrix.T
    lag, _ = time_offset(t, given, turned)
    moved = resample_columns(t - lag, t, bridge_unknown(t, turned))
    axes = fit_axes(np.where(usable, moved, np.nan) @ fit.matrix, given)
    if not axes.correlation > RESEMBLES:
        return [*remarks, caution("log-wrench-unlike")]
    # The trace of a signed permutation: 3 for our axes, −3 for opposite.
    turn = {3: "log-wrench-fits", -3: "log-wrench-fits-turned"}
    remarks.append(
        fact(
            turn.get(round(np.trace(axes.matrix)), "log-wrench-fits-other-axes"),
            stated=str(recording.wrench_frame or "frame not stated"),
            frame=frame,
            axes=axes.words,
            gain=axes.gain,
            lag_ms=lag * 1e3,
            correlation=axes.correlation,
        )
    )
    if axes.correlation >= DERIVED:  # computed from the same torques, not measured
        remarks.append(caution("log-wrench-derived", correlation=DERIVED))
    return remarks


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


def contact_elsewhere(wrench: Wrench, free: Mask) -> tuple[Remark, ...]:
    """A remark where no wrench at the tip explains the torque of over six joints."""
    torque = wrench.null_space
    if torque is None or not len(known := torque[free & np.isfinite(torque)]):
        return ()
    # The largest of the free part (T,), not a quantile: all of it is error.
    limit = MARGIN * known.max()
    share = np.mean(np.nan_to_num(torque) > limit)
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
        """The span that the removed mean is of, None if none was removed. [s]"""
        return next((drift.span for drift in self.drifts if drift.removed), None)


def with_reference(
    reading: SensorReading, reference: Wrench, *, of_sensor: bool = False
) -> SensorReading:
    """The reading with a reference beside it."""
    if not of_sensor:
        return replace(reading, reference=reference)
    remarks = list(reading.remarks)
    if reading.zero_span:
        drift = zero_drift(reference, reading.zero_span)._replace(removed=True)
        reference = without_drift(reference, drift)
        remarks.append(drift.remark)
    for wrench in reading.wrenches:
        lag, fit = time_offset(reference.t, wrench.known / SCALE, reference.known / SCALE)
        where = Where(wrench.name)
        remarks.append(fact("lag-behind-sensor", where, lag_ms=lag * 1e3, correlation=fit))
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
    where a median over 0.1 s departs by `SPREADS` robust SDs and at least
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
