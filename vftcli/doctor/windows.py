"""Model torque over short windows of a log, and least squares over them.

Over a window of 0.3 s the mean of ṗ − Cᵀq̇ is the torque of inertia, since
ṗ = Cᵀq̇ − g + τ: no acceleration is differentiated. Gravity is a matrix times the
direction "up", which can be fitted.

Least squares set contact aside, with terms that cannot be negative.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vftcli.doctor.signals import TRAVEL
from vftcli.robots.chain import link_poses
from vftcli.robots.kernels import load_regressor, momentum_terms, usual_errors
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import (
    Array,
    Indices,
    Mask,
    root_mean_square,
    root_mean_squares,
)
from vftcli.signals.estimation import inverse_of
from vftcli.signals.recording import Recording

WINDOW, WINDOWS = 0.3, 200  #: Length of a window [s], and most windows.
#: Way of a joint that moves in a window [rad]; rest may fill so many windows.
WAY, REST_WINDOWS = 5e-3, 120
#: Instants of the model in a window: 50 ms apart they miss nothing.
POINTS = 7
#: Those of them with gravity, which bends little between them.
GRAVITY = [0, 3, 6]
SIMPSON = np.array([1.0, 4.0, 1.0]) / 6  #: Their weights in the mean.
SLOW = 0.01  #: Speed at which dry friction has its direction. [rad/s]
FAST = 0.8  #: Mean direction of a window in which a joint moves.
#: Windows of motion that suffice; at rest dry friction may be anything.
ENOUGH = 10
#: Prior mass [kg] and first moment [kg·m] of a load.
LOAD = np.array([5.0, 0.5, 0.5, 0.5])
ROUGH = 2.0  #: Errors of a rough description's links, in usual errors.
#: Factor on their prior from fit to fit, and most fits.
TIGHTER, ROUGH_FITS = 0.5, 8
KEPT = 0.7  #: Share of the windows in a fit: the rest may be contact.
ROUNDS = 4  #: Rounds of fitting and trimming, after which nothing changes.
OVERLAP = 2.0  #: Windows that overlap by half count half.


class Terms(NamedTuple):
    """Torques that may explain another one, column by column."""

    columns: Array  #: Torque per unit of each coefficient. (W, n, k)
    positive: bool = False  #: Whether they must not be negative, as friction's.
    #: Standard deviations before any data, one for all or (k,); inf for none.
    prior: Array | float = np.inf


class RobustFit(NamedTuple):
    """A fit."""

    values: Array  #: Coefficients. (k,)
    sd: Array  #: Their standard deviations by the scatter of the kept windows. (k,)
    rest: Array  #: Torque left over in all windows. (W, n) [N·m]
    kept: Mask  #: Windows that the fit was made from. (W,)

    @property
    def size(self) -> float:
        """RMS of the torque left over in the kept windows. [N·m]"""
        return root_mean_square(self.rest[self.kept])

    @property
    def by_joint(self) -> Array:
        """RMS of each joint's rest. (n,) [N·m]"""
        return root_mean_squares(self.rest[self.kept])


def solve(target: Array, *by: Terms) -> RobustFit:
    """Fit of a torque (W, n) [N·m] by terms, with priors, worst windows left out."""
    columns = np.concatenate([part.columns for part in by], axis=2)
    counts = [part.columns.shape[2] for part in by]
    positive = np.repeat([part.positive for part in by], counts)
    sizes = [np.full(part.columns.shape[2], part.prior) for part in by]
    across = columns.swapaxes(1, 2)
    gram, moment = across @ columns, (across @ target[:, :, None])[:, :, 0]
    used = abs(columns).max(axis=(0, 1), initial=0.0) > 1e-9
    kept = np.ones(len(target), bool)
    prior = np.diag(np.concatenate(sizes) ** -2)

    def inverse() -> Array:
        return inverse_of((gram[kept].sum(axis=0) + prior)[np.ix_(used, used)])

    for _ in range(ROUNDS):
        values = np.zeros(len(used))
        values[used] = inverse() @ moment[kept].sum(axis=0)[used]
        # Friction that would drive the arm is another error: it is left out.
        wrong = positive & (values < 0)
        used &= ~wrong
        values[wrong] = 0.0
        rest = target - columns @ values
        kept = without_contact(rest)
    sd = np.zeros(len(used))
    sd[used] = np.sqrt(np.diag(inverse()) * OVERLAP * np.mean(rest[kept] ** 2))
    return RobustFit(values, sd, rest, kept)


