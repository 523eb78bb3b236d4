"""ObserverChoice: which observers, and whose gains go before whose."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.observers import (
    LEAD,
    LONGEST,
    ObserverChoice,
    lead_samples,
    settling_samples,
)
from vftcli.observers.paper import MomentumObserver
from vftcli.observers.spectra import Spectra
from vftcli.observers.table import (
    PAPER,
    LogSpectra,
    Setup,
    build_observers,
    load_gains,
    parse_settings,
)
from vftcli.robots import PROFILES, load_robot
from vftcli.signals.errors import ParameterError, VftError
from vftcli.signals.external_torque import DynamicsTerms

UR5 = load_robot("ur5")
STEP = 0.008


@pytest.fixture
def spectra() -> Spectra:
    """A push that fades as f⁻⁴ beside white noise, on six joints alike."""
    f = np.linspace(0.0, 62.5, 251)
    noise = np.full((251, 6), 0.01)
    push = (10.0 / (1.0 + f**4))[:, None]
    return Spectra(frequency=f, free=noise, loaded=noise + push, step=STEP, segments=(9, 9))


def gain(choice: ObserverChoice) -> float:
    """The momentum observer's gain on joint 1. [1/s]"""
    return float(choice.build(UR5, STEP)[0][0].gain[0])


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ({}, ("best", *PAPER)),
        ({"causal": True}, PAPER),
        # The printed formulas and one footing for all are asked of the paper's observers.
        ({"as_printed": True}, PAPER),
        ({"gains": "delay=0.05"}, PAPER),
        ({"as_printed": True, "observer": ["best", "gmo"]}, ("best", "gmo")),
        ({"observer": ["gmo"]}, ("gmo",)),
        ({"observer": ["gmo", "best", "gmo"]}, ("best", "gmo")),  # the best leads, each once
        ({"observer": ["rts-auto", "kfo-auto", "kfo-rts", "fdo"], "causal": True}, ("fdo",)),
    ],
)
def test_who_runs(words, names):
    assert ObserverChoice.parsed(**words).names == names


def test_beside_a_print_stand_its_own_observers_unless_others_are_named():
    assert ObserverChoice().beside_print().names == PAPER
    named = ObserverChoice(names=("best", "gmo"))
    assert named.beside_print() is named


def test_gains_of_the_log_go_between_the_robot_and_set(spectra):
    gains = {"gmo": {"gain": 7.0}, "kfo": {"r_diag": 2.0}}
    shown = LogSpectra(plain=spectra, best=spectra, gains=gains)
    asked = ObserverChoice.parsed(gains="auto", observer=["gmo", "kfo-zoh"])
    (gmo, zoh), remarks = asked.build(UR5, STEP, shown)
    assert np.all(gmo.gain == 7.0)
    assert np.all(zoh.r_diag == 2.0)
    np.testing.assert_array_equal(zoh.q_p_diag, UR5.gains["kfo"]["q_p_diag"])
    assert remarks == ()
    both = ObserverChoice.parsed(gains="auto", observer=["gmo"], settings={"gmo.gain": "33"})
    assert np.all(both.build(UR5, STEP, shown)[0][0].gain == 33.0)
    # A log without a free part has none to give: those of the file, read as what it would give.
    (gmo, zoh), remarks = asked.build(UR5, STEP)
    np.testing.assert_array_equal(gmo.gain, UR5.gains["gmo"]["gain"])
    assert zoh.noise_convention == "density"
    assert [remark.code for remark in remarks] == ["gains-without-free-part"]


def test_the_best_is_tuned_to_what_is_left_without_the_bias(spectra):
    """Each observer that the log tunes sees the spectra of the terms that it runs on."""
    quiet = replace(spectra, free=0.01 * spectra.free)
    shown = LogSpectra(plain=spectra, best=quiet)
    choice = ObserverChoice(names=("best", "rts-auto"))
    best, plain = choice.build(UR5, STEP, shown)[0]
    assert (best.name, plain.name) == ("best", "rts-auto")
    rates = [o.tuning(STEP, 6).omega_n for o in (best, plain)]
    assert np.all(rates[0] > rates[1])  # less noise is followed faster
    (best, plain), remarks = choice.build(UR5, STEP, LogSpectra(plain=spectra))
    assert best.curve is None
    assert plain.curve is not None
    assert [(r.code, r.where.about) for r in remarks] == [("tuning-without-free-part", "best")]


