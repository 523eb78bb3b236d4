"""Base parameters: what any motion can tell, and what these logs tell of it."""

import numpy as np
import pytest

from vftcli.identification.base_parameters import (
    DOUBTFUL,
    Grouping,
    base_parameters,
    group_parameters,
    with_friction,
)
from vftcli.identification.friction_shapes import FrictionColumns, Shape
from vftcli.identification.stacking import ParameterColumns, Triangles, WeightedLog, stack
from vftcli.robots import load_robot
from vftcli.robots.regressor import chain_parameters, torque_regressor


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


def test_sums_are_written_with_signs_and_factors():
    grouping = Grouping((0, 2), (1, 3), np.array([[1.0, -0.25], [0.0, 1e-12]]))
    assert grouping.sums(("a", "b", "c", "d")) == ["a + b - 0.25 d", "c"]
    np.testing.assert_allclose(grouping.values(np.array([1.0, 2.0, 3.0, 4.0])), [2.0, 3.0])


def test_friction_coefficients_stand_for_themselves():
    chain = load_robot("ur5").chain
    layout = ParameterColumns(chain, True, (Shape(("coulomb", "viscous")),) * 6)
    grouping = with_friction(group_parameters(chain, True), layout)
    assert len(grouping.independent) == 40 + 12
    assert grouping.independent[-12:] == tuple(range(66, 78))
    assert not grouping.carried[-12:].any()


@pytest.fixture
def excited(prepared, sines) -> tuple[Triangles, np.ndarray, np.ndarray]:
    """Equations of a UR5 of known parameters with friction, its profile, and the truth."""
    chain = load_robot("ur5").chain
    t, q, dq, ddq = sines(seconds=12.0, seed=1)
    layout = ParameterColumns(chain, False, (Shape(("coulomb", "viscous")),) * 6)
    start = np.concatenate([chain_parameters(chain), np.tile([5.0, 8.0], 6)])
    true = start * (1.0 + 0.1 * np.random.default_rng(2).standard_normal(len(start)))
    empty = prepared(t, q=q, dq=dq, ddq=ddq)
    columns = FrictionColumns(empty, np.zeros(q.shape))
    tau = layout.rows(empty, columns, slice(0, len(t))) @ true
    noise = 0.1 * np.random.default_rng(3).standard_normal(q.shape)
    motion = prepared(t, q=q, dq=dq, ddq=ddq, tau=tau + noise)
    logs = [WeightedLog(motion, columns, np.ones(q.shape))]
    return stack(layout, logs, start), start, true


def test_estimates_lie_within_their_spread(excited):
    triangles, start, true = excited
    found = base_parameters(triangles, start)
    layout = triangles.layout
    grouping = with_friction(group_parameters(layout.chain, layout.rotor), layout)
    z = (found.values - grouping.values(true)) / found.sd
    sure = np.array(found.determined)
    assert sure.sum() > 20
    # normal deviates of a fixed seed: rms 1 ± 0.15, none beyond 4.5 but by chance in 3000
    assert 0.6 < np.sqrt(np.mean(z[sure] ** 2)) < 1.4
    assert np.max(np.abs(z[sure])) < 4.5
    size = np.maximum(np.abs(found.values), np.abs(grouping.values(start)))
    np.testing.assert_array_equal(sure, found.sd <= DOUBTFUL * size)


def test_what_no_data_tells_keeps_the_start_and_has_no_spread(excited):
    triangles, start, _ = excited
    blind = triangles._replace(parts=tuple(part * _mask(part, 70) for part in triangles.parts))
    found = base_parameters(blind, start)
    place = found.names.index("coulomb6")
    assert triangles.layout.names[70] == "coulomb6"
    assert found.values[place] == start[70]
    assert found.sd[place] == np.inf
    assert not found.determined[place]


def _mask(part, column):
    """Ones but in one column."""
    mask = np.ones(part.shape[1])
    mask[column] = 0.0
    return mask
