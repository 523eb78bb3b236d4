"""Fourier trajectories optimised for the condition number of the base regressor.

After J. Swevers et al., "Optimal robot excitation and identification", IEEE Trans. Robotics and
Automation 13 (1997): position, velocity and
acceleration of one Fourier series a joint, inside the limits, least condition number.
"""

import tomllib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vftcli.robots import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.motion import Periodic
from vftcli.simulation.regressor import Base, base_columns, condition_number, full_regressor
from vftcli.simulation.schema import unknown

FOLDER = Path(__file__).parent / "scenarios" / "excitation"
CHECKED = 128
"""Instants of a round at which the regressor is evaluated while optimising."""
SPEED_SHARE, TORQUE_SHARE, ACCELERATION_SHARE = 0.6, 0.8, 0.7
"""Shares of the robot's limits that a trajectory may use."""
USUAL_ACCELERATION = 6.0
"""Acceleration allowed where the robot states no limit. [rad/s²]"""
CLEARANCE = 0.12
"""Least height of the joints beyond the second, and of the flange, above the base plane. [m]"""


class FourierSeries(NamedTuple):
    """Coefficients of one round: period [s], mean (n,), cosine and sine (H, n) [rad]."""

    period: float
    mean: Array
    cosine: Array
    sine: Array

    def motion(self) -> Periodic:
        """One round."""
        return Periodic(
            period=self.period, cycles=1.0, mean=self.mean, cosine=self.cosine, sine=self.sine
        )


def optimised(robot: str) -> FourierSeries:
    """The trajectory optimised for a built-in robot.

    Raises:
        ParameterError: If there is none.
    """
    path = FOLDER / f"{robot}.toml"
    if not path.is_file():
        there = sorted(p.stem for p in FOLDER.glob("*.toml"))
        raise ParameterError(
            unknown(f"optimised excitation for robot {robot!r}", robot, there)
            + " Give trajectory.period, mean, cosine and sine yourself."
        )
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    return FourierSeries(table["period"], *(np.array(table[k]) for k in ("mean", "cosine", "sine")))


def inside(robot: Robot, series: FourierSeries, box: Array) -> FourierSeries:
    """Shrink a series joint by joint until it respects position, speed and acceleration limits.

    Args:
        robot: The arm.
        series: Coefficients of any size.
        box: Position bounds. (2, n) [rad]
    """
    moving = series.motion().at(np.linspace(0.0, series.period, 4 * CHECKED, endpoint=False))
    reach = np.max(np.abs(moving.q - series.mean), axis=0) + 1e-12
    room = np.minimum(box[1] - series.mean, series.mean - box[0])
    speed = SPEED_SHARE * robot.limits.qd_max / (np.max(np.abs(moving.dq), axis=0) + 1e-12)
    fastest = np.where(np.isfinite(robot.limits.qdd_max), robot.limits.qdd_max, np.inf)
    fastest = np.minimum(ACCELERATION_SHARE * fastest, USUAL_ACCELERATION)
    growth = fastest / (np.max(np.abs(moving.ddq), axis=0) + 1e-12)
    factor = np.minimum(np.minimum(np.maximum(room, 0.0) / reach, speed), growth)
    return series._replace(cosine=series.cosine * factor, sine=series.sine * factor)


def cost(robot: Robot, series: FourierSeries, base: Base) -> float:
    """Condition number, with penalties for torque beyond the drives and for the table."""
    import pinocchio as pin

    motion = series.motion().at(np.linspace(0.0, series.period, CHECKED, endpoint=False))
    model = robot.model
    data = model.createData()
    torque, low = 0.0, 0.0
    for q, dq, ddq in zip(*motion, strict=True):
        used = np.abs(pin.rnea(model, data, q, dq, ddq)) / robot.limits.tau_max
        torque = max(torque, float(np.max(used)))
        pin.framesForwardKinematics(model, data, q)
        heights = [data.oMi[j].translation[2] for j in range(3, model.njoints)]
        low = max(low, CLEARANCE - min([*heights, data.oMf[model.nframes - 1].translation[2]]))
    Y = full_regressor(robot, motion)[:, list(base.columns)]
    return condition_number(Y) + 1e3 * max(torque - TORQUE_SHARE, 0.0) + 1e3 * max(low, 0.0)


def optimise(
    robot: Robot, box: Array, period: float, harmonics: int, seed: int, rounds: int
) -> tuple[FourierSeries, float]:
    """Search for the trajectory of least cost by an evolution strategy with a growing step.

    Args:
        robot: The arm.
        box: Position bounds used. (2, n) [rad]
        period: Time of one round. [s]
        harmonics: Harmonics of the series.
        seed: Seed of the search.
        rounds: Trials.

    Returns:
        The best trajectory and its cost.
    """
    rng, n = np.random.default_rng(seed), robot.joints
    base = base_columns(robot)
    span = 0.5 * (box[1] - box[0])

    def decode(x: Array) -> FourierSeries:
        mean = box.mean(axis=0) + 0.5 * span * np.tanh(x[:n])
        cosine, sine = x[n:].reshape(2, harmonics, n)
        return inside(robot, FourierSeries(period, mean, cosine, sine), box)

    best = rng.standard_normal(n * (2 * harmonics + 1))
    least, step = cost(robot, decode(best), base), 0.5
    for _ in range(rounds):
        change = step * rng.standard_normal(best.shape) * (rng.random(best.shape) < 0.3)
        trial = best + change
        value = cost(robot, decode(trial), base)
        if value < least:
            best, least, step = trial, value, step * 1.3
        else:
            step = max(step * 0.98, 0.02)
    return decode(best), least
