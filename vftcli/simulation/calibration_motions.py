"""Motions for identification: poses at rest, single-joint sweeps, Fourier series."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vftcli.robots import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.kinematics import check_start, flange_pose
from vftcli.simulation.motion import Command, Periodic, Stretches, straight_paths

TABLE = 0.15  #: Least height of the flange in poses that are drawn. [m]


@dataclass(frozen=True, kw_only=True)
class PosesSpec:
    """Drawn joint poses, approached one after the other and held."""

    KIND: ClassVar[str] = "poses"
    move: float = 2.5  #: Time of each move. [s]
    dwell: float = 2.0  #: Rest at each pose. [s]
    count: int = 12  #: How many poses are drawn.
    spread: float = 0.7  #: How far they lie from the usual pose, evenly to both sides. [rad]

    def motion(self, robot: Robot) -> Command:
        """Straight joint-space moves between the poses."""
        if self.move <= 0 or self.dwell < 0 or self.count < 2:
            raise ParameterError(
                "trajectory.move must be positive, dwell not negative, and count at least 2"
            )
        points = self.draw_poses(robot)
        starts = self.dwell + np.arange(self.count - 1) * (self.move + self.dwell)
        return Stretches(
            times=np.column_stack([starts, starts + self.move]),
            paths=straight_paths(points),
            duration=float(starts[-1] + self.move + self.dwell),
        )

    def draw_poses(self, robot: Robot) -> list[Array]:
        """Poses about the usual one, inside the limits and with the flange above the table."""
        rng, home = np.random.default_rng(1), check_start(robot, ())
        low = np.where(np.isfinite(robot.limits.q_min), robot.limits.q_min + 0.05, -np.pi)
        high = np.where(np.isfinite(robot.limits.q_max), robot.limits.q_max - 0.05, np.pi)
        points: list[Array] = []
        for _ in range(100 * self.count):
            pose = np.clip(home + rng.uniform(-self.spread, self.spread, robot.joints), low, high)
            if flange_pose(robot.model, pose).translation[2] > TABLE:
                points.append(pose)
            if len(points) == self.count:
                return points
        raise ParameterError(
            f"trajectory.spread {self.spread:g} leaves robot {robot.name!r} no {self.count} poses "
            "above the table; make it smaller"
        )


@dataclass(frozen=True, kw_only=True)
class JointwiseSpec:
    """One joint at a time swept back and forth at several speeds, the others at rest."""

    KIND: ClassVar[str] = "jointwise"
    amplitude: float = 0.4  #: Sweep to each side. [rad]
    speeds: tuple[float, ...] = (0.1, 0.2, 0.4, 0.7)  #: Mean speeds of the sweeps. [rad/s]
    rest: float = 0.3  #: Rest between sweeps. [s]

    def motion(self, robot: Robot) -> Command:
        """Each sweep as minimum-jerk moves from the usual pose out, across and back."""
        start = check_start(robot, ())
        if min(self.speeds, default=0.0) <= 0:
            raise ParameterError("trajectory.speeds must be positive")
        t, times, paths = self.rest, [], []
        for axis in self.amplitude * np.eye(robot.joints):
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
    """A Fourier series of the joints."""

    KIND: ClassVar[str] = "excitation"
    period: float = 10.0  #: Time of one round. [s]
    cycles: float = 2.0  #: Rounds.
    mean: tuple[float, ...]  #: Mean positions. (n,) [rad]
    cosine: tuple[tuple[float, ...], ...]  #: Cosine coefficients, one row a harmonic. (H, n) [rad]
    sine: tuple[tuple[float, ...], ...]  #: Sine coefficients. (H, n) [rad]

    def motion(self, robot: Robot) -> Command:
        """The series, if its lengths are those of the arm's joints."""
        sizes = {len(row) for row in (self.mean, *self.cosine, *self.sine)}
        if sizes != {robot.joints} or len(self.cosine) != len(self.sine) or self.period <= 0:
            raise ParameterError(
                f"trajectory.mean and each row of cosine and sine must have {robot.joints} "
                f"numbers, one a joint of {robot.name!r}, cosine and sine as many rows, and "
                "trajectory.period must be positive"
            )
        return Periodic(
            period=self.period,
            cycles=self.cycles,
            mean=np.array(self.mean),
            cosine=np.array(self.cosine),
            sine=np.array(self.sine),
        )
