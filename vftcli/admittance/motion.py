"""Algorithm 1: drag and recovery phases, the force that enters, motion (48)–(51).

A motion is judged by axis and drag: peak, its time, overshoot, return, idle time, work.
Joint positions along it follow by damped least squares, sample by sample.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from vftcli.admittance.law import AXES, UNITS, Admittance, Controller
from vftcli.robots.robot import LARGEST_STEP, FlangeSolver, Robot
from vftcli.signals.arrays import Array, Mask, intervals
from vftcli.signals.errors import ParameterError
from vftcli.signals.pose import exp_matrix, exp_quaternion, log_quaternion, quaternion_product

PAUSE = 1.0  #: Drags of one axis closer than this are one. [s]
#: Return time → share of the deviation at release.
SHARES = {"return_10_s": 0.10, "return_2_s": 0.02}
#: A release below this share of the largest deviation has no return. [1]
RELEASED = 0.2


class Phases(NamedTuple):
    """Algorithm 1's phases along a force record."""

    dragged: Mask  #: Whether each axis is in the drag phase. (T, 6)
    force: Array  #: Force and moment that enter the law. (T, 6) [N, N·m]


def phases(wrench: Array, parameters: Admittance, before: Mask | bool = False) -> Phases:
    """Split a record (T, 6) [N, N·m] into drag and recovery phases, axis by axis.

    An axis is dragged from |F_i| > F_tsd,i until |F_i| ≤ (1 − hysteresis) F_tsd,i, those
    of `before` (6,) from the start. NaN counts as no force.

    In mode "hard" the whole force of a dragged axis enters (49), in "soft" F −
    F_tsd·sign(F), and none of an axis that recovers. "literal" is Algorithm 1 as printed:
    all force always enters.
    """
    wrench = np.nan_to_num(wrench, nan=0.0)
    size = abs(wrench)
    on = size > parameters.threshold
    off = size <= parameters.threshold * (1.0 - parameters.hysteresis)
    # The last row that switched gives the state, without a loop.
    last = np.maximum.accumulate(np.where(on | off, np.arange(len(on))[:, None], -1), axis=0)
    dragged = np.where(last < 0, before, np.take_along_axis(on, np.maximum(last, 0), axis=0))
    if parameters.threshold_mode == "literal":
        return Phases(dragged, wrench)
    over = size - (parameters.threshold if parameters.threshold_mode == "soft" else 0.0)
    return Phases(dragged, np.where(dragged, np.sign(wrench) * np.maximum(over, 0.0), 0.0))


class AxisMotion(NamedTuple):
    """Motion of the flange: one row a control period, one column a controller.

    Row k + 1 follows from row k and its force. Axes are the base's, rotations log(R R_dᵀ).
    """

    t: Array  #: Time of T + 1 rows, T control periods. (T+1,) [s]
    x: Array  #: Deviations X̃ from the target pose. (T+1, N, 6) [m, rad]
    v: Array  #: Velocities. (T+1, N, 6) [m/s, rad/s]

    @property
    def escaped(self) -> Mask:
        """Controllers with an infinite motion: finite-time escape. (N,)"""
        return np.asarray(~np.all(np.isfinite(self.x) & np.isfinite(self.v), axis=(0, 2)))


class Recursion:
    """State of N controllers, and one semi-implicit Euler step of it (49)–(51).

    Deviations x [m, rad] and velocities v [m/s, rad/s] are (N, 6); all have one period.
    """

    def __init__(
        self, controllers: Sequence[Controller], x: Array | float = 0.0, v: Array | float = 0.0
    ) -> None:
        """Start at deviations `x` with velocities `v`, (N, 6) or fewer."""
        all_parameters, shape = [c.parameters for c in controllers], (len(controllers), 6)
        self.period = all_parameters[0].period
        self.mass, self.damping, self.stiffness, self.limit = (
            np.array([getattr(p, name) for p in all_parameters])
            for name in ("mass", "damping", "stiffness", "speed_limit")
        )
        self.alpha, self.rate, self.recovery = (
            np.array([getattr(c, name) for c in controllers])
            for name in ("alpha", "rate", "damping")
        )
        self.x, self.v = np.full(shape, x), np.full(shape, v)
        self.turn = exp_quaternion(self.x[:, 3:])
        self.turns = self.x[:, 3:].any() or self.v[:, 3:].any()

    def step(self, force: Array, dragged: Mask) -> None:
        """Move one period under a force (6,) [N, N·m], some axes `dragged` (6,)."""
        x, v, period = self.x, self.v, self.period
        swell = np.exp(abs(v) * self.rate) * self.alpha
        swell[:, dragged] = 1.0
        damping = np.where(dragged, self.damping, self.recovery)
        acceleration = swell / self.mass * (force - damping * v - self.stiffness * swell * x)
        self.v = np.minimum(np.maximum(v + acceleration * period, -self.limit), self.limit)
        self.x = x.copy()
        self.x[:, :3] += self.v[:, :3] * period
        self.turns = self.turns or self.v[:, 3:].any()
        if self.turns:
            turn = quaternion_product(exp_quaternion(self.v[:, 3:] * period), self.turn)
            self.turn = turn / np.sqrt(np.sum(turn**2, axis=1, keepdims=True))
            self.x[:, 3:] = log_quaternion(self.turn)


