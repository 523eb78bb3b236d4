"""Logs of arms whose torques are known, made by their own profiles: the doctor is held to these."""

from dataclasses import replace

import numpy as np

from vftcli.robots import Payload, Robot, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

FRICTION = 4.0  # Coulomb friction of every joint. [N·m]


def carrying(robot: Robot, load: float) -> Robot:
    """The arm with a point mass 5 cm before its flange. [kg]"""
    if not load:
        return robot
    com = np.array([0.0, 0.0, 0.05])
    return robot.with_payload(Payload(mass=load, com=com, inertia=np.zeros((3, 3))))


def moving(name="ur10e", *, load=0.0, seconds=12.0, up=None, seed=0) -> Recording:
    """An arm that moves by its own dynamics, with Coulomb friction, measured by its own signal.

    Torque by the momentum equation: ṗ by central differences of p, exact to the order of the step
    squared. `up` is where up is in base axes, as a unit vector; None for an upright base.
    """
    arm = carrying(load_robot(name), load)
    chain = arm.loaded_chain
    if up is not None:
        chain = replace(chain, gravity=-9.81 * up)
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, 0.008)
    n = arm.joints
    rate, phase = rng.uniform(1, 2, n), rng.uniform(0, 6, n)
    q = rng.uniform(-1, 1, n) + 0.6 * np.sin(np.outer(t, rate) + phase)
    dq = 0.6 * rate * np.cos(np.outer(t, rate) + phase)
    terms = momentum_terms(chain, q, dq)
    torque = np.gradient(terms.p, t, axis=0) - terms.coriolis_transpose_dq + terms.gravity
    torque = torque + FRICTION * np.tanh(dq / 0.01)
    if arm.torque_constant is not None:
        return Recording(t=t, q=q, dq=dq, current=torque / arm.torque_constant)
    return Recording(t=t, q=q, dq=dq, torque=torque)


def gravity(robot: Robot, recording: Recording) -> Array:
    """Torque that holds the arm at the poses of a log. (T, n) [N·m]"""
    still = np.zeros_like(recording.q)
    return np.asarray(momentum_terms(robot.loaded_chain, recording.q, still).gravity)


def exchanged(columns: Array, i: int, j: int) -> Array:
    """Columns with two of them exchanged, counted from 1. (T, n)"""
    order = np.arange(columns.shape[1])
    order[[i - 1, j - 1]] = j - 1, i - 1
    return columns[:, order]
