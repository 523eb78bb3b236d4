"""DynamicsTerms: μ as (33) defines it, and what is said when a signal is missing."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import Payload, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.terms import RunningTerms, drive_torque, dynamics_terms, effort_name
from vftcli.signals.errors import MissingSignalError, RobotError
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.recording import Recording
from vftcli.signals.series import clock_of


def motion(joints: int, samples: int = 400, rate: float = 500.0) -> tuple[np.ndarray, ...]:
    t = np.arange(samples) / rate
    phase = np.linspace(0.0, 2.0, joints)
    angle = 2.0 * np.pi * 0.5 * t[:, None] + phase
    w = np.pi
    return t, 0.5 * np.sin(angle), 0.5 * w * np.cos(angle), -0.5 * w**2 * np.sin(angle)


def test_mu_integrates_to_the_momentum_of_free_motion() -> None:
    """On torque made by Pinocchio's inverse dynamics, ṗ = μ: nothing is left to explain."""
    robot = load_robot("ur5").without_friction()
    t, q, dq, ddq = motion(6)
    data = robot.model.createData()
    tau = np.array([pin.rnea(robot.model, data, *x) for x in zip(q, dq, ddq, strict=True)])
    terms = dynamics_terms(Recording(t=t, q=q, dq=dq, torque=tau), robot)
    step = t[1] - t[0]
    change = np.diff(terms.p, axis=0) - 0.5 * step * (terms.mu[1:] + terms.mu[:-1])
    # trapezoidal rule: Ts³/12 of p''' per step, p''' below 2e3 N·m/s² on this motion
    np.testing.assert_allclose(change, 0.0, atol=step**3 / 12 * 2e3)


def test_current_becomes_torque_through_the_drive_constant() -> None:
    robot = load_robot("ur5")
    t, q, dq, _ = motion(6)
    current = np.ones_like(q)
    torque = drive_torque(Recording(t=t, q=q, dq=dq, current=current), robot)
    np.testing.assert_array_equal(torque[0], [12.625, 12.625, 12.625, 9.3122, 9.3122, 9.3122])


def test_a_link_torque_robot_prefers_torque_and_a_current_robot_current() -> None:
    t, q, dq, _ = motion(6)
    both = Recording(t=t, q=q, dq=dq, current=np.ones_like(q), torque=np.full_like(q, 7.0))
    assert drive_torque(both, load_robot("ur5"))[0, 0] == 12.625
    t, q, dq, _ = motion(7)
    both = Recording(t=t, q=q, dq=dq, current=np.ones_like(q), torque=np.full_like(q, 7.0))
    assert drive_torque(both, load_robot("panda"))[0, 0] == 7.0


def test_friction_is_taken_off_and_literal_dynamics_agree() -> None:
    robot = load_robot("panda")
    t, q, dq, _ = motion(7)
    recording = Recording(t=t, q=q, dq=dq, torque=np.zeros_like(q))
    rough, smooth = (
        dynamics_terms(recording, robot),
        dynamics_terms(recording, robot.without_friction()),
    )
    from vftcli.robots.friction import friction_torque

    np.testing.assert_allclose(
        smooth.mu - rough.mu, friction_torque(robot.friction, dq), atol=1e-12
    )
    literal = dynamics_terms(recording, robot, literal=True)
    np.testing.assert_allclose(literal.mu, rough.mu, atol=5e-6)  # the literal method's own step


@pytest.mark.parametrize(
    ("missing", "words"),
    [("dq", "no joint velocities"), ("current", "no motor currents")],
)
def test_a_missing_signal_is_named(missing: str, words: str) -> None:
    t, q, dq, _ = motion(6)
    signals = {"dq": dq, "current": np.ones_like(q)}
    del signals[missing]
    with pytest.raises(MissingSignalError, match=words):
        dynamics_terms(Recording(t=t, q=q, **signals), load_robot("ur5"))


def test_another_number_of_joints_is_refused() -> None:
    t, q, dq, _ = motion(7)
    recording = Recording(t=t, q=q, dq=dq, torque=q)
    with pytest.raises(RobotError, match="7 joints but robot 'ur5' has 6"):
        dynamics_terms(recording, load_robot("ur5"))


