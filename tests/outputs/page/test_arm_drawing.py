import re
from dataclasses import replace

import numpy as np
import pytest

from vftcli.analysis import Analysis
from vftcli.outputs.page.arm_drawing import (
    ARROW,
    HEIGHT,
    WIDTH,
    arm_drawing,
    arrow,
    side_of,
)


def test_the_arm_is_seen_from_its_side_within_the_drawing(pushed: Analysis) -> None:
    assert pushed.contacts is not None
    for contact in pushed.contacts.contacts:
        html = arm_drawing(pushed, contact)
        path = re.search(r'class="link" d="M([^"]*)"', html)
        assert path is not None
        points = np.array(path[1].split(), dtype=float).reshape(-1, 2)
        assert len(points) == 6 + 2  # the base, six links, the flange
        assert points.min() >= 0.0
        assert np.all(points.max(axis=0) <= [WIDTH, HEIGHT])
        assert points[-1, 0] > points[0, 0]  # it reaches to the right
        assert html.count('class="hit"') == 1


@pytest.mark.parametrize(("places", "points"), [((0,), 1), ((6,), 2), ((2, 3), 4)])
def test_the_places_that_fit_are_marked(
    pushed: Analysis, places: tuple[int, ...], points: int
) -> None:
    assert pushed.contacts is not None
    contact = replace(pushed.contacts.contacts[0], places=places)
    html = arm_drawing(pushed, contact)
    hit = re.search(r'class="hit" d="([^"]*)"', html)
    link = re.search(r'class="link" d="M([^"]*)"', html)
    assert hit is not None
    assert link is not None
    drawn = re.findall(r"[\d.]+ [\d.]+", hit[1])
    assert len(drawn) == points
    arm = re.findall(r"[\d.]+ [\d.]+", link[1])
    # Row k is the frame of link k, which begins there and ends at the next.
    first = len(arm) - 1 if places == (0,) else places[0]
    assert drawn[0] == arm[first]


def test_without_a_place_or_a_force_nothing_is_marked(pushed: Analysis) -> None:
    assert pushed.contacts is not None
    contact = pushed.contacts.contacts[0]
    assert 'class="arrow"' in arm_drawing(pushed, contact)
    assert 'class="arrow"' not in arm_drawing(pushed, replace(contact, wrench=None))
    bare = arm_drawing(pushed, replace(contact, places=()))
    assert 'class="hit"' not in bare
    assert 'class="arrow"' not in bare


def test_an_arrow_ends_at_its_place() -> None:
    path = arrow(np.array([50.0, 30.0]), np.array([1.0, 0.0]))
    assert f"M{50 - ARROW:.1f} 30.0 50.0 30.0" in path
    assert arrow(np.array([50.0, 30.0]), np.array([0.05, 0.0])) == ""  # out of the drawing


def test_the_side_is_where_the_arm_reaches() -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.0, -0.3, 0.5], [0.0, -0.9, 0.2]])
    np.testing.assert_allclose(side_of(points), [0.0, -1.0, 0.0], atol=1e-12)
    upright = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(side_of(upright), [1.0, 0.0, 0.0])
