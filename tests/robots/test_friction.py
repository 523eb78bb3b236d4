"""Friction models at the points where their value is plain."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vftcli.robots import PROFILES, JointFriction, load_robot
from vftcli.robots.friction import (
    bent_line,
    coulomb_logarithmic,
    coulomb_viscous,
    dry_friction,
    dry_torque,
    falling_friction,
    falling_speed,
    friction_torque,
    sigmoid,
    steady_torque,
)
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.profile import robot_toml
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.recording import Recording


def test_coulomb_viscous_at_speed_is_the_sum_of_its_parts() -> None:
    # tanh(0.5/0.01) is 1 to the last bit
    torque = coulomb_viscous(np.array([0.5, -0.5]), 6.3, 14.2, -4.5, 0.2)
    np.testing.assert_allclose(
        torque, [0.2 + 6.3 + 7.1 - 1.125, 0.2 - 6.3 - 7.1 + 1.125], rtol=1e-14
    )


def test_coulomb_is_smoothed_through_zero() -> None:
    assert coulomb_viscous(np.array([0.0]), 6.3, 14.2)[0] == 0.0
    np.testing.assert_allclose(
        coulomb_viscous(np.array([0.01]), 6.3, 0.0), 6.3 * np.tanh(1.0), rtol=1e-15
    )


# Joint test of a UR5e, mean of its size-3 joints [rad/s, N·m].
SPEEDS, TORQUES = (0.01, 0.5, 1.5, 3.2), (5.73, 9.32, 13.58, 18.72)


def test_the_bent_line_runs_through_its_points_and_on() -> None:
    """Between the points as `numpy.interp`, constant below, the last stretch's slope beyond."""
    speed = np.concatenate([np.linspace(0.001, 3.2, 400), SPEEDS])
    for sign in (1.0, -1.0):
        # the sign is there at .001 rad/s already
        torque = bent_line(sign * speed, SPEEDS, TORQUES, smoothing=1e-5)
        # sums of a dozen N·m: rounding
        np.testing.assert_allclose(torque, sign * np.interp(speed, SPEEDS, TORQUES), atol=1e-13)
    slope = (18.72 - 13.58) / 1.7
    beyond = bent_line(np.array([4.0]), SPEEDS, TORQUES)
    np.testing.assert_allclose(beyond, 18.72 + 0.8 * slope, rtol=1e-14)
    slow = bent_line(np.array([0.004]), SPEEDS, TORQUES, smoothing=0.01)
    np.testing.assert_allclose(slow, 5.73 * np.tanh(0.4), rtol=1e-14)


def test_joints_of_points_are_taken_together_and_feel_their_load() -> None:
    one = JointFriction(model="points", speeds=SPEEDS, torques=TORQUES)
    other = JointFriction(
        model="points",
        parameters={"load_coulomb": 0.1, "offset": 0.5},
        speeds=(0.1, 1.0),
        torques=(1.0, 2.0),
    )
    last = JointFriction(model="points", speeds=SPEEDS, torques=(1.0, 1.0, 1.0, 1.0))
    torque = friction_torque((one, other, last), np.ones((1, 3)), np.full((1, 3), -30.0))
    # between the second and third point; 2 + .1·30 + .5; constant (tanh(100) is 1)
    np.testing.assert_allclose(torque, [[9.32 + 0.5 * 4.26, 5.5, 1.0]], rtol=1e-14)
    np.testing.assert_array_equal(dry_friction((one, other, last), 3), [5.73, 1.0, 1.0])


def test_presliding_friction_holds_and_falls_nowhere() -> None:
    values = {"coulomb": 2.0, "viscous": 1.0, "presliding": 3.0, "presliding_length": 1e-3}
    joint = JointFriction(model="coulomb-viscous", parameters=values)
    np.testing.assert_array_equal(dry_friction((joint,), 1), [5.0])  # a + b
    np.testing.assert_allclose(steady_torque(joint, np.array([-0.5, 0.5])), [-5.5, 5.5])
    assert np.isnan(falling_speed(joint, 2.0))
    falling = JointFriction(model="coulomb-viscous", parameters={**values, "viscous": -1.0})
    assert np.isfinite(falling_speed(falling, 2.0))


