"""Which robot a log is from: known misfits, loads and frictions, inside and outside the limits."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vftcli.doctor import fit as doctor_fit
from vftcli.doctor.fit import (
    Evidence,
    RobotMatch,
    Windows,
    best_fit,
    evidences,
    fitted,
    friction_regressor,
    measured,
    plausible,
    ranking,
    robust_size,
)
from vftcli.robots import Payload, Robot, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

PANDA = load_robot("panda")
T = 0.01 * np.arange(1000)


def gravity(robot: Robot, q: Array) -> Array:
    """Torque that holds an arm at rest. (T, n) [N·m]"""
    return np.asarray(momentum_terms(robot.loaded_chain, q, np.zeros_like(q)).gravity)


def held(robot: Robot = PANDA) -> Recording:
    """An arm held in one pose by exactly its own gravity torques."""
    q = np.tile(np.linspace(0.3, 1.2, robot.joints), (len(T), 1))
    return Recording(t=T, q=q, dq=np.zeros_like(q), torque=gravity(robot, q))


def creeping(robot: Robot = PANDA, load: float = 0.0) -> Recording:
    """An arm that goes through many poses, held by the gravity torques of each and of a load.

    At up to 0.2 rad/s inertia and Coriolis torques are below 1 % of gravity's.
    """
    tool = Payload(mass=load, com=np.array([0.0, 0.0, 0.05]), inertia=np.zeros((3, 3)))
    rates = 0.2 + 0.03 * np.arange(robot.joints)
    q = 0.5 + 0.5 * np.sin(np.outer(T, rates) + np.arange(robot.joints))
    dq = 0.5 * rates * np.cos(np.outer(T, rates) + np.arange(robot.joints))
    return Recording(t=T, q=q, dq=dq, torque=gravity(robot.with_payload(tool), q))


def off(misfit: float) -> float:
    """Factor on a torque that leaves such a share of it unexplained: 1 − 1/factor. [-]"""
    return 1 / (1 - misfit)


def first_fit(log: Recording) -> RobotMatch:
    fit = best_fit(log, "panda", PANDA, evidences(log, PANDA))
    assert fit is not None
    return fit


@pytest.mark.parametrize(
    ("evidence", "limit"),
    [
        ("the controller's own model", 0.1),
        ("torque less the vendor's residual", 0.1),
        ("measured effort", 0.2),
    ],
)
def test_a_profile_fits_up_to_the_limit_of_its_evidence(evidence: str, limit: float) -> None:
    """In one pose no load can be fitted, so the planted share is the misfit to rounding."""
    log = held()
    for misfit, fits in ((limit - 0.01, True), (limit + 0.01, False)):
        torque = off(misfit) * log.require("torque")
        signals: Mapping[str, Any] = {
            "the controller's own model": {"target_torque": torque},
            "torque less the vendor's residual": {"torque": torque - 1, "tau_ext": 1 + 0 * torque},
            "measured effort": {"torque": torque},
        }[evidence]
        found = first_fit(replace(log, **signals))
        assert (found.evidence, found.fits, found.load) == (evidence, fits, 0.0)
        assert found.misfit == pytest.approx(misfit, abs=1e-9)
        assert found.robot == "panda"


def test_what_is_evidence_and_whether_friction_is_in_it() -> None:
    log = held()
    torque = log.require("torque")
    zeros, ones = np.zeros_like(torque), np.ones_like(torque)

    def kinds(**signals: Array | None) -> list[tuple[str, bool]]:
        changed = replace(log, **signals)  # type: ignore[arg-type]
        return [(item.name, item.friction) for item in evidences(changed, PANDA)]

    effort = ("measured effort", True)
    assert kinds() == [effort]
    assert kinds(target_torque=ones) == [("the controller's own model", False)]
    assert kinds(target_torque=zeros) == [effort]
    assert kinds(tau_ext=ones) == [("torque less the vendor's residual", True)]
    assert kinds(tau_ext=zeros) == [effort]
    assert kinds(torque=zeros) == []
    assert kinds(torque=None) == []


def test_measured_effort_is_the_torque_or_the_current_times_the_constants() -> None:
    arm = load_robot("ur10e")
    assert arm.torque_constant is not None
    log = held(arm)
    current = log.require("torque") / arm.torque_constant
    (effort,) = measured(replace(log, torque=None, current=current), arm)
    np.testing.assert_allclose(effort.torque, log.require("torque"), rtol=1e-12)
    (effort,) = measured(replace(log, current=3 * current), arm)
    np.testing.assert_array_equal(effort.torque, log.require("torque"))
    unknown = replace(arm, torque_constant=None)
    assert not list(measured(replace(log, torque=None, current=current), unknown))


def test_the_fit_to_the_best_evidence_counts() -> None:
    """One that is good enough goes before one that is better yet not good enough for its kind."""
    log = held()
    torque = log.require("torque")
    strict = Evidence("strict", off(0.02) * torque, 0.01, friction=False)
    loose = Evidence("loose", off(0.05) * torque, 0.2, friction=False)
    better = Evidence("better", off(0.03) * torque, 0.2, friction=False)
    for items in ((strict, loose), (loose, strict)):
        found = best_fit(log, "panda", PANDA, items)
        assert found is not None
        assert found.evidence == "loose"
    found = best_fit(log, "panda", PANDA, (loose, better))
    assert found is not None
    assert found.evidence == "better"
    assert best_fit(log, "panda", PANDA, ()) is None


def test_a_load_is_found_where_the_poses_tell_it() -> None:
    """To 2 %: the log neglects the inertia of 3 kg at 0.2 rad/s."""
    found = first_fit(creeping(load=3.0))
    assert found.load == pytest.approx(3.0, rel=0.02)
    assert found.misfit < 0.02
    assert first_fit(creeping()).load == 0.0
    assert str(found).startswith(f"panda {100 * found.misfit:.3g} % with 3 kg on the flange (meas")


def test_no_load_is_fitted_beyond_what_an_arm_carries() -> None:
    """Up to 12 kg; more is another arm."""
    assert first_fit(creeping(load=11.0)).load == pytest.approx(11.0, rel=0.03)
    assert first_fit(creeping(load=14.0)).load == 0.0


@pytest.mark.parametrize(
    ("mass", "moment", "tool"),
    [
        (0.04, 0.0, False),
        (0.06, 0.0, True),
        (11.9, 0.0, True),
        (12.1, 0.0, False),
        (-1.0, 0.0, False),
        (2.0, 0.99, True),  # 0.35 m of arm for each of 2 kg, and 0.3 kg·m for the fit's error
        (2.0, 1.01, False),
    ],
)
def test_the_mass_and_arm_of_a_tool(mass: float, moment: float, tool: bool) -> None:
    for axis in range(3):
        load = np.array([mass, 0.0, 0.0, 0.0])
        load[1 + axis] = moment
        assert plausible(load) == tool
        assert plausible(load * np.array([1, -1, -1, -1])) == tool


def test_the_quieter_windows_are_seven_in_ten() -> None:
    """Ten windows of two joints; the three loudest, whatever they hold, do not count."""
    rest = np.column_stack([np.full(10, 3.0), np.full(10, 4.0)])
    assert robust_size(rest) == pytest.approx(np.sqrt(25 / 2))
    rest[[1, 5, 8]] *= 100
    assert robust_size(rest) == pytest.approx(np.sqrt(25 / 2))
    rest[2] *= 100
    assert robust_size(rest) > 20


def test_friction_is_diagonal_in_the_joints() -> None:
    direction, speed = np.array([[1.0, -1.0]]), np.array([[0.2, -0.3]])
    expected = [[[1.0, 0.0, 0.2, 0.0], [0.0, -1.0, 0.0, -0.3]]]
    np.testing.assert_array_equal(friction_regressor(direction, speed), expected)


def friction_log(coulomb: float, viscous: float) -> tuple[Array, Array]:
    """What friction leaves over in 200 windows of two joints, and its regressor."""
    speed = np.random.default_rng(5).uniform(-1, 1, (200, 2))
    rest = coulomb * np.sign(speed) + viscous * speed
    return rest, friction_regressor(np.sign(speed), speed)


def test_friction_that_takes_energy_is_explained_and_none_that_gives_it() -> None:
    rest, friction = friction_log(2.0, 0.5)
    none = np.empty((200, 2, 0))
    size, load = fitted(rest, none, friction)
    assert size < 1e-10
    assert load.size == 0
    assert fitted(-rest, none, friction)[0] == pytest.approx(robust_size(rest))
    assert fitted(rest, none, none)[0] == pytest.approx(robust_size(rest))
    # Coulomb friction with the viscous part of the other sign: only the first is explained.
    mixed, _ = friction_log(2.0, -0.1)
    assert 0.01 < fitted(mixed, none, friction)[0] < 0.1


def test_contact_in_less_than_three_windows_of_ten_is_set_aside() -> None:
    rest, friction = friction_log(2.0, 0.5)
    rest[::10] += 30.0
    rest[5::10] -= 30.0
    load = np.random.default_rng(6).normal(size=(200, 2, 4))
    planted = np.array([1.5, -0.2, 0.1, 0.3])
    size, found = fitted(rest + load @ planted, load, friction)
    assert size < 1e-9
    np.testing.assert_allclose(found, planted, atol=1e-9)


def test_a_load_may_have_any_sign_but_friction_may_not() -> None:
    load = np.random.default_rng(6).normal(size=(200, 2, 4))
    _, friction = friction_log(1.0, 1.0)
    planted = np.array([-1.5, -0.2, 0.1, 0.3])
    np.testing.assert_allclose(fitted(load @ planted, load, friction)[1], planted, atol=1e-9)


def test_windows_of_three_tenths_of_a_second_overlap_by_half() -> None:
    windows = Windows(held(), PANDA)
    np.testing.assert_allclose(windows.span, 0.3, rtol=1e-9)
    np.testing.assert_array_equal(np.diff(windows.first), 15)
    assert windows.first[0] == 0
    assert windows.last[-1] >= len(T) - 15
    line = T[:, None] * np.ones(7)
    np.testing.assert_allclose(windows.mean(line)[:, 0], T[windows.first] + 0.15, rtol=1e-9)


def test_windows_of_a_log_that_is_short_or_long() -> None:
    log = held()
    short = Windows(log.between(0, 0.09), PANDA)  # 10 samples: three of them a window
    np.testing.assert_array_equal(short.last - short.first, 3)
    t = 0.01 * np.arange(20_000)
    q = np.tile(log.q[:1], (len(t), 1))
    long = Windows(Recording(t=t, q=q, dq=0 * q), PANDA)
    assert len(long.first) == 400
    assert long.first[0] == 0
    assert long.last[-1] > len(t) - 31


def test_a_torque_of_zero_explains_nothing() -> None:
    windows = Windows(held(), PANDA)
    assert windows.misfit(np.zeros((len(T), 7)), friction=False) == (float("inf"), 0.0)


def fake(misfit: float, *, fits: bool = True) -> RobotMatch:
    return RobotMatch(robot="", misfit=misfit, fits=fits, evidence="", load=0.0)


def ranked(monkeypatch: pytest.MonkeyPatch, **fits: RobotMatch) -> list[tuple[str, bool]]:
    """The ranking of profiles whose fits are as given."""

    def given(_log: Recording, name: str, *_: object) -> RobotMatch:
        return replace(fits[name], robot=name)

    monkeypatch.setattr(doctor_fit, "best_fit", given)
    found = ranking(held(), dict.fromkeys(fits, PANDA))
    return [(fit.robot, fit.fits) for fit in found]


def test_profiles_within_three_tenths_of_the_best_are_not_told_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = ranked(monkeypatch, far=fake(0.0131), near=fake(0.0129), best=fake(0.01))
    assert found == [("best", True), ("near", True), ("far", False)]


def test_a_profile_that_fits_goes_before_a_better_one_that_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = ranked(monkeypatch, better=fake(0.15, fits=False), fitting=fake(0.19))
    assert found == [("fitting", True), ("better", False)]


def test_what_cannot_be_ranked() -> None:
    log, robots = held(), {"panda": PANDA, "ur10e": load_robot("ur10e")}
    assert [fit.robot for fit in ranking(log, robots)] == ["panda"]
    assert ranking(replace(log, dq=None), robots) == ()
    assert ranking(log.between(0, T[8]), robots) == ()
    assert len(ranking(log.between(0, T[9]), robots)) == 1
    assert ranking(replace(log, torque=None), robots) == ()
