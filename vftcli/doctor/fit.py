"""Which robot a log is from: every profile's dynamics against the torques of the log.

Over windows of 0.3 s the mean of ṗ − μ is what the profile cannot explain. The controller's own
model (target_torque, or torque less the vendor's residual) tells most; measured torque or current
come second. Friction is fitted, since it changes from day to day, and so is an unknown load on the
flange where the poses differ enough to tell it from another arm.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vftcli.robots import Robot
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.regressor import load_regressor
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

WINDOW = 0.3
WINDOWS = 400
"""Length of a window [s], and how many are looked at at most."""
SLOW = 0.01
"""Speed at which dry friction has its direction. [rad/s]"""
CLOSE = 1.3
"""Profiles whose misfits differ by less than this factor are not told apart."""
TELLING = 50.0
"""Condition number of the load's regressor up to which the poses tell a load."""
MAX_MASS, MAX_ARM = 12.0, 0.35
"""Loads beyond these are no loads but another arm. [kg, m]"""
KEPT = 0.7
"""Share of the windows that a fit is judged by: the rest may be contact."""


class Evidence(NamedTuple):
    """A torque that a robot's model should explain.

    Attributes:
        name: What it is, in words.
        torque: The torque. (T, n) [N·m]
        limit: Misfit up to which a profile fits.
        friction: Whether friction is in it.
        by_maker: Whether it is the maker's own model rather than what the drives measured.
    """

    name: str
    torque: Array
    limit: float
    friction: bool
    by_maker: bool = False


@dataclass(frozen=True, kw_only=True)
class RobotMatch:
    """How well a profile explains a log.

    Attributes:
        robot: The profile's name.
        misfit: What it cannot explain, relative to the torques; 0 is perfect.
        fits: Whether that is as good as the kind of evidence allows.
        evidence: Which torque was explained, in words.
        load: Mass of the unknown load that was fitted, 0 if none. [kg]
        by_maker: Whether the maker's own model was explained rather than a measured effort.
    """

    robot: str
    misfit: float
    fits: bool
    evidence: str
    load: float
    by_maker: bool = False

    def __str__(self) -> str:
        """The fit in a few words."""
        load = f" with {self.load:.2g} kg on the flange" if self.load else ""
        return f"{self.robot} {100 * self.misfit:.3g} %{load} ({self.evidence})"


def ranking(recording: Recording, robots: Mapping[str, Robot]) -> tuple[RobotMatch, ...]:
    """Profiles with as many joints as the log, best first.

    Args:
        recording: The log; it needs velocities.
        robots: Profiles by name.
    """
    if recording.dq is None or recording.samples < 10:
        return ()
    fits = [
        fit
        for name, robot in robots.items()
        if robot.joints == recording.joints
        and (fit := best_fit(recording, name, robot, evidences(recording, robot)))
    ]
    fits.sort(key=lambda fit: (not fit.fits, fit.misfit))
    return tuple(
        replace(fit, fits=fit.fits and fit.misfit <= CLOSE * fits[0].misfit) for fit in fits
    )


def best_fit(
    recording: Recording, name: str, robot: Robot, evidence: Iterable[Evidence]
) -> RobotMatch | None:
    """A profile's fit to the evidence that it explains best, or None without any torque."""
    windows = Windows(recording, robot)
    found = []
    for item in evidence:
        misfit, load = windows.misfit(item.torque, friction=item.friction)
        found.append(
            RobotMatch(
                robot=name,
                misfit=misfit,
                fits=misfit < item.limit,
                evidence=item.name,
                load=load,
                by_maker=item.by_maker,
            )
        )
    return min(found, key=lambda fit: (not fit.fits, fit.misfit), default=None)


def evidences(recording: Recording, robot: Robot) -> Iterator[Evidence]:
    """The torques of a log that a model should explain; measured ones if nothing is better."""
    torque, vendor = recording.torque, recording.tau_ext
    if recording.target_torque is not None and np.any(recording.target_torque):
        own = recording.target_torque
        yield Evidence("the controller's own model", own, 0.1, friction=False, by_maker=True)
    elif torque is not None and vendor is not None and np.any(vendor):
        name, own = "torque less the vendor's residual", torque + vendor
        yield Evidence(name, own, 0.1, friction=True, by_maker=True)
    else:
        yield from measured(recording, robot)


def measured(recording: Recording, robot: Robot) -> Iterator[Evidence]:
    """The torque of the drives as measured, contact and friction in it."""
    torque = recording.torque
    if torque is None and recording.current is not None and robot.torque_constant is not None:
        torque = recording.current * robot.torque_constant
    if torque is not None and np.any(torque):
        yield Evidence("measured effort", torque, 0.2, friction=True)


