"""The arm that is drawn: how far it lies from its profile, and what leaves it alone."""

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.signals.errors import ParameterError
from vftcli.simulation import load_scenario
from vftcli.simulation.arm import build_arm, deviate
from vftcli.simulation.scenario import MismatchSpec

UR5 = load_robot("ur5")


def arm(*settings, seed=1, robot=UR5):
    """The arm of a UR5 scenario with these settings."""
    scenario = load_scenario("ur5-circle", settings)
    return build_arm(scenario, robot, np.random.default_rng(seed))


def test_deviates_are_normal_and_cut_at_two():
    draw = deviate(np.random.default_rng(0), 0.1, (20000,))
    assert np.max(np.abs(draw)) == pytest.approx(0.2)
    # cutting at 2σ takes σ to 0.96 of itself; 20000 draws tell 0.5 % of it
    assert np.std(draw) == pytest.approx(0.096, rel=0.02)
    assert np.mean(draw) == pytest.approx(0.0, abs=0.002)


NOTHING = tuple(f"mismatch.{name}=0" for name in MismatchSpec.__dataclass_fields__)


def test_each_size_moves_its_own_parameters():
    exact = arm(*NOTHING)
    np.testing.assert_array_equal(exact.chain.mass, UR5.chain.mass)
    np.testing.assert_array_equal(exact.gain, 1.0)
    heavy = arm(*NOTHING, "mismatch.mass=0.05")
    ratio = heavy.chain.mass / UR5.chain.mass
    assert np.all((ratio != 1.0) & (np.abs(ratio - 1.0) <= 0.1))
    np.testing.assert_allclose(heavy.chain.inertia, UR5.chain.inertia * ratio[:, None, None])
    np.testing.assert_array_equal(heavy.chain.com, UR5.chain.com)
    np.testing.assert_array_equal(heavy.chain.rotor_inertia, UR5.chain.rotor_inertia)
    moved = arm(*NOTHING, "mismatch.com=0.01")
    assert np.max(np.abs(moved.chain.com - UR5.chain.com)) <= 0.02
    np.testing.assert_array_equal(moved.chain.mass, UR5.chain.mass)


def test_dry_and_viscous_friction_err_apart():
    friction = arm(*NOTHING).friction
    other = arm(*NOTHING, "mismatch.friction=0.1").friction
    dry = other.coulomb / friction.coulomb
    for wet in other.bend_slopes / friction.bend_slopes:
        assert np.all(np.abs(dry - wet) > 1e-6)
    np.testing.assert_array_equal(other.offset, friction.offset)


@pytest.mark.parametrize("known", [False, True])
def test_a_payload_is_on_the_arm_and_in_the_controller_if_it_knows(known):
    scenario = load_scenario("payload-pair", [f"payload.known={str(known).lower()}", *NOTHING])
    drawn = build_arm(scenario, UR5, np.random.default_rng(1))
    mass = scenario.payload.mass
    assert drawn.chain.mass[-1] == pytest.approx(UR5.chain.mass[-1] + mass)
    assert drawn.nominal.chain.mass[-1] == pytest.approx(UR5.chain.mass[-1] + known * mass)
    assert drawn.nominal.payload is None


def test_negative_sizes_are_refused():
    with pytest.raises(ParameterError, match=r"mismatch\.com is -0\.1"):
        arm("mismatch.com=-0.1")
