"""Friction by joint temperature against the table of joint sizes."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.robots import JointFriction, load_robot
from vftcli.robots.friction import friction_factor, friction_torque, lawless, warmth
from vftcli.robots.running_friction import measured_temperature
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.recording import Recording

# p1 to p4 of the controller's configuration by joint size, and s(28), s(45) relative to 35 °C.
LAWS = {
    "1": ((0.402, -0.09083, 0.9553, -0.01831), 1.161, 0.819),
    "2": ((0.00062, -0.37098, 0.90936, -0.01168), 1.085, 0.890),
    "3 e": ((3.637679, -0.011074, 1.362321, -0.085741), 1.100, 0.883),
    "3 CB3": ((1.858278, -0.017289, 4.273737, -0.231437), 1.134, 0.840),
    "4 e": ((2.0864784, -0.0067425, 1.1497692, -0.0534681), 1.088, 0.901),
    "4 CB3": ((1.584479, -0.075955, 5.968238, -0.015598), 1.134, 0.844),
}


@pytest.mark.parametrize("size", LAWS)
def test_the_law_by_joint_size(size: str) -> None:
    law, cold, hot = LAWS[size]
    share = warmth(law, np.array([28.0, 45.0])) / warmth(law, 35.0)
    # the table has three decimals
    np.testing.assert_allclose(share, [cold, hot], atol=6e-4)
    assert np.all(np.diff(warmth(law, np.linspace(1.0, 100.0, 500))) < 0.0)
    assert lawless(law) == ""


def warm_joint(**others: float) -> JointFriction:
    law = LAWS["1"][0]
    values = {"coulomb": 2.0, "viscous": 1.0, **others}
    return JointFriction(
        model="coulomb-viscous-offset", parameters=values, temperature=law, temperature_at=35.0
    )


def test_all_but_the_offset_follows_it() -> None:
    joint = warm_joint(offset=0.5, presliding=1.0, presliding_length=1e-3)
    dq, state = np.array([[0.5], [-0.5]]), np.array([[1.0], [-1.0]])
    torque = friction_torque((joint,), dq, deflection=state, temperature=np.full((2, 1), 28.0))
    # 1.161 by the table, to its last digit; tanh(50) is 1 to rounding
    np.testing.assert_allclose(torque[:, 0], [0.5 + 1.161 * 3.5, 0.5 - 1.161 * 3.5], atol=2e-3)


def test_without_a_temperature_it_is_that_of_the_reference() -> None:
    dq = np.linspace(-1.0, 1.0, 7)[:, None]
    plain = friction_torque((warm_joint(),), dq)
    for T in (np.full_like(dq, np.nan), np.full_like(dq, 35.0)):
        # one product with 1
        np.testing.assert_array_equal(friction_torque((warm_joint(),), dq, temperature=T), plain)


def test_a_joint_without_a_law_keeps_its_friction() -> None:
    lawless_joint = replace(warm_joint(), temperature=())
    T = np.full((3, 2), 20.0)
    factor = friction_factor((warm_joint(), lawless_joint), T)
    assert factor is not None
    assert np.all(factor[:, 0] > 1.2)
    np.testing.assert_array_equal(factor[:, 1], 1.0)
    assert friction_factor((lawless_joint,), T[:, :1]) is None


def recording_with(temperature: np.ndarray | None) -> Recording:
    rng = np.random.default_rng(1)
    q, dq, current = rng.uniform(-1, 1, (3, 10, 6))
    t = 0.008 * np.arange(10)
    return Recording(t=t, q=q, dq=dq, current=current, temperature=temperature)


def test_zeros_are_no_temperatures() -> None:
    assert measured_temperature(recording_with(None)) is None
    assert measured_temperature(recording_with(np.zeros((10, 6)))) is None
    partly = np.full((10, 6), 30.0)
    partly[3, 2], partly[4, 1] = 0.0, 3000.0
    found = measured_temperature(recording_with(partly))
    assert found is not None
    assert np.argwhere(np.isnan(found)).tolist() == [[3, 2], [4, 1]]


def test_the_terms_follow_the_log() -> None:
    robot = load_robot("ur5").without_friction()
    friction = (warm_joint(),) * 6
    T = np.linspace(25.0, 40.0, 60).reshape(10, 6)
    recording = recording_with(T)
    dq = recording.require("dq")
    rough = dynamics_terms(recording, replace(robot, friction=friction))
    factor = warmth(LAWS["1"][0], T) / warmth(LAWS["1"][0], 35.0)
    expected = factor * (2.0 * np.tanh(dq / 0.01) + dq)
    # differences of torques of 10²: rounding
    smooth = dynamics_terms(recording, robot)
    np.testing.assert_allclose(smooth.mu - rough.mu, expected, atol=1e-12)


@pytest.mark.parametrize(
    "law", [(0.0, 0.0, 0.0, 0.0), (-1.0, -0.01, 0.5, -0.01), (1.0, 10.0, 0.0, 0.0), (1e3,) * 4]
)
def test_a_law_that_is_none_is_reported(law: tuple[float, ...]) -> None:
    assert "temperature makes friction" in lawless(law)


def test_no_law_is_no_wrong_one() -> None:
    assert lawless(()) == ""
