"""Friction models where their value is plain, their dry part, their temperature, their file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.robots import PROFILES, JointFriction, load_robot
from vftcli.robots.friction import (
    RunningFriction,
    dry_friction,
    dry_torque,
    falling_friction,
    falling_speed,
    friction_factor,
    friction_torque,
    measured_temperature,
    play,
    steady_torque,
    warmth,
)
from vftcli.robots.kernels import CHUNK, momentum_terms
from vftcli.robots.profile import robot_toml
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.recording import Recording

# Joint test of a UR5e, mean of its size-3 joints [rad/s, N·m].
SPEEDS, TORQUES = (0.01, 0.5, 1.5, 3.2), (5.73, 9.32, 13.58, 18.72)
STRIBECK = {"coulomb": 3.0, "viscous": 1.0, "stribeck": 2.0, "stribeck_velocity": 0.1}
SLOW_STRIBECK = STRIBECK | {"stribeck_velocity": 0.5}
SIGMOID = {"amplitude": -1.5, "slope": 10.0, "shift": 0.1}


def joint(model: str, **values: float) -> JointFriction:
    return JointFriction(model=model, parameters=values)


def points(torques=TORQUES, speeds=SPEEDS, **values: float) -> JointFriction:
    return JointFriction(model="points", parameters=values, speeds=speeds, torques=torques)


LOADED = joint("coulomb-viscous-load", coulomb=2.0, viscous=1.0, load_coulomb=0.1)
LOGARITHMIC = joint("coulomb-logarithmic", coulomb=2.0, logarithmic=3.0, logarithmic_velocity=1.2)


@pytest.mark.parametrize(
    ("friction", "expected"),
    [
        (joint("coulomb-viscous", coulomb=6.3, viscous=14.2), 6.3 + 7.1),
        (joint("coulomb-viscous", coulomb=6.3, viscous=0.0, smoothing=0.5), 6.3 * np.tanh(1.0)),
        (joint("coulomb-viscous-quadratic", coulomb=6.3, viscous=14.2, quadratic=-4.5), 12.275),
        (joint("coulomb-viscous-stribeck", **STRIBECK), 3.5 + 2.0 * np.exp(-25.0)),
        (joint("coulomb-viscous-stribeck", **SLOW_STRIBECK), 3.5 + 2.0 * np.exp(-1.0)),
        (LOGARITHMIC, 2.0 + 3.0 * np.log(1.0 + 0.5 / 1.2)),
        (LOADED, 2.0 + 0.1 * 30.0 + 0.5),
        (points(), 9.32),
        (points((1.0, 2.0), (0.1, 1.0), load_coulomb=0.1), 1.0 + 0.4 / 0.9 + 3.0),
        (JointFriction(), 0.0),
    ],
)
def test_friction_at_half_a_radian_a_second_under_a_load(friction, expected):
    """The same backwards and under the opposite load, none at rest; beside it a constant offset.

    tanh(50) of the smoothing is 1 to rounding.
    """
    dq, load = np.array([[0.5], [-0.5], [0.0]]), np.array([[30.0], [-30.0], [30.0]])
    torque = friction_torque((friction,), dq, load)
    np.testing.assert_allclose(torque[:, 0], [expected, -expected, 0.0], rtol=1e-9)
    if friction.model != "none":
        off = replace(friction, parameters={**friction.parameters, "offset": 0.2})
        np.testing.assert_allclose(friction_torque((off,), dq, load), torque + 0.2, rtol=1e-12)


def test_joints_are_kept_apart_and_feel_their_own_load():
    """A sigmoid is zero at rest and runs over its amplitude."""
    arm = (LOADED, JointFriction(), joint("sigmoid", **SIGMOID), points())
    dq = np.array([[1.0, 1.0, 1e3, 1.0], [-1.0, -1.0, -1e3, -1.0], [0.0] * 4])
    torque = friction_torque(arm, dq, np.full((3, 4), -30.0))
    np.testing.assert_allclose(torque[:, 0], [6.0, -6.0, 0.0], rtol=1e-14)
    begin = -1.5 / (1.0 + np.exp(-1.0))
    np.testing.assert_allclose(torque[:, 2], [-1.5 - begin, -begin, 0.0], rtol=1e-12)
    np.testing.assert_allclose(torque[:, 3], [11.45, -11.45, 0.0], rtol=1e-14)
    assert not torque[:, 1].any()
    with pytest.raises(ParameterError, match="no friction model 'sticky'; there is"):
        friction_torque((joint("sticky", x=1.0),), np.ones((2, 1)))


def test_the_bent_line_runs_through_its_points_and_on():
    """Between the points as `numpy.interp`, constant below, the last stretch's slope beyond."""
    speed = np.concatenate([np.linspace(0.001, 3.2, 400), SPEEDS, [4.0]])
    # the sign is there at .001 rad/s already
    torque = friction_torque((points(smoothing=1e-5),), speed[:, None])[:, 0]
    # sums of a dozen N·m: rounding
    np.testing.assert_allclose(torque[:-1], np.interp(speed[:-1], SPEEDS, TORQUES), atol=1e-13)
    assert torque[-1] == pytest.approx(18.72 + 0.8 * (18.72 - 13.58) / 1.7, rel=1e-14)


