"""The three ways a robot file states its kinematics, each turned into the chain's frames.

A chain frame has its origin on the joint's axis, z along it, and turns with the link:

- ``modified-dh``: T_j = Rx(α) Tx(a) Rz(q+θ) Tz(d); the table's frame j is the chain's frame j moved
  along z by nothing (Tz commutes with Rz), so inertials stay where they are.
- ``standard-dh``: T_j = Rz(q+θ) Tz(d) Tx(a) Rx(α); the table gives inertials in the *distal* frame
  j, which sits at the far end of the link: they are moved by Tz(d) Tx(a) Rx(α).
- ``xyz-rpy``: T_j = Trans(xyz) R(rpy) Rz(q), as in a URDF whose axes are all z.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vftcli.signals.pose import IDENTITY, Pose, rotation_about, rpy_matrix


class Kinematics(NamedTuple):
    """What a convention yields."""

    placements: list[Pose]  #: Pose of chain frame j in chain frame j−1 at q = 0, one a joint.
    #: Pose of the table's inertial frame in chain frame j, one a joint.
    inertial_frames: list[Pose]
    tip: Pose  #: Pose of the tip in chain frame n.


Joint = Mapping[str, Any]


def standard_dh(joints: Sequence[Joint], document: Mapping[str, Any]) -> Kinematics:
    """Chain frames of a standard (distal) Denavit-Hartenberg table; the tip is frame n's end."""
    placements, distal = [], []
    before = IDENTITY
    for joint in joints:
        placements.append(before @ Pose(rotation_about("z", joint["theta"]), np.zeros(3)))
        link = Pose(rotation_about("x", joint["alpha"]), np.array([joint["a"], 0.0, joint["d"]]))
        distal.append(link)
        before = link
    return Kinematics(placements, distal, distal[-1] @ tip_offset(document))


def modified_dh(joints: Sequence[Joint], document: Mapping[str, Any]) -> Kinematics:
    """Chain frames of a modified (proximal) Denavit-Hartenberg table; the tip is `flange_d` out."""
    placements = []
    for joint in joints:
        R = rotation_about("x", joint["alpha"])
        along = Pose(R, np.array([joint["a"], 0.0, 0.0]))
        screw = Pose(rotation_about("z", joint["theta"]), np.array([0.0, 0.0, joint["d"]]))
        placements.append(along @ screw)
    return Kinematics(placements, [IDENTITY] * len(joints), tip_offset(document))


def xyz_rpy(joints: Sequence[Joint], document: Mapping[str, Any]) -> Kinematics:
    """Chain frames stated as positions and fixed-axis angles."""
    placements = [Pose(rpy_matrix(j["rpy"]), np.asarray(j["xyz"], dtype=float)) for j in joints]
    return Kinematics(placements, [IDENTITY] * len(joints), tip_offset(document))


def tip_offset(document: Mapping[str, Any]) -> Pose:
    """The flange in the last frame: `flange_d` along z, then `ee_xyz` and `ee_rpy`."""
    out = Pose(np.eye(3), np.array([0.0, 0.0, float(document.get("flange_d", 0.0))]))
    turn = rpy_matrix(document.get("ee_rpy", (0.0, 0.0, 0.0)))
    return out @ Pose(turn, np.asarray(document.get("ee_xyz", (0.0, 0.0, 0.0)), dtype=float))


class Convention(NamedTuple):
    """A convention: the keys each joint must have, and the function that reads them."""

    numbers: tuple[str, ...]
    vectors: tuple[str, ...]
    kinematics: Callable[[Sequence[Joint], Mapping[str, Any]], Kinematics]


DH = ("a", "d", "alpha", "theta")
CONVENTIONS: dict[str, Convention] = {
    "standard-dh": Convention(DH, (), standard_dh),
    "modified-dh": Convention(DH, (), modified_dh),
    "xyz-rpy": Convention((), ("xyz", "rpy"), xyz_rpy),
}
