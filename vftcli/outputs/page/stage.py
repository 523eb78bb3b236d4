"""The page's stage: the arm in three dimensions, its view, and its contacts.

Capsules from the chain's geometry, in weak perspective from the side to which the arm
reaches; the page's script has an equal projection.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact
from vftcli.outputs import Record
from vftcli.outputs.contacts import contact_name, direction, place_words
from vftcli.outputs.grid import at_least_shown
from vftcli.outputs.page.packing import PageClock
from vftcli.outputs.page.shell import polyline
from vftcli.outputs.shapes import Surface, capsules, spot_of, touched_point
from vftcli.robots.chain import link_poses
from vftcli.signals.arrays import Z_95, Array, resample_columns, runs_of
from vftcli.signals.errors import VftError
from vftcli.signals.pose import Pose

ASIDE, PITCH = 0.45, 0.3  #: Turn of the view from the arm's side, and downwards. [rad]
AWAY = 4.2  #: Distance of the camera, in reaches.
POSES = 600  #: Most poses that the view is fitted to.
WIDEST = np.pi / 4  #: Half the angle of the widest drawn cone. [rad]
SHARES = 0.14, 0.6  #: Length of an arrow of no force, and the largest's more, in reaches.
MILLIMETRE = 1e-3  #: Step of a surface's corners. [m]
#: Size of the still drawing, and the part it fills.
WIDTH, HEIGHT, FILLED = 624.0, 448.0, 0.92


class View(NamedTuple):
    """The camera."""

    yaw: float  #: Direction to the right, from x towards y. [rad]
    pitch: float  #: Angle downwards. [rad]
    centre: Array  #: Point in the middle. (3,) [m]
    span: Array  #: Visible width and height. (2,) [m]
    reach: float  #: Largest distance of the flange from the base. [m]

    def seen(self, points: Array) -> Array:
        """Points of the still drawing, depth, units of 1 m. (K, 4)"""
        across, up, ahead = axes_of(self.yaw, self.pitch)
        moved, scale = points - self.centre, min(WIDTH / self.span[0], HEIGHT / self.span[1])
        near = FILLED * scale * self.nearness(points)
        x, y = WIDTH / 2 + near * (moved @ across), HEIGHT / 2 - near * (moved @ up)
        return np.column_stack([x, y, moved @ ahead, near])

    def nearness(self, points: Array) -> Array:
        """Size of things at points, by that in the middle. (K,)"""
        away = AWAY * self.reach
        depth = (points - self.centre) @ axes_of(self.yaw, self.pitch)[2]
        return np.asarray(away / (away + depth))


class StillArm(NamedTuple):
    """The arm at one moment, as paths of a drawing."""

    parts: list[tuple[str, float, str]]  #: Path, width, kind; the farthest first.
    arrow: list[str]  #: Shaft and head of the force, none without one.
    label: tuple[float, float]  #: Place of its size.


def axes_of(yaw: float, pitch: float) -> Array:
    """Directions to the right, upwards and ahead of a camera. (3, 3)"""
    (cy, cp), (sy, sp) = np.cos([yaw, pitch]), np.sin([yaw, pitch])
    return np.array([[cy, sy, 0.0], [-sy * sp, cy * sp, cp], [-sy * cp, cy * cp, -sp]])


def view_of(analysis: Analysis) -> View:
    """The view of all poses of the arm, with its arrows."""
    q = analysis.recording.q
    known = q[np.isfinite(q).all(axis=1)]
    every = known[:: max(len(known) // POSES, 1)] if len(known) else np.zeros((1, q.shape[1]))
    swept = link_poses(analysis.robot.chain, np.ascontiguousarray(every)).translation
    flange, points = swept[:, -1], [np.zeros((1, 3)), swept.reshape(-1, 3)]
    reach = np.linalg.norm(flange, axis=1).max() or 1.0
    sized = (c for c in analysis.listed if c.wrench is not None and c.size_known)
    points += (arrow_of(analysis, contact, reach)[:1] for contact in sized)
    mean = flange.mean(axis=0)
    yaw = np.arctan2(mean[1], mean[0]) - ASIDE if np.hypot(*mean[:2]) > 0.05 else -ASIDE
    axes, places = axes_of(yaw, PITCH), np.vstack(points)
    view = View(yaw, PITCH, mean, mean, reach)
    for _ in range(3):
        # Near things look larger, which shifts the middle.
        x, y = ((places - view.centre) @ axes[:2].T * view.nearness(places)[:, None]).T
        middle = 0.5 * np.array([x.min() + x.max(), y.min() + y.max()])
        view = view._replace(centre=view.centre + middle @ axes[:2])
    thick = 4.0 * max(each.radius for part in capsules(analysis.robot.chain) for each in part)
    return view._replace(span=np.array([np.ptp(x), np.ptp(y)]) + thick)


def pose_at(analysis: Analysis, t: float) -> Pose:
    """Poses of links and flange at a time. (1, n + 1, …)"""
    q = resample_columns(np.array([t]), analysis.t, analysis.recording.q)
    return link_poses(analysis.robot.chain, q)


def arrow_of(analysis: Analysis, contact: Contact, reach: float) -> Array:
    """Tail and tip of a contact's force at its peak. (2, 3) [m]"""
    (tip,) = touched_point(contact, pose_at(analysis, contact.peak).translation)
    share = min((contact.peak_force or 0.0) / most_force(analysis.listed), 1.0)
    return np.vstack([tip - reach * (SHARES[0] + SHARES[1] * share) * along(contact), tip])


