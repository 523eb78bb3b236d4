"""The arm as it is drawn without meshes, capsules from its chain, and where a force acts on it."""

from typing import NamedTuple

import numpy as np

from vftcli.contacts.contact_list import Contact
from vftcli.robots.chain import Chain
from vftcli.signals.arrays import Array

#: Radius of the first and of the last link, as a share of the arm's length.
THICKNESS = (0.048, 0.030)
SHORTEST = 0.02  #: A link shorter than this share of the arm's length is not drawn: its joints are.


class Capsule(NamedTuple):
    """A cylinder with round ends, in the axes of the frame it moves with."""

    start: Array  #: Centre of one end. (3,) [m]
    direction: Array  #: From one end's centre to the other's. (3,) [m]
    radius: float  #: Radius. [m]
    joint: bool  #: Whether it is a joint, not a link.


def capsules(chain: Chain) -> list[list[Capsule]]:
    """Parts on the base and on each link: n + 1 lists, base first."""
    n = chain.joints
    offsets = np.vstack([chain.translation, chain.flange_translation])
    length = float(np.linalg.norm(offsets, axis=1).sum())  # of the stretched arm
    radii = length * np.linspace(*THICKNESS, n + 1)
    shapes: list[list[Capsule]] = []
    for j in range(n + 1):
        shapes.append([])
        # A joint is a short thick cylinder about its axis, which is z of the link that it
        # moves.
        if j > 0:
            axis = np.array([0.0, 0.0, 2.2 * radii[j]])
            shapes[j].append(Capsule(-0.5 * axis, axis, 1.18 * radii[j], joint=True))
        if np.linalg.norm(offsets[j]) > SHORTEST * length:
            shapes[j].append(Capsule(np.zeros(3), offsets[j], radii[j], joint=False))
    return shapes


def spot_of(contact: Contact, joints: int) -> tuple[int, int]:
    """Frames between which a force acts: the flange's twice, or both ends of a link."""
    if 0 in contact.places or not contact.places:
        return joints + 1, joints + 1
    return contact.places[-1], contact.places[-1] + 1


def touched_point(contact: Contact, origins: Array) -> Array:
    """Where a force acts, by the origins of links and flange. (S, 3), (S, n+1, 3) [m]"""
    first, last = spot_of(contact, origins.shape[1] - 1)
    return np.asarray(0.5 * (origins[:, first - 1] + origins[:, last - 1]))