def test_set_goes_before_a_file_and_a_file_before_the_robot(tmp_path):
    file = tmp_path / "gains.toml"
    file.write_text("[observers.gmo]\ngain = 21.0\n", encoding="utf-8")
    own = ObserverChoice.parsed(observer=["gmo"], gains="paper")
    assert own == ObserverChoice(names=("gmo",))
    assert gain(own) == np.atleast_1d(UR5.gains["gmo"]["gain"])[0]
    of_file = ObserverChoice.parsed(observer=["gmo"], gains=str(file))
    assert gain(of_file) == 21.0
    assert (own.of_robot_file, of_file.of_robot_file) == (True, False)
    both = ObserverChoice.parsed(observer=["gmo"], gains=file, settings={"gmo.gain": "33"})
    assert gain(both) == 33.0
    matched = ObserverChoice.parsed(observer=["gmo"], gains="delay=0.05")
    # First order: the delay behind a slow ramp is 1/K.
    assert gain(matched) == pytest.approx(20.0, rel=1e-9)


def test_only_observers_that_a_log_tunes_need_its_spectra():
    assert not ObserverChoice(causal=True).from_spectra
    assert ObserverChoice(causal=True, gains="auto").from_spectra
    assert ObserverChoice().from_spectra
    assert ObserverChoice(names=("gmo", "rts-auto")).from_spectra


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"observer": ["kalman"]}, "no observer 'kalman'; there is best, fdo, gmo"),
        ({"settings": {"gmo.gian": "3"}}, "Did you mean gain"),
        ({"gains": "bandwidth=x"}, "is not delay=S"),
        ({"observer": ["rts-auto", "best"], "causal": True}, "leaves out rts-auto, best"),
        ({"observer": ["best", "best"], "causal": True}, "leaves out best, which needs"),
    ],
)
def test_a_slip_is_refused_before_a_log_is_read(words, message):
    with pytest.raises(ParameterError, match=message):
        ObserverChoice.parsed(**words)


PANDA = load_robot("panda")


def observer(name, step):
    (built,), _ = ObserverChoice(names=(name,)).build(PANDA, step)
    return built


def terms(step, mu, samples=120):
    rng = np.random.default_rng(3)
    t = step * (np.arange(samples) + 0.02 * rng.uniform(-1, 1, samples) * (step == 1 / 15))
    return DynamicsTerms(t=t, p=rng.standard_normal((samples, 7)), mu=np.full((samples, 7), mu))


@pytest.mark.parametrize("name", ["fdo", "gmo", "kfo-fe", "kfo-zoh", "kfo-rts"])
@pytest.mark.parametrize("step", [1 / 15, 1e-3])
def test_a_load_that_was_there_all_the_time_shows_at_once(name, step):
    """At rest under 3 N·m, τ_ext = −μ in every sample, on even and uneven clocks."""
    still = terms(step, -3.0)
    still = DynamicsTerms(t=still.t, p=np.zeros((120, 7)), mu=still.mu)
    found = ObserverChoice(from_rest=True).run(observer(name, step), still)
    # 60 time constants leave e⁻⁶⁰; rounding of sums of hundreds of samples
    np.testing.assert_allclose(found.tau, 3.0, atol=1e-12)
    np.testing.assert_array_equal(found.t, still.t)


def test_a_first_order_observer_settles_in_the_time_of_its_gain_and_a_smoother_at_once():
    """(1−a)/(1+a) = 1/3 a sample at K = 10, Ts = .1: 3⁻⁵ = .4 % is the first below 1 %."""
    assert settling_samples(MomentumObserver(gain=10.0), 0.1, 7) in {4, 5}
    assert settling_samples(observer("kfo-rts", 1 / 25), 1 / 25, 7) == 0
    # the lead is bounded
    assert lead_samples(MomentumObserver(gain=10.0), 0.1, 7) == LEAD
    assert lead_samples(MomentumObserver(gain=1e-6), 1e-3, 7) == LONGEST


