"""|F| over the whole log with its band and its contacts: the chart that answers."""

from collections.abc import Sequence
from html import escape

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.outputs.contacts import by_force
from vftcli.outputs.page import figures
from vftcli.outputs.page.figures import Box, Scales, Span
from vftcli.signals.errors import VftError
from vftcli.signals.intervals import runs_of

WIDE = Box(width=1024, height=300, left=44, bottom=24, top=28, right=10)
#: The same chart for a screen and for a telephone, whose letters would be too small else.
NARROW = Box(width=400, height=260, left=38, bottom=24, top=28, right=8)
STRETCHES = {WIDE: 600, NARROW: 200}  #: Stretches of the line in each of them.
FEWEST = 6  #: Fewest stretches of one contact's line.
LETTER = 7.5  #: Width of a letter, for labels that shall not run into one another.


def hero(analysis: Analysis, found: ContactList) -> str:
    """The chart in both widths with what it shows in words below."""
    drawn = "".join(
        figures.svg(box, "Force on the robot over time", content(analysis, found, box), kind=kind)
        for box, kind in ((WIDE, "wide"), (NARROW, "narrow"))
    )
    words = caption(analysis, found)
    return f'<figure class="hero" id="timeline">{drawn}<figcaption>{words}</figcaption></figure>'


def caption(analysis: Analysis, found: ContactList) -> str:
    """What the marks of the chart mean; only those that are there."""
    if found.hardest is None:
        words = ["Yellow: contact."] if found.contacts else []
    else:
        words = ["Size of the force on the robot, at the place that each contact names."]
        words.append("Blue: 95 % band. Yellow: contact.")
    if (least := told(found)) is not None:
        words.append(f"Grey: below {least:.0f} N, what this log cannot tell from none.")
    if free_spans(analysis):
        words.append("Hatched: motion known to be free.")
    if found.stops:
        words.append("Dashed: the arm stopped abruptly.")
    return escape(" ".join(words))


def told(found: ContactList) -> float | None:
    """The smallest force that the log can tell, None where that is not known. [N]"""
    return found.told_force


def free_spans(analysis: Analysis) -> list[tuple[float, float]]:
    """Stretches of the log that are known to be free of contact. [s]"""
    try:
        own = analysis.motion.known.own
    except VftError:
        # Nothing is known to be free, which the list of contacts says.
        return []
    t = analysis.t
    return [(float(t[start]), float(t[stop - 1])) for start, stop in runs_of(own)]


def content(analysis: Analysis, found: ContactList, box: Box) -> str:
    """Everything inside of the drawing."""
    t = analysis.t
    scales = Scales(box, Span(float(t[0]), float(t[-1])), Span(0.0, highest(found)))
    force = found.hardest is not None or told(found) is not None
    hatch = f"free-{box.width:g}"  # named by the chart: two may stand on one page
    parts = [
        f'<defs><pattern id="{hatch}" width="7" height="7" '
        'patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
        '<path d="M0 0V7" class="hatch"/></pattern></defs>'
    ]
    fill = f'fill="url(#{hatch})"'
    parts += [figures.stripe(scales, *span, fill) for span in free_spans(analysis)]
    parts += [stripe_of(scales, contact) for contact in found.contacts]
    if (least := told(found)) is not None:
        parts.append(limit(scales, least))
    parts.append(figures.axes(scales, "s", (10 if box is WIDE else 4, 4 if force else 0)))
    if force:
        parts.append(f'<text x="4" y="{box.top - 12:g}">|F| in N</text>')
    parts += [course_of(scales, contact, STRETCHES[box]) for contact in found.contacts]
    parts += [stop_of(scales, at) for at in found.stops]
    parts += [*numbers(scales, found.contacts), *peaks(scales, found.contacts)]
    return "".join(parts)