def test_sigmoid_is_zero_at_rest_and_spans_its_amplitude() -> None:
    assert sigmoid(np.array([0.0]), 0.5, 5.0, 0.04)[0] == 0.0
    span = sigmoid(np.array([1e3]), 0.5, 5.0, 0.04) - sigmoid(np.array([-1e3]), 0.5, 5.0, 0.04)
    np.testing.assert_allclose(span, 0.5, rtol=1e-12)  # the tails of the exponential are gone


def test_joints_of_different_models_are_kept_apart() -> None:
    friction = (
        JointFriction(model="coulomb-viscous", parameters={"coulomb": 2.0, "viscous": 1.0}),
        JointFriction(),
        JointFriction(model="sigmoid", parameters={"amplitude": 1.0, "slope": 9.0, "shift": 0.0}),
    )
    dq = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, -1.0]])
    torque = friction_torque(friction, dq)
    np.testing.assert_allclose(torque[:, 0], [3.0, -3.0], rtol=1e-14)
    assert not np.any(torque[:, 1])
    np.testing.assert_allclose(torque[:, 2], sigmoid(dq[:, 2], 1.0, 9.0, 0.0))


def test_an_unknown_model_is_named() -> None:
    with pytest.raises(ParameterError, match="no friction model 'sticky'; there is"):
        friction_torque((JointFriction(model="sticky", parameters={"x": 1.0}),), np.ones((2, 1)))


@pytest.mark.parametrize("smoothing", [0.001, 0.01, 0.2])
def test_dry_friction_is_half_the_step_whatever_smooths_it(smoothing: float) -> None:
    """Taken at some low speed it was .46 of a sign smoothed over 0.1 rad/s, and viscous in part."""
    values = {"coulomb": 4.0, "viscous": 30.0, "smoothing": smoothing, "offset": 1.0}
    robot = (JointFriction(model="coulomb-viscous-offset", parameters=values),)
    fast = 20.0 * smoothing  # tanh(20) is 1 to the last digit
    there, back = (friction_torque(robot, np.array([[v]]))[0, 0] for v in (fast, -fast))
    step = 0.5 * (there - back) - values["viscous"] * fast
    np.testing.assert_allclose(dry_friction(robot, 1), [step], rtol=1e-12)


STRIBECK = {"coulomb": 3.0, "viscous": 1.0, "stribeck": 2.0, "stribeck_velocity": 0.1}


def test_dry_friction_of_every_model() -> None:
    robot = (
        JointFriction(model="coulomb-viscous-stribeck", parameters=STRIBECK),
        JointFriction(
            model="sigmoid", parameters={"amplitude": -1.5, "slope": 10.0, "shift": 0.1}
        ),
        JointFriction(),
    )
    # at breakaway; a sigmoid's two saturations lie its amplitude apart
    np.testing.assert_array_equal(dry_friction(robot, 3), [5.0, 0.75, 0.0])
    ends = sigmoid(np.array([-50.0, 50.0]), -1.5, 10.0, 0.1)
    np.testing.assert_allclose(0.5 * abs(ends[1] - ends[0]), 0.75)
    np.testing.assert_array_equal(dry_friction((), 4), np.zeros(4))


def test_dry_friction_grows_with_the_load_either_way() -> None:
    joint = JointFriction(
        model="coulomb-viscous-load", parameters={"coulomb": 3.0, "load_coulomb": 0.1}
    )
    np.testing.assert_allclose(dry_torque(joint, np.array([-20.0, 0.0, 20.0])), [5.0, 3.0, 5.0])


SIZE = st.floats(0.01, 50.0)
"""Of a friction parameter; the UR's are .4 to 17. [N·m, rad/s]"""

SPEED = st.floats(0.0, 7.0)
"""Up to what the fastest UR joint does, 6.48 rad/s. [rad/s]"""


@given(SIZE, SIZE, SIZE, SPEED, SPEED)
def test_the_logarithmic_friction_takes_energy_and_never_falls(c, a, b, one, other) -> None:
    slow, fast = sorted((one, other))
    dq = np.array([-fast, -slow, 0.0, slow, fast])
    torque = coulomb_logarithmic(dq, a, b, coulomb=c)
    assert np.all(torque * dq >= 0.0)
    assert np.all(np.diff(torque) >= -1e-13 * (1.0 + torque[-1]))  # rounding of equal speeds
    np.testing.assert_array_equal(torque, -torque[::-1])
    assert torque[2] == 0.0


