import re
from dataclasses import replace

import numpy as np
import pytest

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import ContactList
from vftcli.outputs.page.details import (
    ARROW,
    SHAPES,
    SIZE,
    arm_drawing,
    arrow,
    free_spans,
    highest,
    side_of,
    timelines,
)
from vftcli.outputs.page.shell import part

WIDE = SHAPES[0][0]


def listed(analysis: Analysis) -> ContactList:
    assert analysis.contacts is not None
    return analysis.contacts


def hero(analysis: Analysis, found: ContactList) -> str:
    """The chart in both shapes with its words."""
    return part("svg/hero", found, free_spans(analysis), timelines(analysis, found))


def content(analysis: Analysis, found: ContactList) -> str:
    """The chart for a screen."""
    return hero(analysis, found).partition("</svg>")[0]


@pytest.mark.slow
def test_every_contact_has_its_stripe_its_number_and_its_course(pushed: Analysis) -> None:
    found = listed(pushed)
    drawn = content(pushed, found)
    scale = (WIDE.width - WIDE.left - WIDE.right) / float(pushed.t[-1] - pushed.t[0])
    for contact in found.contacts:
        stripe = re.search(
            rf'<rect x="([\d.]+)"[^>]*width="([\d.]+)"[^>]*id="mark-{contact.number}"', drawn
        )
        assert stripe is not None
        # drawn to a tenth of a unit
        assert abs(float(stripe[1]) - WIDE.left - scale * contact.start) < 0.06
        assert abs(float(stripe[2]) - scale * (contact.stop - contact.start)) < 0.06
        assert f'href="#contact-{contact.number}"' in drawn
    assert drawn.count('class="force"') == drawn.count('class="band"') == len(found.contacts)
    assert drawn.count('class="peak"') == len(found.contacts)
    assert drawn.count('class="unseen"') == 1
    assert re.search(r'fill="url\(#free-1024\)"', drawn)


def test_both_widths_stand_once_each_with_one_set_of_names(pushed: Analysis) -> None:
    html = hero(pushed, listed(pushed))
    assert html.count("<svg") == 2
    names = re.findall(r'id="([^"]+)"', html)
    assert len(names) == len(set(names))


def test_the_axis_holds_every_peak_with_its_band(pushed: Analysis) -> None:
    found = listed(pushed)
    tops = [(c.peak_force or 0.0) + (c.peak_band or 0.0) for c in found.contacts]
    assert highest(found) > max(tops)
    assert highest(replace(found, contacts=())) == 2.5 * (found.detectable_force or 0.0)
    assert highest(replace(found, contacts=(), smallest_force=None)) == 1.0


def test_a_band_wider_than_its_force_stretches_no_axis_and_labels_no_peak(
    pushed: Analysis,
) -> None:
    found = listed(pushed)
    first, *rest = found.contacts
    course = first.course
    assert course is not None
    wide = replace(first, peak_force=88.0, peak_band=900.0)
    wide = replace(wide, course=course._replace(band=np.full(len(course.t), 900.0)))
    unsure = replace(found, contacts=(wide, *rest))
    assert highest(unsure) < 250.0
    drawn = content(pushed, unsure)
    assert "88 ± 900" not in drawn
    assert drawn.count('class="peak"') == len(found.contacts)
    (band, *_) = re.findall(r'<path d="([^"]+)" class="band"', drawn)
    heights = [float(number) for number in re.findall(r"[\d.-]+", band)[1::2]]
    assert min(heights) >= WIDE.top - 0.1


def test_only_what_is_there_is_explained(pushed: Analysis, without_reference: Analysis) -> None:
    words = hero(pushed, listed(pushed))
    assert "Hatched: motion known to be free." in words
    assert "stopped" not in words
    assert "Grey: too weak to detect (below 4 N)" in words
    stopped = replace(listed(pushed), stops=(3.0,), contacts=(), smallest_force=float("nan"))
    assert stopped.detectable_force is None
    words = hero(without_reference, stopped)
    assert "Dashed: the arm stopped abruptly." in words
    assert "Grey" not in words
    assert 'class="stop"' in content(pushed, stopped)


def test_the_free_part_is_the_first_round(pushed: Analysis) -> None:
    ((start, stop),) = free_spans(pushed)
    np.testing.assert_allclose((start, stop), (0.0, 4.0), atol=0.02)  # a round of 4 s


def test_the_arm_is_seen_from_its_side_within_the_drawing(pushed: Analysis) -> None:
    for contact in listed(pushed).contacts:
        drawn = arm_drawing(pushed, contact)
        assert len(drawn.arm) == 6 + 2  # the base, six links, the flange
        assert drawn.arm.min() >= 0.0
        assert np.all(drawn.arm.max(axis=0) <= SIZE)
        assert drawn.arm[-1, 0] > drawn.arm[0, 0]  # it reaches to the right
        assert part("svg/arm", drawn).count('class="hit"') == 1


@pytest.mark.parametrize(("places", "points"), [((0,), [1]), ((6,), [2]), ((2, 3), [2, 2])])
def test_the_places_that_fit_are_marked(
    pushed: Analysis, places: tuple[int, ...], points: list[int]
) -> None:
    drawn = arm_drawing(pushed, replace(listed(pushed).contacts[0], places=places))
    assert [len(stretch) for stretch in drawn.hit] == points
    # Row k is the frame of link k, which begins there and ends at the next.
    first = len(drawn.arm) - 1 if places == (0,) else places[0]
    assert drawn.hit[0][0].tolist() == drawn.arm[first].tolist()


def test_without_a_place_or_a_force_nothing_is_marked(pushed: Analysis) -> None:
    contact = listed(pushed).contacts[0]
    assert 'class="arrow"' in part("svg/arm", arm_drawing(pushed, contact))
    bare = replace(contact, wrench=None)
    assert 'class="arrow"' not in part("svg/arm", arm_drawing(pushed, bare))
    html = part("svg/arm", arm_drawing(pushed, replace(contact, places=())))
    assert 'class="hit"' not in html
    assert 'class="arrow"' not in html


def test_an_arrow_ends_at_its_place() -> None:
    shaft, _ = arrow(np.array([50.0, 30.0]), np.array([1.0, 0.0]))
    assert shaft.tolist() == [[50.0 - ARROW, 30.0], [50.0, 30.0]]
    assert arrow(np.array([50.0, 30.0]), np.array([0.05, 0.0])) == []  # out of the drawing


def test_the_side_is_where_the_arm_reaches() -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.0, -0.3, 0.5], [0.0, -0.9, 0.2]])
    np.testing.assert_allclose(side_of(points), [0.0, -1.0, 0.0], atol=1e-12)
    upright = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(side_of(upright), [1.0, 0.0, 0.0])
