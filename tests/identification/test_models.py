"""Base parameters and the physically consistent model."""

import numpy as np
import pytest

from vftcli.identification.base_parameters import group_parameters
from vftcli.identification.consistent import (
    Problem,
    fit_at,
    is_physical,
    pseudo_inertias,
    solve,
    starting_point,
    thicken_links,
)
from vftcli.identification.friction_shapes import Shape
from vftcli.identification.stacking import ParameterColumns, Triangles, least_change, triangle
from vftcli.robots import load_robot
from vftcli.robots.regressor import chain_parameters, torque_regressor, with_parameters


@pytest.mark.parametrize(
    ("name", "rotor", "rank"),
    [("ur5", False, 36), ("ur5", True, 40), ("panda", False, 43), ("panda", True, 48)],
)
def test_ranks_are_the_published_ones(name, rotor, rank):
    """UR5 36 of 60 inertial, 58 of 84 with 18 friction numbers; Panda 43 of 70, 69 of 98."""
    assert len(group_parameters(load_robot(name).chain, rotor).independent) == rank


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_rotors_of_joints_one_and_two_are_never_separate(name):
    chain = load_robot(name).chain
    grouping = group_parameters(chain, True)
    n = chain.joints
    for j in (0, 1):
        alone = 10 * n + j
        if alone in grouping.independent:
            row = grouping.carried[grouping.independent.index(alone)]
            assert np.any(row != 0.0)


def test_equal_base_parameters_mean_equal_torque():
    chain = load_robot("panda").chain
    grouping = group_parameters(chain, False)
    phi = chain_parameters(chain)
    other = phi.copy()
    rng = np.random.default_rng(0)
    change = rng.normal(size=len(grouping.dependent))
    other[list(grouping.dependent)] += change
    other[list(grouping.independent)] -= grouping.carried @ change
    np.testing.assert_allclose(grouping.values(other), grouping.values(phi), atol=1e-10)
    q, dq, ddq = rng.uniform(-2, 2, (3, 50, 7))
    Y = torque_regressor(chain, q, dq, ddq)
    # β comes from a triangle of condition 1e3 or so: 1e-12 of torques of 10²
    np.testing.assert_allclose(Y @ other, Y @ phi, atol=1e-8)


def test_names_say_what_is_summed():
    chain = load_robot("ur5").chain
    layout = ParameterColumns(chain, True, (Shape(("coulomb",)),) * 6)
    names = group_parameters(chain, True).sums(layout.names)
    assert len(set(names)) == 40
    assert any(" + " in name for name in names)


def stacked(chain, phi, noise, seed=0, samples=300):
    """Equations of random states for a planted parameter vector, without friction."""
    rng = np.random.default_rng(seed)
    q, dq, ddq = rng.uniform(-2, 2, (3, samples, chain.joints))
    layout = ParameterColumns(chain, False, (Shape(()),) * chain.joints)
    Y = torque_regressor(chain, q, dq, ddq)
    tau = Y @ phi + noise * rng.normal(size=(samples, chain.joints))
    rows = np.concatenate([Y, tau[:, :, None]], axis=2) / noise
    parts = tuple(triangle(part.reshape(-1, rows.shape[2])) for part in np.array_split(rows, 5))
    sigma = np.full(chain.joints, noise)
    return Triangles(layout, parts, sigma, 1.0, float(samples * chain.joints)), (q, dq, ddq)


def perturbed(chain, seed):
    """A chain with 20 % other masses and tensors and centres moved by a centimetre."""
    from dataclasses import replace

    rng = np.random.default_rng(seed)
    scale = 1.0 + rng.uniform(-0.2, 0.2, chain.joints)
    return replace(
        chain,
        mass=chain.mass * scale,
        inertia=chain.inertia * scale[:, None, None],
        com=chain.com + rng.uniform(-0.01, 0.01, chain.com.shape),
    )


