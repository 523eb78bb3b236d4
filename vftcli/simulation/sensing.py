"""A controller's log of a run: sampled, averaged, quantised, noisy, lossy.

Its estimate of contact: measured torque less the nominal model's, low-passed.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from vftcli.robots.friction import friction_torque
from vftcli.robots.robot import Robot
from vftcli.robots.terms import gravity_torque
from vftcli.signals.arrays import Array, Indices, resample_columns, summed
from vftcli.signals.errors import ParameterError
from vftcli.signals.pose import rpy_matrix
from vftcli.signals.steady_filter import steady_filter
from vftcli.simulation.arm import Arm, rigid_torque
from vftcli.simulation.scenario import SensingSpec
from vftcli.simulation.trajectories import Reference

#: Logging rate by kind of drive measurement, for robots that state none. [Hz]
USUAL_RATE = {"current": 125.0, "link_torque": 1000.0, "joint_torque": 500.0}


class Samples(NamedTuple):
    """The true signals at sampling instants; torque averaged or not."""

    time: Array  #: True time of each sample. (M,) [s]
    stamp: Array  #: The same on the log's clock, before jitter. (M,) [s]
    q: Array  #: Positions, velocities, accelerations. (M, n) [rad, rad/s, rad/s²]
    v: Array
    a: Array
    tau: Array  #: Drive torque. (M, n) [N·m]
    friction: Array  #: Friction torque. (M, n) [N·m]
    target_q: Array  #: The reference. (M, n) [rad, rad/s, rad/s²]
    target_dq: Array
    target_ddq: Array


class Measured(NamedTuple):
    """A controller's log, one row a sample."""

    stamp: Array  #: Time stamps, jittering. (M,) [s]
    #: Sample in each row: lost ones are missing, repeated ones come twice.
    rows: Indices
    #: Field of a recording → its signal, the controller's targets and estimate too. (M, n) each
    signals: dict[str, Array]


def check_sensing(spec: SensingSpec) -> None:
    """Raise unless the sensing section is possible."""
    for name in ("dropped", "repeated"):
        if not 0 <= (value := getattr(spec, name)) < 1:
            raise ParameterError(f"sensing.{name} is {value:g}; it is a share from 0 to 1")
    for name in ("rate", "noise", "current_noise", "position_step", "jitter"):
        if (value := getattr(spec, name) or 0.0) < 0:
            raise ParameterError(f"sensing.{name} is {value:g}; it must not be negative")
    if spec.torque not in {"average", "instant"}:
        raise ParameterError(f"sensing.torque is {spec.torque!r}; it is average or instant")
    if abs(spec.clock_drift) >= 0.5 or spec.vendor_cutoff <= 0:
        raise ParameterError("sensing.clock_drift must be below 0.5, vendor_cutoff positive")


def log_rate(spec: SensingSpec, robot: Robot) -> float:
    """The log's rate: stated, the robot's own, or its kind's usual one. [Hz]"""
    if spec.rate > 0:
        return spec.rate
    if np.isfinite(robot.sample_rate_hz):
        return robot.sample_rate_hz
    return USUAL_RATE[robot.torque_source]


def sample_run(arm: Arm) -> Samples:
    """The true signals of a finished run on the log's drifting clock."""
    spec, history = arm.scenario.sensing, arm.close()
    rate = log_rate(spec, arm.robot)
    grid = np.arange(arm.made + 1, dtype=float) * arm.scenario.step
    end = grid[-1]
    count = int(np.floor(end * (1.0 + spec.clock_drift) * rate + 1e-6)) + 1
    stamp = np.arange(count, dtype=float) / rate
    time = np.minimum(stamp / (1.0 + spec.clock_drift), end)
    interval = 1.0 / rate / (1.0 + spec.clock_drift)
    names = ("q", "v", "target_q", "target_dq", "target_ddq")
    signals = {name: resample_columns(time, grid, history[name]) for name in names}
    for name in ("a", "friction"):
        middle = grid[:-1] + 0.5 * arm.scenario.step
        signals[name] = resample_columns(time, middle, history[name][:-1])
    # The mean of an interval: torque is constant over a step.
    step = grid[1]
    total = step * summed(history["tau"][:-1])
    span = max(interval if spec.torque == "average" else 0.0, step)
    begin, stop = np.maximum(time - span, 0.0), np.maximum(time, step)
    grown = resample_columns(stop, grid, total) - resample_columns(begin, grid, total)
    tau = grown / (stop - begin)[:, None]
    return Samples(time=time, stamp=stamp, tau=tau, **signals)


def noise_sizes(arm: Arm) -> tuple[Array, Array, Array]:
    """Noise of positions, velocities, torques or currents (n,) [rad, rad/s, N·m, A]"""
    spec, noise = arm.scenario.sensing, arm.robot.noise
    K = drive_constants(arm.robot)
    own = noise.tau if K is None else noise.current
    q, dq, effort = (spec.noise * np.nan_to_num(size) for size in (noise.q, noise.qd, own))
    if K is not None and spec.current_noise is not None:
        effort = np.full(arm.robot.joints, spec.current_noise)
    return q, dq, effort


def drive_constants(robot: Robot) -> Array | None:
    """Drive constants of an arm that measures motor currents, else None. (n,) [N·m/A]"""
    return robot.torque_constant if robot.torque_source == "current" else None


