"""What a robot's controller would log of a run: sampled, averaged, quantised, noisy, lossy."""

from dataclasses import dataclass

import numpy as np

from vftcli.robots import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.arm import Arm, History, JointSignals
from vftcli.simulation.scenario import SensingSpec

#: Logging rate by kind of drive measurement, for robots that state none. [Hz]
USUAL_RATE = {"current": 125.0, "link_torque": 1000.0, "joint_torque": 500.0}


@dataclass(frozen=True, kw_only=True)
class Samples(JointSignals):
    """The sampling of a run: when, and the true signals then, one row a sample.

    The drive torque is averaged over the sampling interval, or that at the instant.
    """

    time: Array  #: True time of each sample. (M,) [s]
    stamp: Array  #: The same on the log's clock, before jitter. (M,) [s]


@dataclass(frozen=True, kw_only=True)
class Measured:
    """What the sensors report at each sample."""

    stamp: Array  #: Time stamps, jittering. (M,) [s]
    q: Array  #: Positions. (M, n) [rad]
    dq: Array  #: Velocities. (M, n) [rad/s]
    #: Drive torques; for a robot that measures currents, K times `current`. (M, n) [N·m]
    torque: Array
    current: Array | None  #: Motor currents, None for a robot that measures torques. (M, n) [A]
    temperature: Array  #: Joint temperatures. (M, n) [°C]
    #: Which sample each row of the log holds; lost ones are missing, repeated ones doubled.
    rows: tuple[int, ...]


def check_sensing(spec: SensingSpec) -> None:
    """Raise unless the sensing section describes something that can be."""
    shares = {"dropped": spec.dropped, "repeated": spec.repeated}
    if bad := [name for name, value in shares.items() if not 0 <= value < 1]:
        raise ParameterError(f"sensing.{bad[0]} is {shares[bad[0]]:g}; it is a share from 0 to 1")
    sizes = {
        "rate": spec.rate,
        "noise": spec.noise,
        "current_noise": spec.current_noise or 0.0,
        "position_step": spec.position_step,
        "jitter": spec.jitter,
    }
    if bad := [name for name, value in sizes.items() if value < 0]:
        raise ParameterError(f"sensing.{bad[0]} is {sizes[bad[0]]:g}; it must not be negative")
    if spec.torque not in {"average", "instant"}:
        raise ParameterError(f"sensing.torque is {spec.torque!r}; it is average or instant")
    if abs(spec.clock_drift) >= 0.5 or spec.vendor_cutoff <= 0:
        raise ParameterError("sensing.clock_drift must be below 0.5, vendor_cutoff positive")


def log_rate(spec: SensingSpec, robot: Robot) -> float:
    """The log's rate: stated, the robot's own, or the usual one of its kind. [Hz]"""
    if spec.rate > 0:
        return spec.rate
    if np.isfinite(robot.sample_rate_hz):
        return robot.sample_rate_hz
    return USUAL_RATE[robot.torque_source]


def sample_run(arm: Arm) -> Samples:
    """The true signals of a finished run at the instants of the log's own, drifting clock."""
    spec, history = arm.scenario.sensing, arm.close()
    rate = log_rate(spec, arm.robot)
    grid = np.arange(len(history.q), dtype=float) * history.step
    end = grid[-1]
    count = int(np.floor(end * (1.0 + spec.clock_drift) * rate + 1e-6)) + 1
    stamp = np.arange(count, dtype=float) / rate
    time = np.minimum(stamp / (1.0 + spec.clock_drift), end)
    interval = 1.0 / rate / (1.0 + spec.clock_drift)
    names = ("q", "v", "target_q", "target_dq", "target_ddq")
    states = {name: interpolate(time, grid, getattr(history, name)) for name in names}
    middle = grid[:-1] + 0.5 * history.step
    steps = {
        name: interpolate(time, middle, getattr(history, name)[:-1]) for name in ("a", "friction")
    }
    tau = average_torque(history, grid, time, interval if spec.torque == "average" else 0.0)
    return Samples(time=time, stamp=stamp, tau=tau, **states, **steps)


