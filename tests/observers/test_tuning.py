"""Gains for a goal: by a log's spectra, by `vftcli identify --method gains`, and out of reach."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_runs import samples_of
from made_terms import momentum_of
from typer.testing import CliRunner

from vftcli.cli import make_app
from vftcli.observers import ObserverChoice, tuning
from vftcli.observers.observer import Observer
from vftcli.observers.spectra import Spectra, spectra_of
from vftcli.observers.table import OBSERVERS, PAPER, LogSpectra, Setup, build_observers
from vftcli.robots import load_robot
from vftcli.robots.run import RunSamples
from vftcli.signals.errors import ParameterError, VftError
from vftcli.signals.external_torque import DynamicsTerms

app = make_app()

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"
STEP = 0.008


def spectra(noise: float = 1e-3) -> Spectra:
    """A torque of 5 N·m rms below a corner of 1 Hz, over white noise; two joints, analytic."""
    f = np.linspace(0.0, 62.5, 251)
    torque = (2.0 * 25.0 / np.pi / (1.0 + f**2))[:, None] * np.array([1.0, 0.2])
    quiet = np.full((251, 2), noise)
    return Spectra(frequency=f, free=quiet, loaded=quiet + torque, step=STEP, segments=(4, 10))


def test_every_observer_reaches_the_stated_delay_or_bandwidth():
    for line in tuning.tune_all(spectra(), tuning.parse_goal("delay=0.05")):
        expected = 0.0 if line.observer == "kfo-rts" else 0.05
        np.testing.assert_allclose(line.delay, expected, atol=1e-9)
    every = tuning.tune_all(spectra(), tuning.parse_goal("bandwidth=3"))
    lines = {line.observer: line for line in every}
    smoother = tuning.kalman_smoother(lines["kfo-rts"].rate)
    np.testing.assert_allclose(smoother.tuning(STEP, 2).bandwidth, 3.0, rtol=1e-12)
    # FDO and GMO are one filter where they share a rate
    np.testing.assert_allclose(lines["fdo"].rate, lines["gmo"].rate)


def test_few_false_alarms_cost_bandwidth():
    many = tuning.tune_all(spectra(0.3), tuning.parse_goal("false-alarms=1000", "8"))
    few = tuning.tune_all(spectra(0.3), tuning.parse_goal("false-alarms=0.01", "8"))
    for fast, slow in zip(many, few, strict=True):
        assert slow.alarms is not None
        assert np.all(slow.rate <= fast.rate)
        assert np.all(slow.alarms <= 0.01)
    with pytest.raises(ParameterError, match=r"too loud for the threshold on J1"):
        tuning.tune_all(spectra(50.0), tuning.parse_goal("false-alarms=0.01", "0.5"))


@pytest.mark.parametrize(
    "words", ["fast", "auto=3", "false-alarms=2", "false-alarms=2 0", "false-alarms=2 a"]
)
def test_goals_that_are_none(words):
    with pytest.raises(ParameterError, match=r"--gains|alarm\.threshold"):
        tuning.parse_goal(*words.split())


def test_a_tuned_file_goes_into_a_comparison(tmp_path):
    """identify writes it, --gains takes it: GMO then errs as little as was promised."""
    gains, runner = tmp_path / "gains.toml", CliRunner()
    asked = ["identify", str(FIXTURE), "--robot", "ur5", "--method", "gains", "--json"]
    asked += ["-o", str(gains)]
    done = runner.invoke(app, asked)
    assert done.exit_code == 0, done.output
    promised = {o["observer"]: o for o in json.loads(done.stdout)["observers"]}
    table = tomllib.loads(gains.read_text(encoding="utf-8"))["observers"]
    assert set(table) == {"fdo", "gmo", "kfo", "kfo-rts"}
    compare = ["compare", str(FIXTURE), "--robot", "ur5", "--json"]
    compare += ["--reference", f"file:{FIXTURE}.truth.parquet", "--gains", str(gains)]
    compare += ["--observer", "gmo", "--observer", "kfo-rts", "--observer", "rts-auto"]
    found = json.loads(runner.invoke(app, compare).stdout)["rows"]
    rmse = {(r["observer"], r["joint"]): r["rmse_Nm"] for r in found}
    for j in (1, 2, 3, 4, 6):  # J5 rests
        # the spectrum of 4 s of free motion tells the error to about a third on each joint
        assert rmse["gmo", j] == pytest.approx(promised["gmo"]["rmse"][j - 1], rel=0.5)
        # the file's smoother is the tuned observer itself
        assert rmse["kfo-rts", j] == pytest.approx(rmse["rts-auto", j], rel=1e-9)
    again = runner.invoke(app, asked)
    assert isinstance(again.exception, VftError)
    assert "--force" in str(again.exception)


@pytest.mark.parametrize("offset", [0.0, 0.5, -0.5])
def test_a_constant_error_brings_one_threshold_nearer(offset):
    """2 Hz of σ = 1.5 N·m about an offset m: 7200·(e^{−(h−m)²/2σ²} + e^{−(h+m)²/2σ²}) an hour."""
    f = np.linspace(0.0, 10.0, 1001)
    power = np.where(np.isclose(f, 2.0), 2.25, 0.0)[:, None]
    power[0] = offset**2
    sides = np.array([2.0 - offset, 2.0 + offset])
    expected = 7200.0 * np.exp(-(sides**2) / 4.5).sum()
    assert tuning.crossings(power, f, np.array([2.0]))[0] == pytest.approx(expected, rel=1e-12)
    # at the threshold it is an alarm without end
    power = np.array([[4.0], [1.0]])
    assert tuning.crossings(power, np.array([0.0, 2.0]), np.array([2.0]))[0] == np.inf


def test_the_one_rate_of_filtered_dynamics_lies_between_those_of_the_joints():
    """It has the smallest mean error; each joint by itself could have less."""
    fdo, gmo, *_ = tuning.tune_all(spectra(0.3), tuning.parse_goal("auto"))
    assert fdo.gains["omega"] == fdo.rate[0] == fdo.rate[1]
    assert np.min(gmo.rate) < fdo.rate[0] < np.max(gmo.rate)
    assert np.all(gmo.rmse < fdo.rmse)


def test_a_threshold_is_one_or_one_a_joint():
    with pytest.raises(
        ParameterError, match=r"alarm.threshold has 3 values; .* each of 2 joints"
    ):
        tuning.tune_all(spectra(), tuning.parse_goal("auto", "1,2,3"))
    for line in tuning.tune_all(spectra(), tuning.parse_goal("auto", "1,2")):
        assert line.alarms is not None


def test_a_gain_at_a_bound_is_said_with_the_numbers():
    """No torque beyond the noise: every observer runs to the slowest; a stated delay has none."""
    quiet, goal = spectra(), tuning.parse_goal("auto")
    silent = replace(quiet, loaded=quiet.free)
    remarks = tuning.bounds_reached(tuning.tune_all(silent, goal), silent, goal)
    assert {r.where.about for r in remarks} == {"fdo", "gmo", "kfo-zoh", "kfo-rts"}
    for remark in remarks:
        assert (remark.code, remark.level) == ("gain-at-slowest", "warning")
        assert remark.values["rate_rad_s"] == 1.0
    assert tuning.bounds_reached(tuning.tune_all(quiet, goal), quiet, goal) == ()
    slow = tuning.parse_goal("delay=1")
    assert tuning.bounds_reached(tuning.tune_all(quiet, slow), quiet, slow) == ()


def low_passed_noise(samples: int, corner: float, seed: int) -> np.ndarray:
    """A random torque without jumps, two poles at a corner [rad/s], standard deviation 1."""
    from scipy.signal import lfilter

    a = np.exp(-corner * STEP)
    # variance of white noise behind 1/(1 − a z⁻¹)²
    gain = np.sqrt((1 - a * a) ** 3 / (1 + a * a))
    white = np.random.default_rng(seed).normal(0.0, gain, (samples, 2))
    return lfilter([1.0], [1.0, -2.0 * a, a * a], white, axis=0)


def pushed(samples=8000, scale=5.0, noise=2.0) -> tuple[RunSamples, RunSamples]:
    """Half free, half with a random torque; white torque noise everywhere. Seed 1."""
    t = STEP * np.arange(samples)
    free = np.arange(samples) < samples // 2
    torque = scale * low_passed_noise(samples, 6.0, 1) * ~free[:, None]
    terms = momentum_of(t, torque, noise)
    return samples_of(terms, ~free), samples_of(terms, free)


@pytest.mark.parametrize("name", tuning.KINDS)
def test_the_expected_error_is_the_measured_one(name):
    """The spectra predict the rmse that the tuned observer then has against the truth."""
    loaded, free = pushed()
    observer = tuning.tune_to_spectra(name, spectra_of(loaded, [free]))
    tau = observer.estimate(loaded.run.terms).tau
    truth = 5.0 * low_passed_noise(8000, 6.0, 1) * loaded.inside[:, None]
    inner = loaded.inside.copy()
    inner[:4200] = False
    rmse = np.sqrt(np.mean((tau - truth)[inner] ** 2, axis=0))
    # power of 30 s of a torque with a correlation time of 0.17 s: known to 10 %; the tail of its
    # spectrum lies under the noise, where (S_d − S_n)₊ sees only a part: the smoother's 10 % more
    np.testing.assert_allclose(rmse, observer.curve.least, rtol=0.2)


def test_tuning_finds_the_best_of_all_natural_frequencies():
    loaded, free = pushed()
    spectra = spectra_of(loaded, [free])
    found = tuning.error_curve(tuning.kalman_filter, spectra)

    def expected(omega_n: np.ndarray) -> np.ndarray:
        response = tuning.kalman_filter(omega_n).frequency_response(spectra.frequency, STEP, 2)
        return np.sqrt(spectra.missed(response) + spectra.passed(response))

    np.testing.assert_allclose(expected(found.best), found.least, rtol=1e-12)
    for factor in (0.7, 1.4):
        assert np.all(expected(found.best * factor) >= found.least)


def test_the_noise_level_gives_innovations_their_expected_variance():
    """NIS = 1 on the loaded part, which is what R is scaled for."""
    loaded, free = pushed()
    spectra = spectra_of(loaded, [free])
    omega_n = np.array([20.0, 40.0])
    observer = tuning.kalman_filter(omega_n, tuning.noise_level(omega_n, spectra))
    settled, model = observer.steady(STEP, 2), observer.model(STEP, 2)
    tau = observer.estimate(loaded.run.terms).tau
    nu = ((tau[1:] - model.a22 * tau[:-1]) / settled.l2)[4199:]
    nis = np.mean(nu**2, axis=0) / settled.S
    # variance of the same samples, windowed and not: the rest is the spectrum's own scatter
    np.testing.assert_allclose(nis, 1.0, rtol=0.1)


def test_without_spectra_auto_falls_back_and_says_so():
    setup = Setup(gains={}, settings={}, joints=2, step=STEP, as_printed=False)
    observers, remarks = build_observers(("kfo-auto", "rts-auto", "kfo-zoh", "kfo-rts"), setup)
    untuned = [r for r in remarks if r.code == "tuning-without-free-part"]
    assert [r.where.about for r in untuned] == ["kfo-auto", "rts-auto"]
    assert str(untuned[0]).startswith("kfo-auto: no contact-free part to tune on")
    loaded, _ = pushed(samples=400)
    filtered, smoothed, by_hand, rts = (o.estimate(loaded.run.terms) for o in observers)
    assert filtered.name == "kfo-auto"
    np.testing.assert_array_equal(filtered.tau, by_hand.tau)
    np.testing.assert_array_equal(smoothed.tau, rts.tau)


def test_tuned_observers_have_nothing_left_to_tune():
    setup = Setup(gains={}, settings={}, joints=2, step=STEP, as_printed=False)
    setup = setup._replace(shown=LogSpectra(plain=spectra()))
    observer, remarks = OBSERVERS["rts-auto"].build(setup, "rts-auto")
    assert remarks == ()
    assert observer.tuning(STEP, 2).parameter_count == 0
    np.testing.assert_allclose(observer.tuning(STEP, 2).zeta, np.sqrt(0.5))


def test_a_bound_is_never_reached_in_silence():
    grid = np.array([1.0, 10.0, 250.0])
    slow, fast = tuning.bound_remarks("kfo-auto", np.array([1.0, 10.0, 250.0, 1.0]), grid)
    assert (slow.code, fast.code) == ("gain-at-slowest", "gain-at-fastest")
    assert slow.level == fast.level == "warning"
    assert (slow.where.joints, fast.where.joints) == ((1, 4), (3,))
    assert (slow.values["rate_rad_s"], fast.values["rate_rad_s"]) == (1.0, 250.0)
    assert str(fast).startswith("kfo-auto: J3: ")


def test_best_keeps_a_push_where_the_log_shows_none():
    """Tuned on noise alone it keeps what 1/(1 + (ω/9)⁴) leaves of a half sine of .6 s."""
    _, free = pushed()
    t = free.run.terms.t
    begin = t[len(t) // 2]
    inside = (t >= begin) & (t < begin + 0.6)
    push = np.where(inside, np.sin(np.pi * (t - begin) / 0.6), 0.0)
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(t), STEP)
    left = np.fft.irfft(np.fft.rfft(push) / (1.0 + (omega / 9.0) ** 4), len(t)).max()
    p = np.cumsum(push[:, None] * np.ones(2), axis=0) * STEP
    quiet = DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))
    kept = {}
    for name in ("best", "rts-auto"):
        observer = tuning.tune_to_spectra(name, spectra_of(free, [free]))
        kept[name] = float(observer.estimate(quiet).tau[:, 0].max())
    # The grid of natural frequencies is 7 % fine, of which the peak moves by a third.
    assert kept["best"] == pytest.approx(left, rel=0.025)
    assert kept["rts-auto"] < kept["best"]


GAINS = {
    "fdo": {"omega": 10.0},
    "gmo": {"gain": [5.0, 3.0, 4.0]},
    "kfo": {"r_diag": [0.5, 0.5, 1.3], "q_p_diag": [0.01, 0.01, 0.02], "q_tau_diag": 5000.0},
}


def setup(step: float = 0.008, **changed: object) -> Setup:
    given = {"gains": GAINS, "settings": {}, "joints": 3, "step": step, "as_printed": False}
    return Setup(**(given | changed))


def tuned(goal: str, step: float = 0.008, convention: str | None = None) -> list[Observer]:
    settings = {"kfo": {"noise_convention": convention}} if convention else {}
    how = setup(step, settings=settings)
    asked = tuning.parse_goal(goal, allowed=("delay", "bandwidth"))
    return list(tuning.match_observers(build_observers(PAPER, how)[0], asked, step, 3)[0])


@pytest.mark.parametrize("step", [0.001, 0.008])
@pytest.mark.parametrize("convention", ["density", "discrete", "literal"])
@pytest.mark.parametrize("delay", [0.02, 0.1, 0.5])
def test_the_same_delay_on_every_joint(delay, convention, step):
    for observer in tuned(f"delay={delay}", step, convention):
        found = observer.tuning(step, 3).delay
        assert found == pytest.approx(np.full(3, delay), rel=1e-9), observer.name


@pytest.mark.parametrize("step", [0.001, 0.008])
@pytest.mark.parametrize("hertz", [0.5, 5.0, 20.0])
def test_the_same_bandwidth_on_every_joint(hertz, step):
    for observer in tuned(f"bandwidth={hertz}", step):
        gain = np.abs(observer.frequency_response(np.array([hertz]), step, 3))
        assert gain[0] == pytest.approx(np.full(3, np.sqrt(0.5)), rel=1e-9), observer.name


def test_frequency_responses_are_those_of_the_filters():
    """Amplitude and lag of the answer to a sine of 2 Hz, long after the transient."""
    t, w = 0.008 * np.arange(5000), 4 * np.pi
    p = -np.cos(w * t)[:, None] / w * np.ones(3)
    basis = np.column_stack([np.sin(w * t), np.cos(w * t)])[2500:]
    for observer in build_observers(PAPER, setup())[0]:
        answer = observer.estimate(DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))).tau[2500:]
        sine, cosine = np.linalg.lstsq(basis, answer, rcond=None)[0]
        response = observer.frequency_response(np.array([2.0]), 0.008, 3)[0]
        np.testing.assert_allclose(sine + 1j * cosine, response, atol=1e-9)


def test_a_ramp_lags_by_the_matched_delay():
    """τ_ext = t: after the transient every estimate is t − delay."""
    t = np.arange(0.0, 6.0, 0.008)
    p = np.repeat(0.5 * t[:, None] ** 2, 3, axis=1)
    terms = DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))
    for observer in tuned("delay=0.08"):
        lag = t[-1] - observer.estimate(terms).tau[-1]
        # 6 s are 75 time constants; what is left is rounding of p ≈ 18.
        assert lag == pytest.approx(np.full(3, 0.08), abs=1e-9), observer.name


NO_GOAL = r"delay=S \(seconds\) or bandwidth=HZ, a positive"


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ("delay", NO_GOAL),
        ("speed=3", NO_GOAL),
        ("delay=-1", NO_GOAL),
        ("delay=nan", NO_GOAL),
        ("delay=0.002", "more than half a sample"),
        ("bandwidth=200", "half the sample rate"),
    ],
)
def test_goals_that_are_none_or_out_of_reach(goal, message):
    with pytest.raises(ParameterError, match=message):
        tuned(goal)


def test_one_joint_out_of_reach_is_refused():
    """Two joints could have the delay; on the third R = 1e12 and the largest Q_τ, 1e18, make
    ω_n = (Q_τ/R)^¼ = 32 rad/s and so √2/ω_n = 45 ms."""
    density = {"r_diag": [0.5, 0.5, 1e12], "noise_convention": "density"}
    gains = {**GAINS, "kfo": {**GAINS["kfo"], **density}}
    how = setup(gains=gains)
    observers, _ = build_observers(["kfo-zoh"], how)
    with pytest.raises(ParameterError, match=r"no gain gives kfo-zoh a delay of 0\.02 s"):
        tuning.match_observers(observers, tuning.parse_goal("delay=0.02"), 0.008, 3)


def test_printed_formulas_are_not_matched():
    choice = ObserverChoice.parsed(gains="delay=0.05", as_printed=True)
    with pytest.raises(ParameterError, match="--as-printed"):
        choice.build(load_robot("ur5"), 0.008)


def test_first_order_observers_are_called_alike_only_where_both_run():
    observers, _ = build_observers(["fdo", "kfo-zoh"], setup())
    _, (remark,) = tuning.match_observers(observers, tuning.parse_goal("bandwidth=3"), 0.008, 3)
    assert (remark.code, remark.values) == ("bandwidth-matched", {"bandwidth_Hz": 3.0})
    observers, _ = build_observers(PAPER, setup())
    goal = tuning.parse_goal("delay=0.05")
    _, (matched, alike) = tuning.match_observers(observers, goal, 0.008, 3)
    assert (matched.code, matched.values) == ("delay-matched", {"delay_s": 0.05})
    assert alike.code == "first-order-observers-alike"
