"""The band around an estimate: drawn where something is free of contact, from what is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.bias.baseline import Baseline, baseline_of, free_reading
from vftcli.bias.refine import band_remarks, with_band
from vftcli.bias.whole_log import WholeLogBias
from vftcli.free_motion import FreeChoice
from vftcli.free_motion.free_motion import FreeMotion
from vftcli.observers import MomentumObserver
from vftcli.observers.tuning import tune_to_spectra
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.run import Run

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
GMO = MomentumObserver(gain=np.full(6, 20.0))


@pytest.fixture(scope="module")
def found() -> Baseline:
    log = Run(recording=read(FIXTURE), robot=load_robot("ur5"))
    return baseline_of(FreeMotion(log=log, choice=FreeChoice(cycles=(1,))))


def corrected(found: Baseline, free, sd: float = 0.0, load: float = 0.0) -> Baseline:
    """The baseline with a correction off that changes nothing but says this of the log."""
    shape = found.of(found.motion.log).terms.p.shape
    off = WholeLogBias(
        weight=np.zeros(6),
        bias=np.zeros(shape),
        sd=np.full(shape, sd),
        free=free,
        load=np.full(shape, load),
        remarks=(),
    )
    return replace(found, correction=off)


def test_a_correction_adds_its_own_variance(found: Baseline) -> None:
    reading = free_reading(found, GMO, GMO.estimate(found.of(found.motion.log).terms))
    known = found.part.own
    plain, wider = (with_band(corrected(found, known, sd), reading).error_sd for sd in (0.0, 0.7))
    # Bands are kept in single precision.
    np.testing.assert_allclose(wider, np.hypot(plain, 0.7), rtol=1e-6)


def test_without_spectra_or_free_samples_there_is_none(found: Baseline) -> None:
    reading = free_reading(found, GMO, GMO.estimate(found.of(found.motion.log).terms))
    assert with_band(replace(found, spectra=None), reading).error_sd is None
    nothing = reading._replace(samples=reading.samples[:0], resting=reading.resting[:0])
    assert with_band(found, nothing).error_sd is None
    said = band_remarks(replace(found, part=None, spectra=None))
    assert [r.code for r in said] == ["no-band"]


def test_the_larger_of_what_is_stated_and_what_a_fit_calls_free_counts(found: Baseline) -> None:
    reading = free_reading(found, GMO, GMO.estimate(found.of(found.motion.log).terms))
    quiet = np.arange(found.of(found.motion.log).terms.samples) % 7 == 0
    rests = found.motion.log.rests
    tau = reading.estimate.tau[quiet]
    fitted = with_band(found, reading._replace(samples=tau, resting=rests[quiet])).error_sd
    stated = with_band(found, reading).error_sd
    both = with_band(corrected(found, quiet), reading).error_sd
    np.testing.assert_array_equal(both, np.maximum(stated, fitted))
    # Where nothing is stated the samples of the fit stand alone.
    alone = with_band(replace(corrected(found, quiet), by_fit=True), reading).error_sd
    np.testing.assert_array_equal(alone, fitted)
    # too few to speak for anything
    few = np.arange(found.of(found.motion.log).terms.samples) < 20
    np.testing.assert_array_equal(with_band(corrected(found, few), reading).error_sd, stated)


def test_a_slow_load_that_the_fit_believes_in_is_no_error(found: Baseline) -> None:
    reading = free_reading(found, GMO, GMO.estimate(found.of(found.motion.log).terms))
    pushed = reading._replace(estimate=replace(reading.estimate, tau=reading.estimate.tau + 5.0))
    known, alone = found.part.own, replace(found, by_fit=True)
    np.testing.assert_allclose(
        with_band(corrected(alone, known, load=5.0), pushed).error_sd,
        with_band(corrected(alone, known), reading).error_sd,
        rtol=1e-9,  # 5 is added and taken off again, at errors down to .05
    )


def test_the_band_holds_on_a_real_arm_with_planted_pushes(
    logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every joint at least .88 of its samples, and no wider than 2.6 × the RMSE; seed 1."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "accuracy"))
    from planted_pushes import planted

    columns = "t,q:6,dq:6,current:6,target_current:6,target_torque:6"
    robot = load_robot("ur10e")
    pushed = planted(read(logs / "ur10e" / "free_12harm_40s.csv.gz", columns=columns), robot, 1)
    run = Run(recording=pushed.recording, robot=robot)
    base = baseline_of(FreeMotion(log=run, choice=FreeChoice(spans=((0.0, 8.0),))))
    assert base.load is None
    observer = tune_to_spectra("rts-auto", base.spectra)
    estimate = with_band(
        base, free_reading(base, observer, observer.estimate(base.of(base.motion.log).terms))
    )
    error, half = estimate.tau - pushed.torque, 1.96 * estimate.error_sd
    assert np.all(np.mean(np.abs(error) <= half, axis=0) >= 0.88)
    assert half.mean() <= 2.6 * np.sqrt(np.mean(error**2, axis=0)).mean()
