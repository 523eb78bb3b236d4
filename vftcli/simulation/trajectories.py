"""Commanded motions: smooth joint trajectories with exact first and second derivatives."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

import numpy as np

from vftcli.arrays import Array
from vftcli.errors import ParameterError
from vftcli.robots import Robot
from vftcli.simulation.kinematics import FlangePose, check_limits, flange_pose, follow

HARMONICS = 48
"""Harmonics kept of a periodic path; those of a circle fall below rounding long before."""

Vector = tuple[float, float, float]


class Reference(NamedTuple):
    """Commanded positions, velocities and accelerations. (T, n) each [rad, rad/s, rad/s²]"""

    q: Array
    dq: Array
    ddq: Array


class Motion(Protocol):
    """A commanded motion of known length."""

    @property
    def duration(self) -> float:
        """Its own length. [s]"""
        ...

    def at(self, t: Array) -> Reference:
        """The reference at times `t` (T,) [s]; before its start and after its end it rests."""
        ...


@dataclass(frozen=True, kw_only=True)
class Periodic:
    """Joint positions as a Fourier series in the phase 2πt/period.

    Attributes:
        period: Time of one round. [s]
        cycles: Rounds.
        mean: Mean positions. (n,) [rad]
        cosine: Cosine coefficients. (H, n) [rad]
        sine: Sine coefficients. (H, n) [rad]
    """

    period: float
    cycles: float
    mean: Array
    cosine: Array
    sine: Array

    @property
    def duration(self) -> float:
        """Its own length. [s]"""
        return self.period * self.cycles

    def at(self, t: Array) -> Reference:
        """The reference at times `t` (T,) [s]."""
        order = 2.0 * np.pi / self.period * np.arange(1, len(self.sine) + 1)
        c, s = np.cos(np.outer(t, order)), np.sin(np.outer(t, order))
        a, b, w = self.cosine, self.sine, order[:, None]
        return Reference(
            self.mean + c @ a + s @ b,
            c @ (w * b) - s @ (w * a),
            -(c @ (w**2 * a)) - s @ (w**2 * b),
        )


@dataclass(frozen=True, kw_only=True)
class Stretches:
    """Rest-to-rest stretches, each a path q(s) run through with minimum jerk, rests between them.

    Attributes:
        times: Start and end of each stretch, in order. (K, 2) [s]
        paths: Chebyshev coefficients of q over s in [−1, 1], one a stretch. (D, n) [rad]
        duration: Length with the rest at the end. [s]
    """

    times: Array
    paths: tuple[Array, ...]
    duration: float

    def at(self, t: Array) -> Reference:
        """The reference at times `t` (T,) [s]."""
        from numpy.polynomial import chebyshev

        t = np.asarray(t, dtype=float)
        which = np.clip(np.searchsorted(self.times[:, 0], t, side="right") - 1, 0, None)
        n = self.paths[0].shape[1]
        out = Reference(*(np.zeros((len(t), n)) for _ in range(3)))
        for k, path in enumerate(self.paths):
            rows = np.flatnonzero(which == k)
            length = float(self.times[k, 1] - self.times[k, 0])
            u = np.clip((t[rows] - self.times[k, 0]) / length, 0.0, 1.0)
            s, ds, dds = minimum_jerk(u, length)
            first, second = chebyshev.chebder(path), chebyshev.chebder(path, 2)
            x = 2.0 * s - 1.0
            slope = 2.0 * chebyshev.chebval(x, first).T
            curve = 4.0 * chebyshev.chebval(x, second).T
            out.q[rows] = chebyshev.chebval(x, path).T
            out.dq[rows] = slope * ds[:, None]
            out.ddq[rows] = slope * dds[:, None] + curve * (ds**2)[:, None]
        return out


def minimum_jerk(u: Array, length: float) -> tuple[Array, Array, Array]:
    """Way 10u³ − 15u⁴ + 6u⁵ from 0 to 1 over u in [0, 1], with its time derivatives."""
    way = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    speed = 30.0 * u**2 * (1.0 - u) ** 2 / length
    acceleration = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / length**2
    return way, speed, acceleration


def check_start(robot: Robot, start: tuple[float, ...]) -> Array:
    """Return a start pose as an array, or say that it has the wrong number of joints. (n,) [rad]"""
    if len(start) != robot.joints:
        raise ParameterError(
            f"trajectory.start has {len(start)} angles; robot {robot.name!r} has {robot.joints} "
            "joints"
        )
    return np.array(start, dtype=float)


@dataclass(frozen=True, kw_only=True)
class CircleSpec:
    """A horizontal circle of the flange at constant speed and orientation.

    Attributes:
        start: Joint positions at a point of the circle. (n,) [rad]
        radius: Radius. [m]
        period: Time of one round. [s]
        cycles: Rounds.
        towards: Direction from the start to the centre, from base x about base z. [rad]
    """

    KIND: ClassVar[str] = "circle"
    start: tuple[float, ...]
    radius: float = 0.2
    period: float = 4.0
    cycles: float = 5.0
    towards: float = 0.0

    def motion(self, robot: Robot) -> Motion:
        """Solve the circle for the joints of `robot`."""
        if self.radius <= 0 or self.period <= 0 or self.cycles <= 0:
            raise ParameterError("trajectory radius, period and cycles must be positive")
        start = check_start(robot, self.start)
        home = flange_pose(robot.model, start)
        count = 4 * HARMONICS
        angle = self.towards + np.pi + 2.0 * np.pi * np.arange(count) / count
        toward = np.array([np.cos(self.towards), np.sin(self.towards), 0.0])
        centre = home.translation + self.radius * toward
        ring = self.radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
        poses = [FlangePose(home.rotation, centre + offset) for offset in ring]
        q = follow(robot, [*poses, poses[0]], start, "the circle")
        closure = np.outer(np.arange(count) / count, q[-1] - q[0])
        if np.max(np.abs(closure)) > 1.0:
            raise ParameterError("the circle winds a joint up; choose another start or radius")
        series = np.fft.rfft(q[:-1], axis=0) / count
        return Periodic(
            period=self.period,
            cycles=self.cycles,
            mean=series[0].real,
            cosine=2.0 * series[1 : HARMONICS + 1].real,
            sine=-2.0 * series[1 : HARMONICS + 1].imag,
        )


@dataclass(frozen=True, kw_only=True)
class HoldSpec:
    """A held pose.

    Attributes:
        start: Joint positions. (n,) [rad]
        length: How long. [s]
    """

    KIND: ClassVar[str] = "hold"
    start: tuple[float, ...] = (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)
    length: float = 10.0

    def motion(self, robot: Robot) -> Motion:
        """The pose as a motion of no amplitude."""
        start = check_start(robot, self.start)
        return Stretches(
            times=np.array([[0.0, 1.0]]),
            paths=(np.vstack([start, 0.0 * start]),),
            duration=self.length,
        )


@dataclass(frozen=True, kw_only=True)
class OffsetsSpec:
    """Straight lines of the flange at constant orientation between stated points, at rest there.

    Attributes:
        start: Joint positions at the offset (0, 0, 0). (n,) [rad]
        moves: Rows (start time, end time, x, y, z): by the end time the flange is displaced from
            the start by (x, y, z) in base axes. [s, m]
        length: Length of the whole motion. [s]
    """

    KIND: ClassVar[str] = "offsets"
    start: tuple[float, ...]
    moves: tuple[tuple[float, float, float, float, float], ...]
    length: float

    def motion(self, robot: Robot) -> Motion:
        """Solve every line for the joints of `robot`."""
        from numpy.polynomial import chebyshev

        q = check_start(robot, self.start)
        home = flange_pose(robot.model, q)
        check_times([m[:2] for m in self.moves], self.length)
        before, paths = np.zeros(3), list[Array]()
        nodes = np.linspace(-1.0, 1.0, 33)
        for move in self.moves:
            after = np.array(move[2:])
            share = 0.5 * (nodes[:, None] + 1.0)
            points = home.translation + before + share * (after - before)
            line = follow(robot, [FlangePose(home.rotation, p) for p in points], q, "a move")
            paths.append(chebyshev.chebfit(nodes, line, 16))
            q, before = line[-1], after
        return Stretches(
            times=np.array([m[:2] for m in self.moves]), paths=tuple(paths), duration=self.length
        )


@dataclass(frozen=True, kw_only=True)
class PosesSpec:
    """Joint poses approached one after the other and held.

    Attributes:
        poses: Joint positions. (K, n) [rad]
        move: Time of each move. [s]
        dwell: Rest at each pose. [s]
    """

    KIND: ClassVar[str] = "poses"
    poses: tuple[tuple[float, ...], ...]
    move: float = 3.0
    dwell: float = 2.0

    def motion(self, robot: Robot) -> Motion:
        """Straight joint-space moves between the poses."""
        if self.move <= 0 or self.dwell < 0 or not self.poses:
            raise ParameterError("trajectory.move must be positive, and there must be poses")
        points = [check_start(robot, pose) for pose in self.poses]
        starts = self.dwell + np.arange(max(len(points) - 1, 1)) * (self.move + self.dwell)
        pairs = list(zip(points[:-1], points[1:], strict=True)) or [(points[0], points[0])]
        return Stretches(
            times=np.column_stack([starts, starts + self.move]),
            paths=tuple(np.vstack([0.5 * (a + b), 0.5 * (b - a)]) for a, b in pairs),
            duration=float(starts[-1] + self.move + self.dwell),
        )


@dataclass(frozen=True, kw_only=True)
class JointwiseSpec:
    """One joint at a time swept back and forth at several speeds, the others at rest.

    Attributes:
        start: Joint positions at the middle of the sweeps. (n,) [rad]
        amplitude: Sweep to each side. [rad]
        speeds: Mean speeds of the sweeps. [rad/s]
        joints: Joints swept, from 1; empty for all.
        rest: Rest between sweeps. [s]
    """

    KIND: ClassVar[str] = "jointwise"
    start: tuple[float, ...]
    amplitude: float = 0.4
    speeds: tuple[float, ...] = (0.1, 0.2, 0.4, 0.7)
    joints: tuple[int, ...] = ()
    rest: float = 0.3

    def motion(self, robot: Robot) -> Motion:
        """Each sweep as a pair of minimum-jerk moves out and back."""
        start = check_start(robot, self.start)
        joints = self.joints or tuple(range(1, robot.joints + 1))
        if min(self.speeds, default=0.0) <= 0 or not all(1 <= j <= robot.joints for j in joints):
            raise ParameterError(
                f"trajectory.speeds must be positive and joints lie in 1 to {robot.joints}"
            )
        t, times, paths = self.rest, [], []
        for joint in joints:
            axis = np.eye(robot.joints)[joint - 1] * self.amplitude
            for speed in self.speeds:
                legs = [(0 * axis, axis), (axis, -axis), (-axis, 0 * axis)]
                for a, b in legs:
                    length = max(float(np.sum(np.abs(b - a))) / speed, 0.2)
                    times.append((t, t + length))
                    paths.append(np.vstack([start + 0.5 * (a + b), 0.5 * (b - a)]))
                    t += length
                t += self.rest
        return Stretches(times=np.array(times), paths=tuple(paths), duration=t)


@dataclass(frozen=True, kw_only=True)
class ExcitationSpec:
    """A persistently exciting Fourier trajectory; the built-in ones are optimised for a robot.

    Attributes:
        period: Time of one round; 0 takes the optimised one. [s]
        cycles: Rounds.
        mean: Mean positions; empty takes the optimised ones. (n,) [rad]
        cosine: Cosine coefficients, one row a harmonic. (H, n) [rad]
        sine: Sine coefficients. (H, n) [rad]
    """

    KIND: ClassVar[str] = "excitation"
    period: float = 0.0
    cycles: float = 2.0
    mean: tuple[float, ...] = ()
    cosine: tuple[tuple[float, ...], ...] = ()
    sine: tuple[tuple[float, ...], ...] = ()

    def motion(self, robot: Robot) -> Motion:
        """The stated series, or the one optimised for `robot`."""
        if not self.mean:
            from vftcli.simulation.excitation import optimised

            best = optimised(robot.name)
            period = self.period or best.period
            return Periodic(
                period=period,
                cycles=self.cycles,
                mean=best.mean,
                cosine=best.cosine,
                sine=best.sine,
            )
        check_start(robot, self.mean)
        shape = (len(self.cosine), robot.joints)
        cosine, sine = np.array(self.cosine), np.array(self.sine)
        if cosine.shape != shape or sine.shape != shape or self.period <= 0:
            raise ParameterError(
                "trajectory.cosine and trajectory.sine must have one row a harmonic and one "
                "number a joint, and trajectory.period must be positive"
            )
        return Periodic(
            period=self.period,
            cycles=self.cycles,
            mean=np.array(self.mean),
            cosine=cosine,
            sine=sine,
        )


TrajectorySpec = CircleSpec | HoldSpec | OffsetsSpec | PosesSpec | JointwiseSpec | ExcitationSpec


def check_times(times: list[tuple[float, float]], length: float) -> None:
    """Raise unless moves follow one another inside the motion's length."""
    flat = np.array(times, dtype=float).ravel()
    good = len(flat) > 0 and flat[0] >= 0 and flat[-1] <= length
    if not good or np.any(np.diff(flat) < 0) or np.any(np.diff(flat)[::2] <= 0):
        raise ParameterError(
            "trajectory.moves must have times that increase and lie inside trajectory.length"
        )


def plan(spec: TrajectorySpec, robot: Robot, t: Array) -> Reference:
    """Return the reference of a trajectory at times `t`, inside the robot's limits.

    Raises:
        ParameterError: If it leaves the workspace or the limits.
    """
    reference = spec.motion(robot).at(t)
    check_limits(robot, reference.q, reference.dq, f"trajectory {spec.KIND!r}")
    return reference
