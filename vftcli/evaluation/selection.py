"""The paper's guidelines for an observer (Sec. IV-A), as facts of a log."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation.errors import joint_means
from vftcli.observers.observer import Observer, Tuning
from vftcli.robots.run import Run
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array
from vftcli.signals.series import median_step

STEP_TIME = 3.0  #: Length of the step that response times are read from. [s]
REACHED = 0.9  #: Share of a step at which it counts as seen.
#: Contacts by a person's deliberate action lie below this frequency, the rest is noise. [Hz]
FAST = 5.0


class Facts(NamedTuple):
    """Speed, noise and error of one observer on one log."""

    name: str  #: The observer.
    response: float  #: Time until 90 % of a step is seen, the slowest joint. [s]
    delay: float  #: Delay behind a slow ramp, the slowest joint. [s]
    #: Noise of the estimate, mean of joints: the drive torque's white noise through the observer's
    #: own response. [N·m]
    noise: float
    #: Share of the drive torque's noise above `FAST` that comes through, mean of joints.
    passed: float
    rmse: float  #: Root-mean-square error against the reference, mean of joints, NaN without. [N·m]
    parameter_count: int  #: Numbers to tune.


class Advice(NamedTuple):
    """One guideline and what this log says of it."""

    purpose: str  #: Use of the observer.
    criterion: str  #: Deciding number.
    best: tuple[str, ...]  #: The observers that are best by it, alike within 2 %.
    paper: str  #: Advice of the paper.


def facts(
    observers: Sequence[Observer],
    tunings: Mapping[str, Tuning],
    run: Run,
    errors: pl.DataFrame | None,
) -> tuple[Facts, ...]:
    """The facts of every observer that has a response of its own."""
    step, noise, each = median_step(run.recording.t), run.noise, list[Facts]()
    means = {} if errors is None else joint_means(errors).errors
    frequency = np.linspace(0.0, 0.5 / step, 513)[1:]
    fast = frequency >= min(FAST, frequency[-1])
    for observer in observers:
        if observer.name in tunings:
            tuning = tunings[observer.name]
            gain = np.abs(observer.frequency_response(frequency, step, len(noise))) ** 2
            one = Facts(
                name=observer.name,
                response=float(np.max(step_response(observer, step, len(noise)))),
                delay=float(np.max(tuning.delay)),
                noise=float(np.mean(noise * np.sqrt(gain.mean(axis=0)))),
                passed=float(np.mean(np.sqrt(gain[fast].mean(axis=0)))),
                rmse=means.get(observer.name, float("nan")),
                parameter_count=tuning.parameter_count,
            )
            each.append(one)
    return tuple(each)


def step_response(observer: Observer, step: float, joints: int) -> Array:
    """Time of a unit step's estimate to 90 %, NaN if never. (n,) [s]

    The step begins after the first sample; its momentum is the integral of it.
    """
    t = np.arange(0.0, STEP_TIME, step)
    p = np.repeat(t[:, None], joints, axis=1)
    seen = observer.estimate(DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))).tau >= REACHED
    times: Array = np.where(seen.any(axis=0), t[seen.argmax(axis=0)], np.nan)
    return times


def advice(found: Sequence[Facts]) -> tuple[Advice, ...]:
    """The paper's three guidelines with the best observers on this log."""
    return (
        Advice(
            "collision detection",
            "shortest response",
            best(found, [f.response for f in found]),
            "GMO or FDO: fast to compute and to respond",
        ),
        Advice(
            "safe response",
            f"least noise above {FAST:g} Hz",
            best(found, [f.passed for f in found]),
            "FDO: its one cutoff chooses what passes",
        ),
        Advice(
            "force estimation",
            "smallest RMSE against the reference",
            best(found, [f.rmse for f in found]),
            "KFO: ZOH for accuracy, FE for computation",
        ),
    )


def best(found: Sequence[Facts], values: Sequence[float]) -> tuple[str, ...]:
    """Names of those within 2 % of the smallest value; none where no value is known."""
    known = [v for v in values if np.isfinite(v)]
    if not known:
        return ()
    least = min(known)
    return tuple(f.name for f, v in zip(found, values, strict=True) if v <= 1.02 * least)
