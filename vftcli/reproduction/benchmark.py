"""The benchmark: Table II on this machine, and the ratios that do not depend on it.

Every ratio is between things measured in one run, interleaved round by round, so that a machine
whose speed drifts drifts for both sides. Medians over the rounds are reported.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from vftcli.doctor import Examiner, examine
from vftcli.observers import BEST, PAPER, KalmanObserver
from vftcli.observers.auto_tuning import tune_to_spectra
from vftcli.observers.choice import ObserverChoice
from vftcli.observers.spectra import Part, Spectra, spectra_of
from vftcli.readers import read
from vftcli.readers.ahead import header, wanted_columns
from vftcli.readers.opening import head_of
from vftcli.reproduction.yardsticks import analytic_script, literal_script, rnea_loop
from vftcli.robots import Robot, load_robot
from vftcli.robots.terms import DynamicsTerms, dynamics_terms
from vftcli.signals.arrays import Array
from vftcli.signals.names import EFFORTS, EXAMINED
from vftcli.signals.recording import Recording
from vftcli.virtual_sensor.smoother.noise import FreeTerms
from vftcli.virtual_sensor.smoother.smoothing import smooth_wrench

SAMPLES = 30_060
"""Samples of the paper's Table II."""

SCRIPT_SAMPLES = 1_500
"""Samples the slow per-sample scripts run over; their time is scaled to all samples."""

FREE_SECONDS = 8.0
"""Length of the part that counts as free for the observers that the log tunes. [s]"""

TUNED = ("kfo-auto", "rts-auto")
"""Observers that are timed with their tuning."""

SMOOTHER = "wrench smoother"
"""Name of the smoother of the whole log's wrench."""

LOOKING_BACK = (BEST, "kfo-rts", *TUNED)
"""Observers that need a complete log."""

JITTER = 0.05
"""How far the steps of the jittering clock stray, of their mean. [1]"""

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


def jittering(motion: Recording) -> Recording:
    """The same motion on a clock that jitters by 5 %, seed 1."""
    strayed = np.random.default_rng(1).uniform(-JITTER, JITTER, motion.samples) * motion.median_step
    return replace(motion, t=motion.t + 0.5 * strayed)


def simd() -> str:
    """The widest instructions that NumPy found on this machine, as it names them."""
    found = np.show_config(mode="dicts") or {}
    return str((found.get("SIMD Extensions", {}).get("found") or ["baseline"])[-1])


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


def benchmark(robot_name: str = "ur5", samples: int = SAMPLES, rounds: int = 7) -> dict[str, Any]:
    """Measure the observers and the ratios of the project's bars.

    Returns:
        ``observers``: rows (name, total_s, per_sample_us, paper_s), dynamics included in none;
        ``dynamics``: the batched terms; ``core``: these and all four observers, on the even clock,
        on one that jitters, and when first called; ``ratios``: core_over_rnea_loop,
        core_over_rnea_loop_jittering, core_over_rnea_loop_cold, analytic_script_over_core,
        literal_script_over_core, complete_over_core, best_over_observers; and what was run.
        ``complete_log`` holds the spectra and the observers that need a complete log: the tuned
        ones with their tuning, ``best`` without, its smoothing pass alone. best_over_observers is
        that pass over the paper's four together, dynamics in neither; ``wrench smoother`` is the
        wrench of the whole log, its noise and prior included.
    """
    robot = load_robot(robot_name)
    recording = circle(robot, samples)
    timings = Timings()
    with one_core():
        run_rounds(timings, robot, recording, rounds)
    core, rnea = timings.median("core"), timings.median("rnea loop")
    return {
        "simd": simd(),
        "robot": robot.name,
        "samples": samples,
        "rounds": rounds,
        "observers": [
            {"name": name, **timings.row(name, samples), "paper_s": PAPER_TABLE_2.get(name)}
            for name in PAPER
        ],
        "complete_log": [
            {"name": name, **timings.row(name, samples)}
            for name in ("spectra", *LOOKING_BACK, SMOOTHER)
            if name in timings.seconds
        ],
        "dynamics": timings.row("dynamics", samples),
        "core": [
            {"name": name, **timings.row(name, samples)}
            for name in ("core", "jittering core", "cold core")
        ],
        "ratios": {
            "core_over_rnea_loop": core / rnea,
            "core_over_rnea_loop_jittering": timings.median("jittering core") / rnea,
            "core_over_rnea_loop_cold": timings.median("cold core") / rnea,
            "analytic_script_over_core": timings.median("analytic script") / core,
            "literal_script_over_core": timings.median("literal script") / core,
            "complete_over_core": timings.median("complete") / core,
            "best_over_observers": timings.median(BEST) / sum(map(timings.median, PAPER)),
        },
    }


