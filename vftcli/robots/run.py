"""A run: a log in its robot's order of joints, with its model's terms made once."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vftcli.readers.aliases import UR_NAMES, UR_WORDS, kinematic_order
from vftcli.readers.table import listed
from vftcli.robots.friction import dry_friction
from vftcli.robots.robot import Robot
from vftcli.robots.terms import TIE, drive_torque, dynamics_terms
from vftcli.signals.arrays import Array, Mask, handed_over, median_step
from vftcli.signals.errors import RobotError
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.filters import low_pass
from vftcli.signals.recording import JOINT_SIGNALS, Recording, trim
from vftcli.signals.remarks import fact, on_joints
from vftcli.signals.repairs import without_isolated
from vftcli.signals.rest import duration, resting, standing
from vftcli.signals.shown import Shown

#: Samples from which on a recording's series do not stay in memory beside its results.
LONG = 1 << 17
#: Step of a run of which only the motion is of interest: a UR5's own. [s]
COARSE = 0.008
#: A run of fewer samples, half a minute of 1 kHz, is as good as its coarse one.
WORTH = 1 << 15
#: What has a value for each sample, and stays in a part of a run.
SERIES = ("standing", "standstill", "drive_torque", "model_torque", "momentum")
#: What is made again in less than an observer's pass.
BULKY = (*SERIES[1:], "smooth_dq", "coarse")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Run(Shown):
    """A recording, or a part of one, with its robot's model evaluated."""

    recording: Recording
    robot: Robot  #: The arm, its payload mounted.
    #: Whether `terms` come from the paper's numeric method.
    literal: bool = False

    @cached_property
    def name(self) -> str:
        """The recording's name in tables and messages."""
        return self.recording.name

    @cached_property
    def t(self) -> Array:
        """Clock. (T,) [s]"""
        return self.recording.t

    @cached_property
    def q(self) -> Array:
        """Joint positions. (T, n) [rad]"""
        return self.recording.q

    @cached_property
    def dq(self) -> Array:
        """Joint velocities. (T, n) [rad/s]"""
        return self.recording.require("dq")

    @cached_property
    def step(self) -> float:
        """Median sample time. [s]"""
        return median_step(self.t)

    @cached_property
    def terms(self) -> DynamicsTerms:
        """P and μ, as the observers take them."""
        return dynamics_terms(self.recording, self.robot, literal=self.literal)

    @cached_property
    def momentum(self) -> Array:
        """P = M q̇. (T, n) [kg·m²/s]"""
        return self.terms.p

    @cached_property
    def drive_torque(self) -> Array:
        """Torque of the drives. (T, n) [N·m]"""
        return drive_torque(self.recording, self.robot)

    @cached_property
    def model_torque(self) -> Array:
        """Drive torque that the model expects of the motion without contact. (T, n) [N·m]

        It is ṗ − Cᵀq̇ + g + F_f, with ṗ by central differences.
        """
        change = np.gradient(self.terms.p, self.t, axis=0)
        return change - self.terms.mu + self.drive_torque

    @cached_property
    def smooth_dq(self) -> Array:
        """Joint velocities without their noise. (T, n) [rad/s]"""
        return low_pass(self.t, self.dq, min(12.0, 0.2 / self.step))

    @cached_property
    def dry_friction(self) -> Array:
        """Dry friction of each joint by the robot's model, 0 without one. (n,) [N·m]"""
        return dry_friction(self.robot.friction, self.robot.joints)

    @cached_property
    def rests(self) -> Mask:
        """Where a joint rests. (T, n)"""
        return resting(self.t, self.dq)

    @cached_property
    def standing(self) -> Mask:
        """Where a joint is at rest. (T, n)"""
        return standing(self.t, self.dq)

    @cached_property
    def moving(self) -> Mask:
        """Where a joint is not at rest, read-only. (T, n)"""
        return handed_over(~self.standing)

    @cached_property
    def standstill(self) -> Array:
        """Length of the stop of each sample, 0 where the joint moves. (T, n) [s]"""
        return duration(self.t, self.dq)

    @cached_property
    def steadied(self) -> "Run":
        """The run without samples that stand alone; itself where there are none."""
        whole = without_isolated(self.recording)
        return self if whole is self.recording else replace(self, recording=whole)

    @cached_property
    def coarse(self) -> "Run":
        """The run by means of its samples over `COARSE`; itself where it is no finer."""
        count = self.blocked
        if count < 2:
            return self
        t, q, dq, drive_torque, p, mu = (
            block_means(x, count)
            for x in (self.t, self.q, self.dq, self.drive_torque, self.terms.p, self.terms.mu)
        )
        motion = Recording(t=t, q=q, dq=dq, source=self.recording.source)
        terms = DynamicsTerms(t=t, p=p, mu=mu)
        return replace(self, recording=motion).holding(terms=terms, drive_torque=drive_torque)

    @property
    def blocked(self) -> int:
        """Samples that one of the coarse run is the mean of."""
        if self.recording.samples < WORTH:
            return 1
        return max(1, int(COARSE / self.step + TIE))

    def less(self, torque: Array) -> "Run":
        """The run without an external torque (T, n) [N·m], μ ← μ + τ."""
        mu = handed_over(self.terms.mu + torque)
        return self.holding(terms=replace(self.terms, mu=mu))

    def holding(self, **values: object) -> "Run":
        """This run with other values of the model."""
        made = replace(self)
        vars(made).update(values)
        return made

    def part(self, span: slice) -> "Run":
        """Some of its samples as a run, with the model's values of the whole."""
        motion = Recording(
            t=self.t[span], q=self.q[span], dq=self.dq[span], source=self.recording.source
        )
        values = {name: getattr(self, name)[span] for name in SERIES}
        return replace(self, recording=motion).holding(**values)

    def spare(self, *others: str) -> None:
        """Free `BULKY` and `others` of a long recording."""
        self.recording.release()
        if self.recording.samples > LONG:
            if terms := vars(self).get("terms"):
                vars(terms).pop("d", None)
            for name in (*BULKY, *others):
                vars(self).pop(name, None)
            trim()
        if (steadied := vars(self).get("steadied", self)) is not self:
            steadied.spare(*others)


