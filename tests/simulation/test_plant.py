"""The plant against inverse dynamics, energy, its own refinement, and another engine."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import JointFriction, Robot, load_robot
from vftcli.robots.friction import friction_torque
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.plant import (
    Plant,
    TrueFriction,
    bounded_step,
    slide_or_stick,
    true_friction,
)
from vftcli.simulation.scenario import FrictionSpec


def frictionless(robot: Robot) -> TrueFriction:
    return true_friction(robot, FrictionSpec(enabled=False))


def driven(robot: Robot, step: float, seconds: float) -> tuple[Array, Array, Array, float]:
    """Drive an arm by smooth torques about gravity.

    Returns positions, velocities, torques, and by how much energy is not the work done.
    """
    n = robot.joints
    q = np.linspace(-0.8, 0.9, n)
    plant = Plant(robot.model, frictionless(robot), q, np.full(n, 0.3), step)
    data = robot.model.createData()
    hold = pin.rnea(robot.model, data, q, np.zeros(n), np.zeros(n))
    swing = 4.0 * np.diag(pin.crba(robot.model, data, q))
    qs, vs, taus, work, begun = [plant.q], [plant.v], [], 0.0, energy(robot, plant)
    for k in range(round(seconds / step)):
        taus.append(hold + swing * np.sin(9.0 * (k + 0.5) * step + np.arange(n)))
        plant.advance(taus[-1])
        work += step * float(taus[-1] @ (vs[-1] + plant.v)) / 2.0
        qs.append(plant.q)
        vs.append(plant.v)
    return np.array(qs), np.array(vs), np.array(taus), energy(robot, plant) - begun - work


def energy(robot: Robot, plant: Plant) -> float:
    data = robot.model.createData()
    M = pin.crba(robot.model, data, plant.q)
    potential = pin.computePotentialEnergy(robot.model, data, plant.q)
    return float(0.5 * plant.v @ M @ plant.v + potential)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_inverse_dynamics_return_the_applied_torque(name: str) -> None:
    robot = load_robot(name)
    rng = np.random.default_rng(3)
    plant = Plant(robot.model, frictionless(robot), *rng.uniform(-1, 1, (2, robot.joints)), 1e-3)
    data = robot.model.createData()
    for _ in range(50):
        tau = 0.3 * robot.limits.tau_max * rng.standard_normal(robot.joints)
        plant.advance(tau)
        back = pin.rnea(robot.model, data, plant.q_mid, plant.v_mid, plant.a)
        # the required bound; the scheme solves this equation, rounding is 1e-12
        np.testing.assert_allclose(back, tau, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_torque_and_energy_are_of_second_order(name: str) -> None:
    """A half step leaves a quarter of the error of the differenced torque, and of the balance."""
    robot = load_robot(name)
    data, errors, gaps = robot.model.createData(), [], []
    for step in (1e-3, 5e-4):
        q, v, tau, gap = driven(robot, step, 0.5)
        a = (v[2:] - v[:-2]) / (2.0 * step)
        rows = zip(q[1:-1], v[1:-1], a, strict=True)
        back = np.array([pin.rnea(robot.model, data, *row) for row in rows])
        errors.append(np.abs(back - 0.5 * (tau[1:] + tau[:-1])).max())
        gaps.append(abs(gap))
    assert errors[0] / errors[1] > 3.0
    # J; of a kinetic energy of tens of joules
    assert gaps[0] < 2e-3
    assert gaps[0] / gaps[1] > 3.0


def test_joint_below_breakaway_does_not_move_at_all() -> None:
    robot = load_robot("ur5")
    friction = true_friction(robot, FrictionSpec(stribeck=0.3))
    q, still = np.array([0.0, -1.35, 1.9, -2.1208, -1.5708, 0.0]), np.zeros(6)
    plant = Plant(robot.model, friction, q, still, 1e-3)
    data = robot.model.createData()
    gravity = pin.computeGeneralizedGravity(robot.model, data, q)
    breakaway = friction.dry(still, gravity)
    # the Stribeck peak, and on joint 2 the load that the profile says
    loaded = friction.load_coulomb * np.abs(gravity)
    np.testing.assert_allclose(breakaway, 1.3 * friction.coulomb + loaded)
    assert loaded[1] > 1.0
    for _ in range(500):
        plant.advance(gravity + 0.999 * breakaway * np.array([1, -1, 1, -1, 1, -1]))
    np.testing.assert_array_equal(plant.v, still)
    np.testing.assert_array_equal(plant.q, q)
    plant.advance(gravity + 1.01 * breakaway)
    assert np.all(plant.v > 0)


def test_sliding_joint_comes_to_exact_rest_and_stays() -> None:
    robot = load_robot("ur5")
    friction = true_friction(robot, FrictionSpec())
    plant = Plant(robot.model, friction, np.zeros(6), np.full(6, 0.2), 1e-3)
    data = robot.model.createData()
    for _ in range(1500):
        plant.advance(pin.computeGeneralizedGravity(robot.model, data, plant.q))
    rest = plant.q.copy()
    np.testing.assert_array_equal(plant.v, np.zeros(6))
    plant.advance(pin.computeGeneralizedGravity(robot.model, data, plant.q))
    np.testing.assert_array_equal(plant.q, rest)


@pytest.mark.parametrize("seed", range(30))
def test_stick_and_slide_agree_with_least_squares_in_bounds(seed: int) -> None:
    """Both solvers of the set-valued step find its one solution, whatever the guess."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    root = rng.standard_normal((n, n))
    M = root @ root.T + 0.1 * np.eye(n)
    impulse, v = rng.standard_normal((2, n))
    v[rng.random(n) < 0.4] = 0.0
    limit = rng.uniform(0.0, 1.5, n)
    limit[0] = 0.0  # a joint without dry friction
    after, friction, _ = slide_or_stick(M, impulse, v, limit, np.sign(v))
    other, other_friction, signs = bounded_step(M, impulse, v, limit)
    # least squares stop at 1e-14 of change; their error is that times the condition of M
    np.testing.assert_allclose(after, other, atol=1e-8)
    np.testing.assert_allclose(friction, other_friction, atol=1e-8)
    np.testing.assert_array_equal(signs == 0.0, np.abs(friction) < limit * (1 - 1e-9))
    assert np.all(np.abs(friction) <= limit * (1 + 1e-9))
    sliding = np.abs(after) > 1e-9
    np.testing.assert_allclose(friction[sliding], (limit * np.sign(after))[sliding], atol=1e-8)


