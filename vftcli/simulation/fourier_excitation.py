"""Exciting motions made for any arm: Fourier series inside its limits, the best of many drawn.

What is judged is the condition number of the base regressor, as in J. Swevers et al., "Optimal
robot excitation and identification", IEEE Trans. Robotics and Automation 13 (1997); the series is
the best of those drawn and bettered at random, where theirs is the solution of an optimisation.
"""

from dataclasses import dataclass, replace

import numpy as np

from vftcli.robots import Robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.regressor import chain_parameters, torque_regressor
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.motion import Periodic, Reference

PERIOD = 10.0
"""Time of one round unless another is asked for. [s]"""
HARMONICS = 5
"""Harmonics of the series."""
INSTANTS = 200
"""Instants of a round at which limits and regressor are looked at."""
DRAWS, BETTERINGS = 40, 80
"""Most series drawn, and most attempts to better the best of them."""
GOOD = 20.0
"""Condition number at which no better one is looked for."""
BETTERING = 0.15
"""Standard deviation of a bettering, as a share of the root mean square of the coefficients."""
SHARE = 0.8
"""Share of every limit that is used: the servo errs and the true arm is not the profile's."""
WIDEST = 1.5
"""Largest way to either side of the mean, also where a joint could go on. [rad]"""
SPEED, ACCELERATION = 1.0, 5.0
"""What a joint may do where its limits are unknown. [rad/s, rad/s²]"""
SHRINKING = 0.8
"""By how much a series that needs too much torque is made smaller, and how often at most."""
SHRINKINGS = 8
DRY_SPEED = 0.01
"""Velocity over which the dry friction of the regressor changes its sign. [rad/s]"""
DEPENDENT = 1e-8
"""Share of the largest column below which a column adds nothing to those before it."""


@dataclass(frozen=True, kw_only=True)
class MadeExcitation:
    """An exciting motion made for a robot.

    Attributes:
        series: The motion.
        condition: Condition number of its base regressor, columns scaled to one length.
        rank: Columns of the base regressor.
    """

    series: Periodic
    condition: float
    rank: int


def full_regressor(robot: Robot, motion: Reference) -> Array:
    """Regressor of inertia, rotors, viscous and dry friction and offsets. (T·n, 14n)

    Args:
        robot: The arm, of which only the geometry counts.
        motion: Positions, velocities and accelerations. (T, n) each
    """
    n = robot.joints
    rigid = torque_regressor(robot.loaded_chain, *motion)
    drives = (motion.ddq, motion.dq, np.tanh(motion.dq / DRY_SPEED), np.ones_like(motion.q))
    diagonal = [row[:, :, None] * np.eye(n) for row in drives]
    return np.concatenate([rigid, *diagonal], axis=2).reshape(-1, 14 * n)


def base_columns(robot: Robot) -> list[int]:
    """The columns of `full_regressor` that add to those before them, found on random states."""
    rng = np.random.default_rng(0)
    shape = (60, robot.joints)
    states = Reference(*(rng.uniform(-scale, scale, shape) for scale in (np.pi, 2.0, 5.0)))
    R: Array = np.asarray(np.linalg.qr(full_regressor(robot, states), mode="r"))
    columns = R.T
    largest = float(np.max(np.linalg.norm(columns, axis=1)))
    kept: list[int] = []
    basis = np.zeros((columns.shape[1], 0))
    for j, column in enumerate(columns):
        rest = column - basis @ (basis.T @ column)
        rest -= basis @ (basis.T @ rest)
        if (length := float(np.linalg.norm(rest))) > DEPENDENT * largest:
            basis = np.column_stack([basis, rest / length])
            kept.append(j)
    return kept


def condition_number(robot: Robot, motion: Reference, columns: list[int]) -> float:
    """Condition number of the base regressor of a motion, its columns scaled to one length."""
    Y = full_regressor(robot, motion)[:, columns]
    length = np.linalg.norm(Y, axis=0)
    if np.min(length) == 0.0:
        return float("inf")
    return float(np.linalg.cond(Y / length))


def torque_share(robot: Robot, motion: Reference) -> Array:
    """Largest nominal torque of each joint along a motion, as a share of its limit. (n,) [1]

    Zero where no limit is known.
    """
    chain = robot.loaded_chain
    rigid = torque_regressor(chain, *motion) @ chain_parameters(chain)
    drive = rigid + motion.ddq * chain.rotor_inertia + friction_torque(robot.friction, motion.dq)
    most = np.where(np.isfinite(robot.limits.tau_max), robot.limits.tau_max, np.inf)
    share: Array = np.max(np.abs(drive), axis=0) / most
    return share


