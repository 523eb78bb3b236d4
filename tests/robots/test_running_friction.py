"""Friction along a log: presliding in stretches, beside every model, and in the terms."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from vftcli.robots import JointFriction, load_robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.kernels import CHUNK, momentum_terms
from vftcli.robots.running_friction import RunningFriction, play
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.recording import Recording

A, LENGTH = 2.5, 3e-4
GIVING = {"presliding": A, "presliding_length": LENGTH}
PLAIN = {"coulomb": 2.0, "viscous": 1.0}


def wandering(samples: int, joints: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Angles that turn back every few samples by about the presliding length. [rad, rad/s]"""
    rng = np.random.default_rng(seed)
    q = np.cumsum(2e-4 * rng.standard_normal((samples, joints)), axis=0)
    return q, np.gradient(q, 0.008, axis=0)


def test_a_joint_that_turns_back_gives_before_it_slides() -> None:
    """Worked by hand: 2 s₀ away from a turn the full torque holds the other way."""
    values = {"coulomb": 0.0, "viscous": 0.0, **GIVING}
    friction = RunningFriction((JointFriction(model="coulomb-viscous", parameters=values),))
    q = LENGTH * np.array([0.0, 0.5, 1.0, 3.0, 2.5, 1.0, 1.0, 0.0])[:, None]
    torque = friction.torque(q, np.zeros_like(q))
    expected = A * np.array([0.0, 0.5, 1.0, 1.0, 0.5, -1.0, -1.0, -1.0])
    # quotients of differences of angles: rounding
    np.testing.assert_allclose(torque[:, 0], expected, atol=1e-12)


@pytest.mark.parametrize("cuts", [(1, 2, 3), (31, 32, 33, 64), (500,)])
def test_stretches_give_the_whole_to_the_last_bit(cuts: tuple[int, ...]) -> None:
    q, dq = wandering(1000, 3)
    one = JointFriction(model="coulomb-viscous", parameters={**PLAIN, **GIVING})
    other = replace(one, parameters={**PLAIN, **GIVING, "presliding_length": 1e-3})
    friction = (one, JointFriction(model="coulomb-viscous", parameters=PLAIN), other)
    whole = RunningFriction(friction).torque(q, dq)
    running = RunningFriction(friction)
    edges = (0, *cuts, len(q))
    parts = [running.torque(q[a:b], dq[a:b]) for a, b in pairwise(edges)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_joints_without_it_are_left_alone() -> None:
    q, dq = wandering(200, 2)
    friction = (
        JointFriction(model="coulomb-viscous", parameters={**PLAIN, **GIVING}),
        JointFriction(model="coulomb-viscous", parameters=PLAIN),
    )
    torque = RunningFriction(friction).torque(q, dq)
    steady = friction_torque(friction, dq)
    np.testing.assert_array_equal(torque[:, 1], steady[:, 1])
    state = play(q[:, :1], LENGTH).state
    np.testing.assert_array_equal(torque[:, :1], steady[:, :1] + A * state)


@pytest.mark.parametrize(
    "joint",
    [
        JointFriction(model="coulomb-viscous", parameters=PLAIN),
        JointFriction(
            model="coulomb-logarithmic",
            parameters={"coulomb": 2.0, "logarithmic": 3.0, "logarithmic_velocity": 1.2},
        ),
        JointFriction(model="sigmoid", parameters={"amplitude": 1.0, "slope": 9.0, "shift": 0.1}),
        JointFriction(model="points", speeds=(0.01, 0.5), torques=(2.0, 3.0)),
    ],
)
def test_it_stands_beside_every_model(joint: JointFriction) -> None:
    q, dq = wandering(300, 1)
    giving = replace(joint, parameters={**joint.parameters, **GIVING})
    more = RunningFriction((giving,)).torque(q, dq) - friction_torque((joint,), dq)
    # a sum and its difference: rounding
    np.testing.assert_allclose(more, A * play(q, LENGTH).state, atol=1e-13)


def test_the_terms_carry_the_centre_from_chunk_to_chunk() -> None:
    """More than two chunks, each joint with its own length, against the operator in one piece."""
    robot = load_robot("ur5").without_friction()
    q, dq = wandering(2 * CHUNK + 100, 6)
    recording = Recording(t=0.008 * np.arange(len(q)), q=q, dq=dq, current=np.zeros_like(q))
    lengths = 1e-4 * np.arange(1.0, 7.0)
    friction = tuple(
        JointFriction(
            model="coulomb-viscous",
            parameters={**PLAIN, "presliding": A, "presliding_length": length},
        )
        for length in lengths
    )
    rough = dynamics_terms(recording, replace(robot, friction=friction))
    smooth = dynamics_terms(recording, robot)
    load = momentum_terms(robot.loaded_chain, q, dq).gravity
    expected = friction_torque(friction, dq, load, deflection=play(q, lengths).state)
    # differences of torques of 10²: rounding
    np.testing.assert_allclose(smooth.mu - rough.mu, expected, atol=1e-12)
    assert np.ptp(play(q[CHUNK:], lengths).state[:20] - play(q, lengths).state[CHUNK:][:20]) > 0.1


def test_without_presliding_nothing_is_remembered() -> None:
    running = RunningFriction((JointFriction(model="coulomb-viscous", parameters=PLAIN),))
    assert running.deflection(np.zeros((5, 1))) is None
    assert running.centre is None


def looped(q, length, centre=None):
    """The operator as it is written: one sample after another."""
    centre = q[0] if centre is None else centre
    states = []
    for row in q:
        centre = np.clip(centre, row - length, row + length)
        states.append((row - centre) / length)
    return np.array(states), centre


@pytest.mark.parametrize("samples", [1, 2, 31, 32, 33, 1024, 1025, 5000])
def test_blocks_are_the_loop(samples):
    rng = np.random.default_rng(7)
    q = np.cumsum(rng.normal(scale=2e-4, size=(samples, 6)), axis=0)
    length = np.array([1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-4])
    state, centre = looped(q, length)
    found = play(q, length)
    # Only comparisons and one division are made, in both: no rounding can differ.
    np.testing.assert_array_equal(found.state, np.clip(state, -1.0, 1.0))
    np.testing.assert_array_equal(found.centre, centre)


@pytest.mark.parametrize("cut", [1, 17, 32, 900])
def test_stretches_carry_their_centre(cut):
    rng = np.random.default_rng(8)
    q = np.cumsum(rng.normal(scale=2e-4, size=(1000, 3)), axis=0)
    whole, first = play(q, 3e-4), play(q[:cut], 3e-4)
    second = play(q[cut:], 3e-4, first.centre)
    np.testing.assert_array_equal(np.concatenate([first.state, second.state]), whole.state)
    np.testing.assert_array_equal(second.centre, whole.centre)


def test_it_is_the_sign_of_a_long_motion_and_holds_at_rest():
    # Forward by 10 s₀, rest, back by s₀ (half of the way through the play), back by 9 s₀.
    s0 = 3e-4
    q = s0 * np.array([0.0, 5.0, 10.0, 10.0, 10.0, 9.0, 0.0])[:, None]
    state = play(q, s0).state[:, 0]
    # The angles are multiples of s₀ with rounding errors of some 1e-19 rad: 1e-15 of s₀.
    np.testing.assert_allclose(state, [0.0, 1.0, 1.0, 1.0, 1.0, 0.0, -1.0], atol=1e-12)


def test_an_empty_log_has_no_state():
    found = play(np.zeros((0, 2)), 3e-4)
    assert found.state.shape == (0, 2)
