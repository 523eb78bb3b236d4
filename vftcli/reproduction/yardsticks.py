"""The yardsticks of the benchmark: scripts that compute the same, one sample after another."""

from typing import Any

import numpy as np

from vftcli.observers import KalmanObserver
from vftcli.robots.literal import literal_momentum_terms
from vftcli.signals.arrays import Array
from vftcli.signals.packages import needed
from vftcli.signals.recording import Recording


def rnea_loop(model: Any, q: Array, dq: Array) -> None:  # noqa: ANN401
    """The yardstick: one bare `pin.rnea` call a sample, one term, nothing else."""
    pin = needed("pinocchio", "the benchmark")

    data, zero = model.createData(), np.zeros(model.nv)
    for k in range(len(q)):
        pin.rnea(model, data, q[k], dq[k], zero)


def analytic_script(model: Any, recording: Recording, kalman: KalmanObserver) -> None:  # noqa: ANN401
    """What one would write at first: Pinocchio a sample, and a dense Kalman filter."""
    pin = needed("pinocchio", "the benchmark")

    q, dq, tau = recording.q, recording.require("dq"), recording.require("torque")
    data, step = model.createData(), recording.median_step
    p, mu = np.empty_like(q), np.empty_like(q)
    for k in range(len(q)):
        M = pin.crba(model, data, q[k])
        C = pin.computeCoriolisMatrix(model, data, q[k], dq[k])
        p[k] = M @ dq[k]
        mu[k] = tau[k] + C.T @ dq[k] - pin.computeGeneralizedGravity(model, data, q[k])
    first_order_loops(p, mu, step)
    dense_kalman_loop(p, mu, step, kalman)
    dense_kalman_loop(p, mu, step, kalman)


def literal_script(model: Any, recording: Recording, kalman: KalmanObserver) -> None:  # noqa: ANN401
    """The paper's own way, (7)–(16) and (19)–(44) sample by sample.

    n + 3 RNEA calls a sample, FDO, GMO, the Kalman filter by forward Euler, and the one by
    zero-order hold with its matrices made anew at every sample from fifth-order Taylor series, as
    Sec. II-D describes.
    """
    terms = literal_momentum_terms(model, recording.q, recording.require("dq"))
    mu = recording.require("torque") + terms.coriolis_transpose_dq - terms.gravity
    first_order_loops(terms.p, mu, recording.median_step)
    dense_kalman_loop(terms.p, mu, recording.median_step, kalman)
    dense_kalman_loop(terms.p, mu, recording.median_step, kalman, rebuild=True)


def first_order_loops(p: Array, mu: Array, step: float, rate: float = 10.0) -> tuple[Array, Array]:
    """FDO and GMO, one sample after another."""
    a = 0.5 * rate * step
    y1, y2, r = np.zeros(p.shape[1]), -rate * p[0], np.zeros(p.shape[1])
    for k in range(1, len(p)):
        y1 = (1 - a) / (1 + a) * y1 - a / (1 + a) * (mu[k] + mu[k - 1])
        y2 = (1 - a) / (1 + a) * y2 - rate * a / (1 + a) * (p[k] + p[k - 1])
        r = ((1 - a) * r + rate * (p[k] - p[k - 1]) - a * (mu[k] + mu[k - 1])) / (1 + a)
    return y1 + y2 + rate * p[-1], r


def taylor_exponential(A: Array, order: int = 5) -> Array:
    """exp(A) by its Taylor series, as the paper approximates it."""
    term = total = np.eye(len(A))
    for k in range(1, order + 1):
        term = term @ A / k
        total = total + term
    return total


def held_matrices(step: float, q_p: Array, q_tau: Array) -> tuple[Array, Array, Array]:
    """A, B (43) and Q (44, corrected) of the zero-order hold, by Taylor series."""
    n = len(q_p)
    eye, zero = np.eye(n), np.zeros((n, n))
    A_c = np.block([[zero, eye], [zero, zero]])
    B_c = np.vstack([eye, zero])
    both = taylor_exponential(np.block([[A_c, B_c], [np.zeros((n, 3 * n))]]) * step)
    Q_c = np.diag(np.concatenate([q_p, q_tau]))
    M = taylor_exponential(np.block([[A_c, Q_c], [np.zeros_like(A_c), -A_c.T]]) * step)
    Q = M[: 2 * n, 2 * n :] @ M[: 2 * n, : 2 * n].T
    return both[: 2 * n, : 2 * n], both[: 2 * n, 2 * n :], Q


def dense_kalman_loop(
    p: Array,
    mu: Array,
    step: float,
    kalman: KalmanObserver,
    *,
    rebuild: bool = False,
) -> Array:
    """The 2n-state textbook Kalman filter with its covariance, one sample after another.

    With `rebuild` its matrices are made anew at every sample.
    """
    n = p.shape[1]
    model, prior = kalman.model(step, n), kalman.steady(step, n).prior
    densities = kalman.densities(n)
    eye, zero = np.eye(n), np.zeros((n, n))
    A = np.block([[eye, np.diag(model.a12)], [zero, np.diag(model.a22)]])
    B, C = np.vstack([step * eye, zero]), np.hstack([eye, zero])
    Q = np.block(
        [[np.diag(model.q11), np.diag(model.q12)], [np.diag(model.q12), np.diag(model.q22)]]
    )
    R = np.diag(model.r)
    P = np.block(
        [[np.diag(prior.p11), np.diag(prior.p12)], [np.diag(prior.p12), np.diag(prior.p22)]]
    )
    x, identity = np.concatenate([p[0], np.zeros(n)]), np.eye(2 * n)
    for k in range(len(p)):
        if rebuild:
            A, B, Q = held_matrices(step, densities.q_p, densities.q_tau)
        if k:
            x = A @ x + B @ (0.5 * (mu[k] + mu[k - 1]))
            P = A @ P @ A.T + Q
        L = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
        x = x + L @ (p[k] - C @ x)
        I_LC = identity - L @ C
        P = I_LC @ P @ I_LC.T + L @ R @ L.T
    return x
