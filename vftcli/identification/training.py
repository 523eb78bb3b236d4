"""Training data: logs filtered alike, friction as columns, joints that move."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise, starmap
from typing import NamedTuple

import numpy as np

from vftcli.identification.shapes import Shape, term_values
from vftcli.robots.chain import Chain
from vftcli.robots.friction import RunningFriction, friction_factor, measured_temperature, play
from vftcli.robots.kernels import INERTIAL_NAMES, LINK, chain_parameters, torque_regressor
from vftcli.robots.robot import Robot
from vftcli.robots.terms import drive_torque, effort_name, gravity_torque
from vftcli.signals.arrays import Array, Indices, Mask, covered, gaps_of, intervals, median_step
from vftcli.signals.errors import IdentificationError
from vftcli.signals.filters import STEEP, derivative, zero_phase
from vftcli.signals.recording import Recording
from vftcli.signals.rest import MOVES, NONZERO, faster

#: Cutoff of the zero-phase low-pass, −3 dB a pass; the used band ends there. [Hz]
CUTOFF = 8.0
#: Samples kept per period of the cutoff when the filtered log is decimated.
OVERSAMPLING = 6.0
STOP = 0.3  #: Length of a stop that identifies nothing, by stiction. [s]
STATIC = 4  #: A link's parameters that gravity shows.
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
    """Stride of the kept samples of the filtered log."""
    return max(1, int(1.0 / (step * OVERSAMPLING * cutoff) + 1e-9))


ENOUGH = 1.0  #: Least time of a joint's motion, a tenth of it each way. [s]


@dataclass(frozen=True, kw_only=True)
class PreparedLog:
    """A prepared log: M samples from first to last motion."""

    recording: Recording  #: The log.
    robot: Robot  #: The arm with its model.
    cutoff: float  #: Cutoff of its filter. [Hz]
    kept: Indices  #: Numbers of these samples in the log. (M,)
    t: Array  #: Time. (M,) [s]
    q: Array  #: Positions. (M, n) [rad]
    dq: Array  #: Velocities. (M, n) [rad/s]
    ddq: Array  #: Accelerations. (M, n) [rad/s²]
    tau: Array  #: Drive torque, friction included. (M, n) [N·m]
    #: Weights, 0 in a joint's long stops, in gaps, in a contact. (M, n)
    weights: Array
    #: Friction columns that were made for this robot. (M,) each
    columns: dict[tuple[str, int, tuple[float, ...]], Array] = field(default_factory=dict)

    @property
    def samples(self) -> int:
        """Number of kept samples M; 0 without motion."""
        return len(self.t)

    def with_robot(self, robot: Robot) -> "PreparedLog":
        """This log with another arm's model."""
        return replace(self, robot=robot, columns={})

    def filtered(self, signals: Array) -> Array:
        """Kept samples of filtered signals (T, m). (M, m)"""
        return zero_phase(self.recording.t, signals, self.cutoff)[self.kept]

    def chunks(self) -> Iterator[slice]:
        """Spans of 1024 samples, as a regressor needs much memory."""
        for start in range(0, self.samples, 1024):
            yield slice(start, start + 1024)

    @cached_property
    def load(self) -> Array:
        """Absolute gravity torque along the whole log. (T, n) [N·m]"""
        return abs(gravity_torque(self.robot, self.recording.q))

    @cached_property
    def warmth(self) -> Array | None:
        """Factor on each joint's friction by temperature, or None. (T, n)"""
        temperature = measured_temperature(self.recording)
        return None if temperature is None else friction_factor(self.robot.friction, temperature)

    @cached_property
    def rigid(self) -> Array:
        """Rigid-body torque of the loaded arm, without rotors. (M, n) [N·m]"""
        chain, phi = self.robot.chain, chain_parameters(self.robot.loaded_chain)
        out = np.empty(self.q.shape)
        for s in self.chunks():
            out[s] = torque_regressor(chain, self.q[s], self.dq[s], self.ddq[s]) @ phi
        return out

    @cached_property
    def predicted(self) -> Array:
        """Drive torque by the robot's model, filtered friction. (M, n) [N·m]"""
        robot, log = self.robot, self.recording
        torque = self.rigid + robot.chain.rotor_inertia * self.ddq
        if not robot.friction:
            return torque
        load, temperature = gravity_torque(robot, log.q), measured_temperature(log)
        friction = RunningFriction(robot.friction)
        losses = friction.torque(log.q, log.require("dq"), load, temperature)
        return torque + self.filtered(losses)

    def column(self, term: str, j: int, shape: Shape) -> Array:
        """One filtered friction term of joint j (from 0). (M,)"""
        # The key holds only the term's own numbers: shapes share columns.
        numbers = {
            **dict.fromkeys(("coulomb", "load_coulomb"), (shape.smoothing,)),
            "stribeck": (shape.smoothing, shape.stribeck_velocity),
            "logarithmic": (shape.logarithmic_velocity,),
            "presliding": (shape.presliding_length,),
            **dict.fromkeys(shape.points, (shape.smoothing, *shape.speeds)),
        }
        key = (term, j, numbers.get(term, ()))
        if key not in self.columns:
            log = self.recording
            if term == "presliding":
                values = play(log.q[:, j : j + 1], shape.presliding_length).state[:, 0]
            else:
                values = term_values(term, shape, log.require("dq")[:, j], self.load[:, j])
            if self.warmth is not None and term != "offset":
                values = values * self.warmth[:, j]
            self.columns[key] = self.filtered(values[:, None])[:, 0]
        return self.columns[key]

    def friction(self, j: int, shape: Shape) -> Array:
        """A shape's terms for joint j (from 0), a column each. (M, k)"""
        columns = [self.column(term, j, shape) for term in shape.terms]
        return np.stack(columns, axis=1) if columns else np.zeros((self.samples, 0))


