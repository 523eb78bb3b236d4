"""Terms of known momenta, the textbook filter over them, and observers run block by block."""

from typing import Any

import numpy as np

from vftcli.observers import KalmanObserver, MomentumObserver
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.remarks import Remark


def momentum_of(t: np.ndarray, external: np.ndarray, noise: float = 0.0) -> DynamicsTerms:
    """A body whose momentum integrates a torque that is linear between samples, plus white noise.

    Seed 3.
    """
    dt = np.diff(t, prepend=t[0])[:, None]
    middle = 0.5 * (external + np.vstack([external[:1], external[:-1]]))
    white = np.random.default_rng(3).normal(0.0, noise, external.shape)
    p = np.cumsum(dt * (middle + white), axis=0)
    return DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))


def random_walk(
    samples: int = 1500, jitter: float = 0.0, seed: int = 0, joints: int = 6
) -> DynamicsTerms:
    """A momentum that walks at random by 0.1 kg·m²/s a sample, and μ of 5 N·m, both white."""
    rng = np.random.default_rng(seed)
    steps = 0.008 * (1 + jitter * rng.uniform(-1, 1, samples - 1))
    t = np.concatenate([[0.0], np.cumsum(steps)])
    p = 2.0 + np.cumsum(rng.normal(0, 0.1, (samples, joints)), axis=0)
    return DynamicsTerms(t=t, p=p, mu=rng.normal(0, 5, (samples, joints)))


def dense_filter(observer: KalmanObserver, log: DynamicsTerms, wide: float = 0.0) -> list[Any]:
    """Of each sample the state, its covariance and A before the update, and the first two after.

    `wide` is added to the variances of the first state.
    """
    n, clock = log.joints, log.clock
    eye, zero = np.eye(n), np.zeros((n, n))
    C, whole = np.hstack([eye, zero]), np.eye(2 * n)
    p11, p12, p22 = map(np.diag, observer.first_prior(clock.step, n))
    x, P = np.append(log.p[0], np.zeros(n)), np.block([[p11, p12], [p12, p22]]) + wide * whole
    steps = []
    for k in range(log.samples):
        step = clock.step if clock.uniform else log.dt[k, 0]
        m = observer.model(step, n)
        A = np.block([[eye, np.diag(m.a12)], [zero, np.diag(m.a22)]])
        if k:
            B = np.vstack([step * eye, zero])
            Q = np.block([[np.diag(m.q11), np.diag(m.q12)], [np.diag(m.q12), np.diag(m.q22)]])
            u = log.mu[k] if observer.as_printed else 0.5 * (log.mu[k] + log.mu[k - 1])
            x, P = A @ x + B @ u, A @ P @ A.T + Q
        before = x, P, A
        L = P @ C.T @ np.linalg.inv(C @ P @ C.T + np.diag(m.r))
        x = x + L @ (log.p[k] - C @ x)
        P = (whole - L @ C) @ P @ (whole - L @ C).T + L @ np.diag(m.r) @ L.T
        steps.append((before, (x, P)))
    return steps


def run_in_blocks(
    observer: MomentumObserver, log: DynamicsTerms, size: int
) -> tuple[np.ndarray, tuple[Remark, ...]]:
    """τ̂ over a log cut into blocks of `size` samples, and the remarks of the last block."""
    state, before, tau = None, None, []
    for first in range(0, log.samples, size):
        span = slice(first, first + size)
        block = DynamicsTerms(
            t=log.t[span],
            p=log.p[span],
            mu=log.mu[span],
            log_clock=log.clock,
            before=before,
        )
        estimate, state = observer.run(block, state)
        before = block.last
        tau.append(estimate.tau)
    return np.concatenate(tau), estimate.remarks