def setup(robot: str, *assignments: str, joints: int = 6, step: float = 0.008) -> Setup:
    gains = load_robot(robot).gains if robot else {}
    settings = parse_settings(assignments)
    return Setup(gains=gains, settings=settings, joints=joints, step=step, as_printed=False)


def test_the_profile_gives_the_papers_gains():
    (fdo, gmo, fe, _), remarks = build_observers(PAPER, setup("ur5"))
    assert fdo.omega == 10.0
    np.testing.assert_array_equal(gmo.gain, [5, 3, 4, 10, 10, 10])
    np.testing.assert_array_equal(fe.r_diag, [0.5, 0.5, 0.5, 1.3, 1.3, 1.3])
    assert remarks == ()


def test_the_command_line_wins_over_the_profile():
    asked = setup("ur5", "gmo.gain=30", "kfo.r_diag=1,2,3,4,5,6", "kfo-zoh.decay=2")
    (gmo, zoh), _ = build_observers(["gmo", "kfo-zoh"], asked)
    np.testing.assert_array_equal(gmo.gain, [30.0] * 6)
    np.testing.assert_array_equal(zoh.r_diag, [1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(zoh.decay, [2.0] * 6)


def test_gains_nobody_gave_take_the_kalman_filters_delay_and_say_so():
    asked = setup("panda", "kfo.noise_convention=density", joints=7, step=0.001)
    (fdo, gmo, fe), remarks = build_observers(["fdo", "gmo", "kfo-fe"], asked)
    delay = fe.tuning(0.001, 7).delay
    np.testing.assert_allclose(gmo.tuning(0.001, 7).delay, delay, rtol=1e-12)
    np.testing.assert_allclose(1.0 / fdo.omega, np.mean(delay), rtol=1e-12)
    given = {remark.values.get("parameter"): remark.code for remark in remarks}
    assert given["gmo.gain"] == "gain-from-kalman-delay"


@pytest.mark.parametrize("name", ["kfo-fe", "kfo-zoh", "kfo-rts"])
def test_a_file_s_noise_is_a_sample_s_and_a_bare_robot_s_a_density(name):
    """ω_n of R .5 and Q_τ 5000 at 125 Hz: (Q_τ/R)^¼ of densities, (Q_τ/(R·Ts))^¼ of samples."""
    expected = {"ur5": (5000 / 0.5 / 0.008) ** 0.25, "": 10.0}
    for robot, omega in expected.items():
        (observer,), _ = build_observers([name], setup(robot))
        assert observer.tuning(0.008, 6).omega_n[0] == pytest.approx(omega, rel=1e-12)
        (observer,), _ = build_observers([name], setup(robot, "kfo.noise_convention=density"))
        assert observer.tuning(0.008, 6).omega_n[0] == pytest.approx(10.0, rel=1e-12)

    own = {"kfo": {**load_robot("ur5").gains["kfo"], "noise_convention": "density"}}
    (named,), _ = build_observers([name], setup("ur5")._replace(gains=own))
    assert named.tuning(0.008, 6).omega_n[0] == pytest.approx(10.0, rel=1e-12)


def test_the_print_runs_its_own_convention_and_says_so():
    (fe,), _ = build_observers(["kfo-fe"], setup("ur5")._replace(as_printed=True))
    assert fe.noise_convention == "literal"


def test_what_a_log_would_tune_and_first_order_gains_keep_to_densities():
    """Delay of the Panda's density reading at 1 kHz: 41.8 and 24.7 ms, not 7.1 and 4.1 ms."""
    panda = setup("panda", joints=7, step=0.001)
    names = ["best", "kfo-auto", "rts-auto", "fdo", "gmo"]
    (best, auto, smoother, fdo, gmo), _ = build_observers(names, panda)
    stated = setup("panda", "kfo.noise_convention=density", joints=7, step=0.001)
    (density,), _ = build_observers(["kfo-zoh"], stated)
    wanted = density.tuning(0.001, 7)
    for observer in (best, auto, smoother):
        np.testing.assert_array_equal(observer.tuning(0.001, 7).omega_n, wanted.omega_n)
    delay = np.array([0.0418] * 4 + [0.0247] * 3)
    np.testing.assert_allclose(1.0 / gmo.gain, delay, atol=5e-5)  # printed to 0.1 ms
    assert 1.0 / fdo.omega == pytest.approx(delay.mean(), abs=5e-5)


def test_a_bare_robot_gets_ten_per_second_and_is_reported():
    (gmo,), remarks = build_observers(["gmo"], setup(""))
    np.testing.assert_array_equal(gmo.gain, [10.0] * 6)
    assert [remark.code for remark in remarks] == ["gain-from-default"]
    # From 2/Ts on a first-order observer alternates; at 4 Hz that is 8 1/s.
    (gmo,), _ = build_observers(["gmo"], setup("", step=0.25))
    np.testing.assert_array_equal(gmo.gain, [8.0] * 6)


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("gmo.gain", "is not OBSERVER.PARAMETER=VALUE"),
        ("gmo.gian=3", "Did you mean gain"),
        ("gm.gain=3", "Did you mean gmo"),
        ("gmo.gain=fast", "is not a number"),
        ("gmo.gain=1,nan,3,4,5,6", "must be finite"),
        ("gmo.gain=1,2,3", r"gmo\.gain has 3 values; give one, or one for each of 6"),
    ],
)
def test_a_malformed_assignment_says_what_is_wrong(assignment, words):
    with pytest.raises(ParameterError, match=words):
        build_observers(["gmo"], setup("ur5", assignment))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("not toml", "gains.toml: not valid TOML"),
        ("gain = 1.0", r"no \[observers"),
        ("[observers]\ngain = 1.0", "line 2: gain is 1.0; it must be a section"),
        ("[observers.gmoo]\ngain = 1.0", "Did you mean gmo"),
        ("[observers.gmo]\ngian = 1.0", "Did you mean gain"),
        ("[observers.gmo]\ngain = true", "line 2: gain is True; it must be a number or one"),
        ('[observers.gmo]\ngain = [1, "2"]', r"line 2: gain is \[1, '2'\]; it must be a number"),
        ("[observers.gmo]\ngain = [nan]", r"line 2: gain is \[nan\]; it must be a number"),
        ("[observers.fdo]\nomega = 1e20", r"1e\+20 is out of range; .* to 1e\+06 in size"),
        ("[observers.kfo]\nr_diag = 5e-324", "kfo.r_diag: 5e-324 is out of range"),
        ("[observers.kfo]\nr_diag = 1e300", r"kfo.r_diag: 1e\+300 is out of range"),
        ("[observers.kfo]\nnoise_convention = 3", "must be text in quotes"),
        (f"x = {'[' * 5000}", "gains.toml: not valid TOML: nested too deep"),
    ],
)
def test_what_is_no_gains_file_is_refused(tmp_path, text, words):
    path = tmp_path / "gains.toml"
    path.write_text(text)
    with pytest.raises(VftError, match=words):
        load_gains(path)


def test_a_robot_file_s_gains_are_checked_like_a_gains_file_s(tmp_path):
    text = PROFILES["ur5"].read_text(encoding="utf-8")
    path = tmp_path / "arm.toml"
    path.write_text(text.replace("[observers.gmo]", "[observers.gmoo]"), encoding="utf-8")
    with pytest.raises(ParameterError, match=r"arm.toml: no observer 'gmoo'.* Did you mean gmo"):
        ObserverChoice().build(load_robot(path), 0.008)


def test_a_word_that_is_no_file_of_gains_says_which_words_there_are(tmp_path):
    with pytest.raises(ParameterError, match="--gains takes auto, paper, or a file"):
        load_gains(tmp_path / "papper")


def test_gains_come_from_a_pipe_too():
    read, write = os.pipe()
    os.write(write, b"[observers.gmo]\ngain = 12.0\n")
    os.close(write)
    try:
        assert load_gains(Path(f"/dev/fd/{read}")) == {"gmo": {"gain": 12.0}}
    finally:
        os.close(read)