def without_contact(rest: Array) -> Mask:
    """Windows with the least of the torque left over (W, n) [N·m]. (W,)"""
    left = np.einsum("wn,wn->w", rest, rest)
    return np.asarray(left <= np.sort(left)[int(KEPT * (len(left) - 1))])


@dataclass(frozen=True, kw_only=True)
class Windows:
    """Windows of a log, and a robot's model in them."""

    recording: Recording  #: The log.
    robot: Robot  #: The arm with its payload.
    ignored: tuple[int, ...]  #: Joints without evidence in the effort, from zero.
    samples: Indices  #: All samples of each window. (W, L)
    t: Array  #: A few instants of each window. (W, K) [s]
    q: Array  #: Positions there. (W, K, n) [rad]
    dq: Array  #: Velocities there. (W, K, n) [rad/s]
    motion: Array  #: Mean direction and mean speed of every joint. (W, 2, n) [-, rad/s]

    def exchanged(self, i: int, j: int, few: Indices) -> "Windows":
        """Some of the windows, all signals of two joints in them exchanged."""
        names = ("samples", "t", "q", "dq", "motion")
        some = {name: getattr(self, name)[few] for name in names}
        for values in (some["q"], some["dq"], some["motion"]):
            values[:, :, [i, j]] = values[:, :, [j, i]]
        return replace(self, **some)

    @property
    def moves(self) -> Mask:
        """Joints that travel. (n,)"""
        return np.asarray(np.ptp(self.q, axis=(0, 1)) > TRAVEL)

    @property
    def ways(self) -> Indices:
        """Windows in which each joint moves forth, and back. (2, n)"""
        direction = self.motion[:, 0]
        return np.stack([(direction > FAST).sum(axis=0), (direction < -FAST).sum(axis=0)])

    @cached_property
    def inertial(self) -> Array:
        """Torque of inertia and rotors. (W, n) [N·m]"""
        count, points, n = self.q.shape
        terms = momentum_terms(
            self.robot.loaded_chain, *(x.reshape(-1, n) for x in (self.q, self.dq))
        )
        p = terms.p.reshape(count, points, n)
        rise = (p[:, -1] - p[:, 0]) / (self.t[:, -1:] - self.t[:, :1])
        coriolis = terms.coriolis_transpose_dq.reshape(p.shape)
        return np.asarray(rise - np.einsum("wk,wkn->wn", trapezoids(self.t), coriolis))

    @cached_property
    def gravity(self) -> Array:
        """Torque that holds the arm, by the components of "up". (W, n, 3) [N·m]

        It is linear in "up", with the robot file's own direction as third axis.
        """
        few, chain = self.q[:, GRAVITY], self.robot.loaded_chain
        R, origins = (x[:, :-1] for x in link_poses(chain, few.reshape(-1, few.shape[2])))
        mass = chain.mass[:, None]
        moments = mass * (origins + np.einsum("tjab,jb->tja", R, chain.com))
        # A joint carries every link from its own to the last.
        carried, masses = (np.flip(np.flip(x, -2).cumsum(axis=-2), -2) for x in (moments, mass))
        held = np.cross(R[..., 2], carried - masses * origins) @ up_axes(chain.gravity)
        return np.asarray(np.einsum("k,wk...->w...", SIMPSON, held.reshape(*few.shape, 3)))

    @cached_property
    def friction(self) -> Terms:
        """Coulomb and viscous friction of every joint, never driving."""
        each = self.motion[..., None] * np.eye(self.q.shape[2])
        return Terms(np.concatenate([*each.swapaxes(0, 1)], axis=2), positive=True)

    @cached_property
    def load(self) -> Terms:
        """Torque that carries a load, by its mass and first moment at the flange."""
        middle = self.q[:, self.q.shape[1] // 2]
        return Terms(-load_regressor(self.robot.loaded_chain, middle), prior=LOAD)

    @cached_property
    def weights(self) -> Terms:
        """Torque by usual errors of every link; a rough description has `ROUGH` of them."""
        chain, q = self.robot.loaded_chain, self.q[:, self.q.shape[1] // 2]
        return Terms(usual_errors(chain, q), prior=ROUGH)

    def mean(self, value: Array) -> Array:
        """Mean of a signal over each window, of all its samples. (W, n)"""
        return means(self.recording.t[self.samples], value[self.samples])


def windows_of(recording: Recording, robot: Robot, ignored: Sequence[int] = ()) -> Windows:
    """Windows of a log with velocities, some joints' effort ignored."""
    t, dq = recording.t, recording.require("dq")
    length = max(1, min(round(WINDOW / recording.median_step), (recording.samples - 1) // 3))
    first = np.arange(0, recording.samples - length, max(1, length // 2))
    way = abs(recording.q[first + length] - recording.q[first]).max(axis=1)
    moving, still = (first[some] for some in (way > WAY, way <= WAY))
    if len(moving):  # of rest, one pose and its stiction, no more than of motion
        still = still[spread(len(still), max(len(moving), REST_WINDOWS))]
    first = np.sort(np.concatenate([moving, still]))
    first = first[spread(len(first), WINDOWS)]
    samples = first[:, None] + np.arange(length + 1)
    few, speed = samples[:, np.linspace(0, length, POINTS).round().astype(int)], dq[samples]
    return Windows(
        recording=recording,
        robot=robot,
        ignored=tuple(ignored),
        samples=samples,
        t=t[few],
        q=recording.q[few],
        dq=dq[few],
        motion=np.stack([means(t[samples], x) for x in (np.tanh(speed / SLOW), speed)], axis=1),
    )


def spread(count: int, most: int, block: int = 1) -> Indices:
    """At most so many numbers, evenly spread in blocks of neighbours. (≤ most,)"""
    if count <= most:
        return np.arange(count)
    first = np.linspace(0, count - block, most // block).astype(int)
    return np.unique(first[:, None] + np.arange(block))


def trapezoids(t: Array) -> Array:
    """Weights of a window's instants (W, K) [s] in its mean. (W, K)"""
    steps = np.diff(t, axis=1) / (2 * (t[:, -1:] - t[:, :1]))
    return np.pad(steps, ((0, 0), (0, 1))) + np.pad(steps, ((0, 0), (1, 0)))


def means(t: Array, value: Array) -> Array:
    """Mean of a signal over windows (W, K, n) by trapezoids, t (W, K) [s]. (W, n)"""
    return np.asarray(np.einsum("wk,wkn->wn", trapezoids(t), value))


def up_axes(gravity: Array) -> Array:
    """Axes with "up" third, as columns, times the size of gravity. (3, 3) [m/s²]"""
    size = float(np.linalg.norm(gravity))
    up = -gravity / size
    # The base's own axes if it is upright.
    side = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    second = np.cross(up, side)
    second /= np.linalg.norm(second)
    return size * np.column_stack([np.cross(second, up), second, up])


MAX_MASS, MAX_ARM = 12.0, 0.35  #: Loads beyond these are another arm. [kg, m]
SHED = 1.2  #: Largest share of the mounted payload that a fit removes.
#: Largest share of the misfit that a load may leave.
TELLING = 0.9
#: Range of gravity's torque, relative to the effort, that shows a load.
VARIED = 0.3
#: A cause shows in a window where it makes this many times the rest; it is refuted where
#: the rest without it is below this share.
FELT, REFUTED = 4.0, 0.6
LASTING = 0.95  #: Share of the windows that do not refute a lasting cause.


@dataclass(frozen=True)
class Case:
    """A log against an arm."""

    windows: Windows  #: The log's windows with the arm's model.
    given: Array  #: Mean of the effort, as torque, over each window. (W, n) [N·m]
    size: float  #: RMS of the logged column. [N·m]
    constant: Array  #: Torque per unit of the logged column. (n,)
    #: Direction "up" in axes with the robot file's own third. (3,)
    up: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))

    @cached_property
    def gravity(self) -> Array:
        """Torque that holds the arm. (W, n) [N·m]"""
        return self.windows.gravity @ self.up

    @cached_property
    def needed(self) -> Array:
        """Torque that inertia, rotors and gravity need. (W, n) [N·m]"""
        return self.windows.inertial + self.gravity

    @cached_property
    def bare(self) -> RobustFit:
        """Fit by friction alone."""
        return solve(self.given - self.needed, self.windows.friction)

    @cached_property
    def loaded(self) -> RobustFit:
        """Fit by a load on the flange, its four coefficients first, and friction."""
        return solve(self.given - self.needed, self.windows.load, self.windows.friction)

    @cached_property
    def rough(self) -> RobustFit:
        """Fit by a load and by errors of the links in a rough description."""
        weights, load, friction = self.windows.weights, self.windows.load, self.windows.friction
        for prior in ROUGH * TIGHTER ** np.arange(ROUGH_FITS):
            fit = solve(self.given - self.needed, weights._replace(prior=prior), load, friction)
            if root_mean_square(fit.values[: weights.columns.shape[2]]) <= ROUGH:
                break
        return fit

    @property
    def mounted(self) -> float:
        """Mass of the payload in the robot file, 0 without one. [kg]"""
        payload = self.windows.robot.payload
        return 0.0 if payload is None else payload.mass

    @property
    def carries_load(self) -> bool:
        """Whether a load beyond the mounted one explains part of the rest."""
        mass, moment = self.loaded.values[0], self.loaded.values[1:4]
        if self.gravity_range < VARIED * self.size:
            return False  # in one pose any residual passes for a load
        # A negative load removes what is mounted.
        possible = 0.05 < mass < MAX_MASS or -SHED * self.mounted < mass < -0.05
        plausible = possible and np.linalg.norm(moment) < MAX_ARM * abs(mass) + 0.3
        return plausible and self.loaded.size < TELLING * self.bare.size

    @property
    def best(self) -> RobustFit:
        """The fit with a load if it explains something, else without."""
        return self.loaded if self.carries_load else self.bare

    @property
    def misfit(self) -> float:
        """Share of the logged effort left unexplained; loads and contacts are not."""
        return self.left_by(self.best)

    def left_by(self, fit: RobustFit) -> float:
        """Share of the logged effort that a fit leaves over: of all windows or of motion.

        Contact may fill the one, dry friction of any direction the rest between.
        """
        moving = fit.rest[(abs(self.windows.motion[:, 0]) > FAST).any(axis=1)]
        kept = moving[without_contact(moving)] if len(moving) >= ENOUGH else fit.rest[fit.kept]
        return min(fit.size, root_mean_square(kept)) / self.size

    @cached_property
    def effort_sizes(self) -> Array:
        """RMS of each joint's effort, contact set aside. (n,) [N·m]"""
        return np.maximum(root_mean_squares(self.given[self.bare.kept]), 1e-9 * self.size)

    @cached_property
    def by_joint(self) -> Array:
        """Share of each joint's effort that friction leaves over. (n,)"""
        return self.bare.by_joint / self.effort_sizes

    @property
    def gravity_range(self) -> float:
        """Range of gravity's torque on the joint where it varies most. [N·m]"""
        return float(np.ptp(self.gravity, axis=0).max())

    def lasts(self, cause: RobustFit, change: Array) -> bool:
        """Whether a cause's change (W, n) [N·m] is always there, unlike a push."""
        size = np.linalg.norm(change, axis=1)
        felt = size > FELT * cause.size * np.sqrt(change.shape[1])
        without = np.linalg.norm(cause.rest + change, axis=1)
        refuted = felt & (without < REFUTED * np.linalg.norm(cause.rest, axis=1))
        return bool(refuted.sum() <= (1 - LASTING) * max(felt.sum(), 1))

    def exchanged(self, i: int, j: int) -> "Case":
        """The log with the logged efforts of two joints exchanged."""
        logged = self.given / self.constant
        logged[:, [i, j]] = logged[:, [j, i]]
        return replace(self, given=logged * self.constant)