def ends_of(robot: Robot) -> tuple[Array, Array]:
    """Lowest and highest position of each joint; half a turn to either side where it has no ends.

    (n,), (n,) [rad]
    """
    limits = robot.limits
    low = np.where(np.isfinite(limits.q_min), limits.q_min, -np.pi)
    high = np.where(np.isfinite(limits.q_max), limits.q_max, np.pi)
    return low, high


class SeriesMaker:
    """Brings Fourier series inside a robot's limits.

    Attributes:
        robot: The arm.
        period: Time of one round. [s]
        cycles: Rounds.
    """

    def __init__(self, robot: Robot, period: float, cycles: float) -> None:
        self.robot, self.period, self.cycles = robot, period, cycles
        self.t = np.linspace(0.0, period, INSTANTS, endpoint=False)
        limits = robot.limits
        low, high = ends_of(robot)
        self.middle, self.half = 0.5 * (low + high), SHARE * 0.5 * (high - low)
        self.way = np.minimum(self.half, WIDEST)
        known = [(limits.qd_max, SPEED), (limits.qdd_max, ACCELERATION)]
        self.fastest, self.hardest = (
            np.where(np.isfinite(limit), SHARE * limit, usual) for limit, usual in known
        )

    def fitted(self, place: Array, cosine: Array, sine: Array) -> Periodic | None:
        """The series of this shape, joint by joint as large as the limits let it be, or None.

        Args:
            place: Where the means lie in what is left of the range, −1 to 1. (n,)
            cosine: Cosine coefficients of any size. (H, n)
            sine: Sine coefficients. (H, n)
        """
        nothing = np.zeros(self.robot.joints)
        series = Periodic(
            period=self.period, cycles=self.cycles, mean=nothing, cosine=cosine, sine=sine
        )
        largest = [np.max(np.abs(rows), axis=0) for rows in series.at(self.t)]
        bounds = (self.way, self.fastest, self.hardest)
        size = np.min([b / most for b, most in zip(bounds, largest, strict=True)], axis=0)
        mean = self.middle + place * (self.half - size * largest[0])
        at_rest = Reference(mean[None], nothing[None], nothing[None])
        if np.max(torque_share(self.robot, at_rest)) > SHARE:
            return None
        for _ in range(SHRINKINGS):
            made = replace(series, mean=mean, cosine=size * cosine, sine=size * sine)
            needed = torque_share(self.robot, made.at(self.t))
            if np.max(needed) <= SHARE:
                return made
            size = size * SHRINKING
        return None


def make_excitation(robot: Robot, period: float = 0.0, cycles: float = 2.0) -> MadeExcitation:
    """Make an exciting motion for a robot, the same whenever it is asked for.

    Args:
        robot: The arm; what its limits leave open is `SPEED`, `ACCELERATION` and half a turn.
        period: Time of one round; 0 for `PERIOD`. [s]
        cycles: Rounds.

    Raises:
        ParameterError: If nothing that was drawn stays inside the limits.
    """
    if period < 0 or cycles <= 0:
        raise ParameterError("trajectory.period and trajectory.cycles must be positive")
    rng, n = np.random.default_rng(0), robot.joints
    maker, columns = SeriesMaker(robot, period or PERIOD, cycles), base_columns(robot)
    best: MadeExcitation | None = None
    shape: tuple[Array, Array] = (np.zeros(n), np.zeros((2 * HARMONICS, n)))
    for k in range(DRAWS + BETTERINGS):
        if k == DRAWS and best is None:
            break
        if k < DRAWS or best is None:
            place, waves = rng.uniform(-1.0, 1.0, n), rng.standard_normal((2 * HARMONICS, n))
        else:
            spread = BETTERING * float(np.sqrt(np.mean(shape[1] ** 2)))
            waves = shape[1] + spread * rng.standard_normal(shape[1].shape)
            place = np.clip(shape[0] + BETTERING * rng.standard_normal(n), -1.0, 1.0)
        series = maker.fitted(place, waves[:HARMONICS], waves[HARMONICS:])
        if series is None:
            continue
        condition = condition_number(robot, series.at(maker.t), columns)
        if best is None or condition < best.condition:
            best = MadeExcitation(series=series, condition=condition, rank=len(columns))
            shape = (place, waves)
            if condition <= GOOD:
                break
    if best is None:
        raise ParameterError(
            f"robot {robot.name!r}: no exciting motion of {maker.period:g} s stays inside its "
            "limits; its torque limits hardly carry its links. Give trajectory.period, mean, "
            "cosine and sine yourself"
        )
    return best