def highest(found: ContactList) -> float:
    """Upper end of the axis: every peak with its band, what cannot be told, and room. [N]"""
    tops = [2.5 * (told(found) or 0.0)]
    for contact in found.contacts:
        if contact.peak_force is not None and contact.peak_band is not None:
            tops.append(1.12 * (contact.peak_force + min(contact.peak_band, contact.peak_force)))
        if (course := contact.course) is not None:
            tops.append(1.05 * float((course.force + np.minimum(course.band, course.force)).max()))
    return max(*tops, 0.0) or 1.0


def stripe_of(scales: Scales, contact: Contact) -> str:
    """A contact's time, which the table's rows link to."""
    mark = f' id="mark-{contact.number}"' if scales.box is WIDE else ""
    return figures.stripe(scales, contact.start, contact.stop, f'class="contact"{mark}')


def limit(scales: Scales, least: float) -> str:
    """What lies below the smallest force that can be told."""
    y = float(scales.up(least))
    width = scales.side - scales.box.left
    return figures.rectangle(scales.box.left, y, width, scales.floor - y, 'class="untold"')


def course_of(scales: Scales, contact: Contact, stretches: int) -> str:
    """A contact's |F| with its band."""
    course = contact.course
    if course is None:
        return ""
    # A contact's share of the log's stretches: hundreds of them shall not make a large page.
    share = float(course.t[-1] - course.t[0]) / (scales.x.high - scales.x.low)
    t, force = figures.thinned(course.t, course.force, max(round(share * stretches), FEWEST))
    half = np.interp(t, course.t, course.band)
    # What is wider than the force may be leaves the chart.
    above = np.minimum(force + half, scales.y.high)
    band = figures.ribbon(scales, t, np.maximum(force - half, 0.0), above, 'class="band"')
    return band + figures.line(scales, t, force, 'class="force"')


def stop_of(scales: Scales, at: float) -> str:
    """When the arm stopped."""
    x = float(scales.across(at))
    return f'<path class="stop" d="M{x:.1f} {scales.box.top:g}V{scales.floor:.1f}"/>'


def numbers(scales: Scales, contacts: Sequence[Contact]) -> list[str]:
    """The contacts' numbers above the plot, each a link to its row, as far as there is room."""
    parts, last = [], -np.inf
    for contact in contacts:
        x = float(scales.across(0.5 * (contact.start + contact.stop)))
        half = 0.5 * LETTER * len(str(contact.number)) + 3.0
        if x - half < last:
            continue
        last = x + half
        parts.append(
            f'<a href="#contact-{contact.number}"><text class="number" x="{x:.1f}" '
            f'y="{scales.box.top - 8:g}" text-anchor="middle">{contact.number}</text></a>'
        )
    return parts


def peaks(scales: Scales, contacts: Sequence[Contact]) -> list[str]:
    """A dot at every peak; the hardest ones' sizes beside it, as far as there is room."""
    parts: list[str] = []
    taken: list[tuple[float, float]] = []
    hardest = sorted(contacts, key=by_force, reverse=True)
    for contact in hardest:
        if contact.peak_force is None or contact.peak_band is None or contact.is_load:
            continue
        x, y = float(scales.across(contact.peak)), float(scales.up(contact.peak_force))
        parts.append(f'<circle class="peak" cx="{x:.1f}" cy="{y:.1f}" r="3.5"/>')
        if not contact.size_known:
            continue
        text = f"{contact.peak_force:.0f} ± {contact.peak_band:.0f}"
        half = 0.5 * LETTER * len(text)
        middle = min(max(x, scales.box.left + half), scales.side - half)
        above = max(float(scales.up(contact.peak_force + contact.peak_band)), scales.box.top + 8)
        if all(abs(middle - other) > half + reach for other, reach in taken):
            taken.append((middle, half))
            parts.append(
                f'<text class="value" x="{middle:.1f}" y="{above - 6:.1f}" '
                f'text-anchor="middle">{text}</text>'
            )
    return parts
