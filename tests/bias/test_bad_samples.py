"""One bad sample, or an hour in which a clock stands still, does not change `best` elsewhere.

The bound is the band that is stated at each sample, 1.96 sd: a change within it is within what the
estimate says of itself.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from vftcli.doctor.examination import Examiner
from vftcli.observers import ObserverChoice
from vftcli.pipeline import AnalysisChoice, analyse, prepared
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice
from vftcli.robots.run import Run

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
NEAR = 0.5
"""Around a bad sample its own joint may say anything. [s]"""


@cache
def sound(path: Path, robot: str, columns: str | None = None):
    """A log, its robot, how it is analysed, and its `best`."""
    choice = AnalysisChoice(
        read=ReadChoice.parsed(columns=columns),
        robot=RobotChoice(name=robot),
        observers=ObserverChoice(names=("best",)),
        contacts=False,
        examiner=Examiner(anyway=True),
    )
    (log,) = choice.library.open_each([path], choice.read)
    run = prepared(log.between(0.0, 30.0), choice)  # what a test has time for
    return run.recording, run.robot, choice, analyse(run, choice).estimates[0]


def changed(path: Path, robot: str, columns: str | None = None, **values):
    """How far `best` of a log with other values is from its own, in bands. (T, n)"""
    log, arm, choice, own = sound(path, robot, columns)
    (best,) = analyse(Run(recording=replace(log, **values), robot=arm), choice).estimates
    assert np.isfinite(best.error_sd).all()
    return np.abs(best.tau - own.tau) / (1.96 * own.error_sd)


def with_sample(log, signal, row, joint, value):
    """A signal with another value in one sample, added or, where it says so, put there."""
    values = np.array(getattr(log, signal))
    values[row, joint] = value(values[row, joint])
    return {signal: values}


FAULTS = {
    "q3 + 2π": ("q", 2, lambda q: q + 2.0 * np.pi),
    "q3 + .05 rad": ("q", 2, lambda q: q + 0.05),
    "20 A": ("current", 1, lambda _: 20.0),
    "3 A more": ("current", 1, lambda i: i + 3.0),
    "no current": ("current", 1, lambda _: 0.0),
    "5 rad/s": ("dq", 1, lambda _: 5.0),
    ".3 rad/s more": ("dq", 1, lambda dq: dq + 0.3),
}


@pytest.mark.slow
@pytest.mark.parametrize("row", [925, 1700])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_bad_sample_stays_within_the_band(fault, row) -> None:
    """Elsewhere; and on the other joints there too."""
    signal, joint, value = FAULTS[fault]
    log = sound(FIXTURE, "ur5")[0]
    ratio = changed(FIXTURE, "ur5", **with_sample(log, signal, row, joint, value))
    far = np.abs(log.t - log.t[row]) > NEAR
    assert ratio[far].max() <= 1.0
    assert np.delete(ratio, joint, axis=1).max() <= 1.0


@pytest.mark.slow
def test_a_bad_sample_is_said() -> None:
    log, arm, choice, _ = sound(FIXTURE, "ur5")
    bad = replace(log, **with_sample(log, "dq", 925, 1, lambda _: 5.0))
    remarks = analyse(Run(recording=bad, robot=arm), choice).remarks
    said = [r for r in remarks if r.code == "isolated-samples-evened"]
    assert [r.where.joints for r in said] == [(2,)]


REAL = "t,q:6,dq:6,current:6,target_current:6,target_torque:6"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["free_12harm", "free_14harm"])
def test_an_hour_without_samples_stays_within_the_band(logs: Path, name: str) -> None:
    """No free motion is given or repeats: the model's error comes from all of the log."""
    path = logs / "ur10e" / f"{name}.csv"
    log = sound(path, "ur10e", REAL)[0]
    half = log.samples // 2
    later = np.where(np.arange(log.samples) < half, log.t, log.t + 3600.0)
    ratio = changed(path, "ur10e", REAL, t=later)
    far = np.abs(log.t - log.t[half]) > NEAR
    assert ratio[far].max() <= 1.0
