"""Faults of single samples, of spans, of one joint and of a part of the log, with their sizes.

They are planted in three logs, two of them with contacts. A maker takes a `Table` and its own
amounts, as those of `planted_faults` do; what it puts in is marked nowhere but in `sound_t`.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import planted_faults as plant
from planted_faults import Maker, Table, table_from
from sound_logs import UR10E

from vftcli.readers.reading import read
from vftcli.robots.chain import flange_jacobian
from vftcli.signals.arrays import Array, Mask

MIDDLE = 0.4  # Share of the log at which a few bad samples are planted.


def first_bad(table: Table) -> int:
    return int(MIDDLE * len(table.t))


def effort_sample(table: Table, torque: float, joint: int = 2) -> Table:
    """One sample of one joint's effort. [N·m, a current's through its constant]"""
    column = np.array(table.effort[:, joint - 1])
    column[first_bad(table)] = torque / table.constant[joint - 1]
    return replace(table, effort=plant.edited(table.effort, joint, column))


def effort_samples(table: Table, share: float, torque: float = 600.0) -> Table:
    """A share of the samples of J2's effort at random, of either sign. [N·m]"""
    draw = np.random.default_rng(0)
    rows = draw.choice(len(table.t), max(1, round(share * len(table.t))), replace=False)
    column = np.array(table.effort[:, 1])
    column[rows] = draw.choice((-1.0, 1.0), len(rows)) * torque / table.constant[1]
    return replace(table, effort=plant.edited(table.effort, 2, column))


def rows_of(table: Table, signals: tuple[str, ...], count: int, value: float) -> Table:
    """So many rows in which some signals have one value on all joints, in their own unit."""
    made = {name: np.array(getattr(table, name)) for name in signals}
    for signal in made.values():
        signal[first_bad(table) : first_bad(table) + count] = value
    return replace(table, **made)


def position_sample(table: Table, degrees: float, joint: int = 3) -> Table:
    column = np.array(table.q[:, joint - 1])
    column[first_bad(table)] += np.deg2rad(degrees)
    return replace(table, q=plant.edited(table.q, joint, column))


def of_joints(table: Table, joints: tuple[int, ...]) -> Mask:
    """Which columns are those of some joints; all if none is named. (n,)"""
    return np.isin(np.arange(1, table.joints + 1), joints or range(1, table.joints + 1))


def velocity_times(table: Table, factor: float, joints: tuple[int, ...] = ()) -> Table:
    return replace(table, dq=table.dq * np.where(of_joints(table, joints), factor, 1.0))


def velocity_in_degrees(table: Table, joint: int) -> Table:
    return velocity_times(table, np.rad2deg(1.0), (joint,))


def accelerations(table: Table, joints: tuple[int, ...] = ()) -> Table:
    wrong = of_joints(table, joints)
    return replace(table, dq=np.where(wrong, plant.acceleration(table), table.dq))


def brakes(table: Table, seconds: float) -> Table:
    """The arm held by its brakes for so long, where it moves least: the drives idle at 0.3 N·m."""
    third = len(table.t) // 3
    row = third + int(np.argmin(np.abs(table.dq[third : 2 * third]).sum(axis=1)))
    count = round(seconds / float(np.median(np.diff(table.t))))
    at = np.concatenate([np.arange(row), np.full(count, row), np.arange(row, len(table.t))])
    still = slice(row, row + count)
    held = table.selected(at)
    idle = 0.3 * np.random.default_rng(0).standard_normal((count, table.joints)) / table.constant
    effort, dq, t = np.array(held.effort), np.array(held.dq), np.array(held.t)
    effort[still], dq[still] = idle, 0.0
    t[still] += seconds * np.arange(count) / count
    t[row + count :] += seconds
    sound_t = np.array(t if held.sound_t is None else held.sound_t)
    sound_t[still] = np.nan
    return replace(held, t=t, dq=dq, effort=effort, sound_t=sound_t)


def gravity_only(table: Table, seconds: float) -> Table:
    """Effort that is the model's gravity for so long, as in freedrive or of a target."""
    later = table.t - table.t[first_bad(table)]
    span = (later >= 0.0) & (later < seconds) | np.isinf(seconds)
    gravity = plant.gravity_torque(table, table.arm) / table.constant
    return replace(table, effort=np.where(span[:, None], gravity, table.effort))


def frozen(table: Table, seconds: float) -> Table:
    """All signals standing at one row's values for so long, while the clock goes on."""
    first = first_bad(table)
    still = (table.t >= table.t[first]) & (table.t < table.t[first] + seconds)
    return table_with_rows(table, np.where(still, first, np.arange(len(table.t))))


def table_with_rows(table: Table, rows: Array) -> Table:
    return replace(table.selected(rows), t=table.t, sound_t=table.sound_t)


def glued(table: Table, seconds: float) -> Table:
    """Two sessions in one: so much is left out in the middle, and the clock does not show it."""
    made = plant.dropped_span(table, seconds=seconds)
    row = int(np.argmax(np.diff(made.t))) + 1
    step = float(np.median(np.diff(made.t)))
    t = np.array(made.t)
    t[row:] -= t[row] - t[row - 1] - step
    return replace(made, t=t)


