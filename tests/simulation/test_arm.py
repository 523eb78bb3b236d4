"""The position controller against Pinocchio and the linear loop it makes."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import Payload, load_robot
from vftcli.robots.friction import friction_torque
from vftcli.signals.errors import ParameterError
from vftcli.simulation import load_scenario
from vftcli.simulation.arm import Servo, build_arm
from vftcli.simulation.plant import true_friction
from vftcli.simulation.scenario import MismatchSpec, ServoSpec
from vftcli.simulation.trajectories import Reference

ROBOT = load_robot("ur5")
RNG = np.random.default_rng(0)
STATES = Reference(*RNG.uniform(-0.5, 0.5, (3, 4, 6)))


def test_feed_forward_is_inverse_dynamics_and_friction_or_gravity_alone():
    data = ROBOT.model.createData()
    friction = friction_torque(ROBOT.friction, STATES.dq)
    whole, bare = (Servo(ServoSpec(feed_forward=on), ROBOT, 1e-3) for on in (True, False))
    rigid = [pin.rnea(ROBOT.model, data, *row).copy() for row in zip(*STATES, strict=True)]
    np.testing.assert_allclose(whole.feed_forward(STATES), rigid + friction, atol=1e-12)
    gravity = [pin.computeGeneralizedGravity(ROBOT.model, data, q).copy() for q in STATES.q]
    np.testing.assert_allclose(bare.feed_forward(STATES), gravity, atol=1e-12)


@pytest.mark.parametrize(("stiffness", "omega"), [("stiff", 90.0), ("soft", 28.0), (40.0, 40.0)])
def test_every_mode_has_the_loops_frequency_and_damping(stiffness, omega):
    servo = Servo(ServoSpec(stiffness=stiffness, damping=0.7, torque_limits=False), ROBOT, 1e-3)
    q, error, rate = STATES.q[0], 1e-3 * RNG.standard_normal(6), 1e-2 * RNG.standard_normal(6)
    tau = servo.torque(np.zeros(6), q + error, rate, q, np.zeros(6))
    M = pin.crba(ROBOT.model, ROBOT.model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    # computed torque: M⁻¹τ = ω² e + 2ζω ė
    expected = omega**2 * error + 2 * 0.7 * omega * rate
    np.testing.assert_allclose(np.linalg.solve(M, tau), expected, rtol=1e-9)


def test_torque_stays_inside_the_limits():
    servo = Servo(ServoSpec(), ROBOT, 1e-3)
    tau = servo.torque(np.zeros(6), np.full(6, 3.0), np.zeros(6), np.zeros(6), np.zeros(6))
    assert np.all(np.abs(tau) <= ROBOT.limits.tau_max)
    assert np.any(np.abs(tau) == ROBOT.limits.tau_max)
    free = Servo(ServoSpec(torque_limits=False), ROBOT, 1e-3)
    assert np.all(np.isinf(free.limit))


# The arm that is drawn: how far it lies from its profile, and what leaves it alone


def arm(*settings):
    return build_arm(load_scenario("ur5-circle", settings), ROBOT, np.random.default_rng(1))


SIZES = {"mass": 0.05, "com": 0.004, "rotor_inertia": 0.1, "friction": 0.2}
SIZES |= {"torque_constant": 0.03, "torque_offset": 0.5, "payload": 0.06}
MORE = [
    "payload={mass=2.0, com=[0.01, 0.02, 0.03], inertia=[0.01, 0.02, 0.03]}",
    "force_sensor={mass=0.35, com=[0.0, 0.01, 0.03]}",
]


SENSOR = Payload(mass=0.35, com=np.array([0.0, 0.01, 0.03]), inertia=np.zeros((3, 3)))


def load(scale):
    """The payload of `MORE`, scaled."""
    tensor = scale * np.diag([0.01, 0.02, 0.03])
    return Payload(mass=2.0 * scale, com=np.array([0.01, 0.02, 0.03]), inertia=tensor)


@pytest.mark.parametrize("off", [None, "all", *SIZES])
def test_an_arm_is_its_profile_with_what_the_seed_draws(off):
    """The draws of NumPy's generator, one after another, whatever their sizes are."""
    sizes = {name: 0.0 if off in {name, "all"} else size for name, size in SIZES.items()}
    assert sizes.keys() == MismatchSpec.__dataclass_fields__.keys()
    drawn = arm(*MORE, *(f"mismatch.{name}={size}" for name, size in sizes.items()))
    rng = np.random.default_rng(1)

    def draw(name, *shape):
        return sizes[name] * np.clip(rng.standard_normal(shape), -2.0, 2.0)

    mass, com, rotor = 1.0 + draw("mass", 6), draw("com", 6, 3), 1.0 + draw("rotor_inertia", 6)
    dry, wet = 1.0 + draw("friction", 6), 1.0 + draw("friction", 6)
    gain, offset = 1.0 + draw("torque_constant", 6), draw("torque_offset", 6)
    scale = 1.0 + draw("payload", 1)[0]
    links = replace(
        ROBOT.chain,
        mass=ROBOT.chain.mass * mass,
        com=ROBOT.chain.com + com,
        inertia=ROBOT.chain.inertia * mass[:, None, None],
        rotor_inertia=ROBOT.chain.rotor_inertia * rotor,
    )
    same(drawn.chain, links.with_payload(load(scale)).with_payload(SENSOR))
    same(drawn.nominal.chain, ROBOT.chain)
    own = true_friction(ROBOT, load_scenario("ur5-circle").friction)
    for name, factor in (("coulomb", dry), ("presliding", dry), ("bend_slopes", wet)):
        moved, profile = getattr(drawn.friction, name), getattr(own, name)
        np.testing.assert_allclose(moved, profile * factor, rtol=1e-12)
        assert profile.any()
    np.testing.assert_allclose(drawn.gain, gain)
    np.testing.assert_allclose(drawn.offset, offset)


def same(chain, other):
    for name in ("mass", "com", "inertia", "rotor_inertia"):
        np.testing.assert_allclose(
            getattr(chain, name), getattr(other, name), rtol=1e-12, atol=1e-15, err_msg=name
        )


def test_a_controller_knows_payload_and_sensor_if_it_is_told_to():
    """Their stated masses, not the drawn one."""
    drawn = arm(*MORE, "payload.known=true", "force_sensor.known=true", "mismatch.payload=0.4")
    same(drawn.nominal.chain, ROBOT.chain.with_payload(load(1.0)).with_payload(SENSOR))
    assert drawn.nominal.payload is None


@pytest.mark.parametrize("name", SIZES)
def test_sizes_beyond_what_leaves_all_positive_are_refused(name):
    most = {"com": 1.0, "torque_offset": 1e4}.get(name, 0.45)
    arm(f"mismatch.{name}={most}")
    for size in (-0.1, 1.01 * most):
        words = f"mismatch.{name} is {size:g}; it is within 0 to {most:g}"
        with pytest.raises(ParameterError, match=re.escape(words)):
            arm(f"mismatch.{name}={size}")
