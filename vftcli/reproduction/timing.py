"""Computing times: Table II by the paper's way and by ours, and `benchmark speed`.

Rounds of all are interleaved, so that a machine's drift of speed affects all.
"""

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from vftcli.observers import KalmanObserver, ObserverChoice
from vftcli.observers.observer import Observer
from vftcli.observers.table import PAPER
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED, PAPERS, Given
from vftcli.robots import Robot, load_robot
from vftcli.robots.terms import dynamics_terms, literal_momentum_terms
from vftcli.signals.arrays import Array
from vftcli.signals.packages import installed, needed
from vftcli.signals.recording import Recording

SAMPLES = 30_060  #: Samples of the paper's Table II.
#: Samples of the paper's own loop; its time is scaled to all.
SCRIPT_SAMPLES = 1_500
ROUNDS = 3  #: Interleaved repetitions for Table II; the median counts.
JITTER = 0.05  #: Jitter of a step, as a share of the mean step. [1]
RNEA = "rnea loop"  #: Name of the yardstick, a loop of Pinocchio's `rnea`.
#: Dynamics and four observers over it, on an even and a jittering clock.
RATIOS = ("core_over_rnea_loop", "core_over_rnea_loop_jittering")
#: Line of the paper's Table II → its times of 30 060 samples. [s]
PRINTED = {line.key: line.number for line in PAPERS["huang2025"].items["table2"].lines}

Name = TypeVar("Name")
Work = Callable[[], object]  #: What is timed.


def median_times(work: Mapping[Name, Work], rounds: int) -> dict[Name, float]:
    """Name → median time of its call over the rounds. [s]"""
    seconds = np.zeros((rounds, len(work)))
    for own in seconds:
        for k, call in enumerate(work.values()):
            begin = time.perf_counter()
            call()
            own[k] = time.perf_counter() - begin
    return dict(zip(work, np.median(seconds, axis=0).tolist(), strict=True))


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process on one core for a block, if possible."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def circle(robot: Robot, samples: int) -> Recording:
    """A smooth periodic motion with plausible currents, seed 0."""
    rng = np.random.default_rng(0)
    t = np.arange(samples) / 125.0
    phase = rng.uniform(0.0, 2.0 * np.pi, robot.joints)
    omega = 2.0 * np.pi / 4.0
    angle = omega * t[:, None] + phase
    q, dq = 0.4 * np.sin(angle), 0.4 * omega * np.cos(angle)
    current = rng.normal(0.0, 1.0, q.shape)
    return Recording(t=t, q=q, dq=dq, current=current, torque=current)


def jittering(motion: Recording) -> Recording:
    """A motion on a clock that jitters by 5 %, seed 1."""
    strayed = np.random.default_rng(1).uniform(-JITTER, JITTER, motion.samples)
    return replace(motion, t=motion.t + 0.5 * (strayed * motion.median_step))


def rnea_loop(model: Any, q: Array, dq: Array) -> None:  # noqa: ANN401 - Pinocchio is untyped
    """One bare `pin.rnea` call a sample, one term, nothing else."""
    pin = needed("pinocchio", "the ratios of vftcli benchmark speed")
    data, zero = model.createData(), np.zeros(model.nv)
    for k in range(len(q)):
        pin.rnea(model, data, q[k], dq[k], zero)


def simd() -> str:
    """NumPy's name of the widest instructions on this machine."""
    found = np.show_config(mode="dicts") or {}
    return str((found.get("SIMD Extensions", {}).get("found") or ["baseline"])[-1])


def core(log: Recording, robot: Robot, observers: Sequence[Observer]) -> None:
    """Run the dynamics of a log and observers on it."""
    terms = dynamics_terms(log, robot)
    for observer in observers:
        observer.estimate(terms)


def benchmark(robot_name: str, samples: int, rounds: int) -> dict[str, Any]:
    """Times of dynamics and observers, each alone, and what was run.

    ``ratios`` are those of all together over a loop of `pin.rnea`, where Pinocchio is installed.
    """
    robot = load_robot(robot_name)
    log = circle(robot, samples)
    observers, _ = ObserverChoice(names=PAPER).build(robot, log.median_step)
    terms = dynamics_terms(log, robot)
    work: dict[str, Work] = {"dynamics": partial(dynamics_terms, log, robot)}
    work |= {each.name: partial(each.estimate, terms) for each in observers}
    if installed("pinocchio"):
        motions = zip(RATIOS, (log, jittering(log)), strict=True)
        work |= {ratio: partial(core, motion, robot, observers) for ratio, motion in motions}
        work[RNEA] = partial(rnea_loop, robot.model, log.q, log.require("dq"))
    with one_core():
        median_times(work, 1)  # of their first calls
        total = median_times(work, rounds)
    rows = {k: {"total_s": s, "per_sample_us": s / samples * 1e6} for k, s in total.items()}
    return {
        "simd": simd(),
        "robot": robot.name,
        "samples": samples,
        "rounds": rounds,
        "observers": [
            {"name": name, **rows[name], "paper_s": PRINTED[f"seconds/{name}"]} for name in PAPER
        ],
        "dynamics": rows["dynamics"],
        "ratios": {name: total[name] / total[RNEA] for name in RATIOS if name in total},
    }