def run(
    controllers: Sequence[Controller],
    force: Array,
    dragged: Mask,
    x: Array | float = 0.0,
    v: Array | float = 0.0,
) -> AxisMotion:
    """The motion under one force record and its phases.

    Force and phases (T, 6) are those of `Phases`. A law may end in infinities.
    """
    state = Recursion(controllers, x, v)
    rows = [(state.x, state.v)]
    with np.errstate(over="ignore", invalid="ignore"):
        for step in zip(force, dragged, strict=True):
            state.step(*step)
            rows.append((state.x, state.v))
    t = np.arange(len(rows), dtype=float) * state.period
    return AxisMotion(t, *map(np.array, zip(*rows, strict=True)))


def release(
    controllers: Sequence[Controller], x: Array, duration: float, v: Array | float = 0.0
) -> AxisMotion:
    """Motion for `duration` [s] after release at `x` with velocity `v`."""
    steps = int(np.ceil(duration / controllers[0].parameters.period - 1e-9))
    return run(controllers, np.zeros((steps, 6)), np.zeros((steps, 6), bool), x, v)


class Drag(NamedTuple):
    """One drag of one axis, until the next."""

    axis: int  #: Index of the axis.
    number: int  #: Count of the drags of that axis, from 1.
    begin: int  #: Row of the motion at which the drag phase begins.
    release: int  #: Row from which on the axis recovers.
    end: int  #: Row after the last that belongs to it.


def drags_of(phases: Phases, period: float) -> tuple[Drag, ...]:
    """The drags of every axis along T forces (rows 0 … T of the motion)."""
    found, t = list[Drag](), np.arange(len(phases.dragged), dtype=float) * period
    for axis, dragged in enumerate(phases.dragged.T):
        # From the last dragged sample of one to the first of the next.
        spans = intervals(t, dragged, gap=PAUSE + period - 1e-9)
        ends = [*(begin + 1 for begin, _ in spans), len(t) + 1]
        found += [Drag(axis, k, *span, ends[k]) for k, span in enumerate(spans, start=1)]
    return tuple(found)


def rows_of(
    controllers: Sequence[Controller], motion: AxisMotion, drags: Sequence[Drag], wrench: Array
) -> list[dict[str, Any]]:
    """The comparison as rows, one for each controller, axis and drag.

    `start_s` and `release_s` are on the motion's clock, the other times [s] from the drag's
    start or its release. `work_J` is the hand's. None: it does not happen in time.
    """
    rows, peaks = list[dict[str, Any]](), dict[Drag, float]()
    for n, controller in enumerate(controllers):
        for drag in drags:
            row = row_of(controller, motion, n, drag, wrench)
            peak, first = row["time_to_peak_s"], peaks.get(drag)
            if controller.kind == "traditional":
                peaks[drag], first = peak, None
            rows.append({**row, "peak_advance_s": None if first is None else first - peak})
    return rows


def row_of(
    controller: Controller, motion: AxisMotion, n: int, drag: Drag, wrench: Array
) -> dict[str, Any]:
    """One controller's figures for one drag of one axis."""
    axis, t = drag.axis, motion.t
    x, v = motion.x[:, n, axis], motion.v[:, n, axis]
    top = drag.begin + np.nan_to_num(abs(x[drag.begin : drag.end]), nan=np.inf).argmax()
    returns = {name: return_time(t, x, drag, share) for name, share in SHARES.items()}
    back, start, released = returns["return_2_s"], t[drag.begin], t[drag.release]
    # Row k + 1 is what the force of row k made of row k.
    span = slice(drag.begin, drag.release)
    work = np.nansum(wrench[span, axis] * v[1:][span]) * (t[1] - t[0])
    return {
        "controller": controller.kind,
        "alpha": None if controller.kind == "traditional" else controller.alpha[axis],
        "xi": controller.xi[axis],
        "axis": AXES[axis],
        "unit": UNITS[axis],
        "drag": drag.number,
        "start_s": start,
        "release_s": released,
        "peak": finite(x[top]),
        "time_to_peak_s": t[top] - start,
        "at_release": finite(x[drag.release]),
        "overshoot": overshoot(x, drag),
        **returns,
        "idle_s": None if back is None else released - start + back,
        "work_J": finite(work),
    }


