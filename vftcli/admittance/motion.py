"""Algorithm 1: an axis is dragged or recovers, what force enters, and the recursion (48)–(51)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.admittance.law import Controller
from vftcli.admittance.parameters import Admittance
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.pose import exp_quaternion, log_quaternion, quaternion_product


class Phases(NamedTuple):
    """Algorithm 1's phases along a force record."""

    dragged: Mask  #: Whether each axis is in the drag phase. (T, 6)
    force: Array  #: Force and moment that enter the law, see `entering_force`. (T, 6) [N, N·m]


def phases(wrench: Array, parameters: Admittance) -> Phases:
    """Split a record (T, 6) [N, N·m] into drag and recovery phases, axis by axis.

    An axis is dragged from |F_i| > F_tsd,i until |F_i| ≤ (1 − hysteresis) F_tsd,i. An unknown (NaN)
    force counts as none.
    """
    wrench = np.nan_to_num(wrench, nan=0.0)
    size = np.abs(wrench)
    release = parameters.threshold * (1.0 - np.asarray(parameters.hysteresis))
    dragged = held(size > parameters.threshold, size <= release)
    return Phases(dragged, entering_force(wrench, dragged, parameters))


def entering_force(wrench: Array, dragged: Mask, parameters: Admittance) -> Array:
    """The force that enters (49), by the threshold's mode. (…, 6) [N, N·m]

    "hard" passes the whole force of a dragged axis, "soft" F − F_tsd·sign(F), which starts from
    zero; an axis that recovers has none. "literal" is Algorithm 1 as printed: all always enters.
    """
    if parameters.threshold_mode == "literal":
        return wrench
    soft = parameters.threshold_mode == "soft"
    over = np.abs(wrench) - (parameters.threshold if soft else 0.0)
    return np.where(dragged, np.sign(wrench) * np.maximum(over, 0.0), 0.0)


def held(on: Mask, off: Mask) -> Mask:
    """True from where `on` is until `off` is, False before the first of them. (T, 6)"""
    # The last row at which anything was switched tells the state: no loop over samples.
    rows = np.arange(len(on))[:, None]
    last = np.maximum.accumulate(np.where(on | off, rows, -1), axis=0)
    state = np.take_along_axis(on, np.maximum(last, 0), axis=0)
    return np.where(last >= 0, state, False)


@dataclass(frozen=True, kw_only=True)
class AxisMotion:
    """How the flange would move: one row a control period, one column a controller.

    Row k + 1 follows from row k and the force of row k. All components are in base axes; the
    rotation is the vector log(R R_dᵀ).
    """

    t: Array  #: Time; T control periods after the start come T + 1 rows. (T+1,) [s]
    x: Array  #: Deviations X̃ from the target pose. (T+1, N, 6) [m, rad]
    v: Array  #: Velocities. (T+1, N, 6) [m/s, rad/s]
    clipped: Mask  #: Whether the speed limit acted in the step before. (T+1, N, 6)

    @property
    def escaped(self) -> Mask:
        """Controllers whose motion left the finite numbers: finite-time escape. (N,)"""
        return np.asarray(~np.all(np.isfinite(self.x) & np.isfinite(self.v), axis=(0, 2)))


class Recursion:
    """The state of N controllers and one step of their motion, semi-implicit Euler (49)–(51).

    Attributes:
        x: Deviations. (N, 6) [m, rad]
        v: Velocities. (N, 6) [m/s, rad/s]
        clipped: Whether the speed limit acted in the last step. (N, 6)
    """

    def __init__(
        self,
        controllers: Sequence[Controller],
        x: Array | None = None,
        v: Array | None = None,
    ) -> None:
        """Start at deviations `x` with velocities `v`, (N, 6) or (6,), zero if not given."""
        if not controllers:
            raise ParameterError("no controller to run; choose traditional, variable, or both")
        periods = {controller.parameters.period for controller in controllers}
        if len(periods) > 1:
            raise ParameterError("controllers that run side by side need the same control period")
        self.period = periods.pop()
        shape = (len(controllers), 6)
        self.mass, self.damping, self.stiffness, self.limit = (
            np.array([getattr(c.parameters, name) for c in controllers])
            for name in ("mass", "damping", "stiffness", "speed_limit")
        )
        self.alpha, self.rate, self.recovery = (
            np.array([getattr(c, name) for c in controllers])
            for name in ("alpha", "rate", "damping")
        )
        self.x = np.array(np.broadcast_to(np.zeros(6) if x is None else x, shape))
        self.v = np.array(np.broadcast_to(np.zeros(6) if v is None else v, shape))
        self.clipped = np.zeros(shape, dtype=bool)
        self.turn = exp_quaternion(self.x[:, 3:])
        self.turns = bool(np.any(self.x[:, 3:]) or np.any(self.v[:, 3:]))

    def step(self, force: Array, dragged: Mask) -> None:
        """Move on under the force that enters (6,) [N, N·m]; axes are `dragged` (6,) or not."""
        x, v, period = self.x, self.v, self.period
        swell = np.exp(np.abs(v) * self.rate)
        swell *= self.alpha
        swell[:, dragged] = 1.0
        damping = np.where(dragged, self.damping, self.recovery)
        acceleration = swell / self.mass * (force - damping * v - self.stiffness * swell * x)
        wanted = v + acceleration * period
        self.v = np.minimum(np.maximum(wanted, -self.limit), self.limit)
        self.clipped = self.v != wanted
        moved = x[:, :3] + self.v[:, :3] * period
        self.turns = self.turns or bool(self.v[:, 3:].any())
        turned = self._turned() if self.turns else x[:, 3:]
        self.x = np.concatenate([moved, turned], axis=1)

    def _turned(self) -> Array:
        turn = quaternion_product(exp_quaternion(self.v[:, 3:] * self.period), self.turn)
        self.turn = turn / np.sqrt(np.sum(turn**2, axis=1, keepdims=True))
        return log_quaternion(self.turn)


def run(
    controllers: Sequence[Controller],
    force: Array,
    dragged: Mask,
    x: Array | None = None,
    v: Array | None = None,
) -> AxisMotion:
    """Run controllers over one force record, each axis in the phase the record puts it in.

    A law that escapes in finite time ends in infinities, which `AxisMotion.escaped` tells.

    Args:
        controllers: The controllers, all with the same control period.
        force: Force that enters the law. (T, 6) [N, N·m]
        dragged: Phases. (T, 6)
        x: Deviations at the start. (N, 6) or (6,) [m, rad]
        v: Velocities at the start. (N, 6) or (6,) [m/s, rad/s]
    """
    state = Recursion(controllers, x, v)
    shape = (len(force) + 1, len(controllers), 6)
    xs, vs, clips = np.empty(shape), np.empty(shape), np.zeros(shape, dtype=bool)
    xs[0], vs[0] = state.x, state.v
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(len(force)):
            state.step(force[k], dragged[k])
            xs[k + 1], vs[k + 1], clips[k + 1] = state.x, state.v, state.clipped
    return AxisMotion(
        t=np.arange(len(force) + 1, dtype=np.float64) * state.period, x=xs, v=vs, clipped=clips
    )


def release(
    controllers: Sequence[Controller],
    x: Array,
    duration: float,
    v: Array | None = None,
) -> AxisMotion:
    """Let go at deviation `x`, at rest unless `v` is given, and watch for `duration` [s]."""
    steps = int(np.ceil(duration / controllers[0].parameters.period - 1e-9))
    return run(controllers, np.zeros((steps, 6)), np.zeros((steps, 6), dtype=bool), x, v)
