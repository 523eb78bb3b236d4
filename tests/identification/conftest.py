"""Logs made here, prepared without a filter, so that every number in a test has its origin."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from vftcli.identification.training import CUTOFF, PreparedLog, Training, prepare_training
from vftcli.robots import JointFriction, Robot, load_robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.signals.recording import Recording

UR5 = load_robot("ur5")


def prepared_log(
    t, q=None, dq=None, ddq=None, tau=None, weights=None, load=None, warmth=None, **signals
) -> PreparedLog:
    """A prepared log of exactly these signals; what is not given is zero."""
    shape = next(x for x in (q, dq, ddq, tau) if x is not None).shape
    q, dq, ddq, tau = (np.zeros(shape) if x is None else x for x in (q, dq, ddq, tau))
    own = {"t": t, "q": q, "dq": dq, "ddq": ddq, "tau": tau}
    own["weights"] = np.ones(shape) if weights is None else weights
    recording = Recording(t=t, q=q, dq=dq, torque=tau, **signals)
    kept = np.arange(len(t))
    log = PreparedLog(recording=recording, robot=UR5, cutoff=CUTOFF, kept=kept, **own)
    vars(log).update(load=np.zeros(shape) if load is None else load, warmth=warmth)
    return log


@pytest.fixture
def prepared() -> Callable[..., PreparedLog]:
    return prepared_log


def three_sines(seconds=8.0, rate=125.0, joints=6, seed=0, fastest=0.5):
    """Sums of three sines a joint up to `fastest` Hz: t, q, dq, ddq."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, 1 / rate)
    q, dq, ddq = (np.zeros((len(t), joints)) for _ in range(3))
    for k in (1, 2, 3):
        w = 2 * np.pi * fastest * k / 3
        a, b = rng.uniform(-0.4, 0.4, (2, joints))
        s, c = np.sin(w * t[:, None]), np.cos(w * t[:, None])
        q += a * s + b * c
        dq += w * (a * c - b * s)
        ddq -= w * w * (a * s + b * c)
    return t, q, dq, ddq


@pytest.fixture
def sines() -> Callable[..., tuple]:
    return three_sines


@pytest.fixture(scope="session")
def arm() -> Robot:
    """A UR5 with one friction in all joints."""
    parameters = {"coulomb": 4.0, "viscous": 6.0, "offset": 0.5}
    rubbing = JointFriction(model="coulomb-viscous-offset", parameters=parameters)
    return replace(load_robot("ur5"), friction=(rubbing,) * 6)


@pytest.fixture(scope="session")
def recording(arm) -> Recording:
    """12 s of its motion, noise of 0.1 N·m."""
    t, q, dq, ddq = three_sines(seconds=12.0, seed=2)
    torque = torque_regressor(arm.chain, q, dq, ddq) @ chain_parameters(arm.loaded_chain)
    torque = torque + arm.chain.rotor_inertia * ddq + friction_torque(arm.friction, dq)
    torque = torque + 0.1 * np.random.default_rng(0).standard_normal(q.shape)
    return Recording(t=t, q=q, dq=dq, current=torque / arm.torque_constant)


@pytest.fixture
def data(arm, recording) -> Training:
    return prepare_training([recording], arm)
