"""The serial chain: the constants every computation on an arm starts from.

Frame j has its origin *on* axis j, its z along the axis, and turns with link j, whatever
the description's convention (standard DH, modified DH, xyz-rpy, URDF with any axis).
Inertials are moved into these frames on loading. Kernels, kinematics and the Pinocchio
model are all made from a chain.

A robot file states its kinematics in one of three ways:

- ``modified-dh``: T_j = Rx(α) Tx(a) Rz(q+θ) Tz(d); the table's frame j is the chain's (Tz
  commutes with Rz), so inertials stay as they are.
- ``standard-dh``: T_j = Rz(q+θ) Tz(d) Tx(a) Rx(α); the table gives inertials in the
  *distal* frame j, at the far end of the link: they are moved by Tz(d) Tx(a) Rx(α).
- ``xyz-rpy``: T_j = Trans(xyz) R(rpy) Rz(q), as in a URDF with all axes z.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from typing import Any, NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Indices, check_shape, seal
from vftcli.signals.errors import RobotError
from vftcli.signals.packages import needed
from vftcli.signals.parsing import check_kind
from vftcli.signals.pose import IDENTITY, Pose, rotation_about, rpy_matrix
from vftcli.signals.shown import Shown, record


@record
class Payload(Shown):
    """A rigid load on the flange."""

    mass: float  #: Mass. [kg]
    com: Array  #: Centre of mass in the flange frame. (3,) [m]
    #: Tensor about it, in flange axes; zero for a point. (3, 3) [kg·m²]
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def __post_init__(self) -> None:
        seal(self, "com", shape=(3,), called="the payload")
        seal(self, "inertia", shape=(3, 3), called="the payload")
        if why := unphysical(self.mass, self.inertia):
            raise RobotError(f"the payload is unphysical: {why}")


@record
class Chain(Shown):
    """Geometry and inertia of a revolute serial arm at rest on its base."""

    names: tuple[str, ...]  #: Joint names, base to tip.
    rotation: Array  #: Orientation of frame j in frame j−1 at q = 0. (n, 3, 3)
    translation: Array  #: Origin of frame j in frame j−1. (n, 3) [m]
    mass: Array  #: Link masses. (n,) [kg]
    com: Array  #: Centres of mass in the link's own frame. (n, 3) [m]
    #: Inertia tensors about the centre of mass, in the link's axes. (n, 3, 3) [kg·m²]
    inertia: Array
    rotor_inertia: Array  #: Rotor inertia reflected to the joint side. (n,) [kg·m²]
    #: Gravity vector in base axes, (0, 0, −9.81) for an upright base. (3,) [m/s²]
    gravity: Array
    flange_rotation: Array  #: Orientation of the flange in frame n. (3, 3)
    flange_translation: Array  #: Origin of the flange in frame n. (3,) [m]

    def __post_init__(self) -> None:
        seal(self, *(name for name in vars(self) if name != "names"))

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.names)

    @classmethod
    def of(
        cls, names: Iterable[str], frames: Sequence[Pose], links: "Sequence[Body]", **more: Array
    ) -> "Chain":
        """The chain of its joints' names, frames and links.

        Frames are poses in the one before, the last the flange's; `more` is the other fields.
        """
        rotation, translation = map(np.array, zip(*frames, strict=True))
        return cls(
            names=tuple(names),
            rotation=rotation[:-1],
            translation=translation[:-1],
            flange_rotation=rotation[-1],
            flange_translation=translation[-1],
            **stacked(links),
            **more,
        )

    @property
    def bodies(self) -> list["Body"]:
        """The links, base to tip, each in the axes of its frame."""
        return list(map(Body, self.mass.tolist(), self.com, self.inertia))

    def with_payload(self, payload: Payload | None) -> "Chain":
        """The chain with a load on its flange, merged into the last link."""
        if payload is None:
            return self
        flange = Pose(self.flange_rotation, self.flange_translation)
        load = Body(payload.mass, payload.com, payload.inertia).moved(flange)
        *others, last = self.bodies
        return replace(self, **stacked([*others, merge_bodies([last, load])]))

    def to_pinocchio(self, name: str = "arm") -> Any:  # noqa: ANN401 - Pinocchio is untyped
        """The Pinocchio model of this chain, with a frame ``flange``; rotors: `armature`."""
        pin = needed("pinocchio", "a Pinocchio model (simulation, replay, --as-printed)")

        model = pin.Model()
        model.name = name
        parent = 0
        for j, (mass, com, inertia) in enumerate(self.bodies):
            placement = pin.SE3(self.rotation[j], self.translation[j])
            parent = model.addJoint(parent, pin.JointModelRZ(), placement, self.names[j])
            model.appendBodyToJoint(parent, pin.Inertia(mass, com, inertia), pin.SE3.Identity())
        flange = pin.SE3(self.flange_rotation, self.flange_translation)
        model.addFrame(pin.Frame("flange", parent, flange, pin.FrameType.OP_FRAME))
        model.armature = self.rotor_inertia
        model.gravity.linear = self.gravity
        return model


class Body(NamedTuple):
    """The inertia of a rigid body in the axes of some frame."""

    mass: float  #: [kg]
    com: Array  #: Centre of mass. (3,) [m]
    inertia: Array  #: Tensor about it. (3, 3) [kg·m²]

    def moved(self, pose: Pose) -> "Body":
        """The body in another frame's axes, by the pose of its own frame there."""
        R, r = pose
        return Body(self.mass, R @ self.com + r, R @ self.inertia @ R.T)


