"""An arm in smooth motion whose model is wrong by a known amount."""

from dataclasses import replace

import numpy as np

from vftcli.bias.model_error import (
    ModelError,
    column_numbers,
    error_columns,
    expected_error,
    smooth_motion,
)
from vftcli.bias.robust_fit import Rows, slow_loads
from vftcli.robots import load_robot
from vftcli.robots.friction import friction_torque, play
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.robots.robot import Limits, SensorNoise
from vftcli.robots.run import Run
from vftcli.signals.filters import zero_phase
from vftcli.signals.recording import Recording
from vftcli.signals.rest import faster

STEP = 0.01


def motion(t, joints, seed=1):
    """Smooth positions, velocities and accelerations: three sines a joint, up to .9 Hz. (T, n)"""
    rng = np.random.default_rng(seed)
    frequency = 2 * np.pi * rng.uniform(0.05, 0.9, (3, joints))
    amplitude = rng.uniform(0.2, 0.6, (3, joints)) / frequency
    phase = frequency * t[:, None, None] + rng.uniform(0, 2 * np.pi, (3, joints))
    q = (amplitude * np.sin(phase)).sum(axis=1)
    dq = (amplitude * frequency * np.cos(phase)).sum(axis=1)
    ddq = -(amplitude * frequency**2 * np.sin(phase)).sum(axis=1)
    return q, dq, ddq


def shortened(robot, joints):
    """The robot's first joints as an arm of its own."""
    chain, n = robot.chain, joints
    names = ("names", "rotation", "translation", "mass", "com", "inertia", "rotor_inertia")
    each = {name: getattr(chain, name)[:n] for name in names}
    limits = Limits(**{key: value[:n] for key, value in vars(robot.limits).items()})
    noise = SensorNoise(**{key: value[:n] for key, value in vars(robot.noise).items()})
    own = {"torque_constant": robot.torque_constant[:n], "friction": robot.friction[:n]}
    return replace(robot, chain=replace(chain, **each), limits=limits, noise=noise, **own)


def wrong_run(robot, error=None, external=None, seconds=30.0, noise=0.0, seed=1, step=STEP):
    """A log of the arm that the robot describes but for `error`, touched by `external`. (T, n)

    White torque noise from seed 5. The torque is made by the regressor and the friction's formulas.
    """
    t = step * np.arange(round(seconds / step))
    q, dq, ddq = motion(t, robot.joints, seed)
    chain = robot.loaded_chain
    rows = torque_regressor(chain, q, dq, ddq)
    still = np.zeros_like(q)
    gravity = torque_regressor(chain, q, still, still) @ chain_parameters(chain)
    torque = rows @ chain_parameters(chain) + chain.rotor_inertia * ddq
    if error is not None:
        torque = torque * (1.0 + error.drive) + rows @ error.inertial + error.rotor * ddq
        sign = np.tanh(dq / 0.003)
        shapes = [sign, play(q, 3e-4).state - sign, np.abs(gravity) * sign, dq, dq * np.abs(dq)]
        torque = torque + sum(a * x for a, x in zip(error.friction, shapes, strict=True))
        torque = torque + error.offset
    torque = torque + friction_torque(robot.friction, dq, gravity)
    if external is not None:
        torque = torque - external(t, q)
    torque = torque + np.random.default_rng(5).normal(0.0, noise, q.shape)
    return Run(recording=Recording(t=t, q=q, dq=dq, torque=torque), robot=robot)


def drawn_error(robot, seed=2, size=1.0):
    """An error of the model, drawn from what is expected of it."""
    rng = np.random.default_rng(seed)
    values = {
        name: size * rng.normal(size=value.shape) * value
        for name, value in expected_error(robot)._asdict().items()
    }
    return ModelError(**values)


def fit_rows(run, stride, cutoff=None):
    """What the whole log's fit is given of a run, every so many samples. [Hz]"""
    motion = smooth_motion(run)
    d = np.gradient(run.terms.p, motion.t, axis=0) - run.terms.mu
    return Rows(
        columns=error_columns(run, motion, expected_error(run.robot), stride),
        loads=slow_loads(run.robot.chain, motion.t[::stride], motion.q[::stride]),
        d=(d if cutoff is None else zero_phase(motion.t, d, cutoff))[::stride],
        moves=np.any(faster(motion.dq[::stride]), axis=1),
    )


def dense(rows):
    """All columns as one matrix a joint: the model's, then each knot's and component's load."""
    P, loads = rows.unknowns, rows.loads
    A = np.zeros((len(rows.d), rows.joints, P + loads.sizes[-1]))
    for j, column in enumerate(rows.columns):
        A[:, j, column_numbers(j, rows.joints)] = column
    for size in range(loads.sizes[-1]):
        A[:, :, P + size] = loads.torque_of(np.eye(loads.sizes[-1])[size])
    return A


def by_hand(A, d, weight, sd):
    """u and its objective for some columns: (AᵀWA + diag(sd⁻²))⁻¹ AᵀWd with its sign turned."""
    A = A.reshape(-1, A.shape[-1])
    w, d = weight.ravel(), d.ravel()
    u = -np.linalg.solve(A.T @ (A * w[:, None]) + np.diag(sd**-2.0), A.T @ (w * d))
    return u, np.sum(w * (d + A @ u) ** 2) + np.sum((u / sd) ** 2)


def best_by_hand(A, d, weight, scale, rows):
    """u with the group of loads of the least objective and twice its columns."""
    P, tried = rows.unknowns, []
    for size in rows.loads.sizes:
        sd = np.concatenate([np.full(P, scale), np.ones(size)])
        u, objective = by_hand(A[..., : P + size], d, weight, sd)
        tried.append((objective + 2.0 * size, u))
    return min(tried, key=lambda pair: pair[0])[1]


def ur10e():
    return load_robot("ur10e")
