"""The three ways a robot file states its kinematics, each turned into the chain's frames.

A chain frame has its origin on the joint's axis, z along it, and turns with the link:

- ``modified-dh``: T_j = Rx(α) Tx(a) Rz(q+θ) Tz(d); the table's frame j is the chain's frame j moved
  along z by nothing (Tz commutes with Rz), so inertials stay where they are.
- ``standard-dh``: T_j = Rz(q+θ) Tz(d) Tx(a) Rx(α); the table gives inertials in the *distal* frame
  j, which sits at the far end of the link: they are moved by Tz(d) Tx(a) Rx(α).
- ``xyz-rpy``: T_j = Trans(xyz) R(rpy) Rz(q), as in a URDF whose axes are all z.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vftcli.signals.pose import IDENTITY, Pose, rotation_about, rpy_matrix


class Kinematics(NamedTuple):
    """What a convention yields."""

    placements: list[Pose]  #: Pose of chain frame j in chain frame j−1 at q = 0, one a joint.
    #: Pose of the table's inertial frame in chain frame j, one a joint.
    inertial_frames: list[Pose]
    tip: Pose  #: Pose of the tip in chain frame n.


DH = ("a", "d", "alpha", "theta")
#: Convention → the keys that each joint must have: those of one number, and those of three.
CONVENTIONS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "standard-dh": (DH, ()),
    "modified-dh": (DH, ()),
    "xyz-rpy": ((), ("xyz", "rpy")),
}


def kinematics(
    convention: str, joints: Sequence[Mapping[str, Any]], document: Mapping[str, Any]
) -> Kinematics:
    """Chain frames of a table; the tip is `flange_d` along z, then `ee_xyz` and `ee_rpy`."""
    out = Pose(np.eye(3), np.array([0.0, 0.0, float(document.get("flange_d", 0.0))]))
    turn = rpy_matrix(document.get("ee_rpy", (0.0, 0.0, 0.0)))
    tip = out @ Pose(turn, np.asarray(document.get("ee_xyz", (0.0, 0.0, 0.0)), dtype=float))
    placements, inertial_frames = [], [IDENTITY] * len(joints)
    for k, joint in enumerate(joints):
        if convention == "xyz-rpy":
            placements.append(Pose(rpy_matrix(joint["rpy"]), np.asarray(joint["xyz"], dtype=float)))
            continue
        R, about = rotation_about("x", joint["alpha"]), rotation_about("z", joint["theta"])
        if convention == "modified-dh":
            along = Pose(R, np.array([joint["a"], 0.0, 0.0]))
            placements.append(along @ Pose(about, np.array([0.0, 0.0, joint["d"]])))
        else:  # the table's frame is at the far end of its link
            before = inertial_frames[k - 1] if k else IDENTITY
            placements.append(before @ Pose(about, np.zeros(3)))
            inertial_frames[k] = Pose(R, np.array([joint["a"], 0.0, joint["d"]]))
    if convention == "standard-dh":
        tip = inertial_frames[-1] @ tip
    return Kinematics(placements, inertial_frames, tip)
