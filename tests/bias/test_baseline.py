"""A log's free part and spectra: pieces are apart as objects, and what counts as free."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.bias.baseline import Baseline, Baselines, baseline_of, free_reading
from vftcli.free_motion.choice import FreeChoice
from vftcli.free_motion.free_motion import FreeMotion, FreeRun
from vftcli.observers import MomentumObserver
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.recording import Recording

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
ROBOT = load_robot("ur5")
GMO = MomentumObserver(gain=np.full(6, 20.0))


def part(recording: Recording, start: float, stop: float) -> Recording:
    """A span of a log as a log of its own, whose clock begins at 0."""
    span = recording.between(start, stop)
    source = replace(span.source, t0=span.t[0], label=f"{start:g}")
    return replace(span, t=span.t - span.t[0], source=source)


@pytest.fixture(scope="module")
def circle() -> Recording:
    return read(FIXTURE)


def baseline(log: Recording, *free: Recording) -> Baseline:
    own = Run(recording=log, robot=ROBOT)
    runs = [FreeRun(run=Run(recording=run, robot=ROBOT), log=own) for run in free]
    choice = FreeChoice(logs=tuple(Path(str(k)) for k in range(len(free))))
    return baseline_of(FreeMotion(log=own, choice=choice, runs=tuple(runs)))


def test_what_an_observer_reads_in_the_free_pieces(circle: Recording) -> None:
    log, free = part(circle, 4.0, 10.0), part(circle, 0.0, 4.0)
    found = baseline(log, free)
    estimate = GMO.estimate(found.log.terms)
    reading = free_reading(found, GMO, estimate)
    own = GMO.estimate(found.pieces[0].run.terms).tau
    np.testing.assert_array_equal(reading.samples, own)
    np.testing.assert_allclose(reading.rms, np.sqrt(np.mean(own**2, axis=0)))


def test_a_log_without_a_free_part_says_why(circle: Recording) -> None:
    own = Run(recording=part(circle, 4.5, 6.0), robot=ROBOT)
    found = baseline_of(FreeMotion(log=own))
    assert (found.part, found.spectra, found.pieces) == (None, None, ())
    assert found.missing.code == "no-free-part"
    assert "no repetition found" in found.missing.values["reason"]
    assert found.remarks == (found.missing,)


def test_gains_come_from_the_spectra_where_they_are_asked_for(circle: Recording) -> None:
    found = baseline(part(circle, 4.0, 10.0), part(circle, 0.0, 4.0))
    blind = replace(found, spectra=None)
    assert Baselines(plain=found, best=blind).spectra(gains=True).gains
    assert Baselines(plain=found, best=blind).spectra(gains=False) == (found.spectra, None, None)
    assert Baselines(plain=blind, best=found).spectra(gains=True) == (None, found.spectra, None)