def block_means(x: Array, count: int) -> Array:
    """Means of so many rows each, a last broken block left out. (T', …)"""
    whole = len(x) // count * count
    total = sum((x[k:whole:count] for k in range(1, count)), start=x[:whole:count])
    return handed_over(total / count)


class RunSamples(NamedTuple):
    """Some samples of a run."""

    run: Run
    inside: Mask  #: Which of its samples they are. (T,)

    @property
    def coarse(self) -> "RunSamples":
        """The samples of the coarse run that are means of these alone."""
        whole = block_means(self.inside.astype(float), self.run.blocked) == 1.0
        return RunSamples(self.run.coarse, whole)


def signal_edge(step: float, cutoff: float = 12.0) -> float:
    """The frequency above the signal, from which on noise is measured. [Hz]"""
    return min(cutoff, 0.22 / step)


NUMBER = re.compile(r"(.*?)(\d{1,4})(\D*)")


def paired(recording: Recording, robot: Robot) -> Recording:
    """A log in the robot's order of joints, positions and torques of the links.

    If both have joint names, these decide, and joints unknown to the robot are left out.
    """
    named = recording.joint_names
    tables = robot.document.get("joints", ())
    nameless = bool(tables) and all("name" not in table for table in tables)
    if len(named) == recording.joints and not nameless:
        order = places(named, robot.chain.names)
        if order is None:
            raise RobotError(
                f"{recording.name}: the joints of the log ({listed(named)}) are not named as "
                f"those of robot {robot.name!r} ({listed(robot.chain.names)}). Choose this log's "
                "arm with --robot, or call the joints in the robot file as the log does (name in "
                "[[joints]])"
            )
        if order != tuple(range(recording.joints)):
            left = [name for k, name in enumerate(named) if k not in order]
            remarks = [fact("joints-by-name", joints=[named[k] for k in order])]
            remarks += [fact("joints-left-out", joints=left)] if left else []
            there = (name for name in recording.signals if name in JOINT_SIGNALS)
            fields = {name: getattr(recording, name)[:, order] for name in there}
            names = tuple(named[k] for k in order)
            recording = recording.changed(*remarks, joint_names=names, **fields)
    done = {remark.code for remark in recording.source.remarks}
    if robot.gear is None or "gear-applied" in done or recording.joints != robot.joints:
        return recording
    # q = q_m / N, τ = N η τ_m; currents and the vendor's estimate stay.
    torque = robot.gear if robot.efficiency is None else robot.gear * robot.efficiency
    scales = dict.fromkeys(("q", "dq", "target_q", "target_dq"), 1 / robot.gear)
    scales |= dict.fromkeys(("torque", "torque_without_gravity", "target_torque"), torque)
    each = scales.keys() & recording.signals
    fields = {name: getattr(recording, name) * scales[name] for name in each}
    return recording.changed(fact("gear-applied", ratios=robot.gear), **fields)


