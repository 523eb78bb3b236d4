"""The links' equations and base parameters: what any motion can tell, and what these logs tell."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from vftcli.identification import links
from vftcli.identification.shapes import Shape
from vftcli.identification.training import ParameterColumns, PreparedLog
from vftcli.robots import load_robot
from vftcli.robots.kernels import TENSOR, chain_parameters, torque_regressor, with_parameters

CHAIN = load_robot("ur5").chain
SHAPES = Shape(("coulomb", "viscous")), *(Shape(("viscous",)),) * 5
LAYOUT = ParameterColumns(CHAIN, True, SHAPES)


@pytest.fixture
def log(prepared, sines) -> PreparedLog:
    """Six seconds of a UR5 with rotors and friction, some noise, the first second unweighted."""
    t, q, dq, ddq = sines(seconds=6.0, seed=4)
    rng = np.random.default_rng(5)
    tau = LAYOUT.rows(prepared(t, q=q, dq=dq, ddq=ddq), slice(0, len(t))) @ planted()
    tau = tau + rng.standard_normal(q.shape) * [0.5, 0.5, 0.5, 0.1, 0.1, 0.1]
    weights = np.ones(q.shape)
    weights[t < 1.0] = 0.0
    return prepared(t, q=q, dq=dq, ddq=ddq, tau=tau, weights=weights)


def planted():
    return np.concatenate([chain_parameters(CHAIN), 1.0 + np.arange(6), 5.0 + np.arange(7)])


def test_rows_are_the_equation_of_motion(log):
    x = planted()
    rows = LAYOUT.rows(log, slice(100, 140))
    rigid = torque_regressor(CHAIN, log.q, log.dq, log.ddq)[100:140] @ x[:60]
    rotors = log.ddq[100:140] * (1.0 + np.arange(6))
    parts = enumerate(LAYOUT.frictions)
    friction = [log.friction(j, SHAPES[j])[100:140] @ x[place] for j, place in parts]
    np.testing.assert_allclose(rows @ x, rigid + rotors + np.transpose(friction), atol=1e-10)
    assert len(LAYOUT.names) == LAYOUT.size == 73
    assert LAYOUT.names[65:69] == ("J6", "coulomb1", "viscous1", "viscous2")


def test_triangles_are_the_weighted_equations(log):
    left = links.residuals(LAYOUT, log, planted())
    used = left[log.weights[:, 0] > 0]
    sigma = 1.4826 * np.median(np.abs(used), axis=0)
    left[log.weights[:, 0] == 0] = 1e6  # samples of no weight do not count
    triangles = links.triangulate(LAYOUT, [log], left=[left])
    z = np.abs(left / sigma)
    weights = log.weights * np.where(z > 2.5, 2.5 / np.maximum(z, 2.5), 1.0)
    A = LAYOUT.rows(log, slice(0, len(left)))
    rows = np.concatenate([A, log.tau[:, :, None]], axis=2)
    rows = (rows * (np.sqrt(weights) / sigma)[:, :, None]).reshape(-1, LAYOUT.size + 1)
    R, right = triangles.joined()
    assert R.shape == (LAYOUT.size, LAYOUT.size)
    np.testing.assert_allclose(R.T @ R, rows[:, :-1].T @ rows[:, :-1], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(R.T @ right, rows[:, :-1].T @ rows[:, -1], rtol=1e-9, atol=1e-6)
    most, part = triangles.joined(leave_out=2)[0], triangles.parts[2][:, :-1]
    np.testing.assert_allclose(R.T @ R, most.T @ most + part.T @ part, atol=1e-6)
    x = planted()
    total = sum(triangles.misfit(part, x) for part in range(5))
    assert total == pytest.approx(np.sum((rows[:, -1] - rows[:, :-1] @ x) ** 2), rel=1e-9)
    # white noise: neighbours count as one each, to what 625 samples can tell
    assert triangles.correlation == pytest.approx(1.0, abs=0.3)


def frictionless(name, rotor):
    chain = load_robot(name).chain
    return ParameterColumns(chain, rotor, (Shape(()),) * chain.joints)


@pytest.mark.parametrize(
    ("name", "rotor", "rank"),
    [("ur5", False, 36), ("ur5", True, 40), ("panda", False, 43), ("panda", True, 48)],
)
def test_ranks_are_the_published_ones(name, rotor, rank):
    """UR5 36 of 60 inertial, 58 of 84 with 18 friction numbers; Panda 43 of 70, 69 of 98."""
    assert len(links.group_parameters(frictionless(name, rotor)).independent) == rank


def test_equal_base_parameters_mean_equal_torque():
    layout = frictionless("panda", False)
    chain, grouping = layout.chain, links.group_parameters(layout)
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


def test_sums_are_written_with_signs_and_factors():
    grouping = links.Grouping((0, 2), (1, 3), np.array([[1.0, -0.25], [0.0, 1e-12]]))
    assert grouping.sums(("a", "b", "c", "d")) == ["a + b - 0.25 d", "c"]
    np.testing.assert_allclose(grouping.values(np.array([1.0, 2.0, 3.0, 4.0])), [2.0, 3.0])


@pytest.fixture
def excited(prepared, sines) -> tuple[links.Triangles, np.ndarray, np.ndarray]:
    """Equations of a UR5 of known parameters with friction, its profile, and the truth."""
    chain = load_robot("ur5").chain
    t, q, dq, ddq = sines(seconds=12.0, seed=1)
    layout = ParameterColumns(chain, False, (Shape(("coulomb", "viscous")),) * 6)
    start = np.concatenate([chain_parameters(chain), np.tile([5.0, 8.0], 6)])
    true = start * (1.0 + 0.1 * np.random.default_rng(2).standard_normal(len(start)))
    tau = layout.rows(prepared(t, q=q, dq=dq, ddq=ddq), slice(0, len(t))) @ true
    noise = 0.1 * np.random.default_rng(3).standard_normal(q.shape)
    log = prepared(t, q=q, dq=dq, ddq=ddq, tau=tau + noise)
    return links.stack(layout, [log], start), start, true


def test_estimates_lie_within_their_spread(excited):
    triangles, start, true = excited
    found = links.base_parameters(triangles, start)
    layout = triangles.layout
    grouping = links.group_parameters(layout)
    values, sd, sure = (found[key].to_numpy() for key in ("value", "sd", "determined"))
    z = (values - grouping.values(true)) / sd
    assert sure.sum() > 20
    # friction's coefficients stand for themselves
    assert grouping.independent[-12:] == tuple(range(60, 72))
    assert not grouping.carried[-12:].any()
    # normal deviates of a fixed seed: rms 1 ± 0.15, none beyond 4.5 but by chance in 3000
    assert 0.6 < np.sqrt(np.mean(z[sure] ** 2)) < 1.4
    assert np.max(np.abs(z[sure])) < 4.5
    size = np.maximum(np.abs(values), np.abs(grouping.values(start)))
    np.testing.assert_array_equal(sure, sd <= links.DOUBTFUL * size)


def test_what_no_data_tells_keeps_the_start_and_has_no_spread(excited):
    triangles, start, _ = excited
    seen = np.arange(triangles.layout.size + 1) != 70
    blind = triangles._replace(parts=tuple(part * seen for part in triangles.parts))
    found = links.base_parameters(blind, start)
    assert triangles.layout.names[70] == "coulomb6"
    (row,) = [row for row in found.to_dicts() if row["parameter"] == "coulomb6"]
    assert row == {"parameter": "coulomb6", "value": start[70], "sd": np.inf, "determined": False}


def stacked(chain, phi, noise, seed=0, samples=300):
    """Equations of random states for a planted parameter vector, without friction."""
    rng = np.random.default_rng(seed)
    q, dq, ddq = rng.uniform(-2, 2, (3, samples, chain.joints))
    layout = ParameterColumns(chain, False, (Shape(()),) * chain.joints)
    Y = torque_regressor(chain, q, dq, ddq)
    tau = Y @ phi + noise * rng.normal(size=(samples, chain.joints))
    rows = np.concatenate([Y, tau[:, :, None]], axis=2) / noise
    parts = tuple(
        links.triangle(part.reshape(-1, rows.shape[2])) for part in np.array_split(rows, 5)
    )
    return links.Triangles(layout, parts, 1.0), (q, dq, ddq)


def perturbed(chain, seed):
    """A chain with 20 % other masses and tensors and centres moved by a centimetre."""
    rng = np.random.default_rng(seed)
    scale = 1.0 + rng.uniform(-0.2, 0.2, chain.joints)
    com = chain.com + rng.uniform(-0.01, 0.01, chain.com.shape)
    inertia = chain.inertia * scale[:, None, None]
    return replace(chain, mass=chain.mass * scale, inertia=inertia, com=com)


@pytest.mark.parametrize(("name", "weight"), [("ur10e", 1.0), ("panda", links.WEIGHTS[0])])
def test_the_nearest_links_are_physical_and_predict(name, weight):
    robot = load_robot(name)
    true = perturbed(robot.chain, 3)
    triangles, state = stacked(robot.chain, chain_parameters(true), noise=0.5)
    x = links.nearest_physical_links(triangles, chain_parameters(robot.chain), weight)
    assert links.is_physical(x)
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


def test_a_point_mass_is_thickened_and_the_physical_stays():
    chain = load_robot("ur10e").chain
    phi = chain_parameters(chain)
    assert links.is_physical(links.thicken_links(phi))
    flat = phi.copy()
    flat[14:20] = 0.0  # a tensor of nothing about the origin, with mass away from it
    assert not links.is_physical(flat)
    assert links.is_physical(links.thicken_links(flat))
    healthy = chain_parameters(load_robot("panda").chain)
    # already physical: only rounding of an eigendecomposition
    np.testing.assert_allclose(links.thicken_links(healthy), healthy, atol=1e-12)


def test_pseudo_inertia_of_a_point_mass():
    """m at c: Σ = m c cᵀ, h = m c (analytic)."""
    c = np.array([0.1, 0.2, 0.3])
    tensor = 2.0 * (c @ c * np.eye(3) - np.outer(c, c))
    phi = np.array([2.0, *(2.0 * c), *(tensor[r, c] for r, c in TENSOR)])
    expected = 2.0 * np.outer([*c, 1.0], [*c, 1.0])
    np.testing.assert_allclose(links.pseudo_inertias(phi)[0], expected, atol=1e-15)


def test_the_profile_is_of_use_where_noise_hides_the_arm():
    """Links 20 % off, 50 N·m of noise."""
    chain = load_robot("ur5").chain
    triangles, _ = stacked(chain, chain_parameters(perturbed(chain, 2)), noise=50.0)
    assert not links.predicts_best_unpulled(triangles, chain_parameters(chain))


def test_a_step_is_newton_s_and_its_decrement_what_the_cost_falls_and_bends_by():
    """Along s = −H⁻¹g slope and curvature are −gᵀH⁻¹g and gᵀH⁻¹g, by central differences."""
    chain, rng = load_robot("ur5").chain, np.random.default_rng(1)
    layout = ParameterColumns(chain, True, (Shape(()),) * 6)
    thick = links.thicken_links(chain_parameters(chain))
    start = np.concatenate([thick, np.linspace(0.5, 3.0, 6)])
    R = 3.0 * np.triu(rng.standard_normal((66, 66)))
    problem = links.Problem(R, R @ start, start, layout, 2.0)
    x = start * np.append(np.repeat(rng.uniform(0.8, 1.2, 6), 10), rng.uniform(0.5, 1.5, 6))
    step, decrement = problem.step(x)
    before, here, after = (problem.value(x + h * step) for h in (-1e-3, 0.0, 1e-3))
    # the third derivative along the step, rounding of a cost of some 10³
    assert (after - before) / 2e-3 == pytest.approx(-decrement, rel=1e-5)
    assert (after - 2.0 * here + before) / 1e-6 == pytest.approx(decrement, rel=1e-5)


def test_correlated_equations_count_less():
    chain = load_robot("ur5").chain
    triangles, _ = stacked(chain, chain_parameters(perturbed(chain, 2)), noise=0.5)
    start = links.thicken_links(chain_parameters(chain))
    correlated = triangles._replace(correlation=100.0)
    slow = links.nearest_physical_links(correlated, chain_parameters(chain), 1.0)
    strong = links.nearest_physical_links(triangles, chain_parameters(chain), 100.0)
    # a hundredth of the equations under a pull of 1 is all of them under one of 100
    problem = links.Problem(*triangles.joined(), start, triangles.layout, 100.0)
    # both stop within a decrement of 1e-3, which is 0.1 of the hundredfold cost
    assert problem.value(slow) == pytest.approx(problem.value(strong), abs=0.2)
    assert problem.value(slow) < problem.value(start) - 10.0


def test_costs_outside_the_physical_models_are_infinite():
    chain = load_robot("ur5").chain
    layout = ParameterColumns(chain, True, (Shape(()),) * 6)
    start = np.concatenate([links.thicken_links(chain_parameters(chain)), np.ones(6)])
    nothing = np.zeros((layout.size, layout.size)), np.zeros(layout.size)
    problem = links.Problem(*nothing, start, layout, 2.0)
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