def test_current_for_a_robot_without_drive_constants_is_refused() -> None:
    t, q, dq, _ = motion(7)
    recording = Recording(t=t, q=q, dq=dq, current=q)
    with pytest.raises(MissingSignalError, match="no torque_constant"):
        dynamics_terms(recording, load_robot("panda"))


@pytest.mark.slow
@pytest.mark.parametrize("size", [1, 150, 399])
def test_blocks_of_a_log_have_the_whole_log_s_terms(size: int) -> None:
    """To the last bit, friction that remembers the motion included."""
    robot = load_robot("ur5")
    slips = {**robot.friction[0].parameters, "presliding": 2.0, "presliding_length": 0.05}
    friction = (replace(robot.friction[0], parameters=slips), *robot.friction[1:])
    robot = replace(robot, friction=friction)
    t, q, dq, _ = motion(6)
    t = t + 1e-4 * np.random.default_rng(1).uniform(-1, 1, len(t))
    log = Recording(t=t, q=q, dq=dq, current=np.cos(q))
    whole = dynamics_terms(log, robot)
    running = RunningTerms(robot, clock_of(t))
    for first in range(0, len(t), size):
        span = slice(first, first + size)
        block = running.next(Recording(t=t[span], q=q[span], dq=dq[span], current=np.cos(q[span])))
        for name in ("p", "mu", "d", "dt"):
            np.testing.assert_array_equal(getattr(block, name), getattr(whole, name)[span])


def test_the_unexplained_change_of_momentum_is_the_trapezoid() -> None:
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.uniform(0.5, 1.5, 50))
    p, mu = rng.normal(size=(50, 3)), rng.normal(size=(50, 3))
    terms = DynamicsTerms(t=t, p=p, mu=mu)
    expected = np.diff(p, axis=0) - 0.5 * np.diff(t)[:, None] * (mu[1:] + mu[:-1])
    np.testing.assert_allclose(terms.d[1:], expected, atol=1e-14)  # rounding of a few
    np.testing.assert_array_equal(terms.d[0], 0.0)
    np.testing.assert_array_equal(replace(terms, mu=0 * mu).d[1:], np.diff(p, axis=0))


T = np.arange(3.0)
Q = np.linspace(0.2, 1.3, 18).reshape(3, 6)
EFFORT = np.linspace(-4.0, 5.0, 18).reshape(3, 6)
UR5E, FR3 = load_robot("ur5e"), load_robot("fr3")


def test_torque_without_gravity_gets_that_of_the_arm_and_its_payload() -> None:
    load = Payload(mass=2.0, com=np.array([0.0, 0.0, 0.1]), inertia=np.zeros((3, 3)))
    arm = UR5E.with_payload(load)
    log = Recording(t=T, q=Q, torque_without_gravity=EFFORT)
    held = momentum_terms(arm.loaded_chain, Q, np.zeros_like(Q)).gravity
    assert effort_name(log, arm) == "torque_without_gravity"
    assert drive_torque(log, arm) == pytest.approx(EFFORT + held, abs=1e-12)  # rounding
    assert np.abs(drive_torque(log, arm) - drive_torque(log, UR5E)).max() > 2.0  # 2 kg on an arm


@pytest.mark.parametrize(
    ("signals", "of_ur", "of_franka"),
    [
        (("current", "torque", "torque_without_gravity"), "current", "torque"),
        (("torque", "torque_without_gravity"), "torque", "torque"),
        (("current", "torque_without_gravity"), "current", "torque_without_gravity"),
        (("current",), "current", "current"),
    ],
)
def test_an_arm_takes_what_its_makers_logs_hold(
    signals: tuple[str, ...], of_ur: str, of_franka: str
) -> None:
    """UR measures currents, Franka torques; what is not there is made up for by the other."""
    log = Recording(t=T, q=Q, **dict.fromkeys(signals, EFFORT))  # type: ignore[arg-type]
    assert effort_name(log, UR5E) == of_ur
    assert effort_name(log, FR3) == of_franka


def test_without_any_effort_a_signal_is_asked_for() -> None:
    with pytest.raises(MissingSignalError, match="no motor currents"):
        drive_torque(Recording(t=T, q=Q), UR5E)
