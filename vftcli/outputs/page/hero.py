"""Drawings of contacts: |F| over the log with its band, the arm at each one."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.outputs.charts import Span, thinned
from vftcli.outputs.contacts import by_force
from vftcli.outputs.page.shell import Box, Scales, path_of, ribbon
from vftcli.outputs.quantity import banded
from vftcli.robots.chain import link_poses
from vftcli.signals.arrays import Array
from vftcli.signals.errors import VftError
from vftcli.signals.series import resample_columns, runs_of

#: The chart for a screen, and for a telephone with larger letters; stretches of the line in
#: each.
SHAPES = (
    (Box(width=1024, height=300, left=44, bottom=24, top=28, right=10), 600),
    (Box(width=400, height=260, left=38, bottom=24, top=28, right=8), 200),
)
FEWEST = 6  #: Fewest stretches of one contact's line.
LETTER = 7.5  #: Width of a letter: labels must not overlap.
SIZE, EDGE = np.array([84.0, 64.0]), 9.0  #: Size of the arm's drawing, and margin.
ARROW, HEAD = 20.0, 5.0  #: Arrow in the drawing's plane, and its head.


class Timeline(NamedTuple):
    """The chart of |F| in one shape."""

    scales: Scales  #: From seconds and newtons to places.
    courses: list[tuple[str, str]]  #: Band and line of contacts with a force.
    numbers: list[tuple[int, float]]  #: Contacts with room for a number, and its place.
    #: Place of a peak, place of its size in words, and the words, "" without room or size.
    peaks: list[tuple[float, float, float, float, str]]


def timelines(analysis: Analysis, found: ContactList) -> list[Timeline]:
    """The chart in both shapes."""
    t, drawn = analysis.t, []
    for box, stretches in SHAPES:
        scales = Scales(box, Span(float(t[0]), float(t[-1])), Span(0.0, highest(found)))
        courses = list(courses_of(scales, found.contacts, stretches))
        numbers = list(placed_numbers(scales, found.contacts))
        drawn.append(Timeline(scales, courses, numbers, list(peaks_of(scales, found.contacts))))
    return drawn


def free_spans(analysis: Analysis) -> list[tuple[float, float]]:
    """Stretches of the log without contact. [s]"""
    try:
        own = analysis.motion.known.own
    except VftError:
        # Nothing is surely free; the list of contacts says so.
        return []
    t = analysis.t
    return [(float(t[start]), float(t[stop - 1])) for start, stop in runs_of(own)]


def highest(found: ContactList) -> float:
    """Upper end of the axis: peaks with bands, the least visible force, room. [N]"""
    tops = [2.5 * (found.detectable_force or 0.0)]
    for contact in found.contacts:
        if contact.peak_force is not None and contact.peak_band is not None:
            tops.append(1.12 * (contact.peak_force + min(contact.peak_band, contact.peak_force)))
        if (course := contact.course) is not None:
            tops.append(1.05 * float((course.force + np.minimum(course.band, course.force)).max()))
    return max(*tops, 0.0) or 1.0


def courses_of(
    scales: Scales, contacts: Sequence[Contact], stretches: int
) -> Iterator[tuple[str, str]]:
    """Every contact's |F| with its band, as paths."""
    for course in (c.course for c in contacts if c.course is not None):
        # A contact's share of the log's stretches: hundreds must not make a large page.
        share = float(course.t[-1] - course.t[0]) / (scales.x.high - scales.x.low)
        t, force = thinned(course.t, course.force, max(round(share * stretches), FEWEST))
        half = np.interp(t, course.t, course.band)
        # A band beyond the force leaves the chart.
        above = np.minimum(force + half, scales.y.high)
        yield ribbon(scales, t, np.maximum(force - half, 0.0), above), path_of(scales, t, force)


