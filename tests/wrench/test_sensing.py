"""The whole virtual sensor on the repository's own logs: order, zero, and what is remarked."""

from pathlib import Path

import numpy as np
import pytest
from made_runs import run_of

from vftcli.free_motion.free_motion import FreeLoad, FreeMotion, without_load
from vftcli.notebook import report
from vftcli.observers import MomentumObserver
from vftcli.readers.reading import read as read_file
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian, link_poses
from vftcli.robots.friction import dry_friction
from vftcli.robots.run import Run, RunSamples
from vftcli.signals.arrays import resample_columns
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.wrench import WrenchChoice
from vftcli.wrench.sensing import (
    HALF,
    FreeLog,
    Gate,
    as_modelled,
    from_free_part,
    given_error,
    mask_remark,
    mean_disturbance,
    missed_torque,
    sense,
    smooth_all,
    torque_error,
)
from vftcli.wrench.sensor import SensorReading
from vftcli.wrench.smoother import WrenchPrior, smooth_wrench

FIXTURES = Path(__file__).parents[2] / "fixtures"


CIRCLE = "ur5_circle.csv"
FIRST_SECONDS = {"interval": "0:8", "free": "0.3:4"}
SMOOTHED = {"virtual-sensor.solver": "smoother"}


def reading(log, *names, frame="flange", **asked) -> SensorReading:
    """What the virtual sensor of a UR5 reads by some observers."""
    sensed = report(FIXTURES / log, "ur5", observer=names, frame=frame, **asked).virtual_sensor
    assert all(str(remark) for remark in sensed.remarks)  # the catalogue has words for each
    return sensed


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["base", "flange"])
def test_neither_order_nor_company_nor_frame_moves_the_zero(frame):
    alone = reading("ur5_sensor.parquet", "gmo", zero="start", frame=frame)
    orders = [("gmo", "fdo", "kfo-fe"), ("kfo-fe", "fdo", "gmo")]
    for names in orders:
        found = reading("ur5_sensor.parquet", *names, zero="start", frame=frame)
        assert found.zero_span == alone.zero_span
        both = found.remarks, alone.remarks
        ours, theirs = ([r for r in some if r.code.startswith("log-wrench")] for some in both)
        assert ours == theirs != []
        np.testing.assert_array_equal(found.masked, alone.masked)
        (same,) = (w for w in found.wrenches if w.name == "gmo")
        np.testing.assert_array_equal(same.values, alone.wrenches[0].values)
        known = ~found.masked
        np.testing.assert_array_equal(same.sd[known], alone.wrenches[0].sd[known])
    base = reading("ur5_sensor.parquet", "gmo", zero="start", frame="base")
    assert base.zero_span == alone.zero_span


@pytest.mark.slow
def test_further_spans_show_the_drift_and_only_the_first_is_removed():
    found = reading(CIRCLE, "gmo", "fdo", zero=("1:2", "2.5:3.5"), frame="base")
    assert [(d.name, d.span[0], d.removed) for d in found.drifts] == [
        ("gmo", 1.0, True), ("fdo", 1.0, True), ("gmo", 2.5, False), ("fdo", 2.5, False),
    ]  # fmt: skip
    for wrench in found.wrenches:
        np.testing.assert_allclose(wrench.between(1.0, 2.0).mean(axis=0), 0.0, atol=1e-12)
    moved = [remark for remark in found.remarks if remark.code == "zero-moved"]
    first, later = found.drifts[0], found.drifts[2]
    assert [remark.where.about for remark in moved] == ["gmo", "fdo"]
    np.testing.assert_allclose(moved[0].values["force_N"], (later.mean - first.mean)[:3])


@pytest.mark.slow
def test_nothing_is_removed_unasked():
    found = reading(CIRCLE, "gmo")
    assert found.drifts == ()
    assert found.zero_span is None
    assert ("pose-hides-wrench" in {r.code for r in found.remarks}) == found.masked.any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("choice", "code"),
    [
        ({"settings": {"virtual-sensor.torque-sd": "0.5"}}, "band-given"),
        ({"settings": {"virtual-sensor.torque-sd": "own"}}, "no-covariance"),
        ({"zero": "start"}, "band-from-free-part"),
        ({}, "no-wrench-band"),
        ({"settings": {"virtual-sensor.solver": "map"}}, "no-wrench-band"),
    ],
)
def test_the_band_says_where_it_comes_from(choice, code):
    found = reading(CIRCLE, "gmo", **choice)
    assert code in [remark.code for remark in found.remarks]