@pytest.mark.slow
def test_follows_another_engine(logs: Path) -> None:
    """Driven by the torque and wrench MuJoCo logged, q stays with MuJoCo's over 0.2 s."""
    folder = logs / "mujoco_ur5e"
    robot = load_robot(folder / "robot.toml")
    table = np.loadtxt(folder / "circle.csv", delimiter=",", skiprows=1)
    q, v, tau, wrench = table[:, 1:7], table[:, 7:13], table[:, 13:19], table[:, 25:31]
    frame, data = robot.model.getFrameId("flange"), robot.model.createData()
    axes = pin.LOCAL_WORLD_ALIGNED
    jacobians = (pin.computeFrameJacobian(robot.model, data, a, frame, axes).copy() for a in q)
    external = np.array([J.T @ w for J, w in zip(jacobians, wrench, strict=True)])
    friction = true_friction(robot, FrictionSpec())
    worst = []
    for first in range(0, len(q) - 26, 25):
        plant, error = Plant(robot.model, friction, q[first], v[first], 1e-3), 0.0
        for k in range(first, first + 25):
            for part in (np.arange(8) + 0.5) / 8.0:
                touch = (1 - part) * external[k] + part * external[k + 1]
                drive = (1 - part) * tau[k] + part * tau[k + 1]
                plant.advance(drive, lambda _m, _d, _v, touch=touch: touch)
            error = max(error, float(np.max(np.abs(plant.q - q[k + 1]))))
        worst.append(error)
    # required 3 mrad; 0.26 measured. The worst window (2.1 mrad) holds a push that begins between
    # two samples of 8 ms, which no interpolation of the log can place
    assert np.median(worst) < 1e-3
    assert np.max(worst) < 3e-3