@pytest.mark.parametrize("name", ["ur10e", "panda"])
def test_the_consistent_model_is_physical_and_predicts(name):
    import pinocchio as pin

    robot = load_robot(name)
    true = perturbed(robot.chain, 3)
    triangles, state = stacked(robot.chain, chain_parameters(true), noise=0.5)
    start = starting_point(triangles.layout, chain_parameters(robot.chain))
    x = fit_at(triangles, start, 1.0, start)
    assert is_physical(x)
    made = with_parameters(robot.chain, x, np.zeros(robot.joints)).to_pinocchio()
    for body in made.inertias[1:]:
        assert np.all(np.linalg.eigvalsh(np.array(body.inertia)) > 0)
    q, dq, ddq = state
    Y = torque_regressor(robot.chain, q, dq, ddq)
    data = made.createData()
    np.testing.assert_allclose(
        pin.rnea(made, data, q[0], dq[0], ddq[0]), (Y @ x)[0], atol=1e-9
    )  # the model Pinocchio accepts is the one that was fitted
    error = np.sqrt(np.mean((Y @ (x - chain_parameters(true))) ** 2))
    # 43 parameters of 300·7 equations: noise·√(43/2100) = 0.07, and a pull of one count
    assert error < 0.12


def test_newtons_point_is_stationary_and_unique():
    chain = load_robot("panda").chain
    triangles, _ = stacked(chain, chain_parameters(perturbed(chain, 4)), noise=0.5)
    start = starting_point(triangles.layout, chain_parameters(chain))
    R, z = triangles.joined()
    problem = Problem(R, z, start, triangles.layout, 1.0)
    one = solve(problem, start)
    two = solve(problem, starting_point(triangles.layout, chain_parameters(perturbed(chain, 5))))
    _, decrement = problem.step(one)
    assert decrement < 1e-3
    # convex: both ends lie within the stopping decrement of one optimum
    assert problem.value(one) == pytest.approx(problem.value(two), abs=2e-3)
    nearby = [
        problem.value(one * (1 + 1e-3 * np.random.default_rng(k).normal(size=len(one))))
        for k in range(5)
    ]
    assert min(nearby) > problem.value(one) - 1e-3


def test_the_gradient_is_the_cost_s():
    chain = load_robot("ur5").chain
    triangles, _ = stacked(chain, chain_parameters(perturbed(chain, 6)), noise=5.0)
    start = starting_point(triangles.layout, chain_parameters(chain))
    problem = Problem(*triangles.joined(), start, triangles.layout, 10.0)
    x = starting_point(triangles.layout, chain_parameters(perturbed(chain, 7)))
    step, decrement = problem.step(x)
    h = 1e-4
    slope = (problem.value(x + h * step) - problem.value(x - h * step)) / (2 * h)
    # d/ds f(x + s·step) = −decrement by Newton's definition; central difference of order h²
    assert slope == pytest.approx(-decrement, rel=1e-3)


def test_a_point_mass_is_thickened_and_the_physical_stays():
    chain = load_robot("ur10e").chain
    phi = chain_parameters(chain)
    assert is_physical(thicken_links(phi))
    flat = phi.copy()
    flat[14:20] = 0.0  # a tensor of nothing about the origin, with mass away from it
    assert not is_physical(flat)
    assert is_physical(thicken_links(flat))
    healthy = load_robot("panda").chain
    # already physical: only rounding of an eigendecomposition
    np.testing.assert_allclose(
        thicken_links(chain_parameters(healthy)), chain_parameters(healthy), atol=1e-12
    )


def test_pseudo_inertia_of_a_point_mass():
    """m at c: Σ = m c cᵀ, h = m c (analytic)."""
    c = np.array([0.1, 0.2, 0.3])
    tensor = 2.0 * (c @ c * np.eye(3) - np.outer(c, c))
    phi = np.array(
        [
            2.0,
            *(2.0 * c),
            tensor[0, 0],
            tensor[0, 1],
            tensor[1, 1],
            tensor[0, 2],
            tensor[1, 2],
            tensor[2, 2],
        ]
    )
    expected = 2.0 * np.outer([*c, 1.0], [*c, 1.0])
    np.testing.assert_allclose(pseudo_inertias(phi)[0], expected, atol=1e-15)


def test_least_squares_leaves_the_start_where_there_is_no_data():
    chain = load_robot("ur5").chain
    phi = chain_parameters(perturbed(chain, 8))
    triangles, state = stacked(chain, phi, noise=0.1)
    start = chain_parameters(chain)
    x = least_change(triangles, start)
    # the first link's mass moves nothing: no motion tells it
    assert x[0] == pytest.approx(start[0], rel=1e-12)
    Y = torque_regressor(chain, *state)
    assert np.sqrt(np.mean((Y @ (x - phi)) ** 2)) < 0.05  # noise 0.1·√(36/1800), and truncation