def test_an_unknown_band_is_said_of_those_only_that_are_not_smoothed():
    found = reading(CIRCLE, "best", "gmo", "fdo", interval="0:2")
    (unknown,) = [remark for remark in found.remarks if remark.code == "no-wrench-band"]
    assert unknown.where.about == "gmo, fdo"
    assert found.wrenches[0].sd is not None


@pytest.mark.slow
def test_a_smoothed_wrench_turns_with_the_flange():
    """Force and moment about the flange point in its own axes are those in base axes, turned."""
    base, flange = (reading(CIRCLE, "best", frame=f).wrenches[0] for f in ("base", "flange"))
    log = read_file(FIXTURES / CIRCLE)
    turn = link_poses(load_robot("ur5").chain, log.q).rotation[:, -1]
    for part in (slice(0, 3), slice(3, 6)):
        expected = np.einsum("tji,tj->ti", turn, base.values[:, part])
        # rounding of 100 N
        np.testing.assert_allclose(flange.values[:, part], expected, atol=1e-9)


def test_samples_that_a_pose_hides_are_counted_with_the_smallest_singular_value():
    sigma, hidden = np.array([0.2, 0.03, 0.04, 0.1]), np.array([False, True, True, False])
    (said,) = mask_remark(hidden, sigma)
    assert said.code == "pose-hides-wrench"
    assert said.values == {"masked": 2, "samples": 4, "share": 0.5, "sigma_min_m": 0.03}
    assert mask_remark(np.zeros(4, bool), sigma) == mask_remark(hidden, None) == ()


@pytest.fixture(scope="module")
def motion() -> FreeMotion:
    """8 s of the circle, free until 4 s."""
    return report(FIXTURES / CIRCLE, "ur5", observer="gmo", **FIRST_SECONDS).motion


@pytest.mark.slow
def test_asked_for_it_is_every_observers_wrench_and_hides_nothing(motion):
    sensed = reading(CIRCLE, "gmo", "fdo", frame="base", settings=SMOOTHED, **FIRST_SECONDS)
    assert sensed.solver == "smoother"
    log, (piece,) = motion.log, motion.part.pieces
    values, sd = smooth_wrench(log, [piece]).at(log.t)
    for wrench in sensed.wrenches:
        np.testing.assert_allclose(wrench.values, values, atol=1e-12)
        np.testing.assert_allclose(wrench.sd, sd, atol=1e-12)
        assert not wrench.hidden.any()
        assert wrench.sigma_min is not None
    assert sensed.smoothed["gmo"] is sensed.smoothed["fdo"]  # the log's, whoever observes it
    codes = [remark.code for remark in sensed.remarks if remark.where.about == "gmo"]
    assert codes == ["wrench-smoothed", "wrench-noise-learned"]
    assert not {"pose-hides-wrench", "band-from-torques"} & {r.code for r in sensed.remarks}


def test_a_span_that_is_its_zero_is_free_motion_where_there_is_no_other(motion):
    log = motion.log
    unloaded = log.t < 4.0
    (found,) = FreeLog(log, ()).known_free(unloaded)
    assert found.inside is unloaded
    assert FreeLog(log, ()).known_free(unloaded & False) == ()
    given = (RunSamples(log, ~unloaded),)
    assert FreeLog(log, given).known_free(unloaded) is given


