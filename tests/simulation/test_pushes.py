"""Contacts one by one, and mounted on the arm."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import load_robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.simulation.contacts import Place, SimulatedContact, Touching, drawn, started
from vftcli.simulation.scenario import (
    ContactSpec,
    HandSpec,
    ProfileSpec,
    PushesSpec,
    StopSpec,
)

HERE = Place(np.eye(3), np.array([0.4, 0.1, 0.3]), np.zeros(3), np.zeros(3))


def rng() -> np.random.Generator:
    return np.random.default_rng(1)


def wrench(contact: SimulatedContact, t: float, place: Place = HERE) -> Array:
    """The contact's wrench at a time, none outside of its spans."""
    k = contact.index_at(t)
    return np.zeros(6) if k is None else contact.wrench(k, t, place)


def test_profile_rises_holds_and_falls() -> None:
    spec = ProfileSpec(name="p", spans=((1.0, 3.0),), force=(0, 0, 10.0))
    contact = started(spec, rng(), 5.0)
    sizes = [wrench(contact, t)[2] for t in (0.5, 1.05, 1.1, 2.0, 2.9, 2.95, 3.5)]
    quarter = 5.0 * (1.0 - np.sqrt(0.5))  # of half a cosine
    np.testing.assert_allclose(sizes, [0.0, quarter, 5.0, 10.0, 5.0, quarter, 0.0], atol=1e-12)
    at_once = started(replace(spec, rise=0.0, fall=0.0), rng(), 5.0)
    assert [wrench(at_once, t)[2] for t in (0.99, 1.0, 2.99, 3.0)] == [0.0, 10.0, 10.0, 0.0]


@pytest.mark.parametrize(
    ("style", "length", "pause", "force", "torque"),
    # the ranges by which the scenarios' files and pages describe them [s, s, N, N·m]
    [
        ("slow", (0.8, 2.0), (0.3, 1.0), (20.0, 60.0), (0.0, 3.0)),
        ("taps", (0.14, 0.4), (0.3, 0.9), (30.0, 136.0), (0.0, 4.0)),
        ("mixed", (0.1, 1.5), (0.3, 1.0), (20.0, 90.0), (1.0, 6.0)),
    ],
)
def test_pushes_fill_what_they_are_drawn_from(style, length, pause, force, torque) -> None:
    pushes = list(drawn(PushesSpec(name="h", style=style, begin=1.0), rng(), 4000.0))
    found = [
        (length, [push.stop - push.start for push in pushes]),
        (pause, [after.start - before.stop for before, after in pairwise(pushes)]),
        (force, [np.linalg.norm(push.wrench[:3]) for push in pushes]),
        (torque, [np.linalg.norm(push.wrench[3:]) for push in pushes]),
    ]
    for (low, high), values in found:
        # the ends of more than 1500 even draws miss those of the range by .5 % at most
        near = 0.005 * (high - low)
        assert low - 1e-9 <= min(values) <= low + near
        assert high - near <= max(values) <= high + 1e-9
    assert 1.0 + pause[0] <= pushes[0].start <= 1.0 + pause[1]
    for push in pushes:
        assert push.rise == push.fall == pytest.approx(0.5 * (push.stop - push.start))


def test_pushes_point_as_flat_and_last_as_long_as_they_are_asked_to() -> None:
    spec = PushesSpec(name="h", vertical=0.0, end=39.0, length=(0.5, 0.5), pause=(1.0, 1.0))
    pushes = list(drawn(spec, rng(), 100.0))
    assert [push.start for push in pushes] == pytest.approx(1.0 + 1.5 * np.arange(26))
    wrenches = np.array([push.wrench for push in pushes])
    assert not wrenches[:, 2].any()
    assert wrenches[:, [0, 1, 3, 4, 5]].all()
    many = drawn(PushesSpec(name="h"), rng(), 4000.0)
    x, y, z = np.array([push.wrench[:3] for push in many]).T
    # even over a sphere, half of all directions have |z| below √(x² + y²)/√3; here z is halved;
    # more than 1500 of them tell it to 3 % (one sigma)
    assert np.median(abs(z) / np.hypot(x, y)) == pytest.approx(0.5 / np.sqrt(3.0), rel=0.1)


def test_hand_pulls_to_where_it_goes_and_lets_go() -> None:
    spec = HandSpec(name="h", spans=((1.0, 2.0), (3.0, 4.0)), moves=((0.1, 0, 0), (0, 0.2, 0)),
                    stiffness=200.0, damping=15.0, reach=0.4, release=0.2)  # fmt: skip
    hand = started(spec, rng(), 5.0)
    assert hand.index_at(0.5) is None
    np.testing.assert_allclose(wrench(hand, 1.0), 0.0, atol=1e-12)
    np.testing.assert_allclose(wrench(hand, 1.1)[:3], [20.0 * 0.103515625, 0, 0])  # a quarter
    np.testing.assert_allclose(wrench(hand, 1.5)[:3], [20.0, 0, 0])
    np.testing.assert_allclose(wrench(hand, 1.95)[:3], [5.0, 0, 0])  # a quarter of its hold
    there = HERE.position + np.array([0.1, 0, 0])
    moved = HERE._replace(position=there, velocity=np.array([0.2, 0, 0]))
    np.testing.assert_allclose(wrench(hand, 1.6, moved)[:3], [-15.0 * 0.2, 0, 0], atol=1e-12)
    assert hand.index_at(2.0) is None
    # it takes hold anew, of the arm where that is now
    still = moved._replace(velocity=np.zeros(3))
    np.testing.assert_allclose(wrench(hand, 3.0, still), 0.0, atol=1e-12)
    np.testing.assert_allclose(wrench(hand, 3.5, still)[:3], [0, 40.0, 0])
    at_once = started(replace(spec, reach=0.0, release=0.0), rng(), 5.0)
    np.testing.assert_allclose(wrench(at_once, 1.0)[:3], [20.0, 0, 0])
    np.testing.assert_allclose(wrench(at_once, 1.99)[:3], [20.0, 0, 0])