def test_presliding_friction_is_a_spring_that_yields() -> None:
    """A drive torque below it deflects the joint by torque / stiffness; above it the joint goes."""
    robot = replace(load_robot("ur5"), friction=())
    giving, reach, n = 4.0, 1e-3, robot.joints
    spec = FrictionSpec(presliding_length=reach)
    # viscous friction to settle in; the spring is 4 kN·m/rad, the lightest inertia .2 kg·m²
    soft = {"presliding": np.full(n, giving), "viscous": np.full(n, 50.0)}
    true = replace(true_friction(robot, spec), **soft)
    q = np.array([0.3, -1.2, 1.0, -0.4, 0.5, 0.0])
    plant = Plant(robot.model, true, q, np.zeros(n), 1e-3)
    for _ in range(1500):
        gravity = plant.pin.computeGeneralizedGravity(plant.model, plant.data, plant.q)
        plant.advance(gravity + 0.5 * giving)
    # held at half the reach; 1.5 s are 30 time constants of the slowest joint
    np.testing.assert_allclose(plant.q - q, 0.5 * reach, rtol=1e-3)
    np.testing.assert_allclose(plant.friction, 0.5 * giving, rtol=1e-3)
    for _ in range(300):
        gravity = plant.pin.computeGeneralizedGravity(plant.model, plant.data, plant.q)
        plant.advance(gravity + 1.5 * giving)
    assert np.all(plant.q - q > 2.0 * reach)
    np.testing.assert_allclose(plant.q_mid - plant.centre, reach, rtol=1e-9)


# The true friction against the profile's curve and its own derivative


def test_the_stribeck_peak_fades_over_its_velocity():
    robot = load_robot("ur5")
    spec = FrictionSpec(stribeck=0.3, stribeck_velocity=0.05)
    friction = true_friction(robot, spec)
    coulomb = true_friction(robot, FrictionSpec()).coulomb
    np.testing.assert_allclose(friction.dry(np.zeros(6)), 1.3 * coulomb)
    np.testing.assert_allclose(friction.dry(np.full(6, 0.05)), (1 + 0.3 / np.e) * coulomb)
    np.testing.assert_allclose(friction.dry(np.full(6, -0.5)), coulomb, rtol=1e-12)


def test_a_joint_that_gives_has_dry_friction_that_fades_and_one_that_does_not_sticks():
    """Of alternate joints; the slope against central differences."""
    friction = true_friction(load_robot("ur5"), FrictionSpec(presliding=0.6))
    friction = replace(friction, presliding=friction.presliding * [1, 0, 1, 0, 1, 0])
    dry, dq, h = friction.dry(np.zeros(6)), np.linspace(-0.004, 0.006, 6), 1e-7
    torque, slope, sticking = friction.creep(dq, dry)
    np.testing.assert_array_equal(sticking, dry * [0, 1, 0, 1, 0, 1])
    np.testing.assert_allclose(torque, (dry - sticking) * np.tanh(dq / 0.003), rtol=1e-12)
    difference = (friction.creep(dq + h, dry)[0] - friction.creep(dq - h, dry)[0]) / (2 * h)
    np.testing.assert_allclose(slope, difference, atol=1e-4)


def test_a_share_of_the_sigmoid_can_stick():
    robot = load_robot("panda")
    whole, part = (true_friction(robot, FrictionSpec(sticking=s)) for s in (0.0, 0.4))
    np.testing.assert_allclose(part.amplitude, 0.6 * whole.amplitude)
    np.testing.assert_allclose(part.coulomb, whole.coulomb + 0.2 * whole.amplitude)
    assert "amplitude" in whole.present


def test_warmth_changes_all_but_the_offset():
    friction = true_friction(load_robot("ur10e"), FrictionSpec(presliding=0.5))
    friction = replace(friction, offset=np.full(6, 0.3))
    factor = np.linspace(0.7, 1.2, 6)
    warm, dq = friction.times(factor, factor), np.linspace(-1.0, 1.5, 6)
    np.testing.assert_allclose(warm.smooth(dq)[0] - 0.3, factor * (friction.smooth(dq)[0] - 0.3))
    np.testing.assert_allclose(warm.dry(dq, 9.0 * dq), factor * friction.dry(dq, 9.0 * dq))
    np.testing.assert_allclose(warm.presliding, factor * friction.presliding)
    np.testing.assert_array_equal(warm.offset, friction.offset)