def prepare(recording: Recording, robot: Robot, cutoff: float = CUTOFF) -> PreparedLog:
    """Filter, differentiate and decimate a log, one column at a time."""
    torque, dq = drive_torque(recording, robot), recording.require("dq")
    t, each = recording.t, stride(cutoff, recording.median_step)
    # Stiction before the first and after the last movement.
    moving = np.flatnonzero(faster(dq, NONZERO).any(axis=1))
    kept = np.arange(moving[0], moving[-1] + 1, each) if moving.size else np.arange(0)

    signals = np.empty((4, len(kept), recording.joints))
    for j in range(recording.joints):
        q, v, tau = (zero_phase(t, x[:, [j]], cutoff) for x in (recording.q, dq, torque))
        signals[:, :, [j]] = [x[kept] for x in (q, v, derivative(t, v), tau)]
    q, velocities, ddq, tau = signals
    return PreparedLog(
        recording=recording,
        robot=robot,
        cutoff=cutoff,
        kept=kept,
        t=t[kept],
        q=q,
        dq=velocities,
        ddq=ddq,
        tau=tau,
        weights=usable_samples(t, dq, cutoff)[kept].astype(float),
    )


def usable_samples(t: Array, dq: Array, cutoff: float) -> Mask:
    """Samples beside long stops and gaps, by joint. (T, n)"""
    usable = np.ones(dq.shape, bool)
    for j, moves in enumerate(faster(dq, NONZERO).T):
        usable[:, j] = ~covered(intervals(t, ~moves, least=STOP), len(t))
    # The filter spreads a gap by half a period of its cutoff.
    margin = 0.5 / cutoff
    for k in gaps_of(t, GAP):
        usable[(t > t[k] - margin) & (t < t[k + 1] + margin)] = False
    return usable


def load_columns(robot: Robot, q: Array, dq: Array, ddq: Array) -> Array:
    """Torque of mass and first moments in the last link's frame. (N, n, 4)"""
    return torque_regressor(robot.chain, q, dq, ddq)[:, :, -LINK : STATIC - LINK]


def apparent_load(log: PreparedLog, residual: Array) -> tuple[float, float]:
    """Mass [kg] that explains a residual best, and the share explained."""
    signals = ((log.q[s], log.dq[s], log.ddq[s]) for s in log.chunks())
    A = np.concatenate([load_columns(log.robot, *part).reshape(-1, STATIC) for part in signals])
    y = residual.ravel()
    x = np.linalg.lstsq(A, y, rcond=1e-6)[0]
    return x[0], 1.0 - np.sum((y - A @ x) ** 2) / max(np.sum(y**2), 1e-12)


