"""Table II: what an observation costs, by the paper's own way and by this program's."""

from collections.abc import Callable
from functools import partial

import numpy as np

from vftcli.observers import PAPER, KalmanObserver
from vftcli.observers.choice import ObserverChoice
from vftcli.reproduction.benchmark import SAMPLES, Timings, circle, one_core
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED, RunResult
from vftcli.robots import load_robot
from vftcli.robots.literal import literal_momentum_terms
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.arrays import Array

#: Samples the paper's way runs over, one after another; its time is scaled to all samples.
SCRIPT_SAMPLES = 1_500
ROUNDS = 3  #: Interleaved repetitions; the median counts.


def computing_time(_seed: int) -> RunResult:
    """Seconds for the paper's samples by observer, dynamics in each, and the printed ratios."""
    with one_core():
        timings = timed()
    result = RunResult()
    for variant in (AS_PRINTED, CORRECTED):
        dynamics = timings.median(f"{variant} dynamics")
        cost = {name: dynamics + timings.median(f"{variant} {name}") for name in PAPER}
        for name, seconds in cost.items():
            result.put(variant, {f"seconds/{name}": seconds})
            result.put(variant, {f"cost/{name}": 1e6 * seconds / SAMPLES})
        for name in ("fdo", "kfo-fe"):
            result.put(variant, {f"zoh/{name}": cost["kfo-zoh"] / cost[name]})
    return result


def timed() -> Timings:
    """The parts of both ways; the printed one runs over fewer samples and is scaled."""
    robot, timings = load_robot("ur5"), Timings()
    log = circle(robot, SAMPLES)
    few = log.between(0.0, float(log.t[SCRIPT_SAMPLES - 1]))
    q, dq, step = few.q, few.require("dq"), few.median_step
    terms, short = dynamics_terms(log, robot), dynamics_terms(few, robot)
    kalman = KalmanObserver(discretisation="zoh", r_diag=0.5, q_p_diag=0.01, q_tau_diag=5000.0)
    dense = partial(dense_kalman_loop, short.p, short.mu, step, kalman)
    built, _ = ObserverChoice(names=PAPER).build(robot, step)
    work: dict[str, Callable[[], object]] = {
        f"{CORRECTED} {o.name}": partial(o.estimate, terms) for o in built
    }
    work[f"{CORRECTED} dynamics"] = partial(dynamics_terms, log, robot)
    # Both first-order observers run in one loop: each is half of it.
    both = partial(first_order_loops, short.p, short.mu, step)
    scripts: dict[str, tuple[Callable[[], object], float]] = {
        "dynamics": (partial(literal_momentum_terms, robot.model, q, dq), 1.0),
        "fdo": (both, 0.5),
        "gmo": (both, 0.5),
        "kfo-fe": (dense, 1.0),
        "kfo-zoh": (partial(dense, rebuild=True), 1.0),
    }
    for _ in range(ROUNDS):
        for name, call in work.items():
            timings.measure(name, call)
        for name, (script, share) in scripts.items():
            timings.measure(f"{AS_PRINTED} {name}", script, share * SAMPLES / len(q))
    return timings


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
