"""Stability before motion: the discrete condition and the escape bound, each in two ways."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vftcli.admittance.law import (
    Admittance,
    UnstableError,
    check_stable,
    controllers,
    discrete_number,
    escape_factor,
    from_table,
    traditional,
    variable,
)
from vftcli.admittance.motion import release
from vftcli.robots import PROFILES, load_robot


def profile(name: str) -> Admittance:
    """A profile's parameters."""
    robot = load_robot(name)
    return from_table(robot.admittance, robot.name, {})


def spectral_radius(mass: float, damping: float, stiffness: float, period: float) -> float:
    """Of one step of (49)–(51) without force."""
    a = np.array([1.0 - period * damping / mass, -period * stiffness / mass])
    step = np.array([a, [period * a[0], 1.0 + period * a[1]]])
    return float(np.max(np.abs(np.linalg.eigvals(step))))


def test_discrete_condition_is_the_eigenvalues() -> None:
    rng = np.random.default_rng(5)
    for _ in range(300):
        mass, damping, stiffness = rng.uniform(0.1, 10.0, 3)
        damping *= 50.0 * rng.uniform()
        period = rng.uniform(1e-3, 0.5)
        number = float(discrete_number(*map(np.asarray, (mass, damping, stiffness)), period))
        if abs(number - 4.0) > 1e-6:  # on the border the radius is 1 to rounding
            assert (spectral_radius(mass, damping, stiffness, period) < 1.0) == (number < 4.0)


def escapes(xi: float, y: float) -> bool:
    """Whether a release from y runs away, by integrating with the speed-stretched time."""

    def slope(_s: float, state: np.ndarray) -> list[float]:
        u, y = state
        return [np.exp(min(u, 300.0)) * y - 2.0 * xi * u, -u * np.exp(-u)]

    def gone(_s: float, state: np.ndarray) -> float:
        return float(state[0] - 15.0)

    def turned(s: float, state: np.ndarray) -> float:
        return slope(s, state)[0]

    gone.terminal = turned.terminal = True  # type: ignore[attr-defined]
    turned.direction = -1.0  # type: ignore[attr-defined]
    found = solve_ivp(
        slope, [0.0, 1e4], [0.0, y], events=[gone, turned], rtol=1e-9, atol=1e-12, method="Radau"
    )
    return len(found.t_events[0]) > 0


@pytest.mark.slow
@pytest.mark.parametrize("xi", [0.0, 0.510, 0.671, 1.0, 1.0607, 2.7386])
def test_escape_factor_against_a_stiff_integrator(xi: float) -> None:
    bound = escape_factor(xi)
    assert not escapes(xi, bound * (1.0 - 1e-4))  # 1e-4: the integrator's own accuracy
    assert escapes(xi, bound * (1.0 + 1e-4))


def test_escape_factors_of_the_science() -> None:
    """Printed to three digits; 2.653 printed for ξ = 2.74 is not confirmed by either method."""
    found = [escape_factor(xi) for xi in (0.510, 0.671, 1.0, 1.0607)]
    np.testing.assert_allclose(found, [1.006, 1.108, 1.321, 1.362], atol=8e-4)
    assert escape_factor(0.0) == pytest.approx(1.0 / np.sqrt(2.0), rel=1e-9)  # W alone decides
    assert escape_factor(120.0 / (2.0 * np.sqrt(480.0))) == pytest.approx(2.511, abs=1e-3)
    ur5 = variable(replace(profile("ur5"), alpha=1.0))
    assert ur5.escape[[0, 3]] == pytest.approx([0.616, 0.495], abs=1e-3)
    # At the position's speed limit, two digits.
    numbers = [variable(profile(name)).recovery[0] for name in ("ur5", "panda")]
    assert numbers == pytest.approx([0.11, 0.22], abs=5e-3)


@pytest.mark.parametrize("name", [name for name in PROFILES if load_robot(name).admittance])
def test_every_profile_is_stable(name: str) -> None:
    complaints = check_stable(controllers(profile(name)))
    assert complaints == ()


def test_unstable_settings_are_refused_with_the_number() -> None:
    robot = load_robot("ur5")
    slow = from_table(robot.admittance, "ur5", {"admittance": {"period": 0.5}})
    with pytest.raises(UnstableError, match=r"axis rx, drag phase: .* = 4\.25 must be below 4"):
        check_stable(controllers(slow))
    complaints = check_stable(controllers(slow), anyway=True)
    assert len(complaints) > 1
    free = from_table(robot.admittance, "ur5", {"rotation": {"speed_limit": np.inf}})
    with pytest.raises(UnstableError, match=r"axis rx has no speed limit.*beyond 0\.31 rad"):
        check_stable(controllers(free))
    check_stable([traditional(free)])  # constant parameters need no limit


def test_a_release_is_excused_only_inside_the_escape_bound_of_its_axes() -> None:
    robot = load_robot("ur5")
    free = from_table(robot.admittance, "ur5", {"rotation": {"speed_limit": np.inf}})
    near, far = np.array([0, 0, 0, 0.3, 0, 0]), np.array([0, 0, 0, 0.3, 0.4, 0])
    complaints = check_stable(controllers(free), release=near)
    assert {remark.code for remark in complaints} == {"law-escapes"}
    assert {remark.values["axis"] for remark in complaints} == {"rx", "ry", "rz"}
    with pytest.raises(UnstableError, match=r"axis ry has no speed limit.*beyond 0\.31 rad"):
        check_stable(controllers(free), release=far)


def test_the_condition_decides_what_happens() -> None:
    """Just beyond the condition a constant-parameter release grows, just inside it decays."""
    period = 0.008
    for share, decays in ((0.97, True), (1.03, False)):
        damping = share * (4.0 - period**2 * 8.0 / 3.0) / (2.0 * period) * 3.0
        p = replace(profile("ur5"), damping=np.full(6, damping))
        motion = release([traditional(p)], np.array([0.1, 0, 0, 0, 0, 0]), 3.0)
        assert (np.abs(motion.v[-1, 0, 0]) < 0.1) == decays