NO_BODY = Body(0.0, np.zeros(3), np.zeros((3, 3)))  #: That of a link without mass.


def merge_bodies(bodies: Sequence[Body]) -> Body:
    """One body of rigidly joined ones, all in one frame (parallel axes)."""
    mass = sum(body.mass for body in bodies)
    com = np.sum([body.mass * body.com for body in bodies], axis=0) / (mass or 1.0)
    inertias = [tensor + m * point_tensor(c - com) for m, c, tensor in bodies]
    return Body(mass, com, np.sum(inertias, axis=0))


def stacked(bodies: Sequence[Body]) -> dict[str, Any]:
    """Masses (n,), centres (n, 3) and tensors (n, 3, 3), by a chain's names of them."""
    values = map(np.array, zip(*bodies, strict=True))
    return dict(zip(Body._fields, values, strict=True))


def point_tensor(d: Array) -> Array:
    """Tensor of a point of 1 kg at d (3,) [m]. (3, 3) [m²]"""
    tensor: Array = np.dot(d, d) * np.eye(3) - np.outer(d, d)
    return tensor


def symmetric(entries: Sequence[float] | Array) -> Array:
    """Return the tensor of (xx, xy, xz, yy, yz, zz). (3, 3)"""
    xx, xy, xz, yy, yz, zz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def unphysical(mass: float, inertia: Array, *, triangle: bool = True) -> str:
    """Why no body can have this mass and tensor about its centre, or "".

    Principal moments p ≥ 0, none above the others' sum (`triangle`), but for 1e-6: rounding.
    """
    if not np.isfinite(mass) or mass < 0:
        return f"mass is {mass:g} kg; it must be zero or positive"
    if not np.isfinite(inertia).all():
        return "inertia is not finite"
    low, middle, high = np.linalg.eigvalsh(inertia)
    slack = 1e-6 * max(-low, high, 1e-12)
    if low < -slack:
        return f"inertia has the negative principal moment {low:.4g} kg·m²"
    if triangle and high > low + middle + slack:
        return (
            f"inertia breaks the triangle inequality: principal moment {high:.4g} is larger than "
            f"{low:.4g} + {middle:.4g} kg·m²"
        )
    return ""


def nearest_tensor(inertia: Array) -> Array:
    """The nearest tensor that a body can have, itself if it can. [kg·m²]

    Negative eigenvalues of the second moments Σ = ½ tr(I) 1 − I of its mass become zero.
    """
    if not unphysical(0.0, inertia):
        return inertia
    moments, axes = np.linalg.eigh(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    second = (axes * np.maximum(moments, 0.0)) @ axes.T
    nearest: Array = np.trace(second) * np.eye(3) - second
    return nearest


DH = ("a", "d", "alpha", "theta")
#: Convention → keys of each joint: single numbers, then vectors.
CONVENTIONS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "standard-dh": (DH, ()),
    "modified-dh": (DH, ()),
    "xyz-rpy": ((), ("xyz", "rpy")),
}


