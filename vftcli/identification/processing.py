"""A log's torques for identification: filtered alike, without delay."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vftcli.robots.kernels import momentum_terms
from vftcli.robots.regressor import LINK, chain_parameters, torque_regressor
from vftcli.robots.robot import Robot
from vftcli.robots.running_friction import RunningFriction, measured_temperature
from vftcli.robots.terms import drive_torque
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.filters import STEEP, derivative, zero_phase
from vftcli.signals.recording import Recording
from vftcli.signals.rest import NONZERO, faster
from vftcli.signals.series import covered, gaps_of, intervals

#: Cutoff of the zero-phase low-pass, −3 dB a pass; the band that is used ends there. [Hz]
CUTOFF = 8.0
#: Samples kept per period of the cutoff when the filtered log is decimated.
OVERSAMPLING = 6.0
STOP = 0.3  #: Length of a stop from which on it identifies nothing, because of stiction. [s]
STATIC = 4  #: Parameters of a link that gravity shows: mass, three first moments.
GAP = 10.0  #: Steps longer than this many median steps are left out.


def settings_record(cutoff: float, step: float) -> dict[str, str | float]:
    """The filter's settings for the robot file and `run.json`."""
    return {
        "filter": f"Butterworth order {STEEP}, forwards and backwards (zero phase)",
        "cutoff_hz": cutoff,
        "band_hz": f"0 to {cutoff:g}",
        "differentiation": "central differences of the filtered velocity on the log's clock; "
        "positions are never differentiated",
        "decimation": float(stride(cutoff, step)),
        "kept_rate_hz": round(1.0 / (step * stride(cutoff, step)), 6),
        "scored_span": f"first to last sample with |dq| > {NONZERO:g} rad/s",
    }


def stride(cutoff: float, step: float) -> int:
    """Every how many samples of the filtered log are kept."""
    return max(1, int(1.0 / (step * OVERSAMPLING * cutoff) + 1e-9))


@dataclass(frozen=True, kw_only=True)
class PreparedLog:
    """A log prepared for identification: M samples from first to last motion."""

    recording: Recording  #: The log.
    cutoff: float  #: Cutoff of its filter, one for all parts of a joint's torque. [Hz]
    kept: NDArray[np.int64]  #: Numbers of these samples in the log. (M,)
    t: Array  #: Time. (M,) [s]
    q: Array  #: Positions. (M, n) [rad]
    dq: Array  #: Velocities. (M, n) [rad/s]
    ddq: Array  #: Accelerations. (M, n) [rad/s²]
    tau: Array  #: Drive torque, friction included. (M, n) [N·m]
    #: Whether a sample of a joint tells anything: the joint is not in a long stop and the sample
    #: lies in no gap of the clock. (M, n)
    usable: Mask

    @property
    def samples(self) -> int:
        """Number of samples M that were kept; 0 where nothing moves."""
        return len(self.t)

    def filtered(self, signals: Array) -> Array:
        """Filter signals on the log's whole clock (T, m) and keep what is kept. (M, m)"""
        recording = self.recording
        columns = [
            zero_phase(recording.t, column[:, None], self.cutoff)[self.kept] for column in signals.T
        ]
        return np.concatenate(columns, axis=1)

    def chunks(self, size: int = 1024) -> Iterator[slice]:
        """Spans of `size` samples: a whole log's regressor would not fit into memory."""
        for start in range(0, self.samples, size):
            yield slice(start, min(start + size, self.samples))


def prepare(recording: Recording, robot: Robot, cutoff: float = CUTOFF) -> PreparedLog:
    """Filter, differentiate and decimate a log, one column at a time."""
    torque, dq = drive_torque(recording, robot), recording.require("dq")
    t, each = recording.t, stride(cutoff, recording.median_step)
    # Before the first and after the last movement stiction holds what no model of velocity knows.
    moving = np.flatnonzero(faster(dq, NONZERO).any(axis=1))
    kept = np.arange(moving[0], moving[-1] + 1, each) if moving.size else np.arange(0)

    def smooth(signal: Array) -> Array:
        return zero_phase(t, signal[:, None], cutoff)

    joints = []
    for position, speed, effort in zip(recording.q.T, dq.T, torque.T, strict=True):
        velocity = smooth(speed)
        signals = smooth(position), velocity, derivative(t, velocity), smooth(effort)
        joints.append([signal[kept] for signal in signals])
    q, velocities, ddq, tau = (np.concatenate(x, axis=1) for x in zip(*joints, strict=True))
    usable = usable_samples(t, dq, cutoff)[kept]
    return PreparedLog(
        recording=recording,
        cutoff=cutoff,
        kept=kept,
        t=t[kept],
        q=q,
        dq=velocities,
        ddq=ddq,
        tau=tau,
        usable=usable,
    )


def usable_samples(t: Array, dq: Array, cutoff: float) -> Mask:
    """Samples with information, by joint: no long stop, no gap beside. (T, n)"""
    usable = np.ones(dq.shape, dtype=bool)
    for j, moves in enumerate(faster(dq, NONZERO).T):
        usable[:, j] = ~covered(intervals(t, ~moves, least=STOP), len(t))
    # What the filter makes of a gap reaches half a period of its cutoff to either side.
    margin = 0.5 / cutoff
    for k in gaps_of(t, GAP):
        usable[(t > t[k] - margin) & (t < t[k + 1] + margin)] = False
    return usable


def gravity_torque(robot: Robot, q: Array) -> Array:
    """Gravity torques of the loaded arm. (T, n) [N·m]"""
    return momentum_terms(robot.loaded_chain, q, np.zeros_like(q)).gravity


def rigid_torque(robot: Robot, motion: PreparedLog) -> Array:
    """Rigid-body torque of the loaded arm, without rotors. (M, n) [N·m]"""
    phi = chain_parameters(robot.loaded_chain)
    out = np.empty(motion.q.shape)
    for span in motion.chunks():
        state = motion.q[span], motion.dq[span], motion.ddq[span]
        out[span] = torque_regressor(robot.chain, *state) @ phi
    return out


def predicted_torque(robot: Robot, motion: PreparedLog) -> Array:
    """Drive torque by the robot's model, friction filtered like the log. (M, n) [N·m]"""
    torque = rigid_torque(robot, motion) + robot.chain.rotor_inertia * motion.ddq
    if not robot.friction:
        return torque
    log, friction = motion.recording, RunningFriction(robot.friction)
    load, temperature = gravity_torque(robot, log.q), measured_temperature(log)
    losses = friction.torque(log.q, log.require("dq"), load, temperature)
    total: Array = torque + motion.filtered(losses)
    return total


def load_columns(robot: Robot, q: Array, dq: Array, ddq: Array) -> Array:
    """Torque of mass and first moments in the last link's frame. (N, n, 4)"""
    return torque_regressor(robot.chain, q, dq, ddq)[:, :, -LINK:][:, :, :STATIC]


def root_mean_square(x: Array) -> Array:
    """Root mean square of each column of x (M, n), in its unit. (n,)"""
    value: Array = np.sqrt(np.mean(x**2, axis=0))
    return value
