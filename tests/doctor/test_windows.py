"""The model over windows against inverse dynamics; least squares over them: planted coefficients,
contact set aside, friction that only takes.
"""

from dataclasses import replace

import numpy as np
import pytest
from moving_arms import FRICTION, exchanged, gravity, moving

from vftcli.doctor.windows import (
    Terms,
    gravity_by_up,
    solve,
    spread,
    up_axes,
    windows_of,
)
from vftcli.robots import load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

UR10E, PANDA = load_robot("ur10e"), load_robot("panda")


def test_inertia_gravity_and_friction_make_the_torque() -> None:
    log = moving("panda")
    windows = windows_of(log, PANDA)
    needed = windows.inertial + windows.gravity[:, :, 2] + FRICTION * windows.motion[:, 0]
    # seven instants of a window and Simpson's rule: .02 N·m at 1.2 rad/s² and 87 N·m
    np.testing.assert_allclose(windows.mean(log.require("torque")), needed, atol=0.1)


@pytest.mark.parametrize("up", [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -0.6, 0.8]])
def test_gravity_is_linear_in_the_direction_that_is_up(up: list[float]) -> None:
    q = np.random.default_rng(3).uniform(-2, 2, (20, 6))
    chain = replace(UR10E.chain, gravity=-9.81 * np.array(up))
    expected = momentum_terms(chain, q, 0 * q).gravity
    base = np.linalg.solve(up_axes(UR10E.chain.gravity) / 9.81, up)
    np.testing.assert_allclose(gravity_by_up(UR10E.chain, q) @ base, expected, atol=1e-9)
    # of a robot file that says its own direction, the third component is it
    own = gravity_by_up(chain, q)[:, :, 2]
    np.testing.assert_allclose(own, expected, atol=1e-9)


def test_axes_stand_upright_by_the_base() -> None:
    np.testing.assert_allclose(up_axes(np.array([0.0, 0.0, -9.81])), 9.81 * np.eye(3), atol=1e-12)
    axes = up_axes(np.array([9.81, 0.0, 0.0])) / 9.81
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(axes[:, 2], [-1.0, 0.0, 0.0], atol=1e-12)


def test_exchanged_joints_are_those_of_an_exchanged_log() -> None:
    log = moving("panda")
    q, dq = exchanged(log.q, 2, 4), exchanged(log.require("dq"), 2, 4)
    expected = windows_of(replace(log, q=q, dq=dq), PANDA)
    found = windows_of(log, PANDA)
    found = found.exchanged(1, 3, np.arange(len(found.first)))
    np.testing.assert_allclose(found.inertial, expected.inertial, atol=1e-9)
    np.testing.assert_allclose(found.motion, expected.motion, atol=1e-12)
    assert len(found.exchanged(1, 3, spread(len(found.first), 10)).first) == 10


def test_windows_are_a_third_of_a_second_and_at_most_two_hundred() -> None:
    windows = windows_of(moving("panda"), PANDA)
    np.testing.assert_allclose(np.ptp(windows.t, axis=1), 0.3, atol=0.005)  # whole steps of 8 ms
    t = 0.01 * np.arange(20_000)
    q = np.tile(np.linspace(0.1, 0.7, 7), (len(t), 1))
    long = windows_of(Recording(t=t, q=q, dq=0 * q), PANDA)
    assert len(long.first) == 200
    assert long.first[0] == 0
    assert long.last[-1] > len(t) - 31
    short = windows_of(Recording(t=t[:11], q=q[:11], dq=0 * q[:11]), PANDA)
    np.testing.assert_array_equal(short.last - short.first, 3)


def test_a_mounted_payload_is_in_the_gravity() -> None:
    log = moving("panda")
    heavy = replace(PANDA, chain=replace(PANDA.chain, mass=2 * PANDA.chain.mass))
    found = windows_of(log, heavy).gravity[:, :, 2]
    np.testing.assert_allclose(found, 2 * windows_of(log, PANDA).gravity[:, :, 2], rtol=1e-9)
    assert gravity(PANDA, log).shape == log.q.shape


def test_things_are_spread_evenly() -> None:
    np.testing.assert_array_equal(spread(4, 5), [0, 1, 2, 3])
    np.testing.assert_array_equal(spread(9, 3), [0, 4, 8])
    np.testing.assert_array_equal(spread(20, 6, 3), [0, 1, 2, 17, 18, 19])


def planted(values: Array, windows: int = 200, joints: int = 3) -> tuple[Array, Array]:
    """A torque of known coefficients, and its columns."""
    rng = np.random.default_rng(7)
    columns = rng.normal(size=(windows, joints, len(values)))
    return columns @ values, columns


def test_coefficients_come_back_and_noise_gives_their_deviation() -> None:
    values = np.array([2.0, -1.0])
    target, columns = planted(values)
    found = solve(target, Terms(columns))
    np.testing.assert_allclose(found.values, values, atol=1e-9)
    assert found.size < 1e-9
    noise = np.random.default_rng(1).normal(size=target.shape)
    found = solve(target + noise, Terms(columns))
    # 600 rows of unit noise: 1/√600 = .04; of it four deviations
    np.testing.assert_allclose(found.values, values, atol=0.17)
    assert np.all((found.sd > 0.01) & (found.sd < 0.08))


def test_a_contact_in_a_quarter_of_the_windows_is_set_aside() -> None:
    values = np.array([2.0, -1.0])
    target, columns = planted(values)
    target[:50] += 30.0
    found = solve(target, Terms(columns))
    np.testing.assert_allclose(found.values, values, atol=1e-9)
    assert not found.kept[:50].any()
    # Without noise all that is left over is rounding, in which windows tie.
    noise = np.random.default_rng(2).normal(scale=1e-6, size=target.shape)
    kept = solve(target + noise, Terms(columns)).kept
    assert not kept[:50].any()
    assert kept.sum() == 140  # seven in ten


def test_what_must_be_positive_is_left_out_where_it_is_not() -> None:
    target, columns = planted(np.array([2.0, -1.0]))
    found = solve(target, Terms(columns, positive=True))
    assert found.values[1] == 0.0
    assert found.values[0] > 0
    both = Terms(columns[:, :, :1], positive=True), Terms(columns[:, :, 1:])
    np.testing.assert_allclose(solve(target, *both).values, [2.0, -1.0], atol=1e-9)


def test_a_column_that_nothing_shows_stays_at_its_prior() -> None:
    target, columns = planted(np.array([2.0]))
    twice = np.concatenate([columns, 1e-3 * columns, 0 * columns], axis=2)
    prior = np.array([np.inf, 1.0, 1.0])
    found = solve(target, Terms(twice, prior=prior))
    assert found.values[0] == pytest.approx(2.0, abs=1e-3)
    assert abs(found.values[1]) < 0.1
    assert found.values[2] == 0.0


def test_no_terms_leave_everything_over() -> None:
    target = np.ones((10, 2))
    found = solve(target, Terms(np.empty((10, 2, 0))))
    assert found.size == 1.0
    np.testing.assert_array_equal(found.by_joint, [1.0, 1.0])
