"""What a robot's model says of a log, over short windows: the torque that moving and holding need.

Over a window of 0.3 s the mean of ṗ − Cᵀq̇ is the torque of inertia, since ṗ = Cᵀq̇ − g + τ, and no
acceleration has to be differentiated. Gravity stands apart, as a matrix times the direction that
is up, so that its direction can be fitted: a base that is tilted, an arm that hangs, an effort from
which gravity was taken off.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vftcli.doctor.robust import Terms, terms
from vftcli.robots import Robot
from vftcli.robots.chain import Chain
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.kinematics import LinkPoses, link_poses
from vftcli.robots.regressor import load_regressor
from vftcli.signals.arrays import Array, Indices
from vftcli.signals.recording import Recording

WINDOW = 0.3
WINDOWS = 200  #: Length of a window [s], and how many are looked at at most.
#: Instants of a window at which the model is asked: 50 ms apart nothing of it is missed.
POINTS = 7
GRAVITY = [0, 3, 6]  #: Those of them at which gravity is asked: between them it bends little.
SIMPSON = np.array([1.0, 4.0, 1.0]) / 6  #: Their weights in the mean.
SLOW = 0.01  #: Speed at which dry friction has its direction. [rad/s]
FAST = 0.8  #: Mean direction of a window in which a joint moves.
#: Mass [kg] and first moment [kg·m] that a load may well have, before the log says anything.
LOAD = np.array([5.0, 0.5, 0.5, 0.5])


@dataclass(frozen=True, kw_only=True)
class Windows:
    """Windows of a log, and what a robot's model says of them."""

    recording: Recording  #: The log.
    chain: Chain  #: The arm with its payload.
    first: Indices  #: First sample of each window. (W,)
    last: Indices  #: Last sample of each window. (W,)
    t: Array  #: Those instants. (W, K) [s]
    q: Array  #: Positions at a few instants of each window. (W, K, n) [rad]
    dq: Array  #: Velocities there. (W, K, n) [rad/s]
    motion: Array  #: Mean direction and mean speed of every joint. (2, W, n) [-, rad/s]

    def exchanged(self, i: int, j: int, few: Indices) -> "Windows":
        """Some of the windows, all signals of two joints in them exchanged."""
        order = np.arange(self.q.shape[2])
        order[[i, j]] = j, i
        q, dq, motion = self.q[few], self.dq[few], self.motion[:, few]
        return replace(
            self,
            first=self.first[few],
            last=self.last[few],
            t=self.t[few],
            q=q[:, :, order],
            dq=dq[:, :, order],
            motion=motion[:, :, order],
        )

    @property
    def ways(self) -> Indices:
        """Windows in which each joint moves forth, and back. (2, n)"""
        direction = self.motion[0]
        return np.stack([(direction > FAST).sum(axis=0), (direction < -FAST).sum(axis=0)])

    @cached_property
    def inertial(self) -> Array:
        """Torque of inertia and rotors. (W, n) [N·m]"""
        count, points, n = self.q.shape
        terms = momentum_terms(self.chain, self.q.reshape(-1, n), self.dq.reshape(-1, n))
        p = terms.p.reshape(count, points, n)
        rise = (p[:, -1] - p[:, 0]) / (self.t[:, -1:] - self.t[:, :1])
        coriolis = terms.coriolis_transpose_dq.reshape(p.shape)
        return np.asarray(rise - np.einsum("wk,wkn->wn", trapezoids(self.t), coriolis))

    @cached_property
    def gravity(self) -> Array:
        """Torque that holds the arm, by the components of "up". (W, n, 3) [N·m]

        The third axis of "up" is the robot file's own.
        """
        few = self.q[:, GRAVITY]
        held = gravity_regressor(self.chain, few.reshape(-1, self.q.shape[2]))
        grouped = held.reshape(*few.shape[:2], *held.shape[1:])
        return np.asarray(np.einsum("k,wk...->w...", SIMPSON, grouped))

    @cached_property
    def friction(self) -> Terms:
        """Coulomb and viscous friction of every joint, which only ever take energy."""
        each = [motion[:, :, None] * np.eye(motion.shape[1]) for motion in self.motion]
        return terms(np.concatenate(each, axis=2), positive=True)

    @cached_property
    def load(self) -> Terms:
        """Torque that carries a load, by its mass and its first moment about the flange."""
        middle = self.q[:, self.q.shape[1] // 2]
        return terms(-load_regressor(self.chain, middle), prior=LOAD)

    def mean(self, value: Array) -> Array:
        """Mean of a signal over each window, of all its samples. (W, n)"""
        return means(self.recording.t, value, self.first, self.last)


def windows_of(recording: Recording, robot: Robot) -> Windows:
    """Cut a log with velocities into windows."""
    t, dq = recording.t, recording.require("dq")
    length = max(1, min(round(WINDOW / recording.median_step), (recording.samples - 1) // 3))
    first = np.arange(0, recording.samples - length, max(1, length // 2))
    first = first[spread(len(first), WINDOWS)]
    last = first + length
    at = first[:, None] + np.linspace(0, length, POINTS).round().astype(int)
    motion = [means(t, value, first, last) for value in (np.tanh(dq / SLOW), dq)]
    return Windows(
        recording=recording,
        chain=robot.loaded_chain,
        first=first,
        last=last,
        t=t[at],
        q=recording.q[at],
        dq=dq[at],
        motion=np.stack(motion),
    )


def spread(count: int, most: int, block: int = 1) -> Indices:
    """Numbers of at most so many things, evenly spread in blocks of neighbours. (≤ most,)"""
    if count <= most:
        return np.arange(count)
    first = np.linspace(0, count - block, most // block).astype(int)
    return np.unique(first[:, None] + np.arange(block))


def trapezoids(t: Array) -> Array:
    """Weights of a window's instants (W, K) [s] in its mean. (W, K)"""
    steps = np.diff(t, axis=1) / (2 * (t[:, -1:] - t[:, :1]))
    return np.pad(steps, ((0, 0), (0, 1))) + np.pad(steps, ((0, 0), (1, 0)))


def means(t: Array, value: Array, first: Indices, last: Indices) -> Array:
    """Mean of a signal from some samples to others, by trapezoids. (W, n)"""
    steps = np.diff(t)[:, None]
    rise = (value[1:] + value[:-1]) / 2 * steps
    area = np.vstack([np.zeros(value.shape[1]), np.cumsum(rise, axis=0)])
    return np.asarray((area[last] - area[first]) / (t[last] - t[first])[:, None])


def gravity_regressor(chain: Chain, q: Array) -> Array:
    """Torque that holds the arm's links, by the components of "up". (N, n, 3) [N·m]

    With S_j the first moment of all links from j on about the origin of frame j, holding them takes
    (axis_j × S_j) · g₀ up. The third axis of "up" is the chain's own, −gravity.

    Args:
        chain: The arm.
        q: Joint positions. (N, n) [rad]
    """
    poses: LinkPoses = link_poses(chain, q)
    rotation, origin = poses.rotation[:, :-1], poses.translation[:, :-1]
    com = origin + np.einsum("tnij,nj->tni", rotation, chain.com)
    # Everything from j on: sums from the tip.
    moment = np.cumsum((chain.mass[:, None] * com)[:, ::-1], axis=1)[:, ::-1]
    mass = np.cumsum(chain.mass[::-1])[::-1]
    about = moment - mass[:, None] * origin
    return np.asarray(np.cross(rotation[:, :, :, 2], about) @ up_axes(chain.gravity))


def up_axes(gravity: Array) -> Array:
    """Axes with "up" third, as columns, times the size of gravity. (3, 3) [m/s²]"""
    size = float(np.linalg.norm(gravity))
    up = -gravity / size
    # Of an upright base the base's own axes.
    side = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    second = np.cross(up, side)
    second /= np.linalg.norm(second)
    return size * np.column_stack([np.cross(second, up), second, up])
