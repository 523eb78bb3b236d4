"""A log's free part and spectra: pieces told apart as objects, and what is believed to be free."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.observers import MomentumObserver
from vftcli.readers import read
from vftcli.refinement.baseline import (
    Baseline,
    baseline_of,
    bias_at_phase,
    free_reading,
    without_free_motion,
)
from vftcli.refinement.refine import refine
from vftcli.repetition.choice import FreeChoice
from vftcli.repetition.free_motion import FreeMotion
from vftcli.repetition.free_run import FreeRun, ModelledRun
from vftcli.robots import load_robot
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
    own = ModelledRun(recording=log, robot=ROBOT)
    runs = [FreeRun(run=ModelledRun(recording=run, robot=ROBOT), log=own) for run in free]
    choice = FreeChoice(logs=tuple(Path(str(k)) for k in range(len(free))))
    return baseline_of(FreeMotion(log=own, choice=choice, runs=tuple(runs)))


def test_every_free_run_counts_though_their_clocks_are_alike(circle: Recording) -> None:
    """Log and runs of 501 samples, 8 ms apart: clock and length tell none from another."""
    log = part(circle, 8.0, 12.0)
    free, more = part(circle, 0.0, 4.0), part(circle, 4.0, 8.0)
    assert len(log.t) == len(free.t) == len(more.t)
    found = {order: baseline(log, *order_of) for order, order_of in
             {"ab": (free, more), "ba": (more, free)}.items()}  # fmt: skip
    estimate = GMO.estimate(found["ab"].terms)
    refined = [refine(one, [GMO], [estimate], "free-cycle").estimates[0] for one in found.values()]
    np.testing.assert_allclose(refined[0].tau, refined[1].tau, atol=1e-9)
    # By hand: the mean of what the observer reads in the two runs, where the log's sample belongs.
    own = found["ab"]
    reads = [GMO.estimate(piece.run.terms).tau for piece in own.pieces]
    there = [pairing.there(x) for pairing, x in zip(own.part.pairings, reads, strict=True)]
    both = np.isfinite(there[0]).all(axis=1) & np.isfinite(there[1]).all(axis=1)
    expected = estimate.tau[both] - 0.5 * (there[0] + there[1])[both]
    np.testing.assert_allclose(refined[0].tau[both], expected, atol=1e-9)
    spectra = [without_free_motion(one).spectra for one in found.values()]
    np.testing.assert_allclose(spectra[0].loaded, spectra[1].loaded, rtol=1e-6)


def test_the_free_run_and_not_the_log_is_subtracted_before_tuning(circle: Recording) -> None:
    """A free run as long as the log: what is left of the log is the push, not nothing."""
    found = baseline(part(circle, 8.0, 12.0), part(circle, 0.0, 4.0))
    left = without_free_motion(found).spectra
    # The noise of the log and of the one free run that is subtracted: twice that of either.
    noise = np.column_stack(
        [np.interp(left.frequency, found.spectra.frequency, x) for x in found.spectra.floor.T]
    )
    np.testing.assert_allclose(left.free, 2.0 * noise)
    slow = left.frequency < 5.0
    assert np.all(left.loaded[slow, :3].sum(axis=0) > 3.0 * left.free[slow, :3].sum(axis=0))


def test_what_an_observer_reads_in_the_free_pieces(circle: Recording) -> None:
    log, free = part(circle, 4.0, 10.0), part(circle, 0.0, 4.0)
    found = baseline(log, free)
    estimate = GMO.estimate(found.terms)
    reading = free_reading(found, GMO, estimate)
    (own,) = reading.free
    np.testing.assert_array_equal(own.tau, GMO.estimate(found.pieces[0].run.terms).tau)
    np.testing.assert_allclose(reading.rms, np.sqrt(np.mean(own.tau**2, axis=0)))
    bias = bias_at_phase(found.part, [own.tau])
    assert np.isfinite(bias[:, 0]).mean() > 0.5


def test_a_log_without_a_free_part_says_why(circle: Recording) -> None:
    own = ModelledRun(recording=part(circle, 4.5, 6.0), robot=ROBOT)
    found = baseline_of(FreeMotion(log=own))
    assert (found.part, found.spectra, found.pieces) == (None, None, ())
    assert found.missing.code == "no-free-part"
    assert "no repetition found" in found.missing.values["reason"]
    assert found.remarks == (found.missing,)
