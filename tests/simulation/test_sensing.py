"""What the log sees: each imperfection alone, and none at all."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import Payload, load_robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.terms import gravity_torque
from vftcli.signals.errors import ParameterError
from vftcli.simulation import Simulation, load_scenario, simulate
from vftcli.simulation.scenario import SensingSpec
from vftcli.simulation.sensing import log_rate

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


@pytest.mark.parametrize("current", [None, 0.3])
def test_noise_has_the_profiles_size_or_the_one_stated(current: float | None) -> None:
    """1001 samples: a standard deviation is good to 2.2 % (one sigma)."""
    loud = ["sensing.rate=1000", "duration=1", "sensing.position_step=0"]
    stated = [] if current is None else [f"sensing.current_noise={current}"]
    quiet = circle(*loud, "sensing.noise=0", "sensing.current_noise=0")
    run, noise = circle(*loud, *stated), quiet.robot.noise
    sizes = {"q": noise.q, "dq": noise.qd, "current": noise.current}
    for name, size in (sizes | {"current": current or noise.current}).items():
        spread = np.std(run.recording.require(name) - quiet.recording.require(name), axis=0)
        np.testing.assert_allclose(spread, np.broadcast_to(size, 6), rtol=0.1, err_msg=name)


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


@pytest.mark.parametrize("count", [1, 2])
def test_rows_that_are_logged_twice_are_dropped_and_counted(count: int) -> None:
    run = circle("duration=0.1")
    rows = tuple(sorted([*run.measured.rows, *run.measured.rows[:count]]))
    log = run._replace(measured=run.measured._replace(rows=rows)).recording
    np.testing.assert_array_equal(log.q, run.recording.q)
    assert (log.source.rows, log.source.duplicates) == (len(rows), count)
    assert [remark.values["rows"] for remark in log.source.remarks] == [count]


def test_jittering_stamps_still_increase() -> None:
    """By at most .45 of a step to either side, however large the jitter is."""
    run = circle("sensing.jitter=0.0002", "duration=0.5", "sensing.rate=500")
    away = run.measured.stamp - run.samples.stamp
    # 251 stamps: a standard deviation to 4.5 % (one sigma)
    assert np.std(away) == pytest.approx(2e-4, rel=0.2)
    wild = circle("sensing.jitter=1.0", "duration=0.1")
    away = wild.measured.stamp - wild.samples.stamp
    assert abs(away).max() == pytest.approx(0.45 * 0.008)
    assert abs(away).min() > 0.0
    assert np.all(np.diff(wild.recording.t) > 0)
    # one sample has no neighbour to run into
    circle("sensing.jitter=1.0", "duration=0.004")


def test_the_first_and_the_last_sample_are_always_in_the_log() -> None:
    kept = circle("duration=1.0", "sensing.dropped=0.8", "sensing.rate=1000").measured.rows
    assert (kept[0], kept[-1]) == (0, 1000)
    assert len(kept) == pytest.approx(200, abs=40)  # of 999 each with .2: 200 ± 12.6 (one sigma)
    again = circle("duration=0.1", "sensing.repeated=0.9", "sensing.rate=1000").measured.rows
    before = np.arange(101) - again
    assert set(before) == {0, 1}
    assert (before[0], before[-1]) == (0, 0)
    assert before.sum() == pytest.approx(0.9 * 99, abs=10)  # ± 3 (one sigma)


SENSOR = {"position": [0.01, -0.02, 0.03], "rpy": [0.3, -0.4, 0.5], "tool_mass": 0.5,
          "tool_com": [0.02, 0.01, 0.06]}  # fmt: skip


def sensed(duration: float = 0.2, **more: object) -> Simulation:
    """A UR5 pushed on the circle, a sensor without noise, drift and offset on its flange."""
    sensor = ", ".join(f"{name}={value}" for name, value in (SENSOR | more).items())
    push = "{name='p', kind='profile', spans=[[0.0, 9.0]], force=[5.0, 9.0, -20.0], rise=0.1}"
    settings = [f"duration={duration}", f"force_sensor={{{sensor}}}", f"contacts=[{push}]"]
    return simulate(load_scenario("ur5-circle", settings), 1)


def test_a_force_sensor_reads_contacts_and_what_its_tool_weighs() -> None:
    """The tool as the joint torques that Pinocchio gives with it and without it."""
    run = sensed()
    chain, frame = run.robot.chain, run.robot.model.getFrameId("flange")
    turn = pin.rpy.rpyToMatrix(*SENSOR["rpy"])
    com = np.array(SENSOR["position"]) + turn @ SENSOR["tool_com"]
    tool = Payload(mass=0.5, com=com, inertia=np.zeros((3, 3)))
    models = [chain.with_payload(tool).to_pinocchio(), run.robot.model]
    samples, axes = run.samples, pin.LOCAL_WORLD_ALIGNED
    for k in range(len(samples.q)):
        state = samples.q[k], samples.v[k], samples.a[k]
        more, less = (pin.rnea(model, model.createData(), *state) for model in models)
        data = run.robot.model.createData()
        J = pin.computeFrameJacobian(run.robot.model, data, state[0], frame, axes)
        wrench = run.truth.wrench[k] - np.linalg.solve(J.T, more - less)
        R, away = data.oMf[frame].rotation @ turn, data.oMf[frame].rotation @ SENSOR["position"]
        moment = wrench[3:] - np.cross(away, wrench[:3])
        expected = [*(R.T @ wrench[:3]), *(R.T @ moment)]
        # the solve through J, of condition 10, rounds to 1e-13
        np.testing.assert_allclose(run.measured.signals["wrench"][k], expected, atol=1e-9)
    assert np.linalg.norm(run.truth.wrench[-1, :3]) > 20.0


def test_a_force_sensor_errs_by_offset_drift_and_noise() -> None:
    bias = [0.1, 0.2, 0.3, 0.04, 0.05, 0.06]
    plain, off = sensed(), sensed(bias=bias, drift_force=0.5, drift_torque=0.02)
    away = off.measured.signals["wrench"] - plain.measured.signals["wrench"]
    drift = np.outer(plain.samples.time, [0.5] * 3 + [0.02] * 3)
    np.testing.assert_allclose(away, bias + drift, atol=1e-12)
    still, noisy = (sensed(0.5, noise_force=n, noise_torque=0.1 * n) for n in (0.0, 0.2))
    away = noisy.measured.signals["wrench"] - still.measured.signals["wrench"]
    # 63 samples of three axes: a standard deviation to 5 % (one sigma)
    spread = [np.std(away[:, :3]), np.std(away[:, 3:])]
    assert spread == pytest.approx([0.2, 0.02], rel=0.2)


def test_the_controllers_targets_and_estimate_are_of_its_nominal_model() -> None:
    """Inverse dynamics by Pinocchio, friction by the profile; at 100 kHz no filter is left."""
    run = circle("duration=0.1", "sensing.vendor_cutoff=1e5")
    samples, seen, robot = run.samples, run.measured.signals, run.robot
    data, constant = robot.model.createData(), robot.torque_constant

    def rigid(*motion: np.ndarray) -> list[np.ndarray]:
        return [pin.rnea(robot.model, data, *row).copy() for row in zip(*motion, strict=True)]

    target = rigid(samples.target_q, samples.target_dq, samples.target_ddq)
    np.testing.assert_allclose(seen["target_torque"], target, atol=1e-9)
    load = gravity_torque(robot, samples.target_q)
    rubs = friction_torque(robot.friction, samples.target_dq, load)
    np.testing.assert_allclose(seen["target_current"] * constant, target + rubs, atol=1e-9)
    model = rigid(seen["q"], seen["dq"], samples.target_ddq)
    model += friction_torque(robot.friction, seen["dq"], load)
    np.testing.assert_allclose(seen["tau_ext"], model - seen["current"] * constant, atol=1e-9)


def test_the_controllers_estimate_is_low_passed_at_its_cutoff() -> None:
    """First order, from its first sample on: y += (1 − exp(−2π·5 Hz·8 ms)) (x − y)."""
    raw, slow = (
        circle("duration=0.4", f"sensing.vendor_cutoff={hz}").measured.signals["tau_ext"]
        for hz in (1e6, 5.0)
    )
    y, share = raw[0], 1.0 - np.exp(-2.0 * np.pi * 5.0 * 0.008)
    for x, found in zip(raw, slow, strict=True):
        y = y + share * (x - y)
        np.testing.assert_allclose(found, y, atol=1e-9)


@pytest.mark.parametrize(
    ("source", "rate"), [("current", 125.0), ("link_torque", 1000.0), ("joint_torque", 500.0)]
)
def test_a_log_has_the_rate_stated_the_robots_or_the_usual_one(source: str, rate: float) -> None:
    robot = replace(load_robot("ur5"), torque_source=source, sample_rate_hz=float("nan"))
    assert log_rate(SensingSpec(), robot) == rate
    assert log_rate(SensingSpec(), replace(robot, sample_rate_hz=320.0)) == 320.0
    assert log_rate(SensingSpec(rate=50.0), replace(robot, sample_rate_hz=320.0)) == 50.0