def test_presliding_friction_holds_and_falls_nowhere():
    values = {"coulomb": 2.0, "viscous": 1.0, "presliding": 3.0, "presliding_length": 1e-3}
    giving = joint("coulomb-viscous", **values)
    np.testing.assert_array_equal(dry_friction((giving,), 1), [5.0])  # a + b
    np.testing.assert_allclose(steady_torque(giving, np.array([-0.5, 0.5])), [-5.5, 5.5])
    assert np.isnan(falling_speed(giving, 2.0))
    falling = joint("coulomb-viscous", **values | {"viscous": -1.0})
    assert np.isfinite(falling_speed(falling, 2.0))


def test_dry_friction_is_half_the_step_whatever_smooths_it():
    """Taken at some low speed it was .46 of a sign smoothed over 0.1 rad/s, and viscous in part."""
    values = {"coulomb": 4.0, "viscous": 30.0, "smoothing": 0.2, "offset": 1.0}
    arm = (
        joint("coulomb-viscous-offset", **values),
        joint("coulomb-viscous-stribeck", **STRIBECK),  # at breakaway
        joint("sigmoid", **SIGMOID),  # its two saturations lie its amplitude apart
        points(),
        JointFriction(),
    )
    np.testing.assert_array_equal(dry_friction(arm, 5), [4.0, 5.0, 0.75, 5.73, 0.0])
    np.testing.assert_array_equal(dry_friction((), 4), np.zeros(4))
    # it grows with the load either way
    np.testing.assert_allclose(dry_torque(LOADED, np.array([-20.0, 0.0, 20.0])), [4.0, 2.0, 4.0])


@pytest.mark.parametrize("name", ["ur5", "ur5e"])
@pytest.mark.parametrize(
    ("number", "points", "scale", "at"),
    [
        # joint test of a UR5e at 44.6 and 43.8 °C [N·m]; the profiles stand at 35 °C
        *((j, TORQUES, 1.128, 44.6) for j in (0, 2)),
        *((j, (1.25, 1.95, 2.74, 3.71), 1.193, 43.8) for j in (3, 4, 5)),
        # the feed-forward of a UR5e's loaded joint 2 follows .87 to .89 of the law
        (1, TORQUES, 0.88 * 1.128, 44.6),
    ],
)
def test_profiles_rub_as_the_joint_test_says(name, number, points, scale, at):
    """The points carried to 35 °C, and on a UR5e back again at the temperature of the test."""
    friction = load_robot(name).friction[number]
    assert friction.speeds == SPEEDS
    # the scales have four digits
    np.testing.assert_allclose(friction.torques, scale * np.array(points), rtol=5e-4)
    if name == "ur5e":
        dq, T = np.array(SPEEDS[1:])[:, None], np.full((3, 1), at)
        back = friction_torque((friction,), dq, temperature=T)
        share = 0.88 if number == 1 else 1.0
        # three decimals of the torques; tanh(50) is 1 to rounding
        np.testing.assert_allclose(back[:, 0], share * np.array(points[1:]), rtol=5e-4)


def test_loaded_joints_of_a_ur5e_rub_more():
    """By .067 of the torque on joint 2, .01 to .02 on joint 3."""
    robot = load_robot("ur5e")
    dq, carried = np.full((1, 6), 0.5), np.array([[0.0, 45.0, 20.0, 0.0, 0.0, 0.0]])
    more = friction_torque(robot.friction, dq, carried) - friction_torque(robot.friction, dq)
    np.testing.assert_allclose(more, carried * [[0, 0.067, 0.015, 0, 0, 0]], atol=1e-12)