@given(SIZE, SIZE, st.floats(0.2, 7.0))
def test_the_logarithmic_friction_rises_as_its_derivative_says(a, b, speed) -> None:
    h = 1e-5
    ends = coulomb_logarithmic(np.array([speed - h, speed + h]), a, b, coulomb=1.0)
    # central differences: h²/3 of the third derivative, 2a/(b + v)³, and rounding of the torque
    error = h**2 * a / (b + speed) ** 3 + 1e-15 * ends[1] / h
    assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(a / (b + speed), abs=error, rel=1e-9)


@pytest.mark.parametrize("name", ["ur5", "ur5e"])
@pytest.mark.parametrize(
    ("joint", "points", "scale", "at"),
    [
        # joint test of a UR5e at 44.6 and 43.8 °C [N·m]; the profiles stand at 35 °C
        *((j, TORQUES, 1.128, 44.6) for j in (0, 2)),
        *((j, (1.25, 1.95, 2.74, 3.71), 1.193, 43.8) for j in (3, 4, 5)),
        # the feed-forward of a UR5e's loaded joint 2 follows .87 to .89 of the law
        (1, TORQUES, 0.88 * 1.128, 44.6),
    ],
)
def test_profiles_rub_as_the_joint_test_says(name, joint, points, scale, at) -> None:
    """The points carried to 35 °C, and on a UR5e back again at the temperature of the test."""
    friction = load_robot(name).friction[joint]
    assert friction.speeds == SPEEDS
    # the scales have four digits
    np.testing.assert_allclose(friction.torques, scale * np.array(points), rtol=5e-4)
    if name == "ur5e":
        back = friction_torque(
            (friction,), np.array(SPEEDS[1:])[:, None], temperature=np.full((3, 1), at)
        )
        share = 0.88 if joint == 1 else 1.0
        # three decimals of the torques; tanh(50) is 1 to rounding
        np.testing.assert_allclose(back[:, 0], share * np.array(points[1:]), rtol=5e-4)


def test_loaded_joints_of_a_ur5e_rub_more() -> None:
    robot = load_robot("ur5e")
    dq, carried = np.full((1, 6), 0.5), np.array([[0.0, 45.0, 20.0, 0.0, 0.0, 0.0]])
    more = friction_torque(robot.friction, dq, carried) - friction_torque(robot.friction, dq)
    # .067 of the torque on joint 2, .01 to .02 on joint 3
    np.testing.assert_allclose(
        more, [[0.0, 0.067 * 45.0, 0.015 * 20.0, 0.0, 0.0, 0.0]], atol=1e-12
    )


def test_the_ur10e_profile_rubs_as_its_controller_does() -> None:
    """A line through points of the feed-forward read off real logs, and each curve's rms to it."""
    speeds = (0.01, 0.5, 1.5, 1.9)
    points = [(17.66, 29.59, 40.47, 44.2), (16.82, 28.75, 38.74), (6.61, 12.57, 20.06)]
    points += [(3.09, 5.17, 7.12, 8.0), (3.42, 4.81, 6.62), (3.09, 5.13, 7.64)]
    for joint, expected, rms in zip(
        load_robot("ur10e").friction, points, (0.37, 0.34, 0.13, 0.09, 0.04, 0.05), strict=True
    ):
        known = np.array(speeds[: len(expected)])
        dq = np.linspace(known[0], known[-1], 400)
        curve = coulomb_logarithmic(dq, **{**joint.parameters, "smoothing": 1e-4})
        found = np.sqrt(np.mean((curve - np.interp(dq, known, expected)) ** 2))
        assert found == pytest.approx(rms, abs=0.01)


def test_a_parabola_turns_down_where_its_slope_is_zero() -> None:
    # wrist 1 of the UR10e as it was: 5.246 − 2·2.15 v = 0 at 1.22 rad/s
    values = {"coulomb": 2.95, "viscous": 5.246, "quadratic": -2.15}
    joint = JointFriction(model="coulomb-viscous-quadratic", parameters=values)
    step = np.pi / 500  # of the speeds looked at
    assert falling_speed(joint, np.pi) == pytest.approx(5.246 / 4.3, abs=2 * step)
    assert np.isnan(falling_speed(joint, 1.2))
    assert np.isnan(falling_speed(joint, np.nan))
    (remark,) = falling_friction((joint, joint), np.array([1.2, np.pi]))
    assert (remark.code, remark.level) == ("falling-friction", "warning")
    assert remark.where.joints == (2,)
    assert "1.2 rad/s" in str(remark)


