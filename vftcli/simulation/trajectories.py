"""The kinds of ``[trajectory]``: commanded joint motions with exact derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, NamedTuple, TypeVar, dataclass_transform

import numpy as np

from vftcli.robots.robot import FlangeSolver, Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError

#: Harmonics kept of a periodic path; those of a circle fall below rounding long before.
HARMONICS = 48
#: A pose counts as reached when position and rotation error are below this. [m, rad]
REACHED = 1e-10
#: Joints → a pose for work, the flange looking down. [rad]
HOMES: dict[int, tuple[float, ...]] = {
    6: (0.0, -1.35, 1.9, -2.1208, -1.5708, 0.0),
    7: (0.0, -0.7854, 0.0, -2.3562, 0.0, 1.5708, 0.7854),
}
Number = TypeVar("Number", float, Array)


class Reference(NamedTuple):
    """Commanded positions, velocities, accelerations (T, n) [rad, rad/s, rad/s²]"""

    q: Array
    dq: Array
    ddq: Array


@dataclass(frozen=True)
class Periodic:
    """Joint positions as a Fourier series in the phase 2πt/period."""

    period: float  #: Time of one round. [s]
    cycles: float  #: Rounds.
    mean: Array  #: Mean positions. (n,) [rad]
    cosine: Array  #: Cosine coefficients. (H, n) [rad]
    sine: Array  #: Sine coefficients. (H, n) [rad]

    @property
    def duration(self) -> float:
        """Time of all rounds. [s]"""
        return self.period * self.cycles

    def at(self, t: Array) -> Reference:
        """The series and its two derivatives at times `t` (T,) [s]."""
        order = 2.0 * np.pi / self.period * np.arange(1, len(self.sine) + 1)
        c, s = np.cos(np.outer(t, order)), np.sin(np.outer(t, order))
        a, b, w = self.cosine, self.sine, order[:, None]
        return Reference(
            self.mean + c @ a + s @ b,
            c @ (w * b) - s @ (w * a),
            -(c @ (w**2 * a)) - s @ (w**2 * b),
        )


@dataclass(frozen=True)
class Stretches:
    """Rest-to-rest paths q(s) with minimum jerk, with rests between them."""

    times: Array  #: Start and end of each stretch, in order. (K, 2) [s]
    #: Chebyshev coefficients of q over s in [−1, 1], one a stretch. (D, n) [rad]
    paths: tuple[Array, ...]
    duration: float  #: Length with the rest at the end. [s]

    def at(self, t: Array) -> Reference:
        """Reference at times `t` (T,) [s]; between stretches the motion rests."""
        from numpy.polynomial import chebyshev

        t = np.asarray(t, float)
        which = np.clip(self.times[:, 0].searchsorted(t, side="right") - 1, 0, None)
        n = self.paths[0].shape[1]
        out = Reference(*np.zeros((3, len(t), n)))
        for k, path in enumerate(self.paths):
            rows = np.flatnonzero(which == k)
            length = self.times[k, 1] - self.times[k, 0]
            u = np.clip((t[rows] - self.times[k, 0]) / length, 0.0, 1.0)
            s = minimum_jerk(u)
            ds = 30.0 * u**2 * (1.0 - u) ** 2 / length
            dds = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / length**2
            first, second = chebyshev.chebder(path), chebyshev.chebder(path, 2)
            x = 2.0 * s - 1.0
            slope = 2.0 * chebyshev.chebval(x, first).T
            curve = 4.0 * chebyshev.chebval(x, second).T
            out.q[rows] = chebyshev.chebval(x, path).T
            out.dq[rows] = slope * ds[:, None]
            out.ddq[rows] = slope * dds[:, None] + curve * (ds**2)[:, None]
        return out


#: A commanded motion of known length: what every ``[trajectory]`` becomes.
Command = Periodic | Stretches


def straight_paths(points: Sequence[Array]) -> tuple[Array, ...]:
    """Paths of `Stretches` from each of the points (n,) [rad] to the next."""
    return tuple(np.vstack([0.5 * (a + b), 0.5 * (b - a)]) for a, b in pairwise(points))


def minimum_jerk(u: Number) -> Number:
    """The way 10u³ − 15u⁴ + 6u⁵ from 0 to 1 over u in [0, 1]."""
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


@dataclass_transform(frozen_default=True, kw_only_default=True)
class Spec:
    """A section of a scenario, a frozen dataclass; of one kind if there are several."""

    kind: ClassVar[str]

    def __init_subclass__(cls, kind: str = "") -> None:
        cls.kind = kind
        dataclass(frozen=True, kw_only=True)(cls)


class CircleSpec(Spec, kind="circle"):
    """A horizontal circle of the flange at constant speed and orientation."""

    #: Joint positions at a point of the circle; empty takes the usual pose. (n,) [rad]
    start: tuple[float, ...] = ()
    radius: float = 0.2  #: Radius. [m]
    period: float = 4.0  #: Time of one round. [s]
    cycles: float = 5.0  #: Rounds.
    #: Direction from the start to the centre, from base x about base z. [rad]
    towards: float = 0.0

    def motion(self, robot: Robot) -> Command:
        """The circle as a Fourier series of the joints."""
        if self.radius <= 0 or self.period <= 0 or self.cycles <= 0:
            raise ParameterError("trajectory radius, period and cycles must be positive")
        start = check_start(robot, self.start)
        count = 4 * HARMONICS
        angle = self.towards + np.pi + 2.0 * np.pi / count * np.arange(count + 1)
        toward = np.array([np.cos(self.towards), np.sin(self.towards), 0.0])
        ring = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
        q = follow(robot, start, self.radius * (toward + ring), "the circle")
        if abs(q[-1] - q[0]).max() > 1.0:
            raise ParameterError("the circle winds a joint up; choose another start or radius")
        mean, *series = np.fft.rfft(q[:-1], axis=0)[: HARMONICS + 1] / count
        cosine, sine = 2.0 * np.real(series), -2.0 * np.imag(series)
        return Periodic(self.period, self.cycles, mean.real, cosine, sine)


class HoldSpec(Spec, kind="hold"):
    """A held pose."""

    start: tuple[float, ...] = ()  #: Joint positions. (n,) [rad]
    length: float = 10.0  #: How long. [s]

    def motion(self, robot: Robot) -> Command:
        """A motion that stays at the pose, by default the usual one."""
        points = [check_start(robot, self.start)] * 2
        return Stretches(np.array([[0.0, 1.0]]), straight_paths(points), self.length)


class OffsetsSpec(Spec, kind="offsets"):
    """Straight lines of the flange between stated points, at constant orientation."""

    #: Rows (start, end, x, y, z), base axes: displaced from the start by the end. [s, m]
    moves: tuple[tuple[float, float, float, float, float], ...]
    length: float  #: Length of the whole motion. [s]
    start: tuple[float, ...] = ()  #: Joint positions at the offset (0, 0, 0). (n,) [rad]

    def motion(self, robot: Robot) -> Command:
        """Each line as a polynomial path of the joints, with minimum jerk."""
        from numpy.polynomial import chebyshev

        q = check_start(robot, self.start)
        times = np.array([m[:2] for m in self.moves])
        check_times(times, self.length)
        before, paths = np.zeros(3), list[Array]()
        nodes = np.linspace(-1.0, 1.0, 33)
        for move in self.moves:
            after = np.array(move[2:])
            share = 0.5 * (nodes[:, None] + 1.0)
            line = follow(robot, q, share * (after - before), "a move")
            paths.append(np.asarray(chebyshev.chebfit(nodes, line, 16), float))
            q, before = line[-1], after
        return Stretches(times, tuple(paths), self.length)


class JointMovesSpec(Spec, kind="joint-moves"):
    """Straight moves in joint space between stated displacements from the start."""

    #: Rows (start, end, one displacement a joint), reached by the end, then rest. [s, rad]
    moves: tuple[tuple[float, ...], ...]
    length: float  #: Length of the whole motion. [s]
    start: tuple[float, ...] = ()  #: Joint positions at no displacement. (n,) [rad]

    def motion(self, robot: Robot) -> Command:
        """The moves, straight in joint space and with minimum jerk."""
        start = check_start(robot, self.start)
        if any(len(row) != 2 + robot.joints for row in self.moves):
            raise ParameterError(
                f"trajectory.moves must have rows of two times and {robot.joints} displacements"
            )
        times = np.array([row[:2] for row in self.moves])
        check_times(times, self.length)
        points = [start, *(start + np.array(row[2:]) for row in self.moves)]
        return Stretches(times, straight_paths(points), self.length)


class ExcitationSpec(Spec, kind="excitation"):
    """A Fourier series of the joints."""

    period: float = 10.0  #: Time of one round. [s]
    cycles: float = 2.0  #: Rounds.
    mean: tuple[float, ...]  #: Mean positions. (n,) [rad]
    #: Cosine coefficients, one row a harmonic. (H, n) [rad]
    cosine: tuple[tuple[float, ...], ...]
    sine: tuple[tuple[float, ...], ...]  #: Sine coefficients. (H, n) [rad]

    def motion(self, robot: Robot) -> Command:
        """The series, if its lengths are those of the arm's joints."""
        sizes = {len(row) for row in (self.mean, *self.cosine, *self.sine)}
        if sizes != {robot.joints} or len(self.cosine) != len(self.sine) or self.period <= 0:
            raise ParameterError(
                f"trajectory.mean and each row of cosine and sine must have {robot.joints} "
                f"numbers, one per joint of {robot.name!r}, cosine and sine as many rows, and "
                "trajectory.period must be positive"
            )
        series = (np.array(part) for part in (self.mean, self.cosine, self.sine))
        return Periodic(self.period, self.cycles, *series)


