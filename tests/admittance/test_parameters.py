"""Parameters from profiles and assignments, and one clear line for each that is wrong."""

import numpy as np
import pytest

from vftcli.admittance import ControlChoice
from vftcli.admittance.law import AXES, controllers, from_table, parse_settings
from vftcli.admittance.replay import release_deviation
from vftcli.robots import load_robot
from vftcli.signals.errors import ParameterError


def read(robot: str = "ur5", *assignments: str):
    """A profile's parameters with assignments."""
    return from_table(load_robot(robot).admittance, robot, parse_settings(assignments))


def test_table_iii_and_iv() -> None:
    """The paper's Tables III and IV."""
    ur, panda = read("ur5"), read("panda")
    np.testing.assert_array_equal(ur.mass, [3, 3, 3, 0.1, 0.1, 0.1])
    np.testing.assert_array_equal(ur.damping, [5, 5, 5, 0.3, 0.3, 0.3])
    np.testing.assert_array_equal(ur.stiffness, [8, 8, 8, 0.5, 0.5, 0.5])
    np.testing.assert_array_equal(ur.threshold, [20, 20, 20, 6, 6, 6])
    np.testing.assert_array_equal(panda.mass, [40, 40, 40, 4, 4, 4])
    np.testing.assert_array_equal(panda.damping, [120, 120, 120, 6, 6, 6])
    np.testing.assert_array_equal(panda.stiffness, [12, 12, 12, 2, 2, 2])
    np.testing.assert_array_equal(panda.alpha, [6, 6, 6, 3, 3, 3])
    np.testing.assert_array_equal(panda.threshold, [4, 4, 15, 2, 2, 2])
    assert (ur.period, panda.period, ur.alpha[0]) == (0.008, 0.0025, 1.6)
    # B_d/(2√(M_d K_d)) as the science prints it
    np.testing.assert_allclose(ur.xi[[0, 3]], [0.510, 0.671], atol=5e-4)
    np.testing.assert_allclose(panda.xi[[0, 3]], [2.74, 1.06], atol=5e-3)


def test_assignments_reach_their_axes() -> None:
    p = read("ur5", "position.stiffness=9", "z.threshold=15", "xi=1", "rotation.mass=0.1,0.2,0.3")
    np.testing.assert_array_equal(p.stiffness, [9, 9, 9, 0.5, 0.5, 0.5])
    np.testing.assert_array_equal(p.threshold, [20, 20, 15, 6, 6, 6])
    np.testing.assert_array_equal(p.mass, [3, 3, 3, 0.1, 0.2, 0.3])
    np.testing.assert_array_equal(p.xi, np.ones(6))
    part = read("ur5", "position.xi=1")
    np.testing.assert_allclose(part.xi, np.r_[[1.0] * 3, [0.6708204] * 3], rtol=1e-7)
    assert np.isinf(read("ur5", "rotation.speed_limit=none").speed_limit[3])


def test_which_assignments_are_ours() -> None:
    ours = ["xi=1", "admittance.xi=1", "position.mass=3", "rz.threshold=4"]
    theirs = ["kfo.noise_convention=discrete", "gmo.gain=30"]
    assert all(map(ControlChoice.takes, ours))
    assert not any(map(ControlChoice.takes, theirs))


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("admittance.alpha=0", "admittance.alpha of axis x is 0; it must be positive"),
        ("rz.alpha=-1", "admittance.alpha of axis rz is -1; it must be positive"),
        ("xi=0", "admittance.xi of axis x is 0; it must be positive"),
        ("position.mass=0", "admittance.mass of axis x is 0; it must be positive"),
        ("y.stiffness=-8", "admittance.stiffness of axis y is -8; it must be positive"),
        ("z.damping=-1", "admittance.damping of axis z is -1; it must be zero or positive"),
        ("rx.threshold=nan", "no admittance threshold for rx; give it in its"),
        ("rotation.speed_limit=nan", "no admittance speed_limit for rx, ry, rz; give it in its"),
        ("position.hysteresis=1", "share of the threshold and must be below 1"),
        ("period=0", "the control period must be positive"),
        ("position.mass=1,2", "position.mass has 2 values; give one, or one for each of 3"),
        ("position.mass=heavy", "'heavy' is not a number or a list"),
        ("threshold_mode=medium", "there is hard, soft"),
        ("position.weight=3", "no such admittance parameter"),
        ("sideways.mass=3", "no such admittance parameter"),
        ("position.period=0.01", "no such admittance parameter"),
        ("start=1", "no such admittance parameter"),
    ],
)
def test_wrong_parameters_are_one_clear_line(assignment: str, words: str) -> None:
    with pytest.raises(ParameterError) as raised:
        read("ur5", assignment)
    assert words in str(raised.value)
    assert "\n" not in str(raised.value)


def test_missing_section_names_what_is_missing() -> None:
    with pytest.raises(ParameterError, match="no admittance mass for x, y, z, rx, ry, rz"):
        from_table({}, "mine", {})
    partial = {"period": 0.01, "position": {"mass": 1.0}}
    with pytest.raises(ParameterError, match="no admittance mass for rx, ry, rz"):
        from_table(partial, "mine", {})


def test_controllers_of_a_comparison() -> None:
    p = read("panda")
    names = [c.name for c in controllers(p)]
    assert names == ["traditional", "α = 6 / 3"]
    assert [c.name for c in controllers(p, "variable", [1.0, 1.9])] == ["α = 1", "α = 1.9"]
    with pytest.raises(ParameterError, match="there is traditional, variable"):
        ControlChoice(kind="adaptive")
    with pytest.raises(ParameterError, match="alpha of axis x is 0"):
        controllers(p, alphas=[0.0])


def test_release_deviation() -> None:
    np.testing.assert_array_equal(release_deviation(["x=0.3,rz=-1"]), [0.3, 0, 0, 0, 0, -1])
    for text in ("q=1", "x", "x=much", "x=inf"):
        with pytest.raises(ParameterError, match=f"axis of {', '.join(AXES)}"):
            release_deviation([text])
    np.testing.assert_array_equal(release_deviation(["rx=3.14"])[3], 3.14)
    with pytest.raises(ParameterError, match="turns by 4 rad; it must be less than π"):
        release_deviation(["rx=2.4,ry=-3.2"])
