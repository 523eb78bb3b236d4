"""The stacked equations against plain least squares of all rows at once."""

import numpy as np
import pytest

from vftcli.identification.friction_shapes import FrictionColumns, Shape
from vftcli.identification.stacking import (
    ParameterColumns,
    Triangles,
    WeightedLog,
    joint_sigma,
    least_change,
    residuals,
    stack,
    triangle,
    triangulate,
)
from vftcli.robots import load_robot
from vftcli.robots.regressor import chain_parameters, torque_regressor

CHAIN = load_robot("ur5").chain
LAYOUT = ParameterColumns(CHAIN, True, (Shape(("coulomb", "viscous")), *(Shape(("viscous",)),) * 5))


def test_columns_are_inertias_then_rotors_then_friction():
    assert (LAYOUT.inertial, LAYOUT.rotors, LAYOUT.size) == (60, 6, 73)
    assert LAYOUT.frictions == (slice(66, 68), *(slice(k, k + 1) for k in range(68, 73)))
    assert LAYOUT.names[:2] == ("m1", "mx1")
    assert LAYOUT.names[60:] == (
        *(f"J{j}" for j in range(1, 7)),
        *("coulomb1", "viscous1"),
        *(f"viscous{j}" for j in range(2, 7)),
    )
    without = LAYOUT._replace(rotor=False)
    assert (without.rotors, without.size) == (0, 67)


@pytest.fixture
def log(prepared, sines) -> WeightedLog:
    """Six seconds of a UR5 with rotors and friction, some noise, the first second unweighted."""
    t, q, dq, ddq = sines(seconds=6.0, seed=4)
    motion = prepared(t, q=q, dq=dq, ddq=ddq)
    columns = FrictionColumns(motion, np.zeros(q.shape))
    rng = np.random.default_rng(5)
    tau = LAYOUT.rows(motion, columns, slice(0, len(t))) @ planted()
    tau = tau + rng.standard_normal(q.shape) * [0.5, 0.5, 0.5, 0.1, 0.1, 0.1]
    weights = np.ones(q.shape)
    weights[t < 1.0] = 0.0
    return WeightedLog(prepared(t, q=q, dq=dq, ddq=ddq, tau=tau), columns, weights)


def planted():
    """The parameters of the log."""
    return np.concatenate([chain_parameters(CHAIN), 1.0 + np.arange(6), 5.0 + np.arange(7)])


def test_rows_are_the_equation_of_motion(log):
    x = planted()
    rows = LAYOUT.rows(log.motion, log.columns, slice(100, 140))
    rigid = torque_regressor(CHAIN, log.motion.q, log.motion.dq, log.motion.ddq)[100:140] @ x[:60]
    rotors = log.motion.ddq[100:140] * (1.0 + np.arange(6))
    friction = [
        log.columns.joint(j, shape)[100:140] @ x[place]
        for j, (shape, place) in enumerate(zip(LAYOUT.shapes, LAYOUT.frictions, strict=True))
    ]
    np.testing.assert_allclose(rows @ x, rigid + rotors + np.transpose(friction), atol=1e-10)


def test_residuals_are_what_x_does_not_explain(log):
    left = residuals(LAYOUT, log, planted())
    # 750 samples: a standard deviation to 2.6 %
    np.testing.assert_allclose(np.std(left, axis=0), [0.5, 0.5, 0.5, 0.1, 0.1, 0.1], rtol=0.1)
    sigma = joint_sigma([log], [left])
    np.testing.assert_allclose(sigma, [0.5, 0.5, 0.5, 0.1, 0.1, 0.1], rtol=0.15)
    loud = left.copy()
    loud[log.weights[:, 0] == 0] = 1e6  # samples of no weight do not count
    np.testing.assert_array_equal(joint_sigma([log], [loud]), sigma)


def test_triangles_are_the_weighted_equations(log):
    left = residuals(LAYOUT, log, planted())
    sigma = np.array([0.5, 0.5, 0.5, 0.1, 0.1, 0.1])
    triangles = triangulate(LAYOUT, [log], left=[left], sigma=sigma)
    z = np.abs(left / sigma)
    weights = log.weights * np.where(z > 2.5, 2.5 / np.maximum(z, 2.5), 1.0)
    A = LAYOUT.rows(log.motion, log.columns, slice(0, len(left)))
    rows = np.concatenate([A, log.motion.tau[:, :, None]], axis=2)
    rows = (rows * (np.sqrt(weights) / sigma)[:, :, None]).reshape(-1, LAYOUT.size + 1)
    R, right = triangles.joined()
    np.testing.assert_allclose(R.T @ R, rows[:, :-1].T @ rows[:, :-1], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(R.T @ right, rows[:, :-1].T @ rows[:, -1], rtol=1e-9, atol=1e-6)
    x = planted()
    total = sum(triangles.misfit(part, x) for part in range(5))
    assert total == pytest.approx(np.sum((rows[:, -1] - rows[:, :-1] @ x) ** 2), rel=1e-9)
    # white noise: neighbours count as one each, to what 625 samples can tell
    assert triangles.correlation == pytest.approx(1.0, abs=0.3)


def test_one_stretch_can_be_left_out(log):
    triangles = triangulate(LAYOUT, [log], [residuals(LAYOUT, log, planted())], np.ones(6))
    whole, most = triangles.joined()[0], triangles.joined(leave_out=2)[0]
    part = triangles.parts[2][:, :-1]
    np.testing.assert_allclose(whole.T @ whole, most.T @ most + part.T @ part, atol=1e-6)


def test_stacking_finds_what_was_planted(log):
    start = planted() * 1.1
    triangles = stack(LAYOUT, [log], start)
    x = least_change(triangles, start)
    left = residuals(LAYOUT, log, x)
    # 53 parameters of 3750 equations take 1.4 % of the noise's square
    np.testing.assert_allclose(np.std(left, axis=0), [0.5, 0.5, 0.5, 0.1, 0.1, 0.1], rtol=0.1)


def test_the_triangle_of_many_rows_is_theirs():
    rows = np.random.default_rng(0).standard_normal((50, 4))
    R = triangle(rows)
    assert R.shape == (4, 4)
    np.testing.assert_allclose(R.T @ R, rows.T @ rows, atol=1e-12)


def test_least_squares_leaves_the_start_where_there_is_no_data():
    rng = np.random.default_rng(8)
    q, dq, ddq = rng.uniform(-2, 2, (3, 300, 6))
    layout = ParameterColumns(CHAIN, False, (Shape(()),) * 6)
    Y = torque_regressor(CHAIN, q, dq, ddq)
    start = chain_parameters(CHAIN)
    true = start * (1.0 + 0.1 * rng.standard_normal(60))
    tau = Y @ true + 0.1 * rng.standard_normal((300, 6))
    rows = np.concatenate([Y, tau[:, :, None]], axis=2) / 0.1
    parts = tuple(triangle(part.reshape(-1, 61)) for part in np.array_split(rows, 5))
    x = least_change(Triangles(layout, parts, 1.0), start)
    # the first link's mass moves nothing: no motion tells it
    assert x[0] == pytest.approx(start[0], rel=1e-12)
    # noise 0.1·√(36/1800) = 0.014, and truncation
    assert np.sqrt(np.mean((Y @ (x - true)) ** 2)) < 0.05