def joint(model: str, **values: float) -> JointFriction:
    return JointFriction(model=model, parameters=values)


GIVING = {"load_coulomb": 0.1, "presliding": 0.5, "presliding_length": 1e-3}
SPEEDS, TORQUES = (0.01, 0.5, 1.5, 3.2), (5.73, 9.32, 13.58, 18.72)
LINE = JointFriction(model="points", parameters=GIVING, speeds=SPEEDS, torques=TORQUES)
SHORT = JointFriction(model="points", speeds=(0.1, 1.0), torques=(1.0, 3.0))
FLAT = joint("coulomb-logarithmic", coulomb=2.0, logarithmic=3.0, logarithmic_velocity=1.2)
SQUARE = joint("coulomb-viscous-quadratic", coulomb=2.0, viscous=1.0, quadratic=0.5)
MADE = replace(load_robot("ur5"), friction=(LINE, SHORT, FLAT, SQUARE, LINE, JointFriction()))


@pytest.mark.parametrize("robot", [MADE, load_robot("ur5"), load_robot("panda")])
def test_a_sliding_joint_rubs_as_the_model_says_and_its_slope_is_the_derivative(robot):
    """The plant's friction by velocity and load, bends included, against the model's function."""
    friction = true_friction(robot, FrictionSpec())
    load = np.resize([-30.0, 20.0, 5.0, 0.0, 1.0, 2.0], robot.joints)
    for speed in (-4.0, -1.0, -0.3, -0.05, 0.05, 0.3, 1.0, 4.0):
        # five times the smoothing: tanh is 1 to 1e-4 of the Coulomb torque
        dq = np.full(robot.joints, speed)
        torque = friction.smooth(dq)[0] + np.sign(speed) * friction.dry(dq, load)
        model = friction_torque(robot.friction, dq[None], load[None])[0]
        np.testing.assert_allclose(torque, model, rtol=2e-4)
        h = 1e-6
        rise = (friction.smooth(dq + h)[0] - friction.smooth(dq - h)[0]) / (2 * h)
        # where it falls, as a quadratic below zero may, the slope used is zero; differences of
        # 20 N·m over 2e-6 rad/s: rounding
        np.testing.assert_allclose(friction.smooth(dq)[1], np.maximum(rise, 0.0), atol=2e-8)


def test_presliding_is_the_models_and_a_share_of_the_coulomb_torque():
    found = true_friction(MADE, FrictionSpec()).presliding
    np.testing.assert_array_equal(found, [0.5, 0, 0, 0, 0.5, 0])
    robot = load_robot("ur10e")
    whole, part = (true_friction(robot, FrictionSpec(presliding=s)) for s in (0.0, 0.6))
    np.testing.assert_allclose(part.presliding, 0.6 * whole.coulomb)
    np.testing.assert_allclose(part.coulomb + part.presliding, whole.coulomb)
    np.testing.assert_array_equal(part.presliding_length, 3e-4)


def test_an_arm_without_friction_figures_has_those_stated():
    robot = load_robot("xarm6")
    stated = FrictionSpec(coulomb=(3.0,) * 6, viscous=(1.0, 2.0, 3.0, 0.0, 0.0, 0.0))
    friction = true_friction(robot, stated)
    np.testing.assert_array_equal(friction.dry(np.ones(6)), 3.0)
    np.testing.assert_array_equal(friction.smooth(np.ones(6))[0], stated.viscous)
    assert not np.any(true_friction(robot, FrictionSpec()).dry(np.ones(6)))
    for wrong in ((1.0,), (-1.0,) * 6, (1e9,) * 6):
        with pytest.raises(ParameterError, match="one number per joint, 6 of them"):
            true_friction(robot, FrictionSpec(coulomb=wrong))
    with pytest.raises(ParameterError, match="'ur5' has some"):
        true_friction(load_robot("ur5"), stated)