def kinematics(
    convention: str, joints: Sequence[Mapping[str, Any]], document: Mapping[str, Any]
) -> tuple[list[Pose], list[Pose]]:
    """Chain frames of a table, the flange's last, and inertial frames in the joints'."""
    out = Pose(np.eye(3), np.array([0.0, 0.0, document.get("flange_d", 0.0)]))
    turn = rpy_matrix(document.get("ee_rpy", (0.0, 0.0, 0.0)))
    tip = out @ Pose(turn, np.array(document.get("ee_xyz", (0.0, 0.0, 0.0)), float))
    # What a joint turns has a pose before its angle, and one from there to the inertia.
    before, after = [], [IDENTITY]
    for joint in joints:
        if convention == "xyz-rpy":
            before.append(Pose(rpy_matrix(joint["rpy"]), np.array(joint["xyz"], float)))
            after.append(IDENTITY)
            continue
        R, turned = rotation_about("x", joint["alpha"]), rotation_about("z", joint["theta"])
        a, d = np.array([joint["a"], 0.0, 0.0]), np.array([0.0, 0.0, joint["d"]])
        distal = convention == "standard-dh"
        before.append(Pose(turned) if distal else Pose(R, a) @ Pose(turned, d))
        after.append(Pose(R, a + d) if distal else IDENTITY)
    return [end @ start for end, start in zip(after, [*before, tip], strict=True)], after[1:]


POSES = 4096  #: Samples at a time, for the cache.


def link_poses(chain: Chain, q: Array) -> Pose:
    """Poses of joints, then flange, in the base frame for q (T, n) [rad]. (T, n+1)"""
    check_kind(chain, Chain, "the chain", "robot.chain")
    check_shape(q, ("T", chain.joints), "q", "the poses")
    samples, n = np.shape(q)
    # Time is the last axis: an entry is a row of memory.
    rotation, translation = np.empty((n + 1, 3, 3, samples)), np.empty((n + 1, 3, samples))
    turns = np.concatenate([chain.rotation, chain.flange_rotation[None]])
    shifts = np.vstack([chain.translation, chain.flange_translation])
    frames = np.concatenate([turns, shifts[:, :, None]], axis=2)
    q = np.column_stack([q, np.zeros(samples)])  # no angle turns the flange
    for start in range(0, samples, POSES):
        span = slice(start, start + POSES)
        cosine, sine = np.cos(q[span].T), np.sin(q[span].T)
        R, o = np.eye(3)[:, :, None], 0.0
        for j, frame in enumerate(frames):
            # A product of BLAS would round by the length, and a log in pieces otherwise.
            a, b, c = frame[:, :, None]
            x, y, z, step = (a * R[:, :1] + b * R[:, 1:2] + c * R[:, 2:]).swapaxes(0, 1)
            R, o = rotation[j, :, :, span], o + step
            R[:, 0], R[:, 2] = cosine[j] * x + sine[j] * y, z
            R[:, 1] = cosine[j] * y - sine[j] * x
            translation[j, :, span] = o
    return Pose(rotation.transpose(3, 0, 1, 2), translation.transpose(2, 0, 1))


def flange_jacobian(chain: Chain, q: Array) -> Array:
    """Jacobian of the flange point in base axes. (T, 6, n)

    Velocity, then angular velocity: Jᵀ takes a force and moment ON the robot to torques.
    """
    return link_jacobian(link_poses(chain, q), chain.joints)


def points_on(poses: Pose, link: Indices | int, share: Array | float) -> Array:
    """Points along links, joint (0) to next joint (1), in base axes. (T, …, 3) [m]"""
    start, end = poses.translation[:, link - 1], poses.translation[:, link]
    return (1.0 - share) * start + share * end


def link_jacobian(poses: Pose, link: int, share: float = 1.0) -> Array:
    """Jacobian of a point along a link, the last to the flange, base axes. (T, 6, n)"""
    axes = poses.rotation[:, :-1, :, 2].transpose(2, 1, 0)
    places = poses.translation[:, :-1].transpose(2, 1, 0)
    (a, b, c), (x, y, z) = axes, points_on(poses, link, share).T[:, None] - places
    rows = np.stack([b * z - c * y, c * x - a * z, a * y - b * x, *axes])
    rows[:, link:] = 0.0
    return np.ascontiguousarray(rows.transpose(2, 0, 1))
