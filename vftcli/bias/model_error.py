"""Possible errors of a robot's model: columns, their sizes, their torque.

The raw disturbance d is the external torque less the model's error, d = τ_ext − A δx. The
columns A are the inertial parameters of every link, the rotor inertias, the drive
constants and the friction of every joint. Each δx has mean zero and an SD
by the robot's own numbers: a maker's table is good to some percent, friction to a fifth.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain
from vftcli.robots.friction import dry_friction, play, steady_torque
from vftcli.robots.kernels import (
    CHUNK,
    LINK,
    TENSOR,
    chain_parameters,
    momentum_terms,
    torque_regressor,
    with_parameters,
)
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run
from vftcli.robots.terms import GAP
from vftcli.signals.arrays import Array, Indices, median_step, resample_columns, summed
from vftcli.signals.filters import derivative, zero_phase

#: What is faster is noise, or contact. [Hz]
CUTOFF = 6.0
PLAY = 0.3e-3  #: Presliding length of the friction that may be missing. [rad]
SMOOTHING = 0.003  #: Velocity over which its sign turns. [rad/s]
#: Longest wait that counts: six periods of `CUTOFF`. [s]
WAIT = 1.0
SHAPES = 5  #: Columns of friction a joint beside its offset.
#: A joint's speed where its limit is unknown. [rad/s]
USUAL_SPEED = np.pi


class SmoothMotion(NamedTuple):
    """A log's motion below `CUTOFF`, and the rigid body's torque of it."""

    t: Array  #: Clock without long waits. (T,) [s]
    q: Array  #: Positions. (T, n) [rad]
    dq: Array  #: Velocities. (T, n) [rad/s]
    ddq: Array  #: Accelerations. (T, n) [rad/s²]
    gravity: Array  #: Gravity torque. (T, n) [N·m]
    rigid: Array  #: Torque of rigid body and rotors. (T, n) [N·m]


def smooth_motion(run: Run) -> SmoothMotion:
    """The smooth motion of a recording."""
    t, n = without_waits(run.t), run.recording.joints
    both = zero_phase(t, np.hstack([run.q, run.dq]), CUTOFF)
    q, dq = both[:, :n], both[:, n:]
    rigid, gravity = rigid_torque(run.robot.loaded_chain, t, q, dq)
    return SmoothMotion(t, q, dq, derivative(t, dq), gravity, rigid)


def without_waits(t: Array) -> Array:
    """A clock that waits no longer than `WAIT`. (T,) [s]"""
    steps = np.diff(t)
    longest = max(WAIT, GAP * median_step(t)) if len(t) > 1 else WAIT
    if not np.any(steps > longest):
        return t
    return np.asarray(summed(np.minimum(steps, longest)) + t[0])


def rigid_torque(chain: Chain, t: Array, q: Array, dq: Array) -> tuple[Array, Array]:
    """Torque of a chain with rotors, ṗ − Cᵀq̇ + g, and g. (T, n) each [N·m]"""
    found = momentum_terms(chain, q, dq)
    return derivative(t, found.p) - found.coriolis_transpose_dq + found.gravity, found.gravity


def friction_shapes(run: Run, gravity: Array) -> Iterator[Array]:
    """Possible errors of each joint's friction, from the measured motion.

    The smoothed sign, how far the presliding deflection is from it, the sign times the
    load, the velocity and its signed square. (T, n) each
    """
    q, dq = run.q, run.dq
    sign = np.tanh(dq / SMOOTHING)
    # One after the other: of a long log all of them have no room.
    yield sign
    yield play(q, PLAY).state - sign
    yield abs(gravity) * sign
    yield dq
    yield dq * abs(dq)


def usual_friction(robot: Robot) -> Array:
    """Dry, viscous, quadratic friction that judges a model's error. (3, n)

    Other curves are fitted; of a sigmoid's amplitude seven tenths count as dry.
    [N·m], [N·m·s/rad], [N·m·s²/rad²]
    """
    found = np.zeros((robot.joints, 3))
    dry = dry_friction(robot.friction, robot.joints)
    for j, joint in enumerate(robot.friction):
        if "amplitude" in joint.parameters:
            found[j, 0] = 0.7 * abs(joint.parameters["amplitude"])
        elif joint.model != "none":
            limit = robot.limits.qd_max[j]
            speed = np.linspace(0.05, 1.0, 40) * (limit if np.isfinite(limit) else USUAL_SPEED)
            found[j] = np.polyfit(speed, steady_torque(joint, speed), 2)[::-1]
            found[j, 0] = abs(dry[j] or found[j, 0])
    return found.T


class ModelError(NamedTuple):
    """A value for each column: an error of the model, or its expected size."""

    inertial: Array  #: Of the links, in the regressor's order. (10n,)
    rotor: Array  #: Of the reflected rotor inertias. (n,) [kg·m²]
    drive: Array  #: Of the drive constants, as a share. (n,)
    friction: Array  #: Of the friction's shapes. (5, n)
    offset: Array  #: Of a constant torque. (n,) [N·m]

    @property
    def values(self) -> Array:
        """The values in the order of `column_numbers`. (P,)"""
        mine = np.column_stack([self.rotor, self.drive, *self.friction, self.offset])
        return np.concatenate([self.inertial, mine.ravel()])

    def torque(self, run: Run, motion: SmoothMotion) -> Array:
        """Torque A δx that a model with this error lacks. (T, n) [N·m]"""
        chain = run.robot.loaded_chain
        wrong = with_parameters(
            chain, chain_parameters(chain) + self.inertial, chain.rotor_inertia + self.rotor
        )
        torque, _ = rigid_torque(wrong, motion.t, motion.q, motion.dq)
        torque += (self.drive - 1.0) * motion.rigid + self.offset
        gravity, t = motion.gravity, run.coarse.t
        if t is not run.t:
            torque, gravity = (resample_columns(run.t, t, x) for x in (torque, gravity))
        for shape, value in zip(friction_shapes(run, gravity), self.friction, strict=True):
            torque += value * shape
        return torque


def error_of(values: Array, joints: int) -> ModelError:
    """The model error with these values, in the order of `column_numbers`."""
    inertial, own = np.split(values, [LINK * joints])
    rotor, drive, *friction, offset = own.reshape(joints, -1).T
    return ModelError(inertial, rotor, drive, np.array(friction), offset)


def column_numbers(joint: int, joints: int) -> Indices:
    """Columns of one joint's row among all: links from it on, then its own."""
    own = LINK * joints + (SHAPES + 3) * joint
    return np.asarray(np.r_[LINK * joint : LINK * joints, own : own + SHAPES + 3])


