"""The arm in a description's tree: the longest run of turning joints.

The rest is locked (fingers, a rail, a mobile base, a second arm) and merged into the link that
carries it: a chain.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np

from vftcli.readers.table import listed
from vftcli.robots.chain import NO_BODY, Body, Chain, merge_bodies, nearest_tensor, unphysical
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.parsing import counted, did_you_mean
from vftcli.signals.pose import IDENTITY, Pose, exp_matrix, rotation_onto

TURNING = ("revolute", "continuous")  #: Kinds of joints that an arm is made of.


@dataclass(frozen=True, kw_only=True, eq=False)
class TreeJoint:
    """A joint between two links."""

    name: str
    #: revolute, continuous, prismatic, fixed, or one that cannot move an arm.
    kind: str
    parent: str  #: The link that carries it.
    child: str  #: The link that it moves; its frame is the joint's.
    placement: Pose = IDENTITY  #: Pose of the child's frame in the parent's at zero.
    #: Unit axis in the child's frame. (3,)
    axis: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    #: Fields of `vftcli.robots.robot.Limits` that the description gives.
    limits: Mapping[str, float] = field(default_factory=dict)
    follows: str = ""  #: The joint that it follows, or "".
    multiplier: float = 1.0  #: How far it goes of the other's position.
    offset: float = 0.0  #: Where it is when the other is at zero. [rad or m]
    rotor_inertia: float = 0.0  #: Reflected rotor inertia. [kg·m²]
    damping: float = 0.0  #: A simulator's viscous friction. [N·m·s/rad]
    dry_friction: float = 0.0  #: A simulator's dry friction. [N·m]

    @property
    def turns(self) -> bool:
        """Whether it may be a joint of an arm."""
        return self.kind in TURNING and not self.follows

    def at(self, position: float) -> Pose:
        """Pose of the child's frame in the parent's at a position. [rad or m]"""
        if position == 0.0:
            return self.placement
        along = position * self.axis
        slides = self.kind == "prismatic"
        return self.placement @ (Pose(np.eye(3), along) if slides else Pose(exp_matrix(along)))


def first_twice(names: Iterable[str]) -> str:
    """The first name, sorted, that is there twice, or ""."""
    return next((a for a, b in pairwise(sorted(names)) if a == b), "")


@dataclass(frozen=True, kw_only=True)
class BodyTree:
    """Links and joints of a description."""

    name: str  #: The robot's name.
    path: Path
    bodies: Mapping[str, Body]  #: Each link's inertia, or `NO_BODY`.
    joints: Sequence[TreeJoint]
    gravity: Array  #: Gravity in the root's axes. (3,) [m/s²]

    def __post_init__(self) -> None:
        if twice := first_twice(joint.name for joint in self.joints):
            raise RobotError(f"{self.path}: two joints are named {twice!r}; each needs its own")
        for joint in self.joints:
            for link in (joint.parent, joint.child):
                if link not in self.bodies:
                    raise RobotError(f"{self.path}: joint {joint.name!r}: no link {link!r}")
        if twice := first_twice(joint.child for joint in self.joints):
            raise RobotError(f"{self.path}: link {twice!r} hangs on two joints; a tree's has one")
        if missed := sorted(self.bodies.keys() - set(self.links)):
            raise RobotError(
                f"{self.path}: link {missed[0]!r} is not connected with {self.root!r}; "
                "the joints must make one tree"
            )

    @cached_property
    def above(self) -> dict[str, TreeJoint]:
        """Link → the joint that moves it; the root has none."""
        return {joint.child: joint for joint in self.joints}

    @cached_property
    def below(self) -> dict[str, list[TreeJoint]]:
        """Link → the joints that it carries, by name, whatever their order in a file."""
        found: dict[str, list[TreeJoint]] = {link: [] for link in self.bodies}
        for joint in sorted(self.joints, key=lambda joint: joint.name):
            found[joint.parent].append(joint)
        return found

    @cached_property
    def root(self) -> str:
        """The link that no joint moves."""
        root = next((link for link in self.bodies if link not in self.above), None)
        if root is None:
            raise RobotError(f"{self.path}: no link is the root: the joints make a circle")
        return root

    @cached_property
    def links(self) -> tuple[str, ...]:
        """The root and the links below it, each behind its parent."""
        order, waiting = [], [self.root]
        while waiting:
            order.append(link := waiting.pop())
            waiting += [joint.child for joint in reversed(self.below[link])]
        return tuple(order)

    @cached_property
    def inner(self) -> tuple[TreeJoint, ...]:
        """The joints above these links, each behind those above its parent."""
        return tuple(self.above[link] for link in self.links[1:])

    def path_to(self, link: str) -> list[TreeJoint]:
        """The joints from the root to a link."""
        path = []
        while link in self.above:
            path.append(self.above[link])
            link = self.above[link].parent
        return path[::-1]

    @cached_property
    def mass_beyond(self) -> dict[str, float]:
        """Link → mass of it and all that it carries. [kg]"""
        found = {link: self.bodies[link].mass for link in self.links}
        for link in reversed(self.links):
            if link in self.above:
                found[self.above[link].parent] += found[link]
        return found

    def rigid_links(self, link: str) -> Iterator[tuple[str, Pose]]:
        """The links fixed to one, itself first, and their poses in its frame."""
        waiting = [(link, IDENTITY)]
        while waiting:
            here, pose = waiting.pop()
            yield here, pose
            fixed = [joint for joint in self.below[here] if joint.kind == "fixed"]
            waiting += [(joint.child, pose @ joint.placement) for joint in reversed(fixed)]


#: Joints that an arm has at least before what it branches into may be a hand.
BEFORE_A_HAND = 4
HAND = 0.25  #: Share of the arm's mass that a finger with its load stays below.
LISTED = 12  #: Names that a message lists.
shortened = partial(listed, most=LISTED)
#: What a flange is called, with or without a robot's prefix; the first that is there.
FLANGE_NAMES = (
    "flange", "tool0", "link8", "ee_link", "tcp", "hand_tcp", "attachment_site", "ee",
)  # fmt: skip
BASE = -1  #: The group of the links that do not move.


@dataclass(frozen=True)
class LumpedArm:
    """An arm of a tree with everything else locked."""

    tree: BodyTree
    tip: str = ""  #: Link or joint at its end, "" for the longest arm.
    #: Position of each joint that is held whatever it is, by name. [rad or m]
    angles: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def joints(self) -> tuple[TreeJoint, ...]:
        """The arm's joints, base to tip."""
        if self.tip:
            return self.longest(self.tree.path_to(self.end))
        arms = dict.fromkeys(arm for leaf in self.leaves() if (arm := self.along(leaf)))
        longest = max(map(len, arms), default=0)
        if not longest:
            raise RobotError(
                f"{self.tree.path}: the model has no moving joint; an arm needs revolute ones"
            )
        alike = [arm for arm in arms if len(arm) == longest]
        if len(alike) > 1:
            tips = [f"--tip {arm[-1].child}" for arm in alike]
            few = len(tips) <= LISTED
            ends = f"{', '.join(tips[:-1])} or {tips[-1]}" if few else shortened(tips)
            count = {2: "two"}.get(len(alike), str(len(alike)))
            joints = counted(longest, "joint")
            raise RobotError(f"{self.tree.path}: {count} arms of {joints}: {ends}")
        return alike[0]

    @cached_property
    def end(self) -> str:
        """The tip's link: behind the last joint it is the flange itself."""
        joints = {joint.name: joint.child for joint in self.tree.joints}
        link = self.tip if self.tip in self.tree.bodies else joints.get(self.tip)
        if link is None or not self.longest(self.tree.path_to(link)):
            meant = did_you_mean(self.tip, [*self.tree.bodies, *joints]) if link is None else ""
            why = "no link or joint of that name." if link is None else "no arm leads there."
            tips = shortened(list(dict.fromkeys(self.tips())))
            raise RobotError(f"{self.tree.path}: --tip {self.tip!r}: {why}{meant} Tips: {tips}")
        return link

    def tips(self) -> Iterator[str]:
        """Names of all possible tips: every arm's last link, and links fixed to it."""
        for run in filter(None, map(self.along, self.leaves())):
            links = [link for link, _ in self.tree.rigid_links(run[-1].child)]
            yield links[0]
            yield from (link for link in links if not self.tree.below[link])

    def moves(self, joint: TreeJoint) -> bool:
        """Whether a joint can move."""
        return joint.kind != "fixed" and joint.name not in self.angles

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
        for joint in self.tree.inner:
            if self.moves(joint) and not self.branches(joint.child):
                yield joint

    def along(self, leaf: TreeJoint) -> tuple[TreeJoint, ...]:
        """The joints of the arm on the way to a leaf; none where nothing turns.

        It ends where branches part, this one a light finger; none within may follow another.
        """
        path = self.tree.path_to(leaf.child)
        run = self.longest(path)
        light = HAND * self.mass(run)
        for count in range(BEFORE_A_HAND, len(run)):
            several = len(self.branches(run[count - 1].child)) > 1
            if several and self.tree.mass_beyond[run[count].child] <= light:
                return run[:count]
        turning = [k for k, joint in enumerate(path) if joint.turns and self.moves(joint)]
        for k, joint in enumerate(path):
            if joint.follows and run and turning[0] < k < turning[-1]:
                raise RobotError(
                    f"{self.tree.path}: joint {joint.name!r} within the arm follows "
                    f"{joint.follows!r} (mimic); only joints that move by themselves make an arm. "
                    f"--tip {run[-1].child} takes the joints before or behind it."
                )
        return run

    def longest(self, path: Sequence[TreeJoint]) -> tuple[TreeJoint, ...]:
        """The longest run of turning joints, fixed ones between; the heavier of several."""
        runs: list[tuple[TreeJoint, ...]] = [()]
        for turns, joints in groupby(filter(self.moves, path), key=lambda joint: joint.turns):
            if turns:
                runs.append(tuple(joints))
        return max(reversed(runs), key=lambda run: (len(run), self.mass(run)))

    def mass(self, run: Sequence[TreeJoint]) -> float:
        """Mass of the links on these joints, without those on other joints. [kg]"""
        heavy = self.tree.mass_beyond
        return sum(
            heavy[joint.child] - sum(heavy[b.child] for b in self.branches(joint.child))
            for joint in run
        )

    @cached_property
    def groups(self) -> dict[str, tuple[int, Pose]]:
        """Link → the joint that moves it, from 0, or `BASE`, and its pose there."""
        index = {joint: j for j, joint in enumerate(self.joints)}
        found = {self.tree.root: (BASE, IDENTITY)}
        for joint in self.tree.inner:
            group, pose = found[joint.parent]
            if joint in index:
                found[joint.child] = (index[joint], IDENTITY)
            else:
                found[joint.child] = (group, pose @ joint.at(self.position(joint)))
        return found

    def position(self, joint: TreeJoint) -> float:
        """Position of a locked joint; a mimic joint goes with its own. [rad or m]"""
        if joint.name in self.angles:
            return self.angles[joint.name]
        if joint.follows in self.angles:
            return joint.multiplier * self.angles[joint.follows] + joint.offset
        return 0.0

    @cached_property
    def locked(self) -> dict[TreeJoint, int]:
        """The locked joints that could move, base to tip, each with its group."""
        return {
            joint: self.groups[joint.child][0]
            for joint in self.tree.inner
            if joint.kind != "fixed" and joint not in self.joints
        }

    @cached_property
    def turned(self) -> list[tuple[Array, Body]]:
        """Rotation of each joint's axis onto z; its link with those locked on it."""
        parts = [[NO_BODY] for _ in self.joints]
        for link in self.tree.links:
            group, pose = self.groups[link]
            if group != BASE:
                parts[group].append(self.tree.bodies[link].moved(pose))
        found = []
        for joint, body in zip(self.joints, map(merge_bodies, parts), strict=True):
            if why := unphysical(body.mass, body.inertia, triangle=False):
                raise RobotError(
                    f"{self.tree.path}: the link of joint {joint.name!r} is unphysical: {why}"
                )
            turn = rotation_onto(joint.axis)
            found.append((turn, body.moved(Pose(turn.T))))
        return found

    @cached_property
    def flange(self) -> tuple[str, Pose]:
        """Name of the flange and its pose in the last joint's frame.

        The link that the tip names, else a frame of a usual name, else the farthest one.
        """
        last = self.joints[-1].child
        if self.tip and self.end != last:
            return self.end, self.groups[self.end][1]
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

    @cached_property
    def chain(self) -> Chain:
        """The arm's constants, each frame turned so that z is the axis."""
        back, frames = IDENTITY, []
        for joint, (after, _) in zip(self.joints, self.turned, strict=True):
            frames.append(back @ self.groups[joint.parent][1] @ joint.placement @ Pose(after))
            back = Pose(after.T)
        return Chain.of(
            (joint.name for joint in self.joints),
            [*frames, back @ self.flange[1]],
            [body._replace(inertia=nearest_tensor(body.inertia)) for _, body in self.turned],
            rotor_inertia=np.array([joint.rotor_inertia for joint in self.joints]),
            gravity=self.tree.gravity,
        )
