"""A planted coupling comes back, and none is claimed where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.evaluation import rmse
from vftcli.identification import Task, identify
from vftcli.identification.coupling import Coupling, couplings, with_couplings
from vftcli.identification.processing import Processing, with_transmission
from vftcli.identification.training import prepare_training
from vftcli.observers import MomentumObserver
from vftcli.robots import load_robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.regressor import chain_parameters, torque_regressor
from vftcli.robots.terms import dynamics_terms
from vftcli.robots.transmission import at_motors, joint_torque, motor_torque
from vftcli.signals.errors import IdentificationError
from vftcli.signals.recording import Recording

UR5 = load_robot("ur5")


@pytest.fixture
def made(rubbing_arm, sines):
    """Logs of a rubbing UR5 whose motor 6 turns with joint 5, links 10 % off, noise .1 N·m."""

    def log(coupling, currents=True, seed=2):
        T = np.eye(6)
        T[5, 4] = coupling
        share = 1.0 + 0.1 * np.array([1, -1, 1, -1, 1, -1])
        chain = replace(rubbing_arm.chain, mass=rubbing_arm.chain.mass * share)
        t, q, dq, ddq = sines(seconds=12.0, seed=seed)
        torque = motor_torque(T, torque_regressor(chain, q, dq, ddq) @ chain_parameters(chain))
        torque = torque + chain.rotor_inertia * at_motors(T, ddq)
        torque = torque + friction_torque(rubbing_arm.friction, at_motors(T, dq))
        torque = torque + 0.1 * np.random.default_rng(seed).standard_normal(q.shape)
        if currents:
            return Recording(t=t, q=q, dq=dq, current=torque / UR5.torque_constant)
        return Recording(t=t, q=q, dq=dq, torque=joint_torque(T, torque))

    return log


def training(log, robot=UR5, rubs=True):
    return prepare_training([log], robot, Processing(), False, rubs)


@pytest.mark.slow
@pytest.mark.parametrize(("coupling", "currents"), [(1.0, True), (-0.3, False)])
def test_a_planted_coupling_is_found_within_2_per_cent(made, coupling, currents):
    found = identify([made(coupling, currents)], UR5, Task(), [made(coupling, currents, seed=5)])
    T = found.robot.chain.transmission
    assert T is not None
    # the figure required
    assert T[5, 4] == pytest.approx(coupling, rel=0.02)
    np.testing.assert_array_equal(np.delete(T - np.eye(6), 5, axis=0), 0.0)
    assert "coupled-joint" in [remark.code for remark in found.remarks]
    train, test = (trace.rms for trace in found.traces)
    # as good as the uncoupled J4: its links' error, the noise of .1 N·m in 8 Hz of 62.5 otherwise
    assert np.all(train[4:] <= train[3])
    assert np.all(test[4:] <= test[3])
    log = made(coupling, currents, seed=5)
    left = MomentumObserver(gain=UR5.gains["gmo"]["gain"]).estimate(
        dynamics_terms(log, found.robot)
    )
    errors = rmse(left.tau, 0.0 * left.tau)
    assert np.all(errors[4:] <= errors[3])


@pytest.mark.slow
def test_nothing_is_claimed_of_an_uncoupled_arm(made):
    data, remarks = with_couplings(training(made(0.0)))
    assert data.robot.chain.transmission is None
    assert remarks == []


def test_what_the_file_says_is_kept(made):
    T = np.eye(6)
    T[5, 4] = 0.7
    given = training(made(1.0), with_transmission(UR5, T))
    assert with_couplings(given) == (given, [])


def test_without_friction_nothing_tells_a_coupling(made):
    given = training(made(1.0), rubs=False)
    assert with_couplings(given) == (given, [])


@pytest.mark.slow
def test_targets_of_coupled_joints_are_refused(made):
    """Nobody knows whose they are: taken for the joints', motor 6 would show in joint 6 alone."""
    T = np.eye(6)
    T[5, 4] = 1.0
    log = made(1.0)
    asked = log.current * UR5.torque_constant
    log = replace(log, target_current=log.current, target_torque=asked)
    robot = with_transmission(UR5, T)
    with pytest.raises(IdentificationError, match=r"driven through each other .*--method friction"):
        identify([log], robot, Task(method="targets"))
    found = identify([log], robot, Task(method="friction")).robot.chain.transmission
    np.testing.assert_array_equal(found, T)


@pytest.mark.parametrize(
    ("value", "sd", "left", "rubs", "demanded"),
    [
        (1.0, 0.01, 0.3, True, True),
        (1.0, 0.03, 0.3, True, False),
        (1.0, 0.01, 0.75, True, False),
        (0.09, 0.0001, 0.3, True, False),
        (1.0, 0.01, 0.3, False, False),
    ],
)
def test_what_the_regression_demands(value, sd, left, rubs, demanded):
    assert Coupling(5, 4, value, sd, left, rubs).is_demanded is demanded


@pytest.mark.slow
@pytest.mark.parametrize("name", ["free_5", "free_6"])
def test_links_that_are_another_arms_feign_none(logs, name):
    """A simulated arm without any friction: what its logs hint at opposes no motion."""
    from vftcli.readers import read

    path = logs / "bullet_ur5" / f"{name}.csv.gz"
    log = read(path, columns="t=t,q=q{i},dq=dq{i},-tau=tau{i}")
    assert not any(found.is_demanded for found in couplings(training(log), np.eye(6)))
