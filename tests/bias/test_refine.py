"""The band around an estimate: drawn where something is free of contact, from what is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sound_logs import UR10E

from vftcli.bias import AUTOMATIC, RefinementChoice
from vftcli.bias.baseline import Baseline, Baselines, baseline_of, free_reading
from vftcli.bias.refine import STICTION, friction_share, limits_remark, refine, with_band
from vftcli.bias.whole_log import WholeLogBias, stride_of
from vftcli.free_motion import FreeChoice
from vftcli.free_motion.free_motion import FreeMotion
from vftcli.observers import MomentumObserver
from vftcli.observers.tuning import tune_to_spectra
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.errors import ParameterError

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
GMO = MomentumObserver(gain=np.full(6, 20.0))


@pytest.fixture(scope="module")
def found() -> Baseline:
    log = Run(recording=read(FIXTURE), robot=load_robot("ur5"))
    return baseline_of(FreeMotion(log=log, choice=FreeChoice(cycles=(1,))))


@pytest.fixture
def reading(found):
    return free_reading(found, GMO, GMO.estimate(found.of(found.motion.log).terms))


def corrected(found: Baseline, free, sd: float = 0.0, load: float = 0.0) -> Baseline:
    """The baseline with a correction off that changes nothing but says this of the log."""
    shape, t = found.of(found.motion.log).terms.p.shape, found.motion.log.t
    nothing = {"weight": np.zeros(6), "bias": np.zeros(shape), "remarks": ()}
    loads = np.full((len(t[:: stride_of(t)]), 6), load)
    off = WholeLogBias(**nothing, sd=np.full(shape, sd), free=free, load=loads)
    return replace(found, correction=off)


def test_a_correction_adds_its_own_variance(found, reading):
    known = found.part.own
    plain, wider = (with_band(corrected(found, known, sd), reading).error_sd for sd in (0.0, 0.7))
    # Bands are kept in single precision.
    np.testing.assert_allclose(wider, np.hypot(plain, 0.7), rtol=1e-6)


def test_without_spectra_or_free_samples_there_is_none(found, reading):
    assert with_band(replace(found, spectra=None), reading).error_sd is None
    nothing = reading._replace(samples=reading.samples[:0], resting=reading.resting[:0])
    assert with_band(found, nothing).error_sd is None
    bare = replace(found, part=None, spectra=None)
    both = Baselines(plain=bare, best=bare)
    said = refine(both, [reading.observer], [reading.estimate]).remarks
    assert [r.code for r in said if "band" in r.code] == ["no-band"]


def test_the_larger_of_what_is_stated_and_what_a_fit_calls_free_counts(found, reading):
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


def test_a_slow_load_that_the_fit_believes_in_is_no_error(found, reading):
    pushed = reading._replace(estimate=replace(reading.estimate, tau=reading.estimate.tau + 5.0))
    known, alone = found.part.own, replace(found, by_fit=True)
    np.testing.assert_allclose(
        with_band(corrected(alone, known, load=5.0), pushed).error_sd,
        with_band(corrected(alone, known), reading).error_sd,
        rtol=1e-9,  # 5 is added and taken off again, at errors down to .05
    )


def test_the_band_holds_on_a_real_arm_with_planted_pushes(logs, monkeypatch):
    """Every joint at least .88 of its samples, and no wider than 2.6 × the RMSE; seed 1."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "accuracy"))
    from planted_pushes import planted

    robot = load_robot("ur10e")
    pushed = planted(read(logs / "ur10e" / "free_12harm_40s.csv.gz", columns=UR10E), robot, 1)
    run = Run(recording=pushed.recording, robot=robot)
    base = baseline_of(FreeMotion(log=run, choice=FreeChoice(spans=((0.0, 8.0),))))
    assert base.load is None
    observer = tune_to_spectra("rts-auto", base.spectra)
    reading = free_reading(base, observer, observer.estimate(base.of(base.motion.log).terms))
    estimate = with_band(base, reading)
    error, half = estimate.tau - pushed.torque, 1.96 * estimate.error_sd
    assert np.all(np.mean(np.abs(error) <= half, axis=0) >= 0.88)
    assert half.mean() <= 2.6 * np.sqrt(np.mean(error**2, axis=0)).mean()