def estimate_tuned(name: str, terms: DynamicsTerms, found: Spectra) -> None:
    """Tune an observer to spectra and run it."""
    tune_to_spectra(name, found).estimate(terms)


def run_rounds(timings: Timings, robot: Robot, recording: Recording, rounds: int) -> None:
    """Run everything once unmeasured, then interleaved for `rounds` rounds."""
    built, _ = ObserverChoice(names=(*PAPER, "kfo-rts")).build(robot, recording.median_step)
    observers, smoother = dict(zip(PAPER, built[:-1], strict=True)), built[-1]
    q, dq, uneven = recording.q, recording.require("dq"), jittering(recording)
    few = min(SCRIPT_SAMPLES, recording.samples)
    short = recording.between(0.0, float(recording.t[few - 1]))
    scale, model = recording.samples / few, robot.model
    kalman = KalmanObserver(discretisation="zoh", r_diag=0.5, q_p_diag=0.01, q_tau_diag=5000.0)

    def core(log: Recording = recording) -> DynamicsTerms:
        terms = dynamics_terms(log, robot)
        for observer in observers.values():
            observer.estimate(terms)
        return terms

    free = recording.t < FREE_SECONDS

    def spectra(terms: DynamicsTerms) -> Spectra:
        return spectra_of(Part(terms, ~free), [Part(terms, free)])

    def complete() -> None:
        terms = core()
        smoother.estimate(terms)
        found = spectra(terms)
        for name in TUNED:
            estimate_tuned(name, terms, found)

    timings.measure("cold core", core)
    terms = core()
    found = spectra(terms)
    part = [FreeTerms(terms, q, free)]
    work: dict[str, Callable[[], object]] = {
        "core": core,
        "jittering core": partial(core, uneven),
        "complete": complete,
        "spectra": partial(spectra, terms),
        "kfo-rts": partial(smoother.estimate, terms),
        BEST: partial(tune_to_spectra(BEST, found).estimate, terms),
        **({SMOOTHER: partial(smooth_wrench, terms, q, robot, part)} if q.shape[1] >= 6 else {}),
        **{name: partial(estimate_tuned, name, terms, found) for name in TUNED},
        "rnea loop": partial(rnea_loop, model, np.array(q), np.array(dq)),
        "dynamics": partial(dynamics_terms, recording, robot),
        **{name: partial(observer.estimate, terms) for name, observer in observers.items()},
    }
    scripts = {"analytic script": analytic_script, "literal script": literal_script}
    work["jittering core"]()
    complete()
    for _ in range(rounds):
        core()  # unmeasured: the scripts before it have given the memory back
        for name, call in work.items():
            timings.measure(name, call)
        for name, script in scripts.items():
            timings.measure(name, partial(script, model, short, kalman), scale)


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


READING = """
import sys
import polars
log, *columns = sys.argv[1:]
polars.read_csv(log, columns=columns)
"""
"""A program that reads some columns of a log, and nothing else."""


def command_costs(robot_name: str, log: Path, rounds: int) -> dict[str, float]:
    """What the whole command takes beside reading the same columns, each a process of its own.

    Args:
        robot_name: The arm.
        log: The log, as `wide_table` has it.
        rounds: Interleaved repetitions.

    Returns:
        ``command_s`` of ``vftcli estimate --causal``, ``reading_s``, and ``over_reading``: the
        first over the second.
    """
    head, _ = head_of(log)
    names, _ = header(head)
    columns = [names[c] for c in wanted_columns(head, log.stat().st_size, EXAMINED)]
    words = ["estimate", log, "--robot", robot_name, "--causal", "--force", "--quiet", "-o"]
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
    found = {f"{name}_s": timings.median(name) for name in commands}
    return {**found, "over_reading": found["command_s"] / found["reading_s"]}


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