def expected_error(robot: Robot) -> ModelError:
    """SD of the model's error in each column, by the robot's numbers."""
    chain, (dry, viscous, quadratic) = robot.loaded_chain, usual_friction(robot)
    inertial = np.empty((chain.joints, LINK))
    for j, (m, c) in enumerate(zip(chain.mass, chain.com, strict=True)):
        reach = np.dot(c, c)
        tensor = 0.2 * (np.trace(chain.inertia[j]) + m * reach) + 0.02 * m * np.sqrt(reach) + 1e-4
        inertial[j] = [0.05 * m, *(0.01 * m + 0.05 * m * abs(c)), *[tensor] * len(TENSOR)]
    shapes = [
        0.2 * dry + 0.05,
        0.7 * dry + 0.05,
        0.0 * dry + 0.03,
        0.4 * abs(viscous) + 0.1,
        0.4 * abs(quadratic) + 0.05,
    ]
    return ModelError(
        inertial=inertial.ravel(),
        rotor=(0.0 if robot.torque_source == "link_torque" else 0.2) * chain.rotor_inertia,
        drive=np.full(chain.joints, 0.02),
        friction=np.array(shapes),
        offset=0.15 * dry + 0.02,
    )


def friction_alone(robot: Robot) -> ModelError:
    """The expected error of friction's shapes alone."""
    expected = expected_error(robot)
    none = ModelError(*(0.0 * values for values in expected))
    return none._replace(friction=expected.friction)


def error_columns(
    run: Run, motion: SmoothMotion, expected: ModelError, stride: int
) -> list[Array]:
    """Each joint's rows of A, `column_numbers`, times their SDs. (S, p)"""
    n, kept, sds = run.robot.joints, slice(None, None, stride), expected.values
    shapes = [
        motion.dq[kept] if k == SHAPES - 2 else zero_phase(motion.t, shape, CUTOFF)[kept]
        for k, shape in enumerate(friction_shapes(run, motion.gravity))
    ]
    q, dq, ddq, rigid = (x[kept] for x in (motion.q, motion.dq, motion.ddq, motion.rigid))
    mine = np.stack([ddq, rigid, *shapes, np.ones_like(q)], axis=2)
    columns = [np.empty((len(q), len(column_numbers(j, n)))) for j in range(n)]
    for start in range(0, len(q), CHUNK):
        span = slice(start, start + CHUNK)
        rows = torque_regressor(run.robot.loaded_chain, q[span], dq[span], ddq[span])
        for j, column in enumerate(columns):
            column[span] = (
                np.hstack([rows[:, j, LINK * j :], mine[span, j]]) * sds[column_numbers(j, n)]
            )
    return columns
