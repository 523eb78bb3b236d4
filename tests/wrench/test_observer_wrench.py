"""The smoother as a solver beside the others: what it is fed, and what its wrench looks like."""

from pathlib import Path

import numpy as np
import pytest
from made_runs import analyse_log

from vftcli.free_motion import FreeChoice
from vftcli.free_motion.free_motion import FreeLoad, FreeMotion
from vftcli.observers import MomentumObserver, ObserverChoice
from vftcli.pipeline import AnalysisChoice, prepared, read
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.run import RunSamples
from vftcli.signals.arrays import resample_columns
from vftcli.wrench import WrenchChoice, ZeroChoice
from vftcli.wrench.sensing import (
    FreeLog,
    Gate,
    as_modelled,
    sense,
    smooth_all,
)
from vftcli.wrench.sensor import SensorReading
from vftcli.wrench.smoother import WrenchPrior, deviations, smooth_wrench

CIRCLE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
FREE = FreeChoice.parsed(free=["0.3:4"])


def choice(*names: str, free: FreeChoice = FREE, **wrench: object) -> AnalysisChoice:
    return AnalysisChoice(
        read=ReadChoice(interval=(0.0, 8.0)),
        robot=RobotChoice(name="ur5"),
        observers=ObserverChoice(names=names),
        free=free,
        wrench=WrenchChoice(**wrench),  # type: ignore[arg-type]
    )


@pytest.fixture(scope="module")
def motion() -> FreeMotion:
    """8 s of the circle, free until 4 s."""
    asked = choice("gmo")
    recording = asked.library.open(CIRCLE, asked.read)
    return read(prepared(recording, asked), asked)


def reading(*names: str, **wrench: object) -> SensorReading:
    sensed = analyse_log(CIRCLE, choice(*names, **wrench)).virtual_sensor  # type: ignore[arg-type]
    assert all(str(remark) for remark in sensed.remarks)  # the catalogue has words for each
    return sensed


@pytest.mark.slow
def test_asked_for_it_is_every_observers_wrench_and_hides_nothing(motion: FreeMotion) -> None:
    sensed = reading("gmo", "fdo", solver="smoother", frame="base")
    assert sensed.solver == "smoother"
    log, (piece,) = motion.log, motion.part.pieces
    values, covariance = smooth_wrench(log, [piece]).at(log.t)
    sd = deviations(covariance)
    for wrench in sensed.wrenches:
        np.testing.assert_allclose(wrench.values, values, atol=1e-12)
        np.testing.assert_allclose(wrench.sd, sd, atol=1e-12)
        assert not wrench.hidden.any()
        assert wrench.sigma_min is not None
    assert sensed.smoothed["gmo"] is sensed.smoothed["fdo"]  # the log's, whoever observes it
    codes = [remark.code for remark in sensed.remarks if remark.where.about == "gmo"]
    assert codes == ["wrench-smoothed", "wrench-noise-learned"]
    assert not {"pose-hides-wrench", "band-from-torques"} & {r.code for r in sensed.remarks}


def test_a_span_that_is_its_zero_is_free_motion_where_there_is_no_other(
    motion: FreeMotion,
) -> None:
    log = motion.log
    unloaded = log.t < 4.0
    (found,) = FreeLog(log, ()).known_free(unloaded)
    assert found.inside is unloaded
    assert FreeLog(log, ()).known_free(unloaded & False) == ()
    given = (RunSamples(log, ~unloaded),)
    assert FreeLog(log, given).known_free(unloaded) is given


@pytest.mark.slow
def test_a_zero_takes_its_mean_off_the_smoothed_wrench_too() -> None:
    sensed = reading("gmo", solver="smoother", zero=ZeroChoice(spans=((0.3, 4.0),)))
    (wrench,) = sensed.wrenches
    np.testing.assert_allclose(wrench.values[sensed.free].mean(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize("newtons", [0.0, 40.0])
def test_a_correction_is_left_out_where_the_log_shows_one_load(
    motion: FreeMotion, newtons: float
) -> None:
    """Under 40 N down all the time the uncorrected terms are used, under pushes the corrected."""
    log, plain = motion.log, as_modelled(motion)
    J = flange_jacobian(log.robot.chain, log.q)
    nothing = np.zeros(len(J), dtype=bool)
    if newtons:
        pushes, _ = smooth_all(["best"], plain, {}, unloaded=log.t < 4.0)["best"].at(log.t)
        taken = np.einsum("tij,ti->tj", J, pushes)
        free = tuple(RunSamples(run.less(taken), inside) for run, inside in plain.free)
        plain = FreeLog(log.less(taken + newtons * J[:, 2]), free)
    own = plain._replace(run=plain.run.less(np.ones_like(J[:, 0])))
    found = smooth_all(["best"], plain, {"best": own}, unloaded=nothing)["best"]
    assert found.uncorrected is (newtons > 0.0)
    codes = {remark.code for remark in found.remarks("best")}
    assert ("wrench-uncorrected" in codes) is (newtons > 0.0)
    if newtons:
        assert found.values[:, 2].mean() == pytest.approx(-newtons, abs=4.0)


def test_a_list_of_contacts_is_its_gate(motion: FreeMotion) -> None:
    log = motion.log
    estimates = [MomentumObserver(gain=10.0).estimate(log.terms)]
    asked = WrenchChoice(solver="smoother", frame="base")
    sensed = sense(motion, (), estimates, asked, gate=Gate([(4.5, 5.0)]))
    (wrench,) = sensed.wrenches
    t = log.recording.t
    away = (t < 4.4) | (t > 5.1)
    assert not wrench.values[away].any()
    assert wrench.sd.min() > 0.0
    assert wrench.values[(t > 4.5) & (t < 5.0)].any()


def test_a_load_of_the_free_part_is_in_the_wrench_and_no_noise(motion: FreeMotion) -> None:
    """2 kg at 5 cm off the flange, in every sample: 19.6 N outside of the contacts too."""
    load = FreeLoad(
        mass=2.0, moment=np.array([0.0, 0.0, 0.1]), sd=0.1, moment_sd=np.full(3, 0.01), share=0.5
    )
    run, nothing = motion.log, np.zeros(motion.log.recording.samples, dtype=bool)
    plain = as_modelled(motion)
    loaded = FreeLog(run.less(-load.torque(run)), plain.free, load)
    gate = Gate([(4.5, 5.0)], WrenchPrior(1.0, 30.0))
    bare, found = (
        smooth_all(["best"], log, {}, unloaded=nothing, gate=gate)["best"]
        for log in (plain, loaded)
    )
    assert found.load is load
    assert "wrench-holds-load" in {remark.code for remark in found.remarks("best")}
    q = resample_columns(found.t, run.recording.t, run.recording.q)
    weight, spread = load.wrench(run.robot.chain, q)
    np.testing.assert_allclose(found.values, bare.values + weight, atol=1e-6)
    np.testing.assert_allclose(found.covariance, bare.covariance + spread, atol=1e-6)
    np.testing.assert_allclose(weight[:, 2], -2.0 * 9.81, rtol=1e-3)
