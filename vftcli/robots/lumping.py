"""From a tree to a chain: what is locked is merged into the link that carries it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vftcli.robots.arm import TreeArm
from vftcli.robots.chain import Chain, improper, merge_bodies, nearest_tensor
from vftcli.robots.tree import Body, BodyTree, TreeJoint
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import IDENTITY, Pose, rotation_onto

#: What a flange is called, with or without a robot's prefix; the first that is there.
FLANGE_NAMES = (
    "flange", "tool0", "link8", "ee_link", "tcp", "hand_tcp", "attachment_site", "ee",
)  # fmt: skip
BASE = -1  #: The group of the links that do not move.


@dataclass(frozen=True)
class LumpedArm:
    """An arm of a tree with everything else locked."""

    tree: BodyTree  #: The tree.
    arm: TreeArm  #: Its arm.
    #: Position of each locked joint that is not at zero, by name. [rad or m]
    angles: Mapping[str, float]

    @cached_property
    def groups(self) -> dict[str, tuple[int, Pose]]:
        """Link → the arm's joint that moves it, from 0, or `BASE`, and its pose in that frame."""
        index = {joint.child: j for j, joint in enumerate(self.arm.joints)}
        found: dict[str, tuple[int, Pose]] = {self.tree.root: (BASE, IDENTITY)}
        for link in self.tree.links[1:]:
            joint = self.tree.above[link]
            group, pose = found[joint.parent]
            if link in index:
                found[link] = (index[link], IDENTITY)
            else:
                found[link] = (group, pose @ joint.at(self.position(joint)))
        return found

    def position(self, joint: TreeJoint) -> float:
        """Where a locked joint is held; one that follows another goes with it. [rad or m]"""
        if joint.name in self.angles:
            return self.angles[joint.name]
        if joint.follows in self.angles:
            return joint.multiplier * self.angles[joint.follows] + joint.offset
        return 0.0

    @cached_property
    def locked(self) -> tuple[TreeJoint, ...]:
        """The joints that could move and are locked, base to tip."""
        own = set(self.arm.joints)
        above = [self.tree.above[link] for link in self.tree.links[1:]]
        return tuple(j for j in above if j.kind != "fixed" and j not in own)

    def group_of(self, joint: TreeJoint) -> int:
        """Which of the arm's joints carries a locked one, from 0, or `BASE`."""
        return self.groups[joint.child][0]

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """The arm's links with all that is locked on them, each in its joint's frame."""
        nothing = Body(0.0, np.zeros(3), np.zeros((3, 3)))
        parts = [[nothing] for _ in self.arm.joints]
        for link in self.tree.links:
            group, (R, r) = self.groups[link]
            if group != BASE and (body := self.tree.bodies[link]) is not None:
                parts[group].append(Body(body.mass, R @ body.com + r, R @ body.inertia @ R.T))
        merged = []
        for joint, bodies in zip(self.arm.joints, parts, strict=True):
            body = Body(*merge_bodies(*map(list, zip(*bodies, strict=True))))
            if why := improper(body.mass, body.inertia):
                raise RobotError(
                    f"{self.tree.path}: the link of joint {joint.name!r} is unphysical: {why}"
                )
            merged.append(body)
        return tuple(merged)

    @cached_property
    def flange(self) -> tuple[str, Pose]:
        """Name of the flange and its pose in the last joint's frame.

        The link that the tip names, else a frame of a usual name that is fixed to the last link,
        else the farthest one.
        """
        last = self.arm.joints[-1].child
        if self.arm.end:
            return self.arm.end, self.groups[self.arm.end][1]
        frames = []
        for link, pose in self.tree.rigid_links(last):
            frames.append((link, pose))
            if link != last:
                frames.append((self.tree.above[link].name, pose))
        for wanted in FLANGE_NAMES:
            for name, pose in frames:
                if name == wanted or name.endswith(f"_{wanted}"):
                    return name, pose
        return max(frames, key=lambda frame: float(np.linalg.norm(frame[1].translation)))

    def chain(self) -> Chain:
        """The arm's constants, each frame turned so that z is the axis."""
        turn = np.eye(3)
        rotations, translations, coms, inertias = [], [], [], []
        for joint, body in zip(self.arm.joints, self.bodies, strict=True):
            place = self.groups[joint.parent][1] @ joint.placement
            before, turn = turn, rotation_onto(joint.axis)
            rotations.append(before.T @ place.rotation @ turn)
            translations.append(before.T @ place.translation)
            coms.append(turn.T @ body.com)
            inertias.append(turn.T @ nearest_tensor(body.inertia) @ turn)
        _, flange = self.flange
        return Chain(
            names=tuple(joint.name for joint in self.arm.joints),
            rotation=np.array(rotations),
            translation=np.array(translations),
            mass=np.array([body.mass for body in self.bodies]),
            com=np.array(coms),
            inertia=np.array(inertias),
            rotor_inertia=np.array([joint.rotor_inertia for joint in self.arm.joints]),
            gravity=self.tree.gravity,
            flange_rotation=turn.T @ flange.rotation,
            flange_translation=turn.T @ flange.translation,
        )

    def tensor_changes(self) -> Array:
        """What the nearest tensors that a body can have differ by, in the chain's axes. (n, 3, 3)

        Zero for the links whose tensor was right. [kg·m²]
        """
        changes = []
        for joint, body in zip(self.arm.joints, self.bodies, strict=True):
            turn = rotation_onto(joint.axis)
            changes.append(turn.T @ (nearest_tensor(body.inertia) - body.inertia) @ turn)
        return np.array(changes)

    def lumped(self) -> dict[str, float]:
        """Joint of the arm that carries locked ones → mass that its own link carries. [kg]"""
        carriers = sorted({self.group_of(joint) for joint in self.locked} - {BASE})
        return {
            (joint := self.arm.joints[j]).name: self.bodies[j].mass - self.tree.mass(joint.child)
            for j in carriers
        }
