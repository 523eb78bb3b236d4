"""The developers' bars: ratios of times that do not depend on the machine.

    python tests/bench/run.py [--robot ur5] [--samples 30060] [--rounds 7]

Prints a line a ratio: its name, its value, what is over what. Of the paper's samples it takes some
minutes. Everything of a ratio is measured in one run, interleaved round by round, so that a machine
whose speed drifts drifts for both sides; medians over the rounds are printed.
"""

import argparse
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio as pin
import polars as pl

from vftcli.doctor import Examiner, examine
from vftcli.observers import KalmanObserver, ObserverChoice
from vftcli.observers.spectra import Spectra, spectra_of
from vftcli.observers.table import BEST, PAPER
from vftcli.observers.tuning import tune_to_spectra
from vftcli.pipeline import AnalysisChoice, analyse, run_of
from vftcli.readers.reading import read
from vftcli.reproduction.timing import (
    SAMPLES,
    SCRIPT_SAMPLES,
    circle,
    dense_kalman_loop,
    first_order_loops,
    jittering,
    one_core,
    rnea_loop,
    simd,
)
from vftcli.robots import Robot, load_robot
from vftcli.robots.run import Run, RunSamples
from vftcli.robots.terms import dynamics_terms, literal_momentum_terms
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.recording import EFFORTS, EXAMINED, Recording

RATIOS = {
    "core_over_rnea_loop": "four observers with dynamics / one bare pin.rnea loop",
    "core_over_rnea_loop_jittering": "the same on a clock that jitters by 5 %",
    "core_over_rnea_loop_cold": "the same when first called",
    "analytic_script_over_core": "a per-sample Pinocchio script / four observers with dynamics",
    "literal_script_over_core": "the paper's literal method / four observers with dynamics",
    "complete_over_core": "these with smoother, spectra and tuning / four observers with dynamics",
    "best_over_observers": "best, gains and correction given / four observers, dynamics in neither",
    "examination_over_estimate": "examination and reading its columns / estimate of a wide log",
    "estimate_over_reading": "vftcli estimate --causal / polars reading the same columns",
    "memory_bytes_per_sample": "B a sample beyond the log's own, a million samples of a Panda",
}
"""Name → what is over what."""

FREE_SECONDS = 8.0
"""Length of the free part for observers tuned to the log. [s]"""
TUNED = ("kfo-auto", "rts-auto")
"""Observers that are timed with their tuning."""

FILLED = "output_double_register"
"""Columns that fill the wide log and that no command reads begin so."""


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
        replace(robot, friction=())
    )


def wide_table(robot: Robot, samples: int, columns: int = 200) -> dict[str, Array]:
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
        table[f"{FILLED}_{k}"] = rng.normal(size=samples)
    return table


def core_ratios(robot: Robot, samples: int, rounds: int) -> dict[str, float]:
    """The ratios of the core: everything once unmeasured, then interleaved round by round."""
    recording, timings = circle(robot, samples), Timings()
    built, _ = ObserverChoice(names=(*PAPER, "kfo-rts")).build(robot, recording.median_step)
    observers, smoother = built[:-1], built[-1]
    uneven, few = jittering(recording), min(SCRIPT_SAMPLES, samples)
    short = recording.between(0.0, float(recording.t[few - 1]))
    kalman = KalmanObserver(discretisation="zoh", r_diag=0.5, q_p_diag=0.01, q_tau_diag=5000.0)

    def core(log: Recording = recording) -> DynamicsTerms:
        terms = dynamics_terms(log, robot)
        for observer in observers:
            observer.estimate(terms)
        return terms

    free = recording.t < FREE_SECONDS

    def spectra(terms: DynamicsTerms) -> Spectra:
        run = Run(recording=recording, robot=robot).holding(terms=terms)
        return spectra_of(RunSamples(run, ~free), [RunSamples(run, free)])

    def complete() -> None:
        terms = core()
        smoother.estimate(terms)
        found = spectra(terms)
        for name in TUNED:
            tune_to_spectra(name, found).estimate(terms)

    timings.measure("cold core", core)
    terms = core()
    work: dict[str, Callable[[], object]] = {
        "core": core,
        "jittering core": partial(core, uneven),
        "complete": complete,
        "spectra": partial(spectra, terms),
        "kfo-rts": partial(smoother.estimate, terms),
        BEST: partial(tune_to_spectra(BEST, spectra(terms)).estimate, terms),
        "rnea loop": partial(rnea_loop, robot.model, recording.q, recording.require("dq")),
        "dynamics": partial(dynamics_terms, recording, robot),
        **{observer.name: partial(observer.estimate, terms) for observer in observers},
    }
    scripts = {"analytic script": analytic_script, "literal script": literal_script}
    work["jittering core"]()
    complete()
    for _ in range(rounds):
        core()  # unmeasured: the scripts before it have given the memory back
        for name, call in work.items():
            timings.measure(name, call)
        for name, script in scripts.items():
            timings.measure(name, partial(script, robot.model, short, kalman), samples / few)
    core_s, rnea = timings.median("core"), timings.median("rnea loop")
    return {
        "core_over_rnea_loop": core_s / rnea,
        "core_over_rnea_loop_jittering": timings.median("jittering core") / rnea,
        "core_over_rnea_loop_cold": timings.median("cold core") / rnea,
        "analytic_script_over_core": timings.median("analytic script") / core_s,
        "literal_script_over_core": timings.median("literal script") / core_s,
        "complete_over_core": timings.median("complete") / core_s,
        "best_over_observers": timings.median(BEST) / sum(map(timings.median, PAPER)),
    }