TrajectorySpec = CircleSpec | HoldSpec | OffsetsSpec | JointMovesSpec | ExcitationSpec


def check_times(times: Array, length: float) -> None:
    """Raise unless moves (K, 2) [s] follow one another inside the motion's length."""
    flat = times.ravel()
    good = len(flat) > 0 and flat[0] >= 0 and flat[-1] <= length
    if not good or np.any(np.diff(flat) < 0) or np.any(np.diff(flat)[::2] <= 0):
        raise ParameterError(
            "trajectory.moves must have times that increase and lie inside trajectory.length"
        )


def plan(spec: TrajectorySpec, robot: Robot, t: Array) -> Reference:
    """The reference of a trajectory at times `t` [s]; it stays inside the robot's limits."""
    motion, limits = spec.motion(robot).at(t), robot.limits
    each = zip(motion.q.T, motion.dq.T, limits.q_min, limits.q_max, limits.qd_max, strict=True)
    for j, (place, speed, low, high, most) in enumerate(each, start=1):
        joint = f"trajectory {spec.kind!r}: joint {j} of {robot.name!r}"
        if place.min() < low or place.max() > high:
            raise ParameterError(
                f"{joint} would move over {place.min():.3f} to {place.max():.3f} rad; its limits "
                f"are {low:.3f} to {high:.3f}"
            )
        if (fastest := abs(speed).max()) > most:
            raise ParameterError(
                f"{joint} would move at {fastest:.2f} rad/s; its limit is {most:.2f}"
            )
    return motion