def computing_time(_seed: int) -> Iterator[Given]:
    """Seconds for the paper's samples by observer; printed ratios."""
    robot, ours = load_robot("ur5"), benchmark("ur5", SAMPLES, ROUNDS)
    rows = {row["name"]: row["total_s"] for row in ours["observers"]}
    # The paper's way runs over fewer samples and is scaled.
    log = circle(robot, SCRIPT_SAMPLES)
    terms, step = dynamics_terms(log, robot), log.median_step
    kalman = KalmanObserver(discretisation="zoh", r_diag=0.5, q_p_diag=0.01, q_tau_diag=5000.0)
    dense = partial(dense_kalman_loop, terms.p, terms.mu, step, kalman)
    loops: dict[str, Work] = {
        "dynamics": partial(literal_momentum_terms, robot.model, log.q, log.require("dq")),
        **dict.fromkeys(("fdo", "gmo"), partial(first_order_loops, terms.p, terms.mu, step)),
        "kfo-fe": dense,
        "kfo-zoh": partial(dense, rebuild=True),
    }
    with one_core():
        printed = median_times(loops, ROUNDS)
    scaled = {name: SAMPLES / SCRIPT_SAMPLES * seconds for name, seconds in printed.items()}
    for name in ("fdo", "gmo"):
        scaled[name] *= 0.5  # both run in one loop
    corrected = {"dynamics": ours["dynamics"]["total_s"], **rows}
    for variant, own in ((AS_PRINTED, scaled), (CORRECTED, corrected)):
        cost = {name: own["dynamics"] + own[name] for name in PAPER}
        for name, seconds in cost.items():
            yield variant, f"seconds/{name}", seconds
        for name in ("fdo", "kfo-fe"):
            yield variant, f"zoh/{name}", cost["kfo-zoh"] / cost[name]


def first_order_loops(p: Array, mu: Array, step: float) -> tuple[Array, Array]:
    """FDO and GMO of 10 1/s, one sample after another."""
    rate = 10.0
    a = 0.5 * rate * step
    keep, share = (1 - a) / (1 + a), a / (1 + a)
    y1, y2, r = np.zeros(p.shape[1]), -rate * p[0], np.zeros(p.shape[1])
    for k in range(1, len(p)):
        y1 = keep * y1 - share * (mu[k] + mu[k - 1])
        y2 = keep * y2 - rate * share * (p[k] + p[k - 1])
        r = keep * r + rate / (1 + a) * (p[k] - p[k - 1]) - share * (mu[k] + mu[k - 1])
    return y1 + y2 + rate * p[-1], r


def taylor_exponential(A: Array) -> Array:
    """exp(A) by its Taylor series to the fifth order."""
    term = total = np.eye(len(A))
    for k in range(1, 6):
        term = term @ A / k
        total = total + term
    return total


def held_matrices(step: float, q_p: Array, q_tau: Array) -> tuple[Array, Array, Array]:
    """A, B (43) and Q (44, corrected) of the zero-order hold."""
    n = len(q_p)
    A_c, B_c = np.eye(2 * n, k=n), np.eye(2 * n, n)
    both = taylor_exponential(np.block([[A_c, B_c], [np.zeros((n, 3 * n))]]) * step)
    Q_c = np.diag(np.concatenate([q_p, q_tau]))
    M = taylor_exponential(np.block([[A_c, Q_c], [np.zeros_like(A_c), -A_c.T]]) * step)
    Q = M[: 2 * n, 2 * n :] @ M[: 2 * n, : 2 * n].T
    return both[: 2 * n, : 2 * n], both[: 2 * n, 2 * n :], Q


def dense_kalman_loop(
    p: Array, mu: Array, step: float, kalman: KalmanObserver, *, rebuild: bool = False
) -> Array:
    """Textbook Kalman filter; `rebuild`: matrices at every sample."""
    n = p.shape[1]
    prior, densities = kalman.first_prior(step, n), kalman.densities(n)
    R = np.diag(kalman.model(step, n).r)
    A, B, Q = held_matrices(step, densities.q_p, densities.q_tau)
    P11, P12, P22 = (np.diag(part) for part in (prior.p11, prior.p12, prior.p22))
    P = np.block([[P11, P12], [P12, P22]])
    identity, x = np.eye(2 * n), np.concatenate([p[0], np.zeros(n)])
    C = identity[:n]
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