@pytest.mark.parametrize(
    ("model", "values", "falls"),
    [
        ("coulomb-viscous", {"coulomb": -1.0, "viscous": 5.0}, True),
        ("coulomb-viscous", {"coulomb": 0.0, "viscous": -1.0}, True),
        ("coulomb-viscous-offset", {"coulomb": 1.0, "viscous": 0.0, "offset": -3.0}, False),
        ("coulomb-viscous-stribeck", STRIBECK, False),
        ("sigmoid", {"amplitude": 1.0, "slope": 9.0, "shift": 0.1}, False),
        ("sigmoid", {"amplitude": 1.0, "slope": -9.0, "shift": 0.1}, True),
        ("none", {}, False),
    ],
)
def test_what_falls_and_what_does_not(model, values, falls) -> None:
    assert np.isfinite(falling_speed(JointFriction(model=model, parameters=values), 2.0)) == falls


@pytest.mark.parametrize("name", PROFILES)
def test_no_profile_has_friction_that_falls(name: str) -> None:
    robot = load_robot(name)
    assert falling_friction(robot.friction, robot.limits.qd_max) == []


POINTS = """model = "points"
speeds = [0.01, 0.5, 1.5, 3.2]
torques = [5.73, 9.32, 13.58, 18.72]
load_coulomb = 0.067
smoothing = 0.003
offset = -0.2
presliding = 2.0
presliding_length = 3e-4
temperature = [3.637679, -0.011074, 1.362321, -0.085741]
temperature_at = 44.6
"""


def arm_with(friction: str, folder: Path) -> Path:
    """The Panda, its first joint's friction replaced."""
    head, _, rest = PROFILES["panda"].read_text(encoding="utf-8").partition("[joints.friction]\n")
    _, _, others = rest.partition("\n\n")
    path = folder / "arm.toml"
    path.write_text(f"{head}[joints.friction]\n{friction}\n{others}", encoding="utf-8")
    return path


def test_they_are_read_and_written_back(tmp_path: Path) -> None:
    robot = load_robot(arm_with(POINTS, tmp_path))
    joint = robot.friction[0]
    assert joint.model == "points"
    assert joint.speeds == (0.01, 0.5, 1.5, 3.2)
    assert joint.torques == (5.73, 9.32, 13.58, 18.72)
    assert joint.temperature == (3.637679, -0.011074, 1.362321, -0.085741)
    assert joint.temperature_at == 44.6
    values = {"load_coulomb": 0.067, "smoothing": 0.003, "offset": -0.2}
    assert joint.parameters == values | {"presliding": 2.0, "presliding_length": 3e-4}
    again = tmp_path / "again.toml"
    again.write_text(robot_toml(robot), encoding="utf-8")
    assert load_robot(again).friction == robot.friction