def unwound(recording: Recording, robot: Robot) -> Recording:
    """The recording without jumps of a turn in the positions of endless joints."""
    endless, changed = np.isin(robot.chain.names, robot.endless), {}
    if not endless.any():
        return recording
    jumping = np.zeros_like(endless)
    for signal in ("q", "target_q"):
        if (values := getattr(recording, signal)) is not None:
            # A missing sample is NaN, and would make all behind it NaN.
            turns = endless & (abs(np.diff(values, axis=0)).max(axis=0, initial=0.0) > np.pi)
            if turns.any():
                changed[signal] = np.where(turns, np.unwrap(values, axis=0), values)
                jumping |= turns
    if not changed:
        return recording
    return recording.changed(fact("endless-joint-unwound", on_joints(jumping)), **changed)


def places(logged: Sequence[str], joints: Sequence[str]) -> tuple[int, ...] | None:
    """Places of a robot's joints among a log's, None if the names do not match.

    By name; without a shared prefix and `_joint`; by number, or by a maker's known order.
    """
    if all(logged.count(name) == 1 for name in joints):
        return tuple(logged.index(name) for name in joints)
    there, wanted = list(map(plain, logged)), list(map(plain, joints))
    # What the robot's names all begin with says nothing of a joint.
    heads = (wanted[0][: k + 1] for k, letter in enumerate(wanted[0]) if letter == "_")
    own = [head for head in heads if all(name.startswith(head) for name in wanted)]
    bare = [name.removeprefix(max(own, default="")) for name in wanted]
    prefixes = {name.removesuffix(bare[0]) for name in there if name.endswith(bare[0])}
    fits = [
        prefix
        for prefix in prefixes
        if prefix[-1:] in {"", "_"} and all(there.count(prefix + name) == 1 for name in bare)
    ]
    if len(fits) == 1 and not all(name.isdigit() for name in bare):
        return tuple(there.index(fits[0] + name) for name in bare)
    return numbered(logged, joints)


def numbered(logged: Sequence[str], joints: Sequence[str]) -> tuple[int, ...] | None:
    """The places of joints by number, or by a known order of a maker's names."""
    count = len(joints)
    if found := by_number(logged, count):
        return found
    known = kinematic_order(logged)
    names, ur = [plain(logged[k]) for k in known], list(map(plain, UR_NAMES))
    is_known = len(known) == count and (
        names == list(map(plain, UR_WORDS)) or all(map(str.endswith, names, ur))
    )
    generic = by_number(joints, count) == tuple(range(count))
    return known if is_known and (generic or list(map(plain, joints)) == ur) else None


def by_number(names: Sequence[str], count: int) -> tuple[int, ...] | None:
    """The places of names that differ in a number alone, by that number.

    None where there are not as many of one stem as are wanted, of two stems, or with holes.
    """
    stems: dict[tuple[str, str], dict[int, int]] = {}
    for place, name in enumerate(names):
        if match := NUMBER.fullmatch(name):
            stems.setdefault((match[1], match[3]), {})[int(match[2])] = place
    fitting = [found for found in stems.values() if len(found) == count]
    if len(fitting) != 1:
        return None
    numbers = sorted(fitting[0])
    if numbers[0] > 1 or numbers[-1] - numbers[0] != count - 1:
        return None
    return tuple(fitting[0][number] for number in numbers)


def plain(name: str) -> str:
    """A joint's name in lower case, joined by `_`, without `_joint`."""
    return re.sub(r"[\s/.:\-]+", "_", name.strip().lower()).removesuffix("_joint")