class ParameterColumns(NamedTuple):
    """Order of all unknowns: inertial, rotor inertias, friction."""

    chain: Chain  #: The arm's geometry.
    rotor: bool  #: Whether rotor inertias are unknown.
    shapes: tuple[Shape, ...]  #: Friction structure of each joint.

    @property
    def inertial(self) -> int:
        """Number of inertial unknowns: ten a link, first in the vector."""
        return LINK * self.chain.joints

    @property
    def rotor_places(self) -> slice:
        """Places of the rotor inertias, next; none behind the gear."""
        return slice(self.inertial, self.inertial + self.rotor * self.chain.joints)

    @property
    def frictions(self) -> tuple[slice, ...]:
        """Places of each joint's friction coefficients, behind the rotors."""
        edges = np.cumsum([self.rotor_places.stop, *(len(s.terms) for s in self.shapes)])
        return tuple(starmap(slice, pairwise(edges.tolist())))

    @property
    def size(self) -> int:
        """Length of the vector of unknowns."""
        return int(self.frictions[-1].stop)

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each unknown: m2, mx3, Ixx1, J4, coulomb5 …"""
        n = self.chain.joints
        inertial = [f"{name}{j}" for j in range(1, n + 1) for name in INERTIAL_NAMES]
        rotors = [f"J{j}" for j in range(1, self.rotor * n + 1)]
        terms = [f"{t}{j}" for j, s in enumerate(self.shapes, start=1) for t in s.terms]
        return (*inertial, *rotors, *terms)

    def rows(self, log: PreparedLog, span: slice) -> Array:
        """Regressor A of a span: A x is the drive torque. (N, n, size)"""
        q, dq, ddq = log.q[span], log.dq[span], log.ddq[span]
        A = np.zeros((len(q), self.chain.joints, self.size))
        A[:, :, : self.inertial] = torque_regressor(self.chain, q, dq, ddq)
        for j, (shape, place) in enumerate(zip(self.shapes, self.frictions, strict=True)):
            if self.rotor:
                A[:, j, self.inertial + j] = ddq[:, j]
            A[:, j, place] = log.friction(j, shape)[span]
        return A


class Training(NamedTuple):
    """The training logs, prepared."""

    robot: Robot  #: The profile.
    recordings: tuple[Recording, ...]  #: The logs.
    logs: tuple[PreparedLog, ...]  #: Those that move, filtered and decimated.
    moves: Mask  #: Joints that move at all. (n,)
    reverses: Mask  #: Joints that move both ways. (n,)
    #: Whether drive constants are unknowns of the friction method.
    fit_constants: bool = False
    rubs: bool = True  #: Whether the joints have friction to be fitted.

    @property
    def rotor(self) -> bool:
        """Whether torque accelerates the rotor too, before the gear."""
        return self.robot.torque_source != "link_torque"

    def joined(self, name: str) -> Array:
        """A signal of all logs, one after the other. (M, n)"""
        return np.concatenate([getattr(log, name) for log in self.logs])

    def top_speed(self, j: int) -> float:
        """Speed limit of joint j (from 0), else its fastest motion. [rad/s]"""
        return float(np.fmax(self.robot.limits.qd_max[j], abs(self.joined("dq")[:, j]).max()))


def prepare_training(
    recordings: Sequence[Recording],
    robot: Robot,
    cutoff: float = CUTOFF,
    fit_constants: bool = False,
    rubs: bool = True,
) -> Training:
    """Training data of a profile's logs, of joints that rub or not."""
    motions = [prepare(recording, robot, cutoff) for recording in recordings]
    if fit_constants and any(effort_name(r, robot) != "current" for r in recordings):
        raise IdentificationError(
            "--set identify.constants=yes needs motor currents; the logs have torques. Leave it out"
        )
    moves, reverses = moving_joints(motions)
    return Training(
        robot=robot,
        recordings=tuple(recordings),
        logs=tuple(motion for motion in motions if motion.samples > 1),
        moves=moves,
        reverses=reverses,
        fit_constants=fit_constants,
        rubs=rubs,
    )


def moving_joints(motions: Sequence[PreparedLog]) -> tuple[Mask, Mask]:
    """Joints that the logs move, and move both ways. (n,), (n,)"""
    times = np.zeros((2, motions[0].dq.shape[1]))
    for motion in motions:
        if motion.samples > 1:
            ways = np.count_nonzero([motion.dq > MOVES, motion.dq < -MOVES], axis=1)
            times += median_step(motion.t) * ways
    moves = times.sum(axis=0) >= ENOUGH
    if not moves.any():
        names = ", ".join(m.recording.name for m in motions)
        raise IdentificationError(
            f"{names}: no joint moves faster than {MOVES:g} rad/s for {ENOUGH:g} s; a log at rest "
            "identifies no friction and no inertia. Record free motion, or use --method "
            "payload on static poses"
        )
    # A tenth back separates the sign of friction from an offset.
    return moves, times.min(axis=0) >= 0.1 * ENOUGH