def test_the_ur10e_profile_rubs_as_its_controller_does():
    """A line through points of the feed-forward read off real logs, and each curve's rms to it."""
    speeds = (0.01, 0.5, 1.5, 1.9)
    points = [(17.66, 29.59, 40.47, 44.2), (16.82, 28.75, 38.74), (6.61, 12.57, 20.06)]
    points += [(3.09, 5.17, 7.12, 8.0), (3.42, 4.81, 6.62), (3.09, 5.13, 7.64)]
    for own, expected, rms in zip(
        load_robot("ur10e").friction, points, (0.37, 0.34, 0.13, 0.09, 0.04, 0.05), strict=True
    ):
        known = np.array(speeds[: len(expected)])
        dq = np.linspace(known[0], known[-1], 400)
        sharp = joint(own.model, **{**own.parameters, "smoothing": 1e-4})
        curve = friction_torque((sharp,), dq[:, None])
        found = np.sqrt(np.mean((curve[:, 0] - np.interp(dq, known, expected)) ** 2))
        assert found == pytest.approx(rms, abs=0.01)


def test_a_parabola_turns_down_where_its_slope_is_zero():
    # wrist 1 of the UR10e as it was: 5.246 − 2·2.15 v = 0 at 1.22 rad/s
    down = joint("coulomb-viscous-quadratic", coulomb=2.95, viscous=5.246, quadratic=-2.15)
    step = np.pi / 500  # of the speeds looked at
    assert falling_speed(down, np.pi) == pytest.approx(5.246 / 4.3, abs=2 * step)
    assert np.isnan(falling_speed(down, np.nan))
    (remark,) = falling_friction((down, down), np.array([1.2, np.pi]))
    assert (remark.code, remark.level) == ("falling-friction", "warning")
    assert remark.where.joints == (2,)
    assert "1.2 rad/s" in str(remark)


@pytest.mark.parametrize(
    ("friction", "falls"),
    [
        (joint("coulomb-viscous", coulomb=-1.0, viscous=5.0), True),
        (joint("coulomb-viscous", coulomb=0.0, viscous=-1.0), True),
        (joint("coulomb-viscous-offset", coulomb=1.0, viscous=0.0, offset=-3.0), False),
        (joint("coulomb-viscous-stribeck", **STRIBECK), False),
        (joint("sigmoid", amplitude=1.0, slope=9.0, shift=0.1), False),
        (joint("sigmoid", amplitude=1.0, slope=-9.0, shift=0.1), True),
        (JointFriction(), False),
    ],
)
def test_what_falls_and_what_does_not(friction, falls):
    assert np.isfinite(falling_speed(friction, 2.0)) == falls


# p1 to p4 of the controller's configuration by joint size, and s(28), s(45) relative to 35 °C.
LAWS = {
    "1": ((0.402, -0.09083, 0.9553, -0.01831), 1.161, 0.819),
    "2": ((0.00062, -0.37098, 0.90936, -0.01168), 1.085, 0.890),
    "3 e": ((3.637679, -0.011074, 1.362321, -0.085741), 1.100, 0.883),
    "3 CB3": ((1.858278, -0.017289, 4.273737, -0.231437), 1.134, 0.840),
    "4 e": ((2.0864784, -0.0067425, 1.1497692, -0.0534681), 1.088, 0.901),
    "4 CB3": ((1.584479, -0.075955, 5.968238, -0.015598), 1.134, 0.844),
}


@pytest.mark.parametrize("size", LAWS)
def test_all_but_the_offset_follows_the_law_of_the_joint_s_size(size):
    """At 28 and 45 °C; where no temperature is measured, and at 35 °C, it is the reference's."""
    law, cold, hot = LAWS[size]
    values = {"coulomb": 2.0, "viscous": 1.0, "presliding": 1.0, "presliding_length": 1e-3}
    warm = joint("coulomb-viscous-offset", **values, offset=0.5)
    warm = replace(warm, temperature=law, temperature_at=35.0)
    T = np.array([[28.0], [45.0], [35.0], [np.nan]])
    one = np.ones((4, 1))
    torque = friction_torque((warm,), 0.5 * one, deflection=one, temperature=T)
    # the table has three decimals; tanh(50) is 1 to rounding
    share = np.array([cold, hot, 1.0, 1.0])
    np.testing.assert_allclose(torque[:, 0], 0.5 + share * 3.5, atol=3.5 * 6e-4)
    plain = friction_torque((warm,), 0.5 * one, deflection=one)
    np.testing.assert_array_equal(torque[2:], plain[2:])
    assert np.all(np.diff(warmth(law, np.linspace(1.0, 100.0, 500))) < 0.0)
    # a joint without a law keeps its friction
    factor = friction_factor((JointFriction(), warm), np.full((3, 2), 20.0))
    np.testing.assert_array_equal(factor[:, 0], 1.0)
    assert friction_factor((JointFriction(),), T) is None


