"""The physical links nearest to least squares."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from vftcli.identification.links import (
    WEIGHTS,
    Problem,
    Triangles,
    is_physical,
    nearest_physical_links,
    predicts_best_unpulled,
    pseudo_inertias,
    solve,
    starting_point,
    thicken_links,
    triangle,
)
from vftcli.identification.shapes import Shape
from vftcli.identification.training import ParameterColumns
from vftcli.robots import load_robot
from vftcli.robots.kernels import TENSOR, chain_parameters, torque_regressor, with_parameters


def stacked(chain, phi, noise, seed=0, samples=300):
    """Equations of random states for a planted parameter vector, without friction."""
    rng = np.random.default_rng(seed)
    q, dq, ddq = rng.uniform(-2, 2, (3, samples, chain.joints))
    layout = ParameterColumns(chain, False, (Shape(()),) * chain.joints)
    Y = torque_regressor(chain, q, dq, ddq)
    tau = Y @ phi + noise * rng.normal(size=(samples, chain.joints))
    rows = np.concatenate([Y, tau[:, :, None]], axis=2) / noise
    parts = tuple(triangle(part.reshape(-1, rows.shape[2])) for part in np.array_split(rows, 5))
    return Triangles(layout, parts, 1.0), (q, dq, ddq)


def perturbed(chain, seed):
    """A chain with 20 % other masses and tensors and centres moved by a centimetre."""
    rng = np.random.default_rng(seed)
    scale = 1.0 + rng.uniform(-0.2, 0.2, chain.joints)
    return replace(
        chain,
        mass=chain.mass * scale,
        inertia=chain.inertia * scale[:, None, None],
        com=chain.com + rng.uniform(-0.01, 0.01, chain.com.shape),
    )


@pytest.mark.parametrize(("name", "weight"), [("ur10e", 1.0), ("panda", WEIGHTS[0])])
def test_the_nearest_links_are_physical_and_predict(name, weight):
    robot = load_robot(name)
    true = perturbed(robot.chain, 3)
    triangles, state = stacked(robot.chain, chain_parameters(true), noise=0.5)
    x = nearest_physical_links(triangles, chain_parameters(robot.chain), weight)
    assert is_physical(x)
    made = with_parameters(robot.chain, x, np.zeros(robot.joints)).to_pinocchio()
    for body in made.inertias[1:]:
        assert np.all(np.linalg.eigvalsh(np.array(body.inertia)) > 0)
    q, dq, ddq = state
    Y = torque_regressor(robot.chain, q, dq, ddq)
    # the model Pinocchio accepts is the one that was fitted
    torque = pin.rnea(made, made.createData(), q[0], dq[0], ddq[0])
    np.testing.assert_allclose(torque, (Y @ x)[0], atol=1e-9)
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


def test_a_point_mass_is_thickened_and_the_physical_stays():
    chain = load_robot("ur10e").chain
    phi = chain_parameters(chain)
    assert is_physical(thicken_links(phi))
    flat = phi.copy()
    flat[14:20] = 0.0  # a tensor of nothing about the origin, with mass away from it
    assert not is_physical(flat)
    assert is_physical(thicken_links(flat))
    healthy = chain_parameters(load_robot("panda").chain)
    # already physical: only rounding of an eigendecomposition
    np.testing.assert_allclose(thicken_links(healthy), healthy, atol=1e-12)


def test_pseudo_inertia_of_a_point_mass():
    """m at c: Σ = m c cᵀ, h = m c (analytic)."""
    c = np.array([0.1, 0.2, 0.3])
    tensor = 2.0 * (c @ c * np.eye(3) - np.outer(c, c))
    phi = np.array([2.0, *(2.0 * c), *(tensor[r, c] for r, c in TENSOR)])
    expected = 2.0 * np.outer([*c, 1.0], [*c, 1.0])
    np.testing.assert_allclose(pseudo_inertias(phi)[0], expected, atol=1e-15)


def test_the_profile_is_of_use_where_noise_hides_the_arm():
    """Links 20 % off, 50 N·m of noise."""
    chain = load_robot("ur5").chain
    triangles, _ = stacked(chain, chain_parameters(perturbed(chain, 2)), noise=50.0)
    assert not predicts_best_unpulled(triangles, chain_parameters(chain))


def test_a_step_is_newton_s_and_its_decrement_what_the_cost_falls_and_bends_by():
    """Along s = −H⁻¹g slope and curvature are −gᵀH⁻¹g and gᵀH⁻¹g, by central differences."""
    chain, rng = load_robot("ur5").chain, np.random.default_rng(1)
    layout = ParameterColumns(chain, True, (Shape(()),) * 6)
    start = np.concatenate([thicken_links(chain_parameters(chain)), np.linspace(0.5, 3.0, 6)])
    R = 3.0 * np.triu(rng.standard_normal((66, 66)))
    problem = Problem(R, R @ start, start, layout, 2.0)
    x = start * np.append(np.repeat(rng.uniform(0.8, 1.2, 6), 10), rng.uniform(0.5, 1.5, 6))
    step, decrement = problem.step(x)
    before, here, after = (problem.value(x + h * step) for h in (-1e-3, 0.0, 1e-3))
    # the third derivative along the step, rounding of a cost of some 10³
    assert (after - before) / 2e-3 == pytest.approx(-decrement, rel=1e-5)
    assert (after - 2.0 * here + before) / 1e-6 == pytest.approx(decrement, rel=1e-5)


def test_correlated_equations_count_less():
    chain = load_robot("ur5").chain
    triangles, _ = stacked(chain, chain_parameters(perturbed(chain, 2)), noise=0.5)
    start = starting_point(triangles.layout, chain_parameters(chain))
    correlated = triangles._replace(correlation=100.0)
    slow = nearest_physical_links(correlated, chain_parameters(chain), 1.0)
    strong = nearest_physical_links(triangles, chain_parameters(chain), 100.0)
    # a hundredth of the equations under a pull of 1 is all of them under one of 100
    problem = Problem(*triangles.joined(), start, triangles.layout, 100.0)
    # both stop within a decrement of 1e-3, which is 0.1 of the hundredfold cost
    assert problem.value(slow) == pytest.approx(problem.value(strong), abs=0.2)
    assert problem.value(slow) < problem.value(start) - 10.0


def test_costs_outside_the_physical_models_are_infinite():
    chain = load_robot("ur5").chain
    layout = ParameterColumns(chain, True, (Shape(()),) * 6)
    start = np.concatenate([thicken_links(chain_parameters(chain)), np.ones(6)])
    nothing = np.zeros((layout.size, layout.size)), np.zeros(layout.size)
    problem = Problem(*nothing, start, layout, 2.0)
    assert problem.value(start) == pytest.approx(0.0, abs=1e-12)
    bad_link, bad_rotor = start.copy(), start.copy()
    bad_link[0], bad_rotor[-1] = -1.0, 0.0
    assert problem.value(bad_link) == problem.value(bad_rotor) == np.inf
    # rotors: weight · (r − ln r − 1) each, r the ratio to the profile
    twice = start.copy()
    twice[-6:] = 2.0
    assert problem.value(twice) == pytest.approx(2.0 * 6 * (2 - np.log(2) - 1))
    # links: tr(P₀⁻¹P) − ln det(P₀⁻¹P) − 4 with P = 2 P₀ is 4 − 4 ln 2
    double = start.copy()
    double[:60] *= 2.0
    assert problem.value(double) == pytest.approx(2.0 * 6 * (4 - 4 * np.log(2)))