def measure_run(arm: Arm, samples: Samples, wrench: Array) -> Measured:
    """A controller's log of true signals and wrench (M, 6), noise from the seed."""
    spec, K = arm.scenario.sensing, drive_constants(arm.robot)
    rng = np.random.default_rng(arm.seeds["sensing"])
    sizes, shape = noise_sizes(arm), samples.q.shape
    q = rounded(samples.q + sizes[0] * rng.standard_normal(shape), spec.position_step)
    dq = samples.v + sizes[1] * rng.standard_normal(shape)
    seen = samples.tau / arm.true.gain + arm.true.offset
    noise = sizes[2] * rng.standard_normal(shape)
    effort = {"torque": seen + noise} if K is None else {"current": seen / K + noise}
    # Less than half a period to either side: stamps must go on increasing.
    stamp, count = samples.stamp, len(samples.stamp)
    draw = spec.jitter * rng.standard_normal(count)
    if spec.jitter and count > 1:
        bound = 0.45 * (stamp[1] - stamp[0])
        stamp = stamp + draw.clip(-bound, bound)
    # The first and the last row always hold their own samples.
    lost, again = rng.random(count) < spec.dropped, rng.random(count) < spec.repeated
    inner = np.arange(count) > 0
    inner[-1] = False
    source = np.arange(count) - (again & inner)
    signals = {"q": q, "dq": dq, **effort}
    signals |= controller_signals(arm, samples, signals)
    if (reading := read_force_sensor(arm, samples, wrench)) is not None:
        signals["wrench"] = reading
    return Measured(stamp, source[~(lost & inner)], signals)


def rounded(q: Array, step: float) -> Array:
    """Positions quantised to a step, 0 for none. [rad]"""
    return np.round(q / step) * step if step > 0 else q


def controller_signals(
    arm: Arm, samples: Samples, measured: Mapping[str, Array]
) -> dict[str, Array]:
    """Temperatures, targets and estimate of contact by the controller's nominal model.

    As Universal Robots', its friction knows load and temperature, no presliding.
    """
    nominal, K = arm.true.nominal, drive_constants(arm.robot)
    target = Reference(samples.target_q, samples.target_dq, samples.target_ddq)
    load, warm = gravity_torque(nominal, samples.target_q), arm.temperature(samples.time)

    def modelled(motion: Reference) -> tuple[Array, Array]:
        """Rigid-body and friction torque. (M, n) [N·m] each"""
        losses = friction_torque(nominal.friction, motion.dq, load, temperature=warm)
        return rigid_torque(nominal.model, motion), losses

    signals, (target_torque, losses) = dict[str, Array](), modelled(target)
    if nominal.torque_constant is not None:
        signals["target_current"] = (target_torque + losses) / nominal.torque_constant
    model_torque = sum(modelled(Reference(measured["q"], measured["dq"], target.ddq)))
    torque = measured["torque"] if K is None else measured["current"] * K
    spec = arm.scenario.sensing
    step = 1.0 / log_rate(spec, arm.robot)
    # A first-order low-pass, exact for an input held over the step.
    share, residual = -np.expm1(-2.0 * np.pi * spec.vendor_cutoff * step), torque - model_torque
    one = np.ones((1, residual.shape[1]))
    slow = (1.0 - share) * one[None], share * one
    residual, _ = steady_filter(*slow, residual, residual[:1], one)
    return signals | {
        "target_q": samples.target_q,
        "target_dq": samples.target_dq,
        "target_torque": target_torque,
        "tau_ext": -residual,
        "temperature": warm,
    }


def read_force_sensor(arm: Arm, samples: Samples, wrench: Array) -> Array | None:
    """Wrench about the sensor's origin in its axes, ON the robot. (M, 6) [N, N·m]

    Contacts, weight and inertia beyond it, offset, drift, noise; None without a sensor.
    """
    import pinocchio as pin

    spec = arm.scenario.force_sensor
    if spec is None:
        return None
    # Its own generator: a sensor changes no other signal's noise.
    rng = np.random.default_rng(arm.seeds["sensing"].spawn(1)[0])
    turn, tool = rpy_matrix(spec.rpy), np.array(spec.tool_com)
    model, clean = arm.true.chain.to_pinocchio(), np.zeros((len(samples.time), 6))
    flange = model.frames[model.getFrameId("flange")]
    # A frame in sensor axes at the centre of mass of what is beyond it.
    place = flange.placement * pin.SE3(turn, spec.position + turn @ tool)
    frame = model.addFrame(pin.Frame("tool", flange.parentJoint, place, pin.OP_FRAME))
    data = model.createData()
    for k, motion in enumerate(zip(samples.q, samples.v, samples.a, strict=True)):
        pin.forwardKinematics(model, data, *motion)
        back = pin.updateFramePlacement(model, data, frame).rotation.T
        moving = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL).linear
        weight = spec.tool_mass * (back @ model.gravity.linear - moving)
        force, moment = back @ wrench[k, :3], back @ wrench[k, 3:]
        clean[k, :3] = force + weight
        clean[k, 3:] = moment - np.cross(spec.position @ turn, force) + np.cross(tool, weight)
    noise = np.repeat([spec.noise_force, spec.noise_torque], 3)
    drift = np.repeat([spec.drift_force, spec.drift_torque], 3)
    reading: Array = clean + np.array(spec.bias) + np.outer(samples.time, drift)
    return reading + noise * rng.standard_normal(clean.shape)