RNG = np.random.default_rng(8)
DQ = RNG.uniform(-1.0, 1.0, (4000, 2))


def test_friction_beside_another_error_is_its_share_of_the_power():
    """tanh has a mean square of nearly 1, the other error `size`²; 4000 samples tell 3 %."""
    size = 4.0
    other = size * RNG.standard_normal(DQ.shape)
    power = np.mean(np.tanh(DQ / 0.02) ** 2, axis=0)
    found = friction_share(DQ, np.tanh(DQ / 0.02) + other)
    np.testing.assert_allclose(found, power / (power + size**2), atol=0.03)
    friction = 3.0 * np.tanh(DQ / 0.02) + 0.5 * DQ
    np.testing.assert_allclose(friction_share(DQ, friction), 1.0, atol=1e-12)
    assert not friction_share(DQ, np.zeros_like(DQ)).any()


def test_the_largest_cause_of_each_joint_is_named():
    names = "noise", "friction", "model", "bandwidth", STICTION
    sizes = np.array([[3.0, 0.1], [4.0, 0.2], [0.0, 0.1], [0.0, 0.5], [9.0, 7.0]])
    causes = dict(zip(names, sizes, strict=True))
    free = limits_remark("gmo", causes, np.array([False, False]))
    assert free.values["causes"] == ["friction", "bandwidth"]
    assert free.values["size_Nm"] == [4.0, 0.5]
    # stiction is no part of what moves
    np.testing.assert_allclose(free.values["total_Nm"], [5.0, np.sqrt(0.31)])
    stuck = limits_remark("gmo", causes, np.array([True, False]))
    assert stuck.values["causes"] == [STICTION, "bandwidth"]
    assert stuck.values["size_Nm"][0] == 9.0
    # 9 N·m beside the 5 of the other causes, and nothing beside the joint that moves
    together = np.sqrt([9.0**2 + 5.0**2, 0.31])
    np.testing.assert_allclose(stuck.values["total_Nm"], together)
    causes[STICTION][0] = 0.0
    both = limits_remark("gmo", causes, np.array([True, True]))
    assert both.values["causes"] == ["friction", STICTION]


LOG = read(Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv")


def test_a_log_without_a_free_part_says_why():
    own = Run(recording=LOG.between(4.5, 6.0), robot=load_robot("ur5"))
    found = baseline_of(FreeMotion(log=own))
    assert (found.part, found.spectra, found.pieces) == (None, None, ())
    assert found.missing.code == "no-free-part"
    assert "no repetition found" in found.missing.values["reason"]
    assert found.remarks == (found.missing,)


def test_gains_come_from_the_spectra_where_they_are_asked_for():
    own = Run(recording=LOG.between(0.0, 10.0), robot=load_robot("ur5"))
    found = baseline_of(FreeMotion(log=own, choice=FreeChoice(spans=((0.0, 4.0),))))
    blind = replace(found, spectra=None)
    assert Baselines(plain=found, best=blind).spectra(gains=True).gains
    assert Baselines(plain=found, best=blind).spectra(gains=False) == (found.spectra, None, None)
    assert Baselines(plain=blind, best=found).spectra(gains=True) == (None, found.spectra, None)


def test_the_whole_log_s_bias_comes_off_for_everyone_if_asked_for():
    """Else the observers ask for it: `best` runs on what the whole log allows."""
    assert RefinementChoice.parsed() == RefinementChoice(bias=AUTOMATIC)
    for word, corrects in {"auto": False, "whole-log": True, "none": False}.items():
        asked = RefinementChoice.parsed(settings={"bias.method": word})
        assert asked.corrects_all == corrects
    with pytest.raises(ParameterError, match="there is auto, whole-log, none"):
        RefinementChoice.parsed(settings={"bias.method": "all"})
