"""A small drawing of the arm at a contact: where it was touched, and from which side."""

import numpy as np

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact
from vftcli.robots.kinematics import link_poses
from vftcli.signals.arrays import Array
from vftcli.signals.series import resample_columns

WIDTH, HEIGHT, EDGE = 84.0, 64.0, 9.0  #: Size of the drawing and its margin.
ARROW, HEAD = 20.0, 5.0  #: Length of an arrow that lies in the drawing's plane, and of its head.


def arm_drawing(analysis: Analysis, contact: Contact) -> str:
    """SVG of the arm from its side at the contact's peak, the places that fit marked."""
    q = resample_columns(np.array([contact.peak]), analysis.t, analysis.recording.q)
    frames = link_poses(analysis.robot.loaded_chain, q).translation[0]
    points = np.vstack([np.zeros(3), frames])
    across = side_of(points)
    flat = np.column_stack([points @ across, points[:, 2]])
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = float(np.min((np.array([WIDTH, HEIGHT]) - 2 * EDGE) / np.maximum(high - low, 1e-9)))
    room = 0.5 * (np.array([WIDTH, HEIGHT]) - scale * (high - low))
    # Drawings count downwards.
    drawn = room + scale * (flat - low)
    drawn[:, 1] = HEIGHT - drawn[:, 1]
    base = drawn[0]
    ground = f'<path class="ground" d="M{base[0] - 12:.1f} {base[1]:.1f}h24"/>'
    parts = [ground, f'<path class="link" d="{polyline(drawn)}"/>']
    # Row k + 1 of the points is the frame of link k + 1, the last the flange's.
    stretches = [drawn[-1:] if link == 0 else drawn[link : link + 2] for link in contact.places]
    if stretches:
        parts.append(f'<path class="hit" d="{"".join(map(polyline, stretches))}"/>')
    if stretches and contact.wrench is not None:
        force = np.array([contact.wrench[:3] @ across, -contact.wrench[2]])
        tip = np.vstack(stretches).mean(axis=0)
        parts.append(arrow(tip, force / max(float(np.linalg.norm(contact.wrench[:3])), 1e-12)))
    return (
        f'<svg class="arm" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" aria-hidden="true">'
        f"{''.join(parts)}</svg>"
    )


def side_of(points: Array) -> Array:
    """The horizontal direction in which the arm reaches furthest, to the right. (3,)"""
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    direction = np.linalg.svd(flat, full_matrices=False)[2][0]
    # The arm reaches to the right; one that stands upright is seen along y.
    if np.linalg.norm(flat) < 1e-9:
        return np.array([1.0, 0.0, 0.0])
    if direction @ (points[-1, :2] - points[0, :2]) < 0:
        direction = -direction
    return np.append(direction, 0.0)


def polyline(points: Array) -> str:
    """Points as the text of an SVG path; a single one is a dot."""
    text = "M" + " ".join(f"{x:.1f} {y:.1f}" for x, y in points)
    return text + ("h.01" if len(points) == 1 else "")


def arrow(tip: Array, direction: Array) -> str:
    """An arrow that ends at a place; the more it points out of the drawing, the shorter it is."""
    length = ARROW * float(np.linalg.norm(direction))
    if length < HEAD:
        return ""
    along = direction / np.linalg.norm(direction)
    beside = np.array([-along[1], along[0]])
    tail, neck = tip - length * along, tip - HEAD * along
    head = np.vstack([neck + 0.6 * HEAD * beside, tip, neck - 0.6 * HEAD * beside])
    return f'<path class="arrow" d="{polyline(np.vstack([tail, tip]))}{polyline(head)}"/>'