def along(contact: Contact) -> Array:
    """Direction of a contact's force at its peak. (3,)"""
    force = np.zeros(3) if contact.wrench is None else contact.wrench[:3]
    return force / max(float(np.linalg.norm(force)), 1e-12)


def most_force(contacts: Sequence[Contact]) -> float:
    """The largest force of known size, 1 without one. [N]"""
    return max((c.peak_force or 0.0 for c in contacts if c.size_known), default=1.0)


def cone_of(contact: Contact) -> float:
    """Half the angle of a force's 95 % cone. [rad]"""
    if contact.wrench_sd is None or not contact.peak_force:
        return 0.0
    # Mean variance of the two directions across the force.
    across = np.sum(contact.wrench_sd[:3] ** 2 * (1.0 - along(contact) ** 2)) / 2.0
    return float(np.arctan(Z_95 * np.sqrt(across) / contact.peak_force))


def still_arm(analysis: Analysis, view: View, contact: Contact | None) -> StillArm:
    """The arm at a contact's peak, else at the log's start."""
    pose = pose_at(analysis, float(analysis.t[0]) if contact is None else contact.peak)
    rotation = np.concatenate([np.eye(3)[None], pose.rotation[0]])
    origin = np.vstack([np.zeros(3), pose.translation[0]])
    places, parts = contact.places if contact is not None else (), []
    touched = {place or analysis.robot.joints for place in places}
    for frame, shapes in enumerate(capsules(analysis.robot.chain)):
        for shape in shapes:
            ends = np.vstack([shape.start, shape.start + shape.direction])
            drawn = view.seen(ends @ rotation[frame].T + origin[frame])
            kind = "hit" if frame in touched else shape.kind
            width = 2.0 * shape.radius * drawn[0, 3]
            parts.append((float(drawn[:, 2].sum()), polyline(drawn[:, :2]), width, kind))
    parts.sort(key=lambda part: -part[0])
    arrow, label = list[str](), (0.0, 0.0)
    if contact is not None and contact.wrench is not None and contact.peak_force is not None:
        tail, tip = view.seen(arrow_of(analysis, contact, view.reach))[:, :2]
        ahead = (tip - tail) / max(np.linalg.norm(tip - tail), 1e-9)
        beside, neck = 5.5 * np.array([-ahead[1], ahead[0]]), tip - 13.0 * ahead
        arrow = [polyline(np.vstack([tail, neck])), polyline([neck + beside, tip, neck - beside])]
        x, y = tail - np.array([24.0, 18.0]) * ahead
        label = np.clip(x, 40.0, WIDTH - 40.0), np.clip(y, 14.0, HEIGHT - 8.0)
    return StillArm([part[1:] for part in parts], arrow, label)


