"""An arm in smooth motion whose model is wrong by a known amount."""

from dataclasses import replace

import numpy as np

from vftcli.bias.model_error import ModelError, expected_error
from vftcli.robots import load_robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.robots.robot import Limits, SensorNoise
from vftcli.robots.run import Run
from vftcli.robots.running_friction import play
from vftcli.signals.recording import Recording

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
    each = {
        name: getattr(chain, name)[:n]
        for name in (
            "names",
            "rotation",
            "translation",
            "mass",
            "com",
            "inertia",
            "rotor_inertia",
        )
    }
    limits = Limits(**{key: value[:n] for key, value in vars(robot.limits).items()})
    noise = SensorNoise(**{key: value[:n] for key, value in vars(robot.noise).items()})
    return replace(
        robot,
        chain=replace(chain, **each),
        torque_constant=robot.torque_constant[:n],
        friction=robot.friction[:n],
        limits=limits,
        noise=noise,
    )


def wrong_run(robot, error=None, external=None, seconds=30.0, noise=0.0, seed=1):
    """A log of the arm that the robot describes but for `error`, touched by `external`. (T, n)

    White torque noise from seed 5. The torque is made by the regressor and the friction's formulas.
    """
    t = STEP * np.arange(round(seconds / STEP))
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


def ur10e():
    """The robot most tests are on."""
    return load_robot("ur10e")