def follow(robot: Robot, start: Array, offsets: Array, what: str) -> Array:
    """Joint positions along flange points (K, 3) [m] about the start's. (K, n) [rad]

    The flange keeps its orientation at the start (n,) [rad]. Each is found from the last one.
    """
    solver, q, path = FlangeSolver(robot, REACHED, limited=False), start, list[Array]()
    rotation, origin = solver.pose(start)
    for k, point in enumerate(origin + offsets):
        last, (q, good) = q, solver.reach(rotation, point, q)
        # A jump of a radian is another branch of the inverse kinematics.
        if not good or abs(q - last).max() > 1.0:
            place = ", ".join(f"{value:.3f}" for value in point)
            raise ParameterError(
                f"{what}: the flange of {robot.name!r} cannot reach ({place}) m (point {k + 1} of "
                f"{len(offsets)}); choose a smaller motion or another start"
            )
        path.append(q)
    return np.array(path)


def check_start(robot: Robot, start: tuple[float, ...]) -> Array:
    """Return a start pose, the usual one if none is given. (n,) [rad]"""
    start = start or HOMES.get(robot.joints, (0.0,) * robot.joints)
    if len(start) != robot.joints:
        raise ParameterError(
            f"trajectory.start has {len(start)} angles; robot {robot.name!r} has {robot.joints} "
            "joints"
        )
    return np.array(start, float)
