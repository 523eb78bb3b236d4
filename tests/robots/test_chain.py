"""The chain's bodies: what is merged, and what no body can be."""

import numpy as np
import pytest

from vftcli.robots.chain import Payload, merge_bodies, symmetric, unphysical
from vftcli.signals.errors import RobotError

RNG = np.random.default_rng(8)


def cloud() -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre and tensor about the centre of ten random points of mass."""
    masses, points = RNG.uniform(0.1, 1.0, 10), RNG.uniform(-0.3, 0.3, (10, 3))
    return body(masses, points)


def body(masses: np.ndarray, points: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    mass = float(masses.sum())
    com = masses @ points / mass
    arms = points - com
    tensor = sum(
        m * (d @ d * np.eye(3) - np.outer(d, d)) for m, d in zip(masses, arms, strict=True)
    )
    return mass, com, np.asarray(tensor)


def test_merged_bodies_are_the_body_of_all_their_points() -> None:
    masses, points = RNG.uniform(0.1, 1.0, 12), RNG.uniform(-0.3, 0.3, (12, 3))
    parts = [body(masses[k::3], points[k::3]) for k in range(3)]
    found = merge_bodies(*(list(column) for column in zip(*parts, strict=True)))
    for got, expected in zip(found, body(masses, points), strict=True):
        # sums of a dozen numbers of order one in another order
        np.testing.assert_allclose(got, expected, atol=1e-14)


def test_nothing_weighs_nothing() -> None:
    mass, com, tensor = merge_bodies([0.0, 0.0], [np.ones(3)] * 2, [np.zeros((3, 3))] * 2)
    assert mass == 0.0
    assert not com.any()
    assert not tensor.any()


def test_six_entries_make_a_tensor() -> None:
    tensor = symmetric([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    assert np.array_equal(tensor, [[1, 2, 3], [2, 4, 5], [3, 5, 6]])


def test_every_cloud_of_points_is_a_body() -> None:
    for _ in range(50):
        mass, _, tensor = cloud()
        assert unphysical(mass, tensor) == ""


@pytest.mark.parametrize(
    ("mass", "moments", "words"),
    [
        (-1.0, (1, 1, 1), "mass is -1 kg"),
        (np.nan, (1, 1, 1), "mass is nan"),
        (1.0, (1, np.inf, 1), "not finite"),
        (1.0, (-0.1, 1, 1), "negative principal moment -0.1"),
        (1.0, (1, 1, 2.1), "triangle inequality: principal moment 2.1"),
        # a flat plate is the limit, and tables are rounded
        (1.0, (1, 1, 2.000001), ""),
    ],
)
def test_what_no_body_can_be_is_named(
    mass: float, moments: tuple[float, float, float], words: str
) -> None:
    found = unphysical(mass, np.diag(moments))
    assert (words in found) if words else found == ""


def test_a_payload_that_no_body_can_be_is_refused() -> None:
    with pytest.raises(RobotError, match="the payload is unphysical: mass is -2 kg"):
        Payload(mass=-2.0, com=np.zeros(3), inertia=np.zeros((3, 3)))