class Windows:
    """Windows of a log, and what a robot's model says about them."""

    def __init__(self, recording: Recording, robot: Robot) -> None:
        t, dq = recording.t, recording.require("dq")
        length = max(1, round(WINDOW / recording.median_step))
        length = min(length, max(1, (recording.samples - 1) // 3))
        starts = np.arange(0, recording.samples - length, max(1, length // 2))
        if len(starts) > WINDOWS:
            starts = starts[np.linspace(0, len(starts) - 1, WINDOWS).astype(int)]
        self.t, self.first, self.last = t, starts, starts + length
        self.span = (t[self.last] - t[self.first])[:, None]
        terms = momentum_terms(robot.chain, recording.q, dq)
        rise = (terms.p[self.last] - terms.p[self.first]) / self.span
        self.needed = rise - self.mean(terms.coriolis_transpose_dq - terms.gravity)
        self.load = load_regressor(robot.chain, recording.q[starts + length // 2])
        self.friction = friction_regressor(self.mean(np.tanh(dq / SLOW)), self.mean(dq))

    def mean(self, value: Array) -> Array:
        """Mean over each window, by trapezoids. (W, n)"""
        steps = np.diff(self.t)[:, None]
        rise = (value[1:] + value[:-1]) / 2 * steps
        area = np.vstack([np.zeros(value.shape[1]), np.cumsum(rise, axis=0)])
        mean: Array = (area[self.last] - area[self.first]) / self.span
        return mean

    def misfit(self, torque: Array, *, friction: bool) -> tuple[float, float]:
        """Unexplained torque relative to the torque, and the mass of a fitted load. [-, kg]"""
        given = self.mean(torque)
        size = float(np.sqrt(np.mean(given**2)))
        if size == 0.0:
            return float("inf"), 0.0
        rest = self.needed - given
        none = np.empty((*rest.shape, 0))
        extra = -self.friction if friction else none
        bare, _ = fitted(rest, none, extra)
        values = np.linalg.svd(self.load.reshape(-1, 4), compute_uv=False)
        # Poses that are too alike let any residual pass for a load.
        if values[0] > TELLING * values[-1]:
            return bare / size, 0.0
        loaded, load = fitted(rest, self.load, extra)
        # A load must explain a good part of the misfit, or it only adds freedom.
        if not plausible(load) or loaded > 0.8 * bare:
            return bare / size, 0.0
        return loaded / size, float(load[0])


def plausible(load: Array) -> bool:
    """Whether a mass and first moment could be a tool's. (4,) [kg, kg·m]"""
    mass = float(load[0])
    return 0.05 < mass < MAX_MASS and float(np.linalg.norm(load[1:])) < MAX_ARM * mass + 0.3


def fitted(rest: Array, load: Array, friction: Array) -> tuple[float, Array]:
    """Fit load and friction to what a model leaves over, contact set aside.

    Args:
        rest: What is left over. (W, n) [N·m]
        load: Regressor of a load, or nothing. (W, n, 4 or 0)
        friction: Regressor of friction, or nothing; it only ever takes energy. (W, n, m)

    Returns:
        What still is left over in the quieter windows [N·m], and the load's parameters.
    """
    columns = np.concatenate([load, friction], axis=2)
    if columns.shape[2] == 0:
        return robust_size(rest), np.empty(0)
    used = np.ones(columns.shape[2], dtype=bool)
    keep = np.ones(len(rest), dtype=bool)
    solution = np.zeros(columns.shape[2])
    for _ in range(4):
        solution = np.zeros(columns.shape[2])
        if not used.any():
            break
        matrix = columns[keep][:, :, used].reshape(-1, int(used.sum()))
        solution[used] = np.linalg.lstsq(matrix, rest[keep].ravel(), rcond=1e-8)[0]
        # Friction that would drive the arm is another error in disguise: it is left out.
        used[load.shape[2] :] &= solution[load.shape[2] :] > 0
        solution[~used] = 0.0
        left = np.linalg.norm(rest - columns @ solution, axis=1)
        keep = left <= np.quantile(left, KEPT)
    return robust_size(rest - columns @ solution), solution[: load.shape[2]]


def friction_regressor(direction: Array, speed: Array) -> Array:
    """Coulomb and viscous friction of every joint: diagonal in the joints. (W, n, 2n)"""
    n = direction.shape[1]
    regressor = np.zeros((len(direction), n, 2 * n))
    joints = np.arange(n)
    regressor[:, joints, joints] = direction
    regressor[:, joints, n + joints] = speed
    return regressor


def robust_size(rest: Array) -> float:
    """Root mean square of the quieter windows: the others may be contact. [N·m]"""
    left = np.sum(rest**2, axis=1)
    quiet = left[left <= np.quantile(left, KEPT)]
    return float(np.sqrt(np.mean(quiet) / rest.shape[1]))