def wrapped(table: Table, joint: int) -> Table:
    """A joint's position that turns over in the middle of its range, as one from −π to π does."""
    column = table.q[:, joint - 1]
    middle = float(np.median(column))
    # Towards zero: what turns over stays within a turn and a half of it.
    over = column - 2 * np.pi if middle > 0 else column + 2 * np.pi
    turns = column > middle if middle > 0 else column < middle
    return replace(table, q=plant.edited(table.q, joint, np.where(turns, over, column)))


def clock_jump(table: Table, seconds: float) -> Table:
    later = np.arange(len(table.t)) >= len(table.t) // 2
    return replace(table, t=table.t + seconds * later)


def effort_late(table: Table, seconds: float = 0.0, drift: float = 0.0) -> Table:
    """Effort that comes so much later, and later by a share of the time that went by."""
    then = table.t - seconds - drift * (table.t - table.t[0])
    late = [np.interp(then, table.t, column) for column in table.effort.T]
    return replace(table, effort=np.stack(late, axis=1))


def drive_scale(table: Table, factor: float, joints: tuple[int, ...] = ()) -> Table:
    return replace(table, effort=table.effort * np.where(of_joints(table, joints), factor, 1.0))


def from_the_middle(table: Table, maker: Maker) -> Table:
    """What a maker does to q, dq and effort, from the middle of the log on."""
    made, later = maker(table), np.arange(len(table.t))[:, None] >= len(table.t) // 2
    signals = {n: np.where(later, getattr(made, n), v) for n, v in table.series()}
    return replace(table, **signals)


def picked_up(table: Table, mass: float) -> Table:
    return from_the_middle(table, partial(plant.payload, mass=mass))


def rehomed(table: Table, radians: float) -> Table:
    return from_the_middle(table, partial(zero_off, degrees=np.rad2deg(radians)))


def zero_off(table: Table, degrees: float, joint: int = 3) -> Table:
    more = np.deg2rad(degrees) * (np.arange(1, table.joints + 1) == joint)
    return replace(table, q=table.q + more)


FRANKA_JOINTS = 7

ROTOR, DRY, VISCOUS = 0.1, 1.0, 0.2
"""What a Franka's joint-side sensor does not feel: rotor inertia [kg·m²], dry [N·m] and viscous
friction [N·m·s/rad], of the size that the README of the logs gives."""


def motor_side(table: Table) -> Table:
    rotor = ROTOR * plant.acceleration(table)
    lost = rotor + DRY * np.tanh(table.dq / 0.02) + VISCOUS * table.dq
    return plant.with_more_torque(table, lost)


def thinned(table: Table, rate: float) -> Table:
    """The table at this rate at most. [Hz]"""
    step = max(1, round(1 / (rate * float(np.median(np.diff(table.t))))))
    return table.selected(np.arange(0, len(table.t), step))


def interpolated(table: Table, rate: float) -> Table:
    """All signals on straight lines between samples of a lower rate. [Hz]"""
    few = thinned(table, rate)
    lines = {
        name: np.stack([np.interp(table.t, few.t, c) for c in values.T], axis=1)
        for name, values in few.series()
    }
    return replace(table, **lines)


def pushed(table: Table, count: int) -> Table:
    """So many pushes of half a second at the flange, 40 N along x, y or z in turn."""
    jacobian = flange_jacobian(table.arm.loaded_chain, table.q)[:, :3]
    force = np.zeros((len(table.t), 3))
    for k, start in enumerate(np.linspace(table.t[0] + 1.0, table.t[-1] - 1.5, count)):
        phase = np.clip((table.t - start) / 0.5, 0.0, 1.0)
        force[:, k % 3] += 40.0 * np.sin(np.pi * phase)
    return plant.with_more_torque(table, -np.einsum("tki,tk->ti", jacobian, force))


EFFORT, MEASURED = ("effort",), ("q", "dq", "effort")


class SpanLog(NamedTuple):
    table: Table
    other: str  # the profile of another generation of its arm
    target: Array | None = None  # what its controller expects of the drives (T, n) [A]
    free: bool = False  # whether nobody touches the arm


class Source(NamedTuple):
    """A log of the folder VFT_LOGS, of which the first seconds are used."""

    path: str
    robot: str  # a profile, or a robot file of the folder
    seconds: tuple[float, float]
    other: str
    columns: str | None = None


SOURCES: Mapping[str, Source] = {
    "ur10e": Source("ur10e/free_14harm.csv", "ur10e", (2.0, 20.0), "ur10", UR10E),
    "mujoco": Source("mujoco_ur5e/circle.csv", "mujoco_ur5e/robot.toml", (0.0, 20.0), "ur5"),
    "libfranka": Source(
        "libfranka_sim/pushes.csv.gz", "libfranka_sim/robot.toml", (0.0, 28.0), "panda"
    ),
}
"""The first is real and free of contact, the others are an independent engine's and have contacts:
five and three."""


