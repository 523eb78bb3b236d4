"""Which joints of a tree are the arm: the longest unbroken run of those that turn, without hands.

Whatever else moves is locked: fingers behind it, a rail, a lift or a mobile base before it, a
second arm beside it. What is locked is merged into the link that carries it: a chain.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain, improper, merge_bodies, nearest_tensor
from vftcli.robots.tree import Body, BodyTree, TreeJoint
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.parsing import did_you_mean
from vftcli.signals.pose import IDENTITY, Pose, rotation_onto

BEFORE_A_HAND = 4  #: Joints that an arm has at least before what it branches into may be a hand.
HAND = 0.25  #: Share of the arm's mass that a finger stays below, with all that it carries.
LISTED = 12  #: Names that a message lists.


class TreeArm(NamedTuple):
    """The joints of an arm, and where it ends."""

    joints: tuple[TreeJoint, ...]  #: Its joints, base to tip.
    end: str  #: The link that is the flange, "" where the usual names decide.


@dataclass(frozen=True)
class ArmSearch:
    """A tree some of whose joints are locked, and the arms in it."""

    tree: BodyTree  #: The tree.
    locked: Set[str]  #: Names of joints that are held whatever they are.

    def find(self, tip: str = "") -> TreeArm:
        """The arm, or the one that a tip names."""
        if tip:
            return self.to(tip)
        arms = {arm: None for leaf in self.leaves() if (arm := self.along(leaf))}
        longest = max(map(len, arms), default=0)
        if not longest:
            raise RobotError(
                f"{self.tree.path}: the model has no moving joint; an arm needs revolute ones"
            )
        alike = [self.named(arm) for arm in arms if len(arm) == longest]
        if len(alike) > 1:
            tips = [f"--tip {arm[-1].child}" for arm in alike]
            few = len(tips) <= LISTED
            ends = f"{', '.join(tips[:-1])} or {tips[-1]}" if few else shortened(tips)
            count = {2: "two"}.get(len(alike), str(len(alike)))
            joints = f"{longest} joint{'s' if longest > 1 else ''}"
            raise RobotError(f"{self.tree.path}: {count} arms of {joints}: {ends}")
        return TreeArm(alike[0], "")

    def to(self, tip: str) -> TreeArm:
        """The arm that ends at a link or a joint.

        A link that is fixed to the last one is the flange itself; the last link, or a joint, only
        says which arm it is.
        """
        above = {joint.name: joint.child for joint in self.tree.joints}
        link = tip if tip in self.tree.bodies else above.get(tip)
        run = self.longest(self.tree.path_to(link)) if link is not None else ()
        if link is None or not run:
            there = [*self.tips()]
            meant = did_you_mean(tip, [*self.tree.bodies, *above]) if link is None else ""
            why = "no link or joint of that name." if link is None else "no arm leads there."
            raise RobotError(
                f"{self.tree.path}: --tip {tip!r}: {why}{meant} Tips: {shortened(there)}"
            )
        return TreeArm(run, "" if link == run[-1].child else link)

    def tips(self) -> Iterator[str]:
        """What a tip may be: the last link of every arm, and what is fixed to it at its ends."""
        seen = set()
        for leaf in self.leaves():
            if run := self.along(leaf):
                last = self.named(run)[-1].child
                ends = [
                    link for link, _ in self.tree.rigid_links(last) if not self.tree.below[link]
                ]
                for link in (last, *ends):
                    if link not in seen:
                        seen.add(link)
                        yield link

    def named(self, names: Iterable[str]) -> tuple[TreeJoint, ...]:
        """The joints of these names."""
        by_name = {joint.name: joint for joint in self.tree.joints}
        return tuple(by_name[name] for name in names)

    def moves(self, joint: TreeJoint) -> bool:
        """Whether a joint can move."""
        return joint.kind != "fixed" and joint.name not in self.locked

    def branches(self, link: str) -> list[TreeJoint]:
        """The movable joints nearest to a link among those it carries."""
        found, waiting = [], [link]
        while waiting:
            for joint in self.tree.below[waiting.pop()]:
                if self.moves(joint):
                    found.append(joint)
                else:
                    waiting.append(joint.child)
        return found

    def leaves(self) -> Iterator[TreeJoint]:
        """The movable joints that carry no other."""
        for link in self.tree.links:
            joint = self.tree.above.get(link)
            if joint is not None and self.moves(joint) and not self.branches(link):
                yield joint

    def along(self, leaf: TreeJoint) -> tuple[str, ...]:
        """The joints of the arm on the way to a leaf; none where nothing turns."""
        path = self.tree.path_to(leaf.child)
        run = self.longest(path)
        arm = self.without_hand(run)
        if len(arm) == len(run):
            self.refuse_followers(path, run)
        return tuple(joint.name for joint in arm)

    def longest(self, path: Sequence[TreeJoint]) -> tuple[TreeJoint, ...]:
        """The longest unbroken run of joints that turn, the heavier one of several, then the last.

        Fixed joints break none.
        """
        runs: list[tuple[TreeJoint, ...]] = [()]
        for turns, joints in groupby(filter(self.moves, path), key=lambda joint: joint.turns):
            if turns:
                runs.append(tuple(joints))
        return max(reversed(runs), key=lambda run: (len(run), self.mass(run)))

    def mass(self, run: Sequence[TreeJoint]) -> float:
        """Mass of the links that these joints move, without what other joints move. [kg]"""
        heavy = self.tree.mass_beyond
        return sum(
            heavy[joint.child] - sum(heavy[b.child] for b in self.branches(joint.child))
            for joint in run
        )

    def without_hand(self, run: tuple[TreeJoint, ...]) -> tuple[TreeJoint, ...]:
        """A run up to the joint from which several branches part, this one a finger by its mass."""
        whole = self.mass(run)
        for count in range(BEFORE_A_HAND, len(run)):
            several = len(self.branches(run[count - 1].child)) > 1
            if several and self.tree.mass_beyond[run[count].child] <= HAND * whole:
                return run[:count]
        return run

    def refuse_followers(self, path: Sequence[TreeJoint], run: Sequence[TreeJoint]) -> None:
        """Refuse a joint within the arm that follows another; fingers behind it may."""
        turning = [k for k, joint in enumerate(path) if joint.turns and self.moves(joint)]
        for k, joint in enumerate(path):
            if joint.follows and run and turning[0] < k < turning[-1]:
                raise RobotError(
                    f"{self.tree.path}: joint {joint.name!r} within the arm follows "
                    f"{joint.follows!r} (mimic); only joints that move by themselves make an arm. "
                    f"--tip {run[-1].child} takes the joints before or behind it."
                )


def shortened(words: Sequence[str]) -> str:
    """Some words, and how many more there are than a message lists."""
    more = f" and {len(words) - LISTED} more" if len(words) > LISTED else ""
    return ", ".join(words[:LISTED]) + more


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