def interpolate(time: Array, grid: Array, values: Array) -> Array:
    """Interpolate columns of `values` (N, n), given on `grid` (N,), linearly at `time` (M,)."""
    step = grid[1] - grid[0]
    place = np.clip((time - grid[0]) / step, 0.0, len(grid) - 1.0)
    left = np.minimum(np.floor(place + 1e-9).astype(int), len(grid) - 2)
    share = np.clip(place - left, 0.0, 1.0)
    share[share < 1e-9] = 0.0
    share = share.reshape(-1, *([1] * (values.ndim - 1)))
    mixed: Array = values[left] * (1.0 - share) + values[left + 1] * share
    return mixed


def average_torque(history: History, grid: Array, time: Array, interval: float) -> Array:
    """Drive torque averaged over the `interval` before each sample, or over the last step. (M, n)

    The torque is constant over an inner step, so its integral is piecewise linear and the average
    exact. The first sample has no interval before it and reports the first step's torque.
    """
    span = max(interval, history.step)
    total = np.zeros_like(history.tau)
    np.cumsum(history.tau[:-1] * history.step, axis=0, out=total[1:])
    begin = np.maximum(time - span, 0.0)
    end = np.maximum(time, grid[1])
    grown = interpolate(end, grid, total) - interpolate(begin, grid, total)
    mean: Array = grown / (end - begin)[:, None]
    return mean


def measure_run(arm: Arm, samples: Samples) -> Measured:
    """Report what the sensors make of the true signals; everything random is from the seed."""
    spec, robot = arm.scenario.sensing, arm.robot
    rng = np.random.default_rng(arm.seeds["sensing"])
    shape = samples.q.shape
    q = samples.q + spec.noise * known_noise(robot.noise.q) * rng.standard_normal(shape)
    if spec.position_step > 0:
        q = np.round(q / spec.position_step) * spec.position_step
    dq = samples.v + spec.noise * known_noise(robot.noise.qd) * rng.standard_normal(shape)
    seen = samples.tau / arm.true.gain + arm.true.offset
    noise = rng.standard_normal(shape)
    current = None
    if robot.torque_source == "current" and robot.torque_constant is not None:
        size = spec.noise * known_noise(robot.noise.current)
        if spec.current_noise is not None:
            size = np.full(robot.joints, spec.current_noise)
        current = seen / robot.torque_constant + size * noise
        torque = current * robot.torque_constant
    else:
        torque = seen + spec.noise * known_noise(robot.noise.tau) * noise
    stamp = with_jitter(samples.stamp, spec.jitter, rng)
    rows = rows_logged(len(stamp), spec, rng)
    return Measured(
        stamp=stamp,
        q=q,
        dq=dq,
        torque=torque,
        current=current,
        temperature=arm.temperature(samples.time),
        rows=rows,
    )


def known_noise(size: Array) -> Array:
    """Noise sizes with zero where the profile has none. (n,)"""
    return np.where(np.isfinite(size), size, 0.0)


def with_jitter(stamp: Array, size: float, rng: np.random.Generator) -> Array:
    """Stamps with normal jitter, cut so that they still increase. (M,) [s]"""
    draw = rng.standard_normal(len(stamp))
    if size == 0 or len(stamp) < 2:
        return stamp
    # Less than half a period to either side: stamps must go on increasing.
    bound = 0.45 * (stamp[1] - stamp[0])
    moved: Array = stamp + np.clip(size * draw, -bound, bound)
    return moved


def rows_logged(count: int, spec: SensingSpec, rng: np.random.Generator) -> tuple[int, ...]:
    """Which sample each row of the log holds. The first and the last are always there."""
    lost = rng.random(count) < spec.dropped
    again = rng.random(count) < spec.repeated
    inner = np.arange(count) > 0
    inner[-1] = False
    source = np.arange(count)
    source[again & inner] -= 1
    return tuple(int(k) for k in source[~(lost & inner)])