def test_presliding_and_temperature_stand_beside_any_model(tmp_path: Path) -> None:
    more = "".join(POINTS.partition("presliding")[1:])
    sigmoid = 'model = "sigmoid"\namplitude = 1.0\nslope = 5.0\nshift = 0.1\n'
    joint = load_robot(arm_with(sigmoid + more, tmp_path)).friction[0]
    assert (joint.parameters["presliding"], joint.temperature_at) == (2.0, 44.6)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("presliding = 2.0", "presliding = -2.0", r"presliding is -2 N·m; on a robot it is"),
        (
            "presliding_length = 3e-4",
            "presliding_length = 0.0",
            "presliding_length is 0 rad; on a",
        ),
        (
            "presliding_length = 3e-4",
            "presliding_length = 3.0",
            "presliding_length is 3 rad; on a",
        ),
        ("presliding_length = 3e-4\n", "", "presliding_length is missing; presliding needs it"),
        ("presliding = 2.0\n", "", "presliding is missing; presliding_length needs it"),
        ("temperature_at = 44.6\n", "", "temperature_at is missing; temperature needs it"),
        ("temperature_at = 44.6", "temperature_at = 308", "temperature_at is 308 °C; on a robot"),
        ("3.637679", "-3.637679", "line .*temperature makes friction"),
        ("-0.085741]", "-0.085741, 1.0]", "temperature is .*; it must be 4 finite numbers"),
        ("speeds = [0.01, 0.5, 1.5, 3.2]\n", "", "speeds is missing; it must be a list of at"),
        ("0.01, 0.5, 1.5, 3.2", "0.01", r"speeds is \[0.01\]; it must be a list of at least 2"),
        (
            "0.01, 0.5, 1.5, 3.2",
            "0.01, 0.5, 0.5, 3.2",
            "speeds is .*; each must be above the one",
        ),
        ("0.01, 0.5, 1.5, 3.2", "0.0, 0.5, 1.5, 3.2", "speeds is 0 rad/s; on a robot it is"),
        ("0.01, 0.5, 1.5, 3.2", "0.01, 0.5, 1.5", "there are 4 torques for 3 speeds"),
        ("5.73, 9.32", "nan, 9.32", "torques is .*; it must be a list of at least 2 finite"),
        ("5.73, 9.32", "1e9, 9.32", r"torques is 1e\+09 N·m; on a robot it is"),
    ],
)
def test_what_no_joint_has_is_refused(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert old in POINTS
    with pytest.raises(RobotError, match=words):
        load_robot(arm_with(POINTS.replace(old, new), tmp_path))


LOADED = JointFriction(
    model="coulomb-viscous-load", parameters={"coulomb": 2.0, "viscous": 1.0, "load_coulomb": 0.1}
)
PLAIN = JointFriction(model="coulomb-viscous", parameters={"coulomb": 2.0, "viscous": 1.0})


def test_the_load_adds_to_the_coulomb_torque_of_its_own_joints_whatever_its_sign():
    dq, friction = np.array([[0.5, -0.5, 0.5]]), (LOADED, LOADED, PLAIN)
    for load in (30.0, -30.0):
        torque = friction_torque(friction, dq, np.full((1, 3), load))
        # 2 + 0.1·30 + 1·0.5; tanh(50) is 1 to rounding
        np.testing.assert_allclose(torque, [[5.5, -5.5, 2.5]], rtol=1e-14)
    assert np.array_equal(friction_torque(friction, dq), friction_torque((PLAIN,) * 3, dq))


def test_the_stribeck_term_fades():
    slow, fast = coulomb_viscous(
        np.array([0.05, 2.0]), 2.0, 0.0, smoothing=1e-3, stribeck=1.0, stribeck_velocity=0.05
    )
    # e⁻¹ at the Stribeck velocity, nothing far above it (analytic)
    assert slow == pytest.approx(2.0 + np.exp(-1.0), rel=1e-12)
    assert fast == pytest.approx(2.0, rel=1e-12)


def test_the_terms_use_the_gravity_torque_as_load():
    from dataclasses import replace

    robot = load_robot("ur5")
    rng = np.random.default_rng(0)
    q, dq, current = rng.uniform(-1, 1, (3, 20, 6))
    recording = Recording(t=0.008 * np.arange(20), q=q, dq=dq, current=current)
    rough = replace(robot, friction=(LOADED,) * 6)
    gravity = momentum_terms(robot.loaded_chain, q, dq).gravity
    expected = friction_torque(rough.friction, dq, gravity)
    smooth = dynamics_terms(recording, robot.without_friction())
    # differences of torques of 10²: rounding
    np.testing.assert_allclose(
        smooth.mu - dynamics_terms(recording, rough).mu, expected, atol=1e-12
    )
    literal = dynamics_terms(recording, rough, literal=True)
    # the paper's numeric method is good to 5e-6 N·m
    np.testing.assert_allclose(literal.mu, dynamics_terms(recording, rough).mu, atol=5e-5)


def test_a_file_needs_the_models_keys(tmp_path):
    from vftcli.robots import PROFILES

    text = PROFILES["ur10e"].read_text(encoding="utf-8")
    path = tmp_path / "arm.toml"
    model = 'model = "coulomb-logarithmic"'
    path.write_text(text.replace(model, 'model = "coulomb-viscous-load"', 1), encoding="utf-8")
    with pytest.raises(RobotError, match="viscous is missing"):
        load_robot(path)
    with_velocity = 'model = "coulomb-logarithmic"\nstribeck = 1.0\nstribeck_velocity = 0.0'
    path.write_text(text.replace(model, with_velocity, 1), encoding="utf-8")
    with pytest.raises(
        RobotError, match=r"stribeck_velocity is 0 rad/s; on a robot it is within"
    ):
        load_robot(path)
