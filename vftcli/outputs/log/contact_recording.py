"""Contacts in a Rerun recording: |F| over time, a log of what happened, the arrow at the place.

Entities: `/force` with |F|, its band and the spans of the contacts, `/force/points` with the peaks,
`/contacts/1` … with the arrow and the words of each contact, `/remarks` with what limits the list.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.observers.table import BEST
from vftcli.outputs.answer import beginning
from vftcli.outputs.page.charts import REFERENCE, Chart, ChartLine
from vftcli.outputs.palette import COLOURS, PLACES, SPARE
from vftcli.outputs.palette import REFERENCE as GREY
from vftcli.outputs.quantity import at_least_shown
from vftcli.outputs.rerun_arm import ArmPoses, PaintedSpan, Stream, send_force
from vftcli.outputs.rerun_file import BAR, CONTACTS, EDGES, LogLine
from vftcli.robots.chain import Chain
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import sentence
from vftcli.signals.wrench import COVERS, Wrench

BELOW = 0.06  #: The spans of the contacts lie below zero by this share of the largest force.
#: The band of |F|: the colour of `best`, paler.
BAND = "#e98aa2"


def best_wrench(analysis: Analysis) -> Wrench | None:
    """The wrench of `best`, None where there is none."""
    return next((w for w in analysis.wrenches if w.name == BEST), None)


def force_plot(analysis: Analysis) -> Chart | None:
    """|F| with its 95 % band, the spans of the contacts below it, their peaks as points.

    None where no wrench of `best` is known, as of an arm of less than six joints.
    """
    wrench, found, sensed = best_wrench(analysis), analysis.contacts, analysis.virtual_sensor
    if wrench is None:
        return None
    size, sd = wrench.size[:, None], wrench.size_sd
    lines = []
    if sensed is not None and sensed.reference is not None:
        lines.append(ChartLine("reference", sensed.reference.size[:, None], REFERENCE))
    lines.append(ChartLine("|F|", size, COLOURS[BEST], leads=True))
    if sd is not None:
        half = COVERS * sd[:, None]
        edges = zip(EDGES, (size + half, np.maximum(size - half, 0.0)), strict=True)
        lines += [ChartLine(name, edge, BAND) for name, edge in edges]
    title = "|F| on the robot"
    if found is not None:
        title += " as at the flange, 95 % band; bars: touched; diamonds: peaks by place"
        if found.detectable_force is not None:
            least = np.full_like(size, found.detectable_force)
            lines.append(ChartLine("smallest that is listed", least, SPARE[7]))
            title += (
                f"; green: {at_least_shown(found.detectable_force)}, the smallest that is listed"
            )
        # The peak of every contact with a force; a load has a mean and no peak.
        felt = [c for c in found.contacts if c.peak_force is not None and not c.is_load]
        force = np.array([c.peak_force for c in felt], dtype=float)
        tallest = np.nanmax(np.concatenate([size[:, 0], [1.0], force]))
        lines += span_lines(analysis.t, found, -BELOW * float(tallest))
        if felt:
            when = np.array([c.peak for c in felt])
            lines.append(ChartLine("peaks", force[:, None], COLOURS[BEST], x=when))
    return Chart("/force", title, ("N",), (title,), analysis.t, tuple(lines))


def span_lines(t: Array, found: ContactList, level: float) -> Iterator[ChartLine]:
    """A bar a contact at one level, a line a part of the arm, so that the legend names them."""
    for where, colour in PLACES.items():
        bar = np.full((len(t), 1), np.nan)
        for contact in found.contacts:
            if contact.where == where:
                bar[(t >= contact.start) & (t <= contact.stop)] = level
        if np.isfinite(bar).any():
            yield ChartLine(f"{BAR}{where}", bar, colour)


def contact_log(found: ContactList) -> list[LogLine]:
    """Start of each contact, its facts, and limits of the list."""
    lines = []
    for contact in found.contacts:
        path, colour = f"{CONTACTS}/{contact.number}", PLACES[contact.where]
        lines.append(LogLine(path, contact.start, beginning(contact), colour))
    for remark in found.remarks:
        begins = remark.where.span[0] if remark.where.span is not None else 0.0
        lines.append(LogLine("/remarks", begins, sentence(remark), GREY, "WARN"))
    if not found.contacts:
        lines.append(LogLine("/remarks", 0.0, "nothing touched the arm, as far as known", GREY))
    return lines


def painted_links(found: ContactList, joints: int) -> dict[int, list[PaintedSpan]]:
    """Number of a link → when it is one of those that were touched, in the colour of the part."""
    spans: dict[int, list[PaintedSpan]] = {}
    for contact in found.contacts:
        span = PaintedSpan(contact.start, contact.stop, PLACES[contact.where])
        for link in sorted({place or joints for place in contact.places}):
            spans.setdefault(link, []).append(span)
    return spans


def send_contacts(
    stream: Stream,
    found: ContactList,
    poses: ArmPoses,
    force: Array | None,
    scale: float,
) -> None:
    """Send the arrow of each contact, while it lasts, at its place.

    On the wrist it is the force as it runs; elsewhere, where the flange's would be another, that of
    the contact's peak.

    Args:
        stream: The recording.
        found: The contacts.
        poses: Where the arm has been.
        force: Force of `best` at these poses in base axes, None where there is none. (S, 3) [N]
        scale: Newtons that are 1 m.
    """
    for contact in found.contacts:
        if contact.wrench is None:
            continue
        first = np.searchsorted(poses.t, contact.start)
        # One more: the last arrow goes with the first pose after the contact.
        last = np.searchsorted(poses.t, contact.stop, side="right")
        rows = slice(int(first), min(int(last) + 1, len(poses.t)))
        t, origin = poses.t[rows], touched_point(contact, poses.translation[rows])
        arrows = np.tile(contact.wrench[:3], (len(t), 1))
        if force is not None and contact.where == "wrist":
            arrows = np.where(np.isfinite(force[rows]), force[rows], arrows)
        arrows[t > contact.stop] = np.nan
        path, colour = f"{CONTACTS}/{contact.number}", PLACES[contact.where]
        send_force(stream, path, t, origin, arrows, scale=scale, colour=colour)


def touched_point(contact: Contact, origins: Array) -> Array:
    """The flange where it fits, else the middle of the last link that does. (S, 3) [m]

    Args:
        contact: The contact.
        origins: Origins of the links and of the flange in the base frame. (S, n+1, 3) [m]
    """
    links: Sequence[int] = [place for place in contact.places if place]
    if 0 in contact.places or not links:
        flange: Array = origins[:, -1]
        return flange
    middle: Array = 0.5 * (origins[:, links[-1] - 1] + origins[:, links[-1]])
    return middle


def flange_force(analysis: Analysis, q: Array, sampled: np.ndarray, chain: Chain) -> Array | None:
    """The force of `best` at some of the log's samples, in base axes, None without one. (S, 3) [N]

    Args:
        analysis: The log.
        q: Joint positions of the samples. (S, n) [rad]
        sampled: Their rows in the log. (S,)
        chain: The arm.
    """
    wrench, sensed = best_wrench(analysis), analysis.virtual_sensor
    if wrench is None or sensed is None:
        return None
    return sensed.sensor.arrow(wrench.force[sampled], q, chain).force
