"""The benchmark: Table II on this machine, and the ratios that do not depend on it.

Every ratio is between things measured in one run, interleaved round by round, so that a machine
whose speed drifts drifts for both sides. Medians over the rounds are reported.
"""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.doctor import Examiner, examine
from vftcli.doctor.examiner import EXAMINED
from vftcli.observers import BEST, PAPER, KalmanObserver
from vftcli.observers.auto_tuning import tune_to_spectra
from vftcli.observers.choice import ObserverChoice
from vftcli.observers.spectra import Part, Spectra, spectra_of
from vftcli.readers import read
from vftcli.robots import Robot, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.literal import literal_momentum_terms
from vftcli.robots.terms import DynamicsTerms, dynamics_terms
from vftcli.signals.arrays import Array
from vftcli.signals.packages import needed
from vftcli.signals.recording import EFFORTS, Recording

SAMPLES = 30_060
"""Samples of the paper's Table II."""

SCRIPT_SAMPLES = 1_500
"""Samples the slow per-sample scripts run over; their time is scaled to all samples."""

FREE_SECONDS = 8.0
"""Length of the part that counts as free for the observers that the log tunes. [s]"""

TUNED = ("kfo-auto", "rts-auto")
"""Observers that are timed with their tuning."""

LOOKING_BACK = (BEST, "kfo-rts", *TUNED)
"""Observers that need a complete log."""

PAPER_TABLE_2 = {"fdo": 10.869, "gmo": 10.541, "kfo-fe": 17.578, "kfo-zoh": 58.363}
"""The paper's total times over 30 060 samples on its laptop. [s]"""


@dataclass
class Timings:
    """Seconds by name, one value a round."""

    seconds: dict[str, list[float]] = field(default_factory=dict)

    def measure(self, name: str, work: Callable[[], object], scale: float = 1.0) -> None:
        """Time one call; `scale` extrapolates a shortened one."""
        begin = time.perf_counter()
        work()
        self.seconds.setdefault(name, []).append((time.perf_counter() - begin) * scale)

    def median(self, name: str) -> float:
        """Median over the rounds. [s]"""
        return float(np.median(self.seconds[name]))

    def row(self, name: str, samples: int) -> dict[str, float]:
        """The time of one name, in all and for each of so many samples."""
        total = self.median(name)
        return {"total_s": total, "per_sample_us": total / samples * 1e6}


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process on one core while it is measured, where the system lets it choose."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def circle(robot: Robot, samples: int, rate: float = 125.0) -> Recording:
    """A smooth periodic motion of an arm with plausible currents, seed 0."""
    rng = np.random.default_rng(0)
    t = np.arange(samples) / rate
    phase = rng.uniform(0.0, 2.0 * np.pi, robot.joints)
    omega = 2.0 * np.pi / 4.0
    angle = omega * t[:, None] + phase
    q, dq = 0.4 * np.sin(angle), 0.4 * omega * np.cos(angle)
    current = rng.normal(0.0, 1.0, q.shape)
    return Recording(t=t, q=q, dq=dq, current=current, torque=current)


def driven(motion: Recording, robot: Robot) -> tuple[Recording, Array]:
    """The same motion with the efforts that drive it: what the doctor calls sound.

    Returns:
        The recording with the current and torque that the arm's own model asks for, friction
        included, and the torque of the rigid body alone, as a controller logs it. (T, n) [N·m]
    """
    zero = np.zeros_like(motion.q)
    free = replace(motion, current=None, torque=zero)

    def asked(arm: Robot) -> Array:
        terms = dynamics_terms(free, arm)
        # ṗ = μ with the drive torque in it: what is missing is that torque.
        return np.asarray(np.gradient(terms.p, motion.t, axis=0) - terms.mu)

    torque = asked(robot)
    constant = 1.0 if robot.torque_constant is None else robot.torque_constant
    return replace(motion, current=torque / constant, torque=torque), asked(
        robot.without_friction()
    )


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


def benchmark(robot_name: str = "ur5", samples: int = SAMPLES, rounds: int = 7) -> dict[str, Any]:
    """Measure the observers and the ratios of the project's bars.

    Returns:
        ``observers``: rows (name, total_s, per_sample_us, paper_s), dynamics included in none;
        ``dynamics``: the batched terms; ``ratios``: core_over_rnea_loop, analytic_script_over_core,
        literal_script_over_core, complete_over_core, best_over_observers; and what was run.
        ``complete_log`` holds the spectra and the observers that need a complete log: the tuned
        ones with their tuning, ``best`` without, its smoothing pass alone. best_over_observers is
        that pass over the paper's four together, dynamics in neither.
    """
    robot = load_robot(robot_name)
    recording = circle(robot, samples)
    timings = Timings()
    with one_core():
        run_rounds(timings, robot, recording, rounds)
    core = timings.median("core")
    return {
        "robot": robot.name,
        "samples": samples,
        "rounds": rounds,
        "observers": [
            {"name": name, **timings.row(name, samples), "paper_s": PAPER_TABLE_2.get(name)}
            for name in PAPER
        ],
        "complete_log": [
            {"name": name, **timings.row(name, samples)} for name in ("spectra", *LOOKING_BACK)
        ],
        "dynamics": timings.row("dynamics", samples),
        "ratios": {
            "core_over_rnea_loop": core / timings.median("rnea loop"),
            "analytic_script_over_core": timings.median("analytic script") / core,
            "literal_script_over_core": timings.median("literal script") / core,
            "complete_over_core": timings.median("complete") / core,
            "best_over_observers": timings.median(BEST) / sum(map(timings.median, PAPER)),
        },
    }