def test_hand_twists_about_its_turn() -> None:
    spec = HandSpec(name="h", spans=((0.0, 1.0),), turns=((0, 0, 0.5),), twist_stiffness=10.0,
                    twist_damping=2.0, reach=0.1)  # fmt: skip
    hand = started(spec, rng(), 1.0)
    wrench(hand, 0.0)
    np.testing.assert_allclose(wrench(hand, 0.5)[3:], [0, 0, 5.0], atol=1e-12)
    turning = HERE._replace(spin=np.array([0.0, 0.0, 1.5]))
    np.testing.assert_allclose(wrench(hand, 0.5, turning)[3:], [0, 0, 2.0], atol=1e-12)


def test_stop_pushes_and_never_pulls() -> None:
    stop = StopSpec(name="s", through=(0, 0, 0.31), stiffness=1000.0, damping=100.0)
    wall = started(stop, rng(), 1.0)
    np.testing.assert_allclose(wrench(wall, 0.0)[:3], [0, 0, 10.0])
    longer = started(replace(stop, normal=(0.0, 0.0, 3.0)), rng(), 1.0)
    np.testing.assert_allclose(wrench(longer, 0.0), wrench(wall, 0.0))
    leaving = HERE._replace(velocity=np.array([0.0, 0, 1.0]))
    np.testing.assert_array_equal(wrench(wall, 0.0, leaving), 0.0)
    away = HERE._replace(position=np.array([0.4, 0.1, 0.32]))
    np.testing.assert_array_equal(wrench(wall, 0.0, away), 0.0)
    coming = away._replace(velocity=np.array([0.0, 0, -1.0]))  # the damper waits for the plane
    np.testing.assert_array_equal(wrench(wall, 0.0, coming), 0.0)


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        (PushesSpec(name="h", style="tapps"), "Did you mean taps"),
        (PushesSpec(name="h", length=(0.0, 1.0)), "must be positive"),
        (PushesSpec(name="h", pause=(0.0, 1.0)), "must be positive"),
        (StopSpec(name="s", through=(0, 0, 0), normal=(0, 0, 0)), "no length"),
        (HandSpec(name="h", spans=((0, 1),), moves=((0, 0, 0), (0, 0, 0))), "one for each"),
    ],
)
def test_impossible_contacts_are_refused(spec: ContactSpec, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        started(spec, rng(), 1.0)


# Its flange is turned against its last joint.
ROBOT, Q, POINT = load_robot("gen3"), np.linspace(-1.0, 0.8, 7), (0.02, 0.05, 0.1)


def wrench_on_arm(spec: ContactSpec, v: Array) -> Array:
    touching = Touching((spec,), ROBOT.chain, 10.0, np.random.SeedSequence(1))
    data = ROBOT.model.createData()
    pin.computeJointJacobians(ROBOT.model, data, Q)
    touching.torque(5.0, ROBOT.model, data, v)
    return touching.wrenches[0]


def point_of(q: Array, link: int) -> tuple[Array, Array]:
    """Where the point is and how its body is turned, by Pinocchio."""
    data = ROBOT.model.createData()
    pin.framesForwardKinematics(ROBOT.model, data, q)
    frame = data.oMf[ROBOT.model.getFrameId("flange")] if link == 0 else data.oMi[link]
    return frame.act(np.array(POINT)), frame.rotation


@pytest.mark.parametrize("link", [0, 4])
def test_a_hand_brakes_how_its_point_moves_and_its_link_turns(link: int) -> None:
    """Dampers alone, against the motion of the point by differences."""
    hand = HandSpec(name="h", spans=((0.0, 10.0),), stiffness=0.0, damping=2.0,
                    twist_damping=3.0, link=link, point=POINT)  # fmt: skip
    v, h = np.linspace(0.5, -0.4, 7), 1e-6
    (ahead, turned), (behind, before) = (point_of(Q + sign * h * v, link) for sign in (1, -1))
    spin = pin.log3(turned @ before.T) / (2 * h)
    # differences of order h²: 1e-9 of a metre a second
    expected = [*(-2.0 * (ahead - behind) / (2 * h)), *(-3.0 * spin)]
    np.testing.assert_allclose(wrench_on_arm(hand, v), expected, atol=1e-7)
    assert np.linalg.norm(expected[:3]) > 0.1
