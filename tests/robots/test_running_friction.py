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