def return_time(t: Array, x: Array, drag: Drag, share: float) -> float | None:
    """Time until an axis stays within `share` of its release, or None. [s]"""
    after = abs(recovery_of(x, drag))
    if not len(after):
        return None
    outside = np.flatnonzero(after > share * after[0])
    last = outside[-1] if outside.size else 0
    if last == len(after) - 1:
        return None
    return float(t[drag.release + last] - t[drag.release])


def overshoot(x: Array, drag: Drag) -> float | None:
    """Overshoot after release, as a share of the deviation then."""
    after = recovery_of(x, drag)
    return max(np.max(-after / after[0]), 0.0) if len(after) else None


def recovery_of(x: Array, drag: Drag) -> Array:
    """Deviations from a drag's release on; none if they escape or are small."""
    after = x[drag.release : drag.end]
    least = RELEASED * abs(x[drag.begin : drag.end]).max()
    return after if np.isfinite(after).all() and abs(after[0]) > least else after[:0]


def finite(value: float) -> float | None:
    """A finite number, or None."""
    return value if np.isfinite(value) else None


def check_start(robot: Robot, q: Array) -> Array:
    """Return a start pose. (n,) [rad]"""
    if robot.joints < 6:
        raise ParameterError(
            f"{robot.name} has {robot.joints} joints; Cartesian admittance needs at least 6"
        )
    q = np.asarray(q, float)
    if q.shape != (robot.joints,):
        raise ParameterError(
            f"the start pose has {q.size} joints; {robot.name} has {robot.joints}"
        )
    lower, upper = np.fmax(robot.limits.q_min, -np.inf), np.fmin(robot.limits.q_max, np.inf)
    if np.any(wrong := ~((q >= lower) & (q <= upper))):
        j = wrong.argmax()
        raise ParameterError(
            f"the start pose is outside the joint limits of {robot.name}: joint {j + 1} "
            f"is at {q[j]:.4g} rad and may be {lower[j]:.4g} to {upper[j]:.4g} rad"
        )
    return q


class JointPath(NamedTuple):
    """Joint positions along the motions of N controllers."""

    #: Positions; out of reach it waits at the last one. (T, N, n) [rad]
    q: Array
    reached: Mask  #: Whether the pose is reached inside the limits. (T, N)
    #: Largest joint speed as a share of its limit, NaN without one. (N,)
    speed: Array


def follow(robot: Robot, start: Array, x: Array, period: float) -> JointPath:
    """Joints along base-axes deviations (T, N, 6), a `period` [s] apart, from `start`."""
    solver = FlangeSolver(robot)
    rotation, translation = solver.pose(start)
    q, reached = np.empty((*x.shape[:2], len(start))), np.zeros(x.shape[:2], bool)
    for i in range(x.shape[1]):
        goals, points = exp_matrix(x[:, i, 3:]) @ rotation, translation + x[:, i, :3]
        same = np.all(x[1:, i] == x[:-1, i], axis=1)
        shown, last, before, good = start, start, start, True
        for k, (goal, point) in enumerate(zip(goals, points, strict=True)):
            if k and same[k - 1]:
                before = last
            else:
                # Straight on from the two poses before.
                guess = 2.0 * last - before if good else last
                found, good = last, False
                if np.isfinite(point).all():
                    found, good = solver.reach(goal, point, guess)
                    if not good or abs(found - last).max() > LARGEST_STEP:
                        found, good = solver.reach(goal, point, last)
                last, before = found, last if good else found
                shown = found if good else shown
            q[k, i], reached[k, i] = shown, good
    return JointPath(q, reached, largest_speed(robot, q, reached, period))


def largest_speed(robot: Robot, q: Array, reached: Mask, period: float) -> Array:
    """Largest joint speed as a share of the limit. (N,)"""
    share = abs(np.diff(q, axis=0)) / period / robot.limits.qd_max
    both = (reached[1:] & reached[:-1])[:, :, None] & np.isfinite(share)
    largest = np.where(both, share, -1.0).max(axis=(0, 2), initial=-1.0)
    return np.where(largest >= 0.0, largest, np.nan)