LAW = "[3.637679, -0.011074, 1.362321, -0.085741]"
POINTS = f"""model = "points"
speeds = [0.01, 0.5, 1.5, 3.2]
torques = [5.73, 9.32, 13.58, 18.72]
load_coulomb = 0.067
smoothing = 0.003
offset = -0.2
presliding = 2.0
presliding_length = 3e-4
temperature = {LAW}
temperature_at = 44.6
"""


def arm_with(friction: str, folder: Path) -> Path:
    head, _, rest = PROFILES["panda"].read_text(encoding="utf-8").partition("[joints.friction]\n")
    _, _, others = rest.partition("\n\n")
    path = folder / "arm.toml"
    path.write_text(f"{head}[joints.friction]\n{friction}\n{others}", encoding="utf-8")
    return path


def test_they_are_read_and_written_back(tmp_path):
    """Presliding and temperature stand beside any model."""
    robot = load_robot(arm_with(POINTS, tmp_path))
    values = {"load_coulomb": 0.067, "smoothing": 0.003, "offset": -0.2}
    expected = points(**values, presliding=2.0, presliding_length=3e-4)
    law = LAWS["3 e"][0]
    assert robot.friction[0] == replace(expected, temperature=law, temperature_at=44.6)
    again = tmp_path / "again.toml"
    again.write_text(robot_toml(robot), encoding="utf-8")
    assert load_robot(again).friction == robot.friction
    sigmoid = 'model = "sigmoid"\namplitude = 1.0\nslope = 5.0\nshift = 0.1\n'
    more = "".join(POINTS.partition("presliding")[1:])
    own = load_robot(arm_with(sigmoid + more, tmp_path)).friction[0]
    assert (own.parameters["presliding"], own.temperature_at) == (2.0, 44.6)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("presliding = 2.0", "presliding = -2.0", r"presliding is -2 N·m; on a robot it is"),
        ("presliding_length = 3e-4", "presliding_length = 0.0", "presliding_length is 0 rad; on"),
        ("presliding_length = 3e-4", "presliding_length = 3.0", "presliding_length is 3 rad; on"),
        ("presliding_length = 3e-4\n", "", "presliding_length is missing; presliding needs it"),
        ("presliding = 2.0\n", "", "presliding is missing; presliding_length needs it"),
        ("smoothing = 0.003", "stribeck_velocity = 0.0", "stribeck_velocity is 0 rad/s; on"),
        ("temperature_at = 44.6\n", "", "temperature_at is missing; temperature needs it"),
        ("temperature_at = 44.6", "temperature_at = 308", "temperature_at is 308 °C; on a robot"),
        (LAW, "[-1.0, -0.01, 0.5, -0.01]", "line .*temperature makes friction"),
        (LAW, "[0.0, 0.0, 0.0, 0.0]", "temperature makes friction"),
        (LAW, "[1.0, 10.0, 0.0, 0.0]", "temperature makes friction"),
        (LAW, "[1e3, 1e3, 1e3, 1e3]", "temperature makes friction"),
        ("-0.085741]", "-0.085741, 1.0]", "temperature is .*; it must be 4 finite numbers"),
        ("speeds = [0.01, 0.5, 1.5, 3.2]\n", "", "speeds is missing; it must be a list of at"),
        ("0.01, 0.5, 1.5, 3.2", "0.01", r"speeds is \[0.01\]; it must be a list of at least 2"),
        ("0.01, 0.5, 1.5", "0.01, 0.5, 0.5", "speeds is .*; each must be above the one"),
        ("0.01, 0.5, 1.5", "0.0, 0.5, 1.5", "speeds is 0 rad/s; on a robot it is"),
        ("0.01, 0.5, 1.5, 3.2", "0.01, 0.5, 1.5", "there are 4 torques for 3 speeds"),
        ("5.73, 9.32", "nan, 9.32", "torques is .*; it must be a list of at least 2 finite"),
        ("5.73, 9.32", "1e9, 9.32", r"torques is 1e\+09 N·m; on a robot it is"),
    ],
)
def test_what_no_joint_has_is_refused(old, new, words, tmp_path):
    assert old in POINTS
    with pytest.raises(RobotError, match=words):
        load_robot(arm_with(POINTS.replace(old, new), tmp_path))


# Friction along a log: presliding in stretches, temperatures, and both in the terms


