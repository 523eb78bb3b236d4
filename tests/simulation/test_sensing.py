"""What the log sees: each imperfection alone, and none at all."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.signals.errors import ParameterError
from vftcli.simulation import Simulation, load_scenario, simulate
from vftcli.simulation.sensing import check_sensing

SHORT = ["duration=0.4", "contacts.hand.begin=0.0"]
CLEAN = ["sensing.noise=0", "sensing.position_step=0"]


def circle(*settings: str) -> Simulation:
    return simulate(load_scenario("ur5-circle", [*SHORT, *settings]), 1)


def test_everything_off_is_the_true_state() -> None:
    run = circle(*CLEAN, "sensing.torque=instant", "mismatch.torque_constant=0")
    np.testing.assert_allclose(run.recording.q, run.samples.q, atol=1e-15)
    np.testing.assert_allclose(run.recording.require("dq"), run.samples.v, atol=1e-15)
    constant = run.robot.torque_constant
    torque = run.recording.require("current") * constant
    np.testing.assert_allclose(torque, run.samples.tau, atol=1e-12)
    np.testing.assert_allclose(np.diff(run.recording.t), 0.008, atol=1e-12)


def test_average_torque_is_the_mean_over_the_interval() -> None:
    fine = circle(*CLEAN, "sensing.rate=1000", "sensing.torque=instant")
    mean = circle(*CLEAN, "sensing.torque=average")
    steps = fine.samples.tau[1:].reshape(-1, 8, 6).mean(axis=1)
    np.testing.assert_allclose(mean.samples.tau[1:], steps, atol=1e-9)


@pytest.mark.slow
def test_noise_has_the_profile_size() -> None:
    run = circle("duration=20.0", "sensing.position_step=0")
    noise = run.robot.noise
    # 2501 samples: the estimate of a standard deviation is good to 1.4 % (one sigma)
    spread = np.std(run.recording.q - run.samples.q, axis=0)
    np.testing.assert_allclose(spread, noise.q, rtol=0.07)
    quiet = circle("duration=20.0", "sensing.noise=0")
    currents = run.recording.require("current") - quiet.recording.require("current")
    np.testing.assert_allclose(np.std(currents, axis=0), noise.current, rtol=0.07)


def test_positions_are_quantised() -> None:
    steps = circle("sensing.position_step=0.001").recording.q / 0.001
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


def test_clock_drift_stretches_the_period_on_the_log_clock() -> None:
    run = circle("duration=8.0", "sensing.clock_drift=0.01", *CLEAN, "contacts=[]")
    t, q = run.recording.t, run.recording.q[:, 0]
    later = np.interp(t[:400] + 4.04, t, q)
    # one round of 4 s is 4.04 s on a clock that is 1 % fast; the servo repeats to 0.1 mrad
    np.testing.assert_allclose(later, q[:400], atol=2e-4)
    assert run.samples.stamp[-1] == pytest.approx(8.08, abs=0.008)


def test_a_seed_is_zero_or_positive() -> None:
    scenario = load_scenario("ur5-circle", ["duration=0.1"])
    assert simulate(scenario, 0).seed == 0
    with pytest.raises(ParameterError, match=r"the seed is -1; it must be zero or positive"):
        simulate(scenario, -1)


@pytest.mark.parametrize(("count", "code"), [(1, "repeat-dropped"), (2, "repeats-dropped")])
def test_rows_that_are_logged_twice_are_dropped_and_counted(count: int, code: str) -> None:
    run = circle("duration=0.1")
    rows = tuple(sorted([*run.measured.rows, *run.measured.rows[:count]]))
    log = replace(run, measured=run.measured._replace(rows=rows)).recording
    np.testing.assert_array_equal(log.q, run.recording.q)
    assert (log.source.rows, log.source.duplicates) == (len(rows), count)
    assert [remark.code for remark in log.source.remarks] == [code]


@pytest.mark.slow
def test_dropped_samples_leave_gaps_and_repeated_rows_are_counted() -> None:
    run = circle("duration=8.0", "sensing.dropped=0.05", "sensing.repeated=0.05")
    written = len(run.measured.rows)
    assert 900 < written < 1000
    assert 20 < run.recording.source.duplicates < 90
    assert run.recording.samples == written - run.recording.source.duplicates
    assert np.max(np.diff(run.recording.t)) > 0.0159


def test_jittering_stamps_still_increase() -> None:
    steps = np.diff(circle("sensing.jitter=0.003").recording.t)
    assert np.all(steps > 0)
    assert np.std(steps) > 1e-3


@pytest.mark.slow
def test_vendor_estimate_sees_the_push_late_and_through_a_filter() -> None:
    run = simulate(load_scenario("ur5-circle", ["contacts.hand.style=slow"]), 1)
    truth, vendor = run.truth.tau_ext[:, 0], run.measured.signals["tau_ext"][:, 0]
    lags = [np.corrcoef(truth[:-k], vendor[k:])[0, 1] for k in range(1, 40)]
    # torque ON the robot, 5 Hz first order: 32 ms behind, and the average's 4 ms
    assert max(lags) > 0.9
    assert 0.016 <= 0.008 * (1 + int(np.argmax(lags))) <= 0.08


@pytest.mark.slow
def test_force_sensor_reads_the_handle_in_its_own_axes() -> None:
    quiet = ["noise_force=0", "noise_torque=0", "drift_force=0", "tool_mass=0"]
    settings = [f"force_sensor.{s}" for s in quiet]
    run = simulate(
        load_scenario("ur5-sensor", ["duration=9", *settings, "force_sensor.bias=[0,0,0,0,0,0]"]), 1
    )
    assert "wrench" in run.measured.signals
    # lengths of a vector do not depend on the axes
    there = np.linalg.norm(run.truth.wrench[:, :3], axis=1)
    np.testing.assert_allclose(
        np.linalg.norm(run.measured.signals["wrench"][:, :3], axis=1), there, atol=1e-9
    )
    assert np.max(there) > 20.0


def test_force_sensor_at_rest_weighs_its_tool() -> None:
    run = simulate(load_scenario("ur5-sensor", ["duration=2", "force_sensor.tool_mass=0.5"]), 1)
    assert "wrench" in run.measured.signals
    bias = np.array(run.scenario.force_sensor.bias)  # type: ignore[union-attr]
    weight = np.linalg.norm((run.measured.signals["wrench"] - bias)[:, :3].mean(axis=0))
    # 250 samples of 0.1 N noise and 2 mN drift: 0.01 N
    assert weight == pytest.approx(0.5 * 9.81, abs=0.02)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("sensing.dropped=1.5", "share from 0 to 1"),
        ("sensing.jitter=-1", "not be negative"),
        ("sensing.torque=peak", "average or instant"),
        ("sensing.clock_drift=0.9", "below 0.5"),
    ],
)
def test_impossible_sensing_is_refused(setting: str, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        check_sensing(load_scenario("ur5-circle", [setting]).sensing)
