"""Friction along a log: presliding in stretches, temperatures, and both in the terms."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.robots import JointFriction, load_robot
from vftcli.robots.friction import RunningFriction, friction_torque, measured_temperature, play
from vftcli.robots.kernels import CHUNK, momentum_terms
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.recording import Recording


def wandering(samples: int, joints: int) -> np.ndarray:
    """Angles that turn back every few samples by about the presliding length. [rad]"""
    rng = np.random.default_rng(3)
    return np.cumsum(2e-4 * rng.standard_normal((samples, joints)), axis=0)


def test_a_joint_that_turns_back_gives_before_it_slides() -> None:
    """Worked by hand: 2 s₀ away from a turn the full torque holds the other way.

    It is the sign of a long motion, and holds at rest; the joint beside has none.
    """
    values = {"coulomb": 0.0, "viscous": 0.0, "presliding": 2.5, "presliding_length": 3e-4}
    giving = JointFriction(model="coulomb-viscous", parameters=values)
    friction = RunningFriction((giving, JointFriction()))
    q = 3e-4 * np.array([0.0, 0.5, 1.0, 3.0, 2.5, 1.0, 1.0, 0.0])[:, None].repeat(2, axis=1)
    torque = friction.torque(q, np.zeros_like(q))
    expected = 2.5 * np.array([0.0, 0.5, 1.0, 1.0, 0.5, -1.0, -1.0, -1.0])
    # quotients of differences of angles: rounding
    np.testing.assert_allclose(torque[:, 0], expected, atol=1e-12)
    assert not torque[:, 1].any()
    assert play(np.zeros((0, 2)), 3e-4).state.shape == (0, 2)


def test_the_terms_take_off_friction_by_load_temperature_and_what_was_before() -> None:
    """More than two chunks, each joint with its own length; by the paper's method too."""
    robot = load_robot("ur5")
    q = wandering(2 * CHUNK + 100, 6)
    dq, T = np.gradient(q, 0.008, axis=0), np.linspace(25.0, 40.0, q.size).reshape(q.shape)
    t = 0.008 * np.arange(len(q))
    log = Recording(t=t, q=q, dq=dq, current=np.zeros_like(q), temperature=T)
    values = {"coulomb": 2.0, "viscous": 1.0, "load_coulomb": 0.1, "presliding": 2.5}
    lengths = 1e-4 * np.arange(1.0, 7.0)
    friction = tuple(
        JointFriction(
            model="coulomb-viscous-load",
            parameters={**values, "presliding_length": length},
            temperature=(0.402, -0.09083, 0.9553, -0.01831),
            temperature_at=35.0,
        )
        for length in lengths
    )
    rough = replace(robot, friction=friction)
    load = momentum_terms(robot.loaded_chain, q, dq).gravity
    state = play(q, lengths).state
    expected = friction_torque(friction, dq, load, deflection=state, temperature=T)
    smooth = dynamics_terms(log, robot.without_friction()).mu
    # differences of torques of 10²: rounding
    found = dynamics_terms(log, rough).mu
    np.testing.assert_allclose(smooth - found, expected, atol=1e-12)
    assert np.ptp(play(q[CHUNK:], lengths).state[:20] - state[CHUNK:][:20]) > 0.1
    few = slice(0, 200)
    part = Recording(t=t[few], q=q[few], dq=dq[few], current=0 * q[few], temperature=T[few])
    # the paper's numeric method is good to 5e-6 N·m
    literal = dynamics_terms(part, rough, literal=True).mu
    np.testing.assert_allclose(literal, found[few], atol=5e-6)


def looped(q, length):
    """The operator as it is written: one sample after another."""
    centre, states = q[0], []
    for row in q:
        centre = np.clip(centre, row - length, row + length)
        states.append((row - centre) / length)
    return np.clip(states, -1.0, 1.0), centre


@pytest.mark.parametrize("samples", [1, 2, 31, 32, 33, 1024, 1025, 5000])
def test_blocks_and_stretches_are_the_loop(samples):
    q, length = wandering(samples, 6), np.array([1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-4])
    state, centre = looped(q, length)
    for cut in {0, 17, 32, 900} & {*range(samples)}:
        first = play(q[:cut], length, q[0])
        second = play(q[cut:], length, first.centre)
        # Only comparisons and one division are made, in both: no rounding can differ.
        np.testing.assert_array_equal(np.concatenate([first.state, second.state]), state)
        np.testing.assert_array_equal(second.centre, centre)


def test_zeros_are_no_temperatures() -> None:
    still = np.zeros((10, 6))
    partly = np.full((10, 6), 30.0)
    partly[3, 2], partly[4, 1] = 0.0, 3000.0
    plain, cold, log = (
        Recording(t=np.arange(10.0), q=still, temperature=T) for T in (None, still, partly)
    )
    assert measured_temperature(plain) is None
    assert measured_temperature(cold) is None
    found = measured_temperature(log)
    assert found is not None
    assert np.argwhere(np.isnan(found)).tolist() == [[3, 2], [4, 1]]