def span_log(name: str, folder: Path) -> SpanLog:
    """A sound log of the folder VFT_LOGS, at 125 Hz at most."""
    source = SOURCES[name]
    log = read(folder / source.path, columns=source.columns)
    log = log.between(*(float(log.t[0]) + second for second in source.seconds))
    robot = source.robot
    table = table_from(log, str(folder / robot) if robot.endswith(".toml") else robot)
    table = thinned(table, 125.0)
    table = replace(table, tau_ext=None, sound_t=table.t)
    rows, target = np.searchsorted(log.t, table.t), log.target_current
    target = None if target is None else target[rows]
    return SpanLog(table, source.other, target, free=name == "ur10e")


Sizes = tuple[str, str, Callable[..., Table], str, tuple[float, ...]]

SIZED: tuple[Sizes, ...] = (
    # 240 N·m on J2 of a UR10e are 20 A, 12 000 N·m are 1000 A.
    ("effort J2 one sample", "N·m", effort_sample, "torque", (240, 1200, 12000)),
    ("effort J5 one sample", "N·m", partial(effort_sample, joint=5), "torque", (100, 500)),
    ("effort J2 ±600 N·m share", "", effort_samples, "share", (0.002, 0.01, 0.04)),
    ("effort -9999", "rows", partial(rows_of, signals=EFFORT, value=-9999.0), "count",
     (1, 3, 10)),
    ("effort 0", "rows", partial(rows_of, signals=EFFORT, value=0.0), "count", (3, 10, 30)),
    ("all 0", "rows", partial(rows_of, signals=MEASURED, value=0.0), "count", (1, 3, 10)),
    ("dq in deg/s of joint", "", velocity_in_degrees, "joint", (1, 3, 5)),
    ("dq of all times", "", velocity_times, "factor", (101,)),
    ("dq J2 times", "", partial(velocity_times, joints=(2,)), "factor", (1.6, 3, 101)),
    ("brakes", "s", brakes, "seconds", (2, 5, 8)),
    ("effort gravity only", "s", gravity_only, "seconds", (3, 6)),
    ("sessions glued over", "s", glued, "seconds", (1, 3, 6)),
    ("wraps by 2π of joint", "", wrapped, "joint", (1, 4, 6)),
    ("q3 one sample", "°", position_sample, "degrees", (2, 20, 360)),
    ("stamps jump", "s", clock_jump, "seconds", (60, 3600, 86400)),
    ("effort late", "s", effort_late, "seconds", (0.02, 0.06, 0.15)),
    ("effort clock drifts by", "", effort_late, "drift", (0.001, 0.005, 0.02)),
    ("drives times", "", drive_scale, "factor", (0.6, 0.8, 0.9)),
    ("drive J2 times", "", partial(drive_scale, joints=(2,)), "factor", (0.6, 0.8, 1.25)),
    ("picked up half-way", "kg", picked_up, "mass", (0.8, 1.5, 4)),
    ("base tilted", "°", plant.mounted, "angle", (3, 7, 15)),
    ("zero of J3 off", "°", zero_off, "degrees", (5, 20, 90)),
    ("zero of J3 half-way off", "rad", rehomed, "radians", (0.01, 0.05, 0.2)),
    ("thinned", "Hz", thinned, "rate", (1, 2, 5)),
    ("frozen", "s", frozen, "seconds", (0.3, 1, 3)),
    ("straight lines from", "Hz", interpolated, "rate", (5, 10, 20)),
    ("dq accelerations", "", accelerations, "", ()),
    ("dq J3 acceleration", "", partial(accelerations, joints=(3,)), "", ()),
    ("effort gravity only all", "", partial(gravity_only, seconds=np.inf), "", ()),
    ("J5 turned", "", partial(plant.turned, signals=MEASURED, joint=5), "", ()),
    ("J5 and J6 swapped", "", partial(plant.swapped, signals=plant.Signals, pair=(5, 6)),
     "", ()),
)  # fmt: skip
"""Name, unit, maker, what its size is called, and the sizes, none of what has no size."""


OF_FREE_MOTION = {f"pushes {count}": partial(pushed, count=count) for count in (5, 15, 40)}
"""Name → what is planted in a log that `thresholds` is told to be free motion."""


def span_faults(log: SpanLog) -> dict[str, Maker]:
    """Name → fault, of all that can be planted in a log; a name states the fault's size."""
    found = dict(OF_FREE_MOTION) if log.free else {}
    for name, unit, maker, key, sizes in SIZED:
        sized = {f"{name} {size:g} {unit}".strip(): {key: size} for size in sizes}
        found |= {full: partial(maker, **size) for full, size in (sized or {name: {}}).items()}
    found["other generation"] = lambda table: replace(table, given=log.other)
    if log.target is not None:
        found["target current"] = lambda table: replace(table, effort=log.target)
    if log.table.joints == FRANKA_JOINTS:
        found["motor side torque"] = motor_side
    return found
