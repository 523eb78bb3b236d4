"""Gains for a goal: `vftcli identify --method gains`, goals, files, and what cannot be reached."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from vftcli.cli import app
from vftcli.observers.spectra import Spectra
from vftcli.observers.tuning import bounds_reached, crossings, parse_goal, tune_all
from vftcli.signals.errors import ParameterError, VftError

FIXTURE = Path(__file__).parent.parent.parent / "fixtures" / "ur5_circle.csv"
STEP = 0.008


def spectra(noise: float = 1e-3) -> Spectra:
    """A torque of 5 N·m rms below a corner of 1 Hz, over white noise; two joints, analytic."""
    f = np.linspace(0.0, 62.5, 251)
    torque = (2.0 * 25.0 / np.pi / (1.0 + f**2))[:, None] * np.array([1.0, 0.2])
    quiet = np.full((251, 2), noise)
    return Spectra(frequency=f, free=quiet, loaded=quiet + torque, step=STEP, segments=(4, 10))


def test_every_observer_reaches_the_stated_delay() -> None:
    for line in tune_all(spectra(), parse_goal("delay=0.05")):
        expected = 0.0 if line.observer == "kfo-rts" else 0.05
        np.testing.assert_allclose(line.delay, expected, atol=1e-9)


def test_every_observer_reaches_the_stated_bandwidth() -> None:
    from vftcli.observers.auto_tuning import kalman_smoother

    lines = {line.observer: line for line in tune_all(spectra(), parse_goal("bandwidth=3"))}
    smoother = kalman_smoother(lines["kfo-rts"].rate)
    np.testing.assert_allclose(smoother.tuning(STEP, 2).bandwidth, 3.0, rtol=1e-12)
    # FDO and GMO are one filter where they share a rate
    np.testing.assert_allclose(lines["fdo"].rate, lines["gmo"].rate)


def test_the_smoother_promises_the_smallest_error() -> None:
    lines = tune_all(spectra(0.3), parse_goal("auto"))
    best = min(lines, key=lambda line: float(np.mean(line.rmse)))
    assert best.observer == "kfo-rts"
    # the joint with the smaller torque over the same noise wants the slower filter
    assert lines[1].rate[1] < lines[1].rate[0]


def test_rices_formula_on_a_narrow_band() -> None:
    """A 2 Hz narrow-band signal of 1 N·m rms passes ±h at 2·2·e^{−h²/2} times a second."""
    f = np.linspace(0.0, 10.0, 1001)
    power = np.exp(-(((f - 2.0) / 0.02) ** 2))[:, None]
    power /= power.sum()
    power[0] = 0.0
    found = crossings(power, f, np.array([2.0]))
    # both sides, upwards only: 2 · 2 Hz · 3600 s · e^{−2}; the band is 1 % wide
    assert found[0] == pytest.approx(2 * 2.0 * 3600 * np.exp(-2.0), rel=1e-3)


def test_few_false_alarms_cost_bandwidth() -> None:
    many = tune_all(spectra(0.3), parse_goal("false-alarms=1000", "8"))
    few = tune_all(spectra(0.3), parse_goal("false-alarms=0.01", "8"))
    for fast, slow in zip(many, few, strict=True):
        assert slow.alarms is not None
        assert np.all(slow.rate <= fast.rate)
        assert np.all(slow.alarms <= 0.01)


def test_alarms_that_nothing_can_avoid_are_said() -> None:
    with pytest.raises(ParameterError, match=r"too loud for the threshold on J1"):
        tune_all(spectra(50.0), parse_goal("false-alarms=0.01", "0.5"))


@pytest.mark.parametrize(
    ("goal", "threshold"),
    [
        ("fast", None),
        ("delay", None),
        ("delay=-1", None),
        ("delay=nan", None),
        ("auto=3", None),
        ("bandwidth=x", None),
        ("false-alarms=2", None),
        ("false-alarms=2", "0"),
        ("false-alarms=2", "a"),
    ],
)
def test_goals_that_are_none(goal: str, threshold: str | None) -> None:
    with pytest.raises(ParameterError, match=r"--gains|alarm\.threshold"):
        parse_goal(goal, threshold)


@pytest.mark.slow
def test_a_tuned_file_goes_into_a_comparison(tmp_path: Path) -> None:
    """identify writes it, --gains takes it: GMO then errs as little as was promised."""
    gains, runner = tmp_path / "gains.toml", CliRunner()
    asked = [
        "identify",
        str(FIXTURE),
        "--robot",
        "ur5",
        "--method",
        "gains",
        "-o",
        str(gains),
        "--json",
    ]
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
def test_a_constant_error_brings_one_threshold_nearer(offset: float) -> None:
    """2 Hz of 1 N·m rms about an offset m: 2·3600·(e^{−(h−m)²/2} + e^{−(h+m)²/2}) an hour."""
    f = np.linspace(0.0, 10.0, 1001)
    power = np.where(np.isclose(f, 2.0), 1.0, 0.0)[:, None]
    power[0] = offset**2
    expected = 7200.0 * (np.exp(-0.5 * (2.0 - offset) ** 2) + np.exp(-0.5 * (2.0 + offset) ** 2))
    assert crossings(power, f, np.array([2.0]))[0] == pytest.approx(expected, rel=1e-12)


def test_an_offset_at_the_threshold_is_an_alarm_without_end() -> None:
    power = np.array([[4.0], [1.0]])
    assert crossings(power, np.array([0.0, 2.0]), np.array([2.0]))[0] == np.inf


def test_the_one_rate_of_filtered_dynamics_lies_between_those_of_the_joints() -> None:
    """It has the smallest mean error; each joint by itself could have less."""
    fdo, gmo, *_ = tune_all(spectra(0.3), parse_goal("auto"))
    assert fdo.gains["omega"] == fdo.rate[0] == fdo.rate[1]
    assert np.min(gmo.rate) < fdo.rate[0] < np.max(gmo.rate)
    assert np.all(gmo.rmse < fdo.rmse)


def test_a_threshold_is_one_or_one_a_joint() -> None:
    with pytest.raises(ParameterError, match=r"alarm.threshold has 3 values; .* each of 2 joints"):
        tune_all(spectra(), parse_goal("auto", "1,2,3"))
    for line in tune_all(spectra(), parse_goal("auto", "1,2")):
        assert line.alarms is not None


@pytest.mark.parametrize("name", ["kfo-zoh", "kfo-rts"])
def test_a_kalman_filters_rate_is_the_fourth_root_of_its_densities(name: str) -> None:
    """ω_n⁴ = Q_τ/R under ``density``, whatever R the log's noise asks for."""
    (line,) = (x for x in tune_all(spectra(0.3), parse_goal("auto")) if x.observer == name)
    ratio = np.array(line.gains["q_tau_diag"]) / np.array(line.gains["r_diag"])
    np.testing.assert_allclose(ratio**0.25, line.rate, rtol=1e-12)


def test_a_gain_at_a_bound_is_said_with_the_numbers() -> None:
    """No torque beyond the noise: every observer runs to the slowest; a stated delay has none."""
    quiet = spectra()
    silent = Spectra(
        frequency=quiet.frequency,
        free=quiet.free,
        loaded=quiet.free,
        step=quiet.step,
        segments=(8, 8),
    )
    goal = parse_goal("auto")
    remarks = bounds_reached(tune_all(silent, goal), silent, goal)
    assert {r.where.about for r in remarks} == {"fdo", "gmo", "kfo-zoh", "kfo-rts"}
    for remark in remarks:
        assert (remark.code, remark.level) == ("gain-at-slowest", "warning")
        assert remark.values["rate_rad_s"] == 1.0
    assert bounds_reached(tune_all(quiet, goal), quiet, goal) == ()
    slow = parse_goal("delay=1")
    assert bounds_reached(tune_all(quiet, slow), quiet, slow) == ()
