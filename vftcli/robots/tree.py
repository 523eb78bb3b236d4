"""A robot as URDF and MJCF describe it: links in a tree, a joint between each and its parent."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from vftcli.robots.chain import Body
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import IDENTITY, Pose, exp_matrix

MOST = 1000  #: Links and joints of a description: a humanoid with two hands has a fifth of it.
TURNING = ("revolute", "continuous")  #: Kinds of joints that an arm is made of.


@dataclass(frozen=True, kw_only=True, eq=False)
class TreeJoint:
    """A joint between two links."""

    name: str  #: Its name.
    #: "revolute", "continuous", "prismatic", "fixed", or another kind, which cannot move within an
    #: arm.
    kind: str
    parent: str  #: The link that carries it.
    child: str  #: The link that it moves; its frame is the joint's.
    placement: Pose = IDENTITY  #: Pose of the child's frame in the parent's at zero.
    #: Unit axis in the child's frame. (3,)
    axis: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    #: Fields of `vftcli.robots.robot.Limits` that the description gives.
    limits: Mapping[str, float] = field(default_factory=dict)
    follows: str = ""  #: The joint whose position this one's follows, "" for one of its own.
    multiplier: float = 1.0  #: How far it goes of the other's position.
    offset: float = 0.0  #: Where it is when the other is at zero. [rad or m]
    rotor_inertia: float = 0.0  #: Reflected rotor inertia. [kg·m²]
    damping: float = 0.0  #: Viscous friction that a simulator uses. [N·m·s/rad]
    dry_friction: float = 0.0  #: Dry friction that a simulator uses. [N·m]

    @property
    def turns(self) -> bool:
        """Whether it may be a joint of an arm."""
        return self.kind in TURNING and not self.follows

    def at(self, position: float) -> Pose:
        """Pose of the child's frame in the parent's at a position. [rad or m]"""
        if position == 0.0:
            return self.placement
        along = position * self.axis
        if self.kind == "prismatic":
            return self.placement @ Pose(np.eye(3), along)
        return self.placement @ Pose(exp_matrix(along), np.zeros(3))


def first_twice(names: Iterable[str]) -> str:
    """The first name, sorted, that is there twice, or ""."""
    return next((a for a, b in pairwise(sorted(names)) if a == b), "")


@dataclass(frozen=True, kw_only=True)
class BodyTree:
    """Links and joints of a description."""

    name: str  #: The robot's name.
    path: Path  #: The file.
    #: Each link's inertia, None where the description gives none.
    bodies: Mapping[str, Body | None]
    joints: Sequence[TreeJoint]  #: The joints.
    gravity: Array  #: Gravity in the root's axes. (3,) [m/s²]

    def __post_init__(self) -> None:
        if len(self.joints) > MOST:
            raise RobotError(f"{self.path}: has {len(self.joints)} joints, more than {MOST}")
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
        """Link → the joints that it carries, by name: the order in a file has no meaning."""
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

    def mass(self, link: str) -> float:
        """Mass of a link, zero where none is given. [kg]"""
        body = self.bodies[link]
        return 0.0 if body is None else body.mass

    @cached_property
    def mass_beyond(self) -> dict[str, float]:
        """Link → mass of it and all that it carries. [kg]"""
        found = {link: self.mass(link) for link in self.links}
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