def placed_numbers(scales: Scales, contacts: Sequence[Contact]) -> Iterator[tuple[int, float]]:
    """The contacts' numbers above the plot, with room."""
    last = -np.inf
    for contact in contacts:
        x = float(scales.across(0.5 * (contact.start + contact.stop)))
        half = 0.5 * LETTER * len(str(contact.number)) + 3.0
        if x - half >= last:
            last = x + half
            yield contact.number, x


def peaks_of(
    scales: Scales, contacts: Sequence[Contact]
) -> Iterator[tuple[float, float, float, float, str]]:
    """Every peak; the hardest with their sizes, with room."""
    labels: list[tuple[float, float]] = []
    for contact in sorted(contacts, key=by_force, reverse=True):
        force, band = contact.peak_force, contact.peak_band
        if force is None or band is None or contact.is_load:
            continue
        x, y = float(scales.across(contact.peak)), float(scales.up(force))
        text = banded(force, band, unit="")
        half = 0.5 * LETTER * len(text)
        middle = min(max(x, scales.box.left + half), scales.side - half)
        above = max(float(scales.up(force + band)), scales.box.top + 8) - 6.0
        if contact.size_known and all(abs(middle - at) > half + reach for at, reach in labels):
            labels.append((middle, half))
            yield x, y, middle, above, text
        else:
            yield x, y, middle, above, ""


class ArmDrawing(NamedTuple):
    """The arm from its side at a peak, as points of a drawing."""

    size: Array  #: Width and height. (2,)
    arm: Array  #: Base, the links' frames, flange. (n + 2, 2)
    hit: list[Array]  #: The probable places, a stretch or point each.
    #: The force: shaft, then head; none if it points out of the drawing.
    arrow: list[Array]


def arm_drawing(analysis: Analysis, contact: Contact) -> ArmDrawing:
    """The arm from its side at a peak, with the probable places."""
    q = resample_columns(np.array([contact.peak]), analysis.t, analysis.recording.q)
    frames = link_poses(analysis.robot.loaded_chain, q).translation[0]
    points = np.vstack([np.zeros(3), frames])
    across = side_of(points)
    flat = np.column_stack([points @ across, points[:, 2]])
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = float(np.min((SIZE - 2 * EDGE) / np.maximum(high - low, 1e-9)))
    # Drawings count downwards.
    drawn = 0.5 * (SIZE - scale * (high - low)) + scale * (flat - low)
    drawn[:, 1] = SIZE[1] - drawn[:, 1]
    # Point k + 1 is the frame of link k + 1, the last the flange's.
    hit = [drawn[-1:] if link == 0 else drawn[link : link + 2] for link in contact.places]
    shaft: list[Array] = []
    if hit and contact.wrench is not None:
        force = np.array([contact.wrench[:3] @ across, -contact.wrench[2]])
        size = max(float(np.linalg.norm(contact.wrench[:3])), 1e-12)
        shaft = arrow(np.vstack(hit).mean(axis=0), force / size)
    return ArmDrawing(SIZE, drawn, hit, shaft)


def side_of(points: Array) -> Array:
    """Horizontal direction of the arm's farthest reach, to the right. (3,)"""
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    direction = np.linalg.svd(flat, full_matrices=False)[2][0]
    # The arm reaches to the right; an upright one shows along y.
    if np.linalg.norm(flat) < 1e-9:
        return np.array([1.0, 0.0, 0.0])
    if direction @ (points[-1, :2] - points[0, :2]) < 0:
        direction = -direction
    return np.append(direction, 0.0)


def arrow(tip: Array, direction: Array) -> list[Array]:
    """An arrow that ends at a place, shorter the more it leaves the plane."""
    length = ARROW * float(np.linalg.norm(direction))
    if length < HEAD:
        return []
    along = direction / np.linalg.norm(direction)
    beside, neck = 0.6 * HEAD * np.array([-along[1], along[0]]), tip - HEAD * along
    return [np.vstack([tip - length * along, tip]), np.vstack([neck + beside, tip, neck - beside])]
