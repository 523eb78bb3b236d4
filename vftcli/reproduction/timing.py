"""Table II: what an observation costs, by the paper's own way and by this program's."""

from collections.abc import Callable
from functools import partial

from vftcli.observers import PAPER, KalmanObserver
from vftcli.observers.choice import ObserverChoice
from vftcli.reproduction.benchmark import (
    SAMPLES,
    SCRIPT_SAMPLES,
    Timings,
    circle,
    one_core,
)
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED, RunResult, Values
from vftcli.reproduction.yardsticks import dense_kalman_loop, first_order_loops
from vftcli.robots import load_robot
from vftcli.robots.literal import literal_momentum_terms
from vftcli.robots.terms import dynamics_terms

ROUNDS = 3
"""Interleaved repetitions; the median counts."""

RATIOS = {"fdo": "zoh/fdo", "kfo-fe": "zoh/kfo-fe"}
"""Observer → key of how much more the zero-order hold costs."""


def computing_time(_seed: int) -> RunResult:
    """Seconds for the paper's samples by observer, dynamics in each, and the printed ratios."""
    with one_core():
        timings = timed()
    values: Values = {}
    for variant in (AS_PRINTED, CORRECTED):
        dynamics = timings.median(f"{variant} dynamics")
        cost = {name: dynamics + timings.median(f"{variant} {name}") for name in PAPER}
        for name in PAPER:
            values.setdefault(f"seconds/{name}", {})[variant] = cost[name]
            values.setdefault(f"cost/{name}", {})[variant] = 1e6 * cost[name] / SAMPLES
        for name, key in RATIOS.items():
            values.setdefault(key, {})[variant] = cost["kfo-zoh"] / cost[name]
    return RunResult(values)


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
        f"{AS_PRINTED} dynamics": (partial(literal_momentum_terms, robot.model, q, dq), 1.0),
        f"{AS_PRINTED} fdo": (both, 0.5),
        f"{AS_PRINTED} gmo": (both, 0.5),
        f"{AS_PRINTED} kfo-fe": (dense, 1.0),
        f"{AS_PRINTED} kfo-zoh": (partial(dense, rebuild=True), 1.0),
    }
    for _ in range(ROUNDS):
        for name, call in work.items():
            timings.measure(name, call)
        for name, (script, share) in scripts.items():
            timings.measure(name, script, share * SAMPLES / len(q))
    return timings