def free_spans(analysis: Analysis) -> list[tuple[float, float]]:
    """Stretches of the log known to be without contact. [s]"""
    t, found = analysis.t, analysis.contacts
    # None if only other runs are free.
    with suppress(VftError):
        if found is not None and found.basis == "free motion":
            own = runs_of(analysis.motion.known.own)
            return [(float(t[start]), float(t[stop - 1])) for start, stop in own]
    return []


def stage_data(
    analysis: Analysis, view: View, surfaces: Mapping[int, Surface], clock: PageClock
) -> Record:
    """The script's data on arm and contacts; `surfaces` by link."""
    found, chain, sensed = analysis.contacts, analysis.robot.chain, analysis.virtual_sensor
    least = found.detectable_force if found is not None else None
    hardest = found.hardest if found is not None else None
    sure = found is not None and found.tells_untouched
    frame = sensed.sensor.frame if sensed is not None else ""
    # A load lasts: contacts meanwhile come before it.
    ordered = sorted(analysis.listed, key=lambda contact: contact.is_load)
    turned = np.concatenate([chain.rotation, chain.flange_rotation[None]]).reshape(-1, 9)
    moved = np.vstack([chain.translation, chain.flange_translation])
    return {
        "chain": [*zip(np.round(turned, 9).tolist(), np.round(moved, 9).tolist(), strict=True)],
        "q": [clock.pose(column) for column in analysis.recording.q.T],
        "shapes": [
            (link, *np.round([s.start, s.start + s.direction], 4).tolist(), s.radius, s.kind)
            for link, shapes in enumerate(capsules(chain))
            for s in shapes
        ],
        # Per link: corners' x, y and z, then corners of triangles.
        "surfaces": [
            (surface := surfaces.get(link))
            and [clock.blob.add(x, MILLIMETRE) for x in surface.corners.T]
            + [clock.blob.add(k, 1.0) for k in surface.faces.T]
            for link in range(chain.joints + 1)
        ],
        # Axes known to the script; others show the peak's direction.
        "wrench": {"flange": frame == "flange"} if frame in {"base", "flange"} else None,
        "view": view._replace(centre=view.centre.tolist(), span=view.span.tolist())._asdict(),
        "contacts": [contact_data(c, chain.joints, clock) for c in ordered],
        "first": 0 if hardest is None else clock.index(hardest.peak),
        "most": most_force(analysis.listed),
        "floor": least,
        # Number, band and words of a moment without one.
        "none": (
            "–" if least is None or not sure else f"< {at_least_shown(least)}",
            "",
            "no contact" if sure else "no contact listed" if found is not None else "",
        ),
        "free": free_spans(analysis),
        "stops": () if found is None else found.stops,
    }


def contact_words(contact: Contact) -> str:
    """A contact's name, place, direction, a wide cone's angle."""
    said = [contact_name(contact), place_words(contact)]
    if contact.wrench is not None:
        cone = cone_of(contact)
        unsure = f" (± {np.degrees(cone):.0f}°)" if cone > WIDEST else ""
        said.append(direction(contact.wrench[:3]) + unsure)
    return " · ".join(said)


def contact_data(contact: Contact, joints: int, clock: PageClock) -> Record:
    """A contact for the script: its moment, its words, its place."""
    cone = cone_of(contact)
    size, _, band = contact.size.partition(" ") if contact.wrench is not None else ("",) * 3
    return {
        "number": contact.number,
        "name": contact_name(contact),
        **{key: round(getattr(contact, key), 4) for key in ("start", "stop", "peak")},
        "i": clock.index(contact.peak),
        "size": contact.peak_force and round(contact.peak_force, 2),
        "half": contact.peak_band and round(contact.peak_band, 2),
        "sized": contact.peak_force is not None and not contact.place_unknown,
        "force": size,
        "band": band,
        "words": contact_words(contact),
        "weak": contact.trust == "weak",
        "load": contact.is_load,
        "sure": contact.where != "cannot tell",
        # Frames of touched links, and the two beside the force's place.
        "frames": [place or joints for place in contact.places],
        "spot": spot_of(contact, joints),
        "along": np.round(along(contact), 3).tolist(),
        # A wider one would fill the picture: 0, with a dashed arrow.
        "cone": round(cone, 3) if cone <= WIDEST else 0,
    }