def run_rounds(timings: Timings, robot: Robot, recording: Recording, rounds: int) -> None:
    """Run everything once unmeasured, then interleaved for `rounds` rounds."""
    built, _ = ObserverChoice(names=(*PAPER, "kfo-rts")).build(robot, recording.median_step)
    observers, smoother = dict(zip(PAPER, built[:-1], strict=True)), built[-1]
    q, dq = np.array(recording.q), np.array(recording.require("dq"))
    few = min(SCRIPT_SAMPLES, recording.samples)
    short = recording.between(0.0, float(recording.t[few - 1]))
    scale, model = recording.samples / few, robot.model
    kalman = KalmanObserver(discretisation="zoh", r_diag=0.5, q_p_diag=0.01, q_tau_diag=5000.0)

    def core() -> DynamicsTerms:
        terms = dynamics_terms(recording, robot)
        for observer in observers.values():
            observer.estimate(terms)
        return terms

    free = recording.t < FREE_SECONDS

    def spectra(terms: DynamicsTerms) -> Spectra:
        return spectra_of(Part(terms, ~free), [Part(terms, free)])

    def auto(name: str, terms: DynamicsTerms, found: Spectra) -> None:
        tune_to_spectra(name, found).estimate(terms)

    def complete() -> None:
        terms = core()
        smoother.estimate(terms)
        found = spectra(terms)
        for name in TUNED:
            auto(name, terms, found)

    terms = core()
    found = spectra(terms)
    best = tune_to_spectra(BEST, found)
    complete()
    momentum_terms(robot.loaded_chain, q, dq)
    for _ in range(rounds):
        core()  # unmeasured: the scripts before it have given the memory back
        timings.measure("core", core)
        timings.measure("complete", complete)
        timings.measure("spectra", lambda: spectra(terms))
        timings.measure("kfo-rts", lambda: smoother.estimate(terms))
        timings.measure(BEST, lambda: best.estimate(terms))
        for name in TUNED:
            timings.measure(name, partial(auto, name, terms, found))
        timings.measure("rnea loop", lambda: rnea_loop(model, q, dq))
        timings.measure("dynamics", lambda: dynamics_terms(recording, robot))
        for name, observer in observers.items():
            timings.measure(name, partial(observer.estimate, terms))
        timings.measure("analytic script", lambda: analytic_script(model, short, kalman), scale)
        timings.measure("literal script", lambda: literal_script(model, short, kalman), scale)


def wide_table(robot: Robot, samples: int = SAMPLES, columns: int = 200) -> dict[str, Array]:
    """A long log as UR's client records it with everything it can: RTDE's columns, and many more.

    Returns:
        Name of a column → its values. (T,)
    """
    log, rigid = driven(circle(robot, samples), robot)
    named = {"actual_q": log.q, "actual_qd": log.require("dq"), "target_moment": rigid}
    named |= dict.fromkeys(("actual_current", "target_current"), log.require("current"))
    table = {"timestamp": log.t}
    for name, values in named.items():
        table |= {f"{name}_{j}": column for j, column in enumerate(values.T)}
    rng = np.random.default_rng(1)
    for k in range(columns - len(table)):
        table[f"output_double_register_{k}"] = rng.normal(size=samples)
    return table


def examination_costs(robot_name: str, log: Path, rounds: int) -> dict[str, float]:
    """What the examination takes of an estimate, of a minute and of a long log.

    Args:
        robot_name: The arm.
        log: The long log, as `wide_table` has it.
        rounds: Interleaved repetitions.

    Returns:
        ``examination_minute_s``, of 60 s at 100 Hz; ``examination_s``, ``columns_s`` and
        ``estimate_s`` of the long log: the examination, reading the columns that it alone looks
        at, and everything: reading, examination, dynamics and observers. ``over_estimate`` is the
        first two over the last. Loading the code is in none of them.
    """
    from vftcli.pipeline import AnalysisChoice, analyse

    robot, timings = load_robot(robot_name), Timings()
    minute, _ = driven(circle(robot, 6_000, rate=100.0), robot)
    computed = frozenset(("dq", *EFFORTS))
    causal = ObserverChoice(names=PAPER)

    def whole() -> None:
        recording = read(log, signals=EXAMINED)
        analyse(recording, robot, AnalysisChoice(observers=causal, examiner=Examiner()))

    recording = read(log, signals=EXAMINED)
    whole()
    for _ in range(rounds):
        timings.measure("minute", lambda: examine(minute, robot))
        timings.measure("examination", lambda: examine(recording, robot))
        timings.measure("all columns", lambda: read(log, signals=EXAMINED))
        timings.measure("columns", lambda: read(log, signals=computed))
        timings.measure("estimate", whole)
    examination, estimate = timings.median("examination"), timings.median("estimate")
    columns = timings.median("all columns") - timings.median("columns")
    return {
        "examination_minute_s": timings.median("minute"),
        "examination_s": examination,
        "columns_s": columns,
        "estimate_s": estimate,
        "over_estimate": (examination + columns) / estimate,
    }


def memory_per_sample(robot_name: str = "panda", samples: int = 1_000_000) -> float:
    """Peak memory of dynamics and all four observers beyond the recording's own. [B/sample]"""
    import tracemalloc

    robot = load_robot(robot_name)
    recording = circle(robot, samples, rate=1000.0)
    observers, _ = ObserverChoice(names=PAPER).build(robot, recording.median_step)
    tracemalloc.start()
    terms = dynamics_terms(recording, robot)
    estimates = [observer.estimate(terms) for observer in observers]
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak / len(estimates[0].t)