def analytic_script(model: Any, recording: Recording, kalman: KalmanObserver) -> None:
    """What one would write at first: Pinocchio a sample, and a dense Kalman filter."""
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


def literal_script(model: Any, recording: Recording, kalman: KalmanObserver) -> None:
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


def examination_ratio(robot: Robot, log: Path, rounds: int) -> float:
    """What the examination and reading the columns that it alone looks at take of an estimate.

    An estimate is everything: reading, examination, dynamics and observers. Loading the code is in
    none of them.
    """
    timings, computed = Timings(), frozenset(("dq", *EFFORTS))
    causal = ObserverChoice(names=PAPER)

    def whole() -> None:
        recording = read(log, signals=EXAMINED)
        choice = AnalysisChoice(observers=causal, examiner=Examiner())
        analyse(run_of(recording, robot, choice), choice)

    recording = read(log, signals=EXAMINED)
    whole()
    for _ in range(rounds):
        timings.measure("examination", lambda: examine(recording, robot))
        timings.measure("all columns", lambda: read(log, signals=EXAMINED))
        timings.measure("columns", lambda: read(log, signals=computed))
        timings.measure("estimate", whole)
    columns = timings.median("all columns") - timings.median("columns")
    return (timings.median("examination") + columns) / timings.median("estimate")


READING = """
import sys
import polars
log, *columns = sys.argv[1:]
polars.read_csv(log, columns=columns)
"""
"""A program that reads some columns of a log, and nothing else."""


def command_ratio(robot: Robot, log: Path, columns: list[str], rounds: int) -> float:
    """`vftcli estimate --causal` over reading the same columns, each a process of its own."""
    words = ["estimate", log, "--robot", robot.name, "--causal", "--force", "--quiet", "-o"]
    timings = Timings()
    with TemporaryDirectory() as folder:
        commands = {
            "reading": [sys.executable, "-c", READING, log, *columns],
            "command": [sys.executable, "-m", "vftcli", *words, folder],
        }
        for _ in range(rounds):
            for name, command in commands.items():
                run = partial(subprocess.run, command, check=True, capture_output=True)
                timings.measure(name, run)
    return timings.median("command") / timings.median("reading")


def memory_per_sample(samples: int) -> float:
    """Peak memory of dynamics and all four observers beyond the recording's own. [B/sample]"""
    robot = load_robot("panda")
    recording = circle(robot, samples)
    observers, _ = ObserverChoice(names=PAPER).build(robot, recording.median_step)
    tracemalloc.start()
    terms = dynamics_terms(recording, robot)
    estimates = [observer.estimate(terms) for observer in observers]
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak / len(estimates[0].t)


def log_ratios(robot: Robot, samples: int, rounds: int) -> dict[str, float]:
    """The ratios of a wide log, which is removed again."""
    with TemporaryDirectory() as folder:
        log, table = Path(folder) / "long.csv", wide_table(robot, samples)
        pl.DataFrame(table).write_csv(log)
        columns = [name for name in table if not name.startswith(FILLED)]
        return {
            "examination_over_estimate": examination_ratio(robot, log, rounds),
            "estimate_over_reading": command_ratio(robot, log, columns, rounds),
        }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="ur5")
    parser.add_argument("--samples", type=int, default=SAMPLES)
    parser.add_argument("--rounds", type=int, default=7)
    chosen = parser.parse_args()
    print(
        f"{chosen.robot}, {chosen.samples} samples, {chosen.rounds} rounds, NumPy with {simd()}"
    )
    run = (load_robot(chosen.robot), chosen.samples, chosen.rounds)
    with one_core():
        ratios = core_ratios(*run)
    ratios |= {**log_ratios(*run), "memory_bytes_per_sample": memory_per_sample(1_000_000)}
    for name, value in ratios.items():
        print(f"{name:<30} {value:8.3g}  {RATIOS[name]}")


if __name__ == "__main__":
    main()