def wandering(samples: int, joints: int) -> np.ndarray:
    """Angles that turn back every few samples by about the presliding length. [rad]"""
    rng = np.random.default_rng(3)
    return np.cumsum(2e-4 * rng.standard_normal((samples, joints)), axis=0)


def test_a_joint_that_turns_back_gives_before_it_slides():
    """Worked by hand: 2 s₀ away from a turn the full torque holds the other way.

    It is the sign of a long motion, and holds at rest; the joint beside has none.
    """
    values = {"coulomb": 0.0, "viscous": 0.0, "presliding": 2.5, "presliding_length": 3e-4}
    friction = RunningFriction((joint("coulomb-viscous", **values), JointFriction()))
    q = 3e-4 * np.array([0.0, 0.5, 1.0, 3.0, 2.5, 1.0, 1.0, 0.0])[:, None].repeat(2, axis=1)
    torque = friction.torque(q, np.zeros_like(q))
    expected = 2.5 * np.array([0.0, 0.5, 1.0, 1.0, 0.5, -1.0, -1.0, -1.0])
    # quotients of differences of angles: rounding
    np.testing.assert_allclose(torque[:, 0], expected, atol=1e-12)
    assert not torque[:, 1].any()
    assert play(np.zeros((0, 2)), 3e-4).state.shape == (0, 2)


def test_the_terms_take_off_friction_by_load_temperature_and_what_was_before():
    """More than two chunks, each joint with its own length; by the paper's method too."""
    robot = load_robot("ur5")
    q = wandering(2 * CHUNK + 100, 6)
    dq, T = np.gradient(q, 0.008, axis=0), np.linspace(25.0, 40.0, q.size).reshape(q.shape)
    t = 0.008 * np.arange(len(q))
    log = Recording(t=t, q=q, dq=dq, current=np.zeros_like(q), temperature=T)
    values = {"coulomb": 2.0, "viscous": 1.0, "load_coulomb": 0.1, "presliding": 2.5}
    lengths = 1e-4 * np.arange(1.0, 7.0)
    each = [joint("coulomb-viscous-load", **values, presliding_length=x) for x in lengths]
    friction = tuple(replace(one, temperature=LAWS["1"][0], temperature_at=35.0) for one in each)
    rough = replace(robot, friction=friction)
    load = momentum_terms(robot.loaded_chain, q, dq).gravity
    state = play(q, lengths).state
    expected = friction_torque(friction, dq, load, deflection=state, temperature=T)
    smooth = dynamics_terms(log, replace(robot, friction=())).mu
    # differences of torques of 10²: rounding
    found = dynamics_terms(log, rough).mu
    np.testing.assert_allclose(smooth - found, expected, atol=1e-12)
    assert np.ptp(play(q[CHUNK:], lengths).state[:20] - state[CHUNK:][:20]) > 0.1
    few = slice(0, 200)
    part = Recording(t=t[few], q=q[few], dq=dq[few], current=0 * q[few], temperature=T[few])
    # the paper's numeric method is good to 5e-6 N·m
    literal = dynamics_terms(part, rough, literal=True).mu
    np.testing.assert_allclose(literal, found[few], atol=5e-6)


def looped(q, length):
    """The operator as it is written: one sample after another."""
    centre, states = q[0], []
    for row in q:
        centre = np.clip(centre, row - length, row + length)
        states.append((row - centre) / length)
    return np.clip(states, -1.0, 1.0), centre


@pytest.mark.parametrize("samples", [1, 2, 31, 32, 33, 1024, 1025, 5000])
def test_blocks_and_stretches_are_the_loop(samples):
    q, length = wandering(samples, 6), np.array([1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-4])
    state, centre = looped(q, length)
    for cut in {0, 17, 32, 900} & {*range(samples)}:
        first = play(q[:cut], length, q[0])
        second = play(q[cut:], length, first.centre)
        # Only comparisons and one division are made, in both: no rounding can differ.
        np.testing.assert_array_equal(np.concatenate([first.state, second.state]), state)
        np.testing.assert_array_equal(second.centre, centre)


def test_zeros_are_no_temperatures():
    still = np.zeros((10, 6))
    partly = np.full((10, 6), 30.0)
    partly[3, 2], partly[4, 1] = 0.0, 3000.0
    plain, cold, log = (
        Recording(t=np.arange(10.0), q=still, temperature=T) for T in (None, still, partly)
    )
    assert measured_temperature(plain) is None
    assert measured_temperature(cold) is None
    found = measured_temperature(log)
    assert np.argwhere(np.isnan(found)).tolist() == [[3, 2], [4, 1]]