@pytest.mark.slow
def test_a_zero_takes_its_mean_off_the_smoothed_wrench_too():
    sensed = reading(CIRCLE, "gmo", zero="0.3:4", settings=SMOOTHED, **FIRST_SECONDS)
    (wrench,) = sensed.wrenches
    np.testing.assert_allclose(wrench.between(0.3, 4.0).mean(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize("newtons", [0.0, 40.0])
def test_a_correction_is_left_out_where_the_log_shows_one_load(motion, newtons):
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


def test_a_list_of_contacts_is_its_gate(motion):
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


def test_a_load_of_the_free_part_is_in_the_wrench_and_no_noise(motion):
    """2 kg at 5 cm off the flange, in every sample: 19.6 N outside of the contacts too."""
    moment, spread = np.array([0.0, 0.0, 0.1]), np.full(3, 0.01)
    load = FreeLoad(mass=2.0, moment=moment, sd=0.1, moment_sd=spread, share=0.5)
    run, nothing = motion.log, np.zeros(motion.log.recording.samples, dtype=bool)
    plain = FreeLog(without_load(run, load), as_modelled(motion).free)
    loaded = FreeLog(run, plain.free, load)
    gate = Gate([(4.5, 5.0)], WrenchPrior(1.0, 30.0))
    how = {"unloaded": nothing, "gate": gate}
    bare, found = (smooth_all(["best"], log, {}, **how)["best"] for log in (plain, loaded))
    assert found.load is load
    assert "wrench-holds-load" in {remark.code for remark in found.remarks("best")}
    q = resample_columns(found.t, run.recording.t, run.recording.q)
    weight, spread = load.wrench(run.robot.chain, q)
    np.testing.assert_allclose(found.values, bare.values + weight, atol=1e-6)
    np.testing.assert_allclose(found.covariance, bare.covariance + spread, atol=1e-6)
    np.testing.assert_allclose(weight[:, 2], -2.0 * 9.81, rtol=1e-3)


T = np.arange(0.0, 40.0, 0.01)


def torque(name: str = "gmo", **more: np.ndarray) -> ExternalTorque:
    tau = np.random.default_rng(3).normal(0.0, [0.5, 2.0], (len(T), 2))
    return ExternalTorque(name=name, t=T, tau=tau, **more)


@pytest.mark.parametrize(("text", "sd"), [("0.4", [0.4, 0.4]), ("1,2.5", [1.0, 2.5])])
def test_a_given_error_is_one_for_all_or_one_a_joint(text, sd):
    np.testing.assert_array_equal(given_error(text, [torque()])[0]["gmo"], sd)


def test_own_takes_the_covariance_of_those_that_have_one():
    own = torque("kfo-fe", sd=np.ones((len(T), 2)))
    deviations, remarks = given_error("own", [torque(), own])
    assert set(deviations) == {"kfo-fe"}
    assert [r.code for r in remarks] == ["band-of-observer", "no-covariance"]


@pytest.mark.parametrize("text", ["1,2,3", "0", "-1", "nan", "much"])
def test_what_is_no_error(text):
    with pytest.raises(ParameterError, match="one positive number, or one for each of 2 joints"):
        given_error(text, [torque()])


def test_a_measured_band_is_taken_as_it_is():
    run = log_run(np.zeros((len(T), 6)))
    varying = torque(error_sd=np.linspace(0.1, 0.2, 2 * len(T)).reshape(-1, 2))
    deviations, remarks = torque_error(None, run, (), [varying], T < 0.0)
    np.testing.assert_array_equal(deviations["gmo"], varying.error_sd)
    assert [r.code for r in remarks] == ["band-from-torques"]


def log_run(dq: np.ndarray) -> Run:
    """A UR5 log whose joints move as given."""
    log = Recording(t=T, q=np.cumsum(dq, axis=0) * 0.01, dq=dq, current=np.zeros((len(T), 6)))
    return Run(recording=log, robot=load_robot("ur5"))


@pytest.mark.parametrize("moves", [True, False])
def test_a_free_part_measures_the_spread_about_its_mean(moves):
    """A free part at rest says nothing of friction in motion: a fifth of it is added."""
    rng = np.random.default_rng(3)
    one = ExternalTorque(name="gmo", t=T, tau=1.0 + rng.normal(0.0, 0.5, (len(T), 6)))
    free = T < 20.0
    speed = np.where(free & (not moves), 0.0, 0.5)
    run = log_run(np.tile(speed[:, None], 6))
    deviations, remarks = from_free_part(run, [one], free, {"gmo": np.full(6, 0.3**2)})
    friction = dry_friction(run.robot.friction, 6)
    spread = one.tau[free].std(axis=0)
    expected = spread**2 + 0.3**2 + (0.0 if moves else (0.2 * friction) ** 2)
    np.testing.assert_allclose(deviations["gmo"][-1], np.sqrt(expected))
    still = np.maximum(spread**2, (0.45 * friction) ** 2) + 0.3**2
    if not moves:
        np.testing.assert_allclose(deviations["gmo"][5], np.sqrt(still))
    codes = [r.code for r in remarks]
    assert codes == ["band-from-free-part", *(["band-of-free-rest"] if not moves else [])]


@pytest.mark.slow
def test_two_observers_of_one_response_have_one_band():
    """FE and ZOH read nearly the same and get nearly the same error, whatever P₂₂ each has."""
    found = reading(CIRCLE, "kfo-fe", "kfo-zoh", zero="start")
    one, other = (wrench.sd[~wrench.hidden] for wrench in found.wrenches)
    np.testing.assert_allclose(one, other, rtol=0.02)


def test_the_lag_adds_what_it_leaves_out_of_the_contacts():
    """A torque of .5 Hz after 20 s, GMO of 5 1/s: |1 − H| = ω/√(ω² + K²) of its rms."""
    tau = np.where(T < 20.0, 0.0, 8.0 * np.sin(2 * np.pi * 0.5 * T))[:, None]
    gained = 0.5 * (tau[1:] + tau[:-1]) * 0.01
    p = np.concatenate([np.zeros((1, 1)), np.cumsum(gained, axis=0)])
    terms = DynamicsTerms(t=T, p=p, mu=np.zeros_like(p))
    observers = (MomentumObserver(gain=5.0),)
    lag = np.sqrt(missed_torque(run_of(terms), observers, T < 20.0)["gmo"])
    omega = 2 * np.pi * 0.5
    expected = 8.0 / np.sqrt(2) * omega / np.hypot(omega, 5.0)
    # windows of a few seconds spread the line over ± .5 Hz, where |1 − H| bends
    assert lag[0] == pytest.approx(expected, rel=0.1)


def test_a_part_too_short_for_a_spectrum_is_no_part():
    terms = DynamicsTerms(t=T, p=np.zeros((len(T), 1)), mu=np.zeros((len(T), 1)))
    assert missed_torque(run_of(terms), (MomentumObserver(gain=5.0),), T < 0.05) is None


def terms_of(t: np.ndarray, tau: np.ndarray, mu: np.ndarray) -> DynamicsTerms:
    """Terms whose momentum gains μ + τ by the trapezoid, so that τ is what they leave. (T, 1)"""
    gained = 0.5 * ((mu + tau)[1:] + (mu + tau)[:-1]) * np.diff(t)[:, None]
    return DynamicsTerms(t=t, p=np.concatenate([[[0.3]], 0.3 + np.cumsum(gained, axis=0)]), mu=mu)


def uneven(samples: int = 600) -> np.ndarray:
    return np.cumsum(np.random.default_rng(1).uniform(0.002, 0.02, samples))


def test_a_constant_torque_is_itself_on_an_uneven_clock():
    t = uneven()
    mu = np.sin(3.0 * t)[:, None]
    found = mean_disturbance(terms_of(t, np.full((600, 1), 2.5), mu))
    np.testing.assert_allclose(found.tau, 2.5, atol=1e-10)  # rounding of sums of some 10 N·m·s


def test_a_ramp_keeps_its_place_and_a_step_is_spread_over_the_window():
    t = np.arange(0.0, 4.0, 0.001)
    inner = (t > HALF) & (t < t[-1] - HALF)
    ramp = mean_disturbance(terms_of(t, t[:, None], np.zeros((len(t), 1))))
    np.testing.assert_allclose(ramp.tau[inner, 0], t[inner], atol=1e-9)
    step = (t >= 2.0).astype(float)[:, None]
    found = mean_disturbance(terms_of(t, step, np.zeros((len(t), 1)))).tau[:, 0]
    expected = np.clip((t - 2.0 + HALF) / (2 * HALF), 0.0, 1.0)
    # the trapezoid puts the step half a sample early, 1 ms of 100
    np.testing.assert_allclose(found, expected, atol=0.01)


def test_two_samples_tell_the_mean_between_them_and_one_nothing():
    t = np.array([0.0, 0.02])
    found = mean_disturbance(terms_of(t, np.array([[1.0], [3.0]]), np.array([[5.0], [-2.0]])))
    np.testing.assert_allclose(found.tau, 2.0, rtol=1e-12)
    one = DynamicsTerms(t=np.zeros(1), p=np.ones((1, 6)), mu=np.ones((1, 6)))
    np.testing.assert_array_equal(mean_disturbance(one).tau, np.zeros((1, 6)))
