"""The benchmark: how long the observers take on this machine.

All are measured interleaved round by round, so that a machine whose speed drifts drifts for all.
Medians over the rounds are reported.
"""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from vftcli.observers import BEST, PAPER
from vftcli.observers.auto_tuning import tune_to_spectra
from vftcli.observers.choice import ObserverChoice
from vftcli.observers.spectra import Spectra, spectra_of
from vftcli.reproduction.paper import PAPERS
from vftcli.robots import Robot, load_robot
from vftcli.robots.run import Run, RunSamples
from vftcli.robots.terms import DynamicsTerms, dynamics_terms
from vftcli.signals.recording import Recording
from vftcli.virtual_sensor.smoother.smoothing import smooth_wrench

SAMPLES = 30_060  #: RunSamples of the paper's Table II.
#: Length of the part that counts as free for the observers that the log tunes. [s]
FREE_SECONDS = 8.0
TUNED = ("kfo-auto", "rts-auto")  #: Observers that are timed with their tuning.
SMOOTHER = "wrench smoother"  #: Name of the smoother of the whole log's wrench.
LOOKING_BACK = (BEST, "kfo-rts", *TUNED)  #: Observers that need a complete log.
#: Line of the paper's Table II → its total times over 30 060 samples on its laptop. [s]
PRINTED = {line.key: line.number for line in PAPERS["huang2025"].items["table2"].lines}


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


def simd() -> str:
    """The widest instructions that NumPy found on this machine, as it names them."""
    found = np.show_config(mode="dicts") or {}
    return str((found.get("SIMD Extensions", {}).get("found") or ["baseline"])[-1])


def benchmark(robot_name: str = "ur5", samples: int = SAMPLES, rounds: int = 7) -> dict[str, Any]:
    """Time the observers.

    Returns:
        ``observers``: rows (name, total_s, per_sample_us, paper_s), dynamics included in none;
        ``dynamics``: the batched terms; and what was run. ``complete_log`` holds the spectra and
        the observers that need a complete log: the tuned ones with their tuning, ``best`` without,
        its smoothing pass alone; ``wrench smoother`` is the wrench of the whole log, its noise and
        prior included.
    """
    robot, timings = load_robot(robot_name), Timings()
    with one_core():
        run_rounds(timings, robot, circle(robot, samples), rounds)
    return {
        "simd": simd(),
        "robot": robot.name,
        "samples": samples,
        "rounds": rounds,
        "observers": [
            {"name": name, **timings.row(name, samples), "paper_s": PRINTED[f"seconds/{name}"]}
            for name in PAPER
        ],
        "complete_log": [
            {"name": name, **timings.row(name, samples)}
            for name in ("spectra", *LOOKING_BACK, SMOOTHER)
            if name in timings.seconds
        ],
        "dynamics": timings.row("dynamics", samples),
    }


def estimate_tuned(name: str, terms: DynamicsTerms, found: Spectra) -> None:
    """Tune an observer to spectra and run it."""
    tune_to_spectra(name, found).estimate(terms)


def run_rounds(timings: Timings, robot: Robot, recording: Recording, rounds: int) -> None:
    """Run everything once unmeasured, then interleaved for `rounds` rounds."""
    observers, _ = ObserverChoice(names=(*PAPER, "kfo-rts")).build(robot, recording.median_step)
    run = Run(recording=recording, robot=robot)
    terms = run.terms
    free = recording.t < FREE_SECONDS
    part = [RunSamples(run, free)]
    spectra = partial(spectra_of, RunSamples(run, ~free), part)
    found = spectra()
    work: dict[str, Callable[[], object]] = {
        "dynamics": partial(dynamics_terms, recording, robot),
        **{observer.name: partial(observer.estimate, terms) for observer in observers},
        "spectra": spectra,
        BEST: partial(tune_to_spectra(BEST, found).estimate, terms),
        **({SMOOTHER: partial(smooth_wrench, run, part)} if robot.joints >= 6 else {}),
        **{name: partial(estimate_tuned, name, terms, found) for name in TUNED},
    }
    for call in work.values():
        call()
    for _ in range(rounds):
        for name, call in work.items():
            timings.measure(name, call)
