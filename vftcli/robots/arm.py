"""Which joints of a tree are the arm: the longest unbroken run of those that turn, without hands.

Whatever else moves is locked: fingers behind it, a rail, a lift or a mobile base before it, a
second arm beside it.
"""

from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

from vftcli.robots.tree import BodyTree, TreeJoint
from vftcli.signals.errors import RobotError
from vftcli.signals.parsing import did_you_mean

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
