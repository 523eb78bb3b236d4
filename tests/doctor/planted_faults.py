"""Faults planted one at a time in sound logs, as plain tables of signals.

A maker takes a `Table` and its own amounts and gives back the faulty one; it knows nothing of what
the doctor looks for. `FAULTS` is the list of 34 that the doctor is held against.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from scipy.signal import lfilter

from vftcli.robots import Payload, Robot, load_robot
from vftcli.robots.kernels import chain_parameters, momentum_terms, torque_regressor
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark
from vftcli.simulation import load_scenario, simulate

Signals = ("q", "dq", "effort", "tau_ext")
Effort, Speed = ("effort",), ("dq",)
NEIGHBOURS = {"ur10e": "ur5", "ur5": "ur10e", "panda": "fr3"}
"""Arm → another profile with as many joints."""


@dataclass(frozen=True, kw_only=True)
class Table:
    t: Array  # (T,) [s]
    q: Array  # (T, n) [rad]
    dq: Array  # (T, n) [rad/s]
    effort: Array  # what the drives report (T, n) [A or N·m]
    signal: str  # what the log calls it: "current" or "tau"
    tau_ext: Array | None = None  # the vendor's estimate (T, n) [N·m]
    robot: str  # the profile of the arm that the log is from
    given: str  # the profile that the user names
    #: Each row's time in the sound log, NaN of a row that it lacks; None for `t`. (T,) [s]
    sound_t: Array | None = None

    @property
    def arm(self) -> Robot:
        return robot_named(self.robot)

    @property
    def joints(self) -> int:
        return int(self.q.shape[1])

    @property
    def torque(self) -> Array:
        """The effort of a sound log in N·m. (T, n)"""
        return self.effort * self.constant

    @property
    def constant(self) -> Array:
        """Torque per unit of effort: K of a current, 1 of a torque. (n,)"""
        if self.signal == "current" and self.arm.torque_constant is not None:
            return np.asarray(self.arm.torque_constant)
        return np.ones(self.joints)

    def selected(self, rows: Array) -> "Table":
        signals = {name: value[rows] for name, value in self.series()}
        sound_t = None if self.sound_t is None else self.sound_t[rows]
        return replace(self, t=self.t[rows], sound_t=sound_t, **signals)

    def between(self, start: float, stop: float) -> "Table":
        """The rows from `start` to before `stop`, counted from the first. [s]"""
        seconds = self.t - self.t[0]
        return self.selected(np.flatnonzero((seconds >= start) & (seconds < stop)))

    def series(self) -> list[tuple[str, Array]]:
        """Name and values of the signals that are there. (T, n) each"""
        there = [(name, getattr(self, name)) for name in Signals]
        return [(name, value) for name, value in there if value is not None]

    def frame(self) -> pl.DataFrame:
        """The table as it is written: t, q1 …, dq1 …, current1 … or tau1 …, tau_ext1 …."""
        columns: dict[str, Array] = {"t": self.t}
        for name, value in self.series():
            heading = self.signal if name == "effort" else name
            columns |= {f"{heading}{j}": value[:, j - 1] for j in range(1, self.joints + 1)}
        return pl.DataFrame(columns)

    def write(self, path: Path) -> Path:
        """Write a plain CSV with a header, or what the name's ending asks for; return its path."""
        if path.suffix == ".parquet":
            self.frame().write_parquet(path)
        else:
            self.frame().write_csv(path, float_precision=9)
        return path


@cache
def robot_named(name: str) -> Robot:
    return load_robot(name)


def edited(signal: Array, joint: int, values: Any) -> Array:
    """A copy of a signal with one joint's column replaced; joints count from 1. (T, n)"""
    copy = np.array(signal)
    copy[:, joint - 1] = values
    return copy


def turned(table: Table, signals: tuple[str, ...], joint: int = 2) -> Table:
    sign = 1.0 - 2.0 * (np.arange(1, table.joints + 1) == joint)
    return replace(table, **{name: sign * getattr(table, name) for name in signals})


def swapped(table: Table, signals: tuple[str, ...], pair: tuple[int, int] = (2, 3)) -> Table:
    first, second = pair
    order = np.arange(table.joints)
    order[[first - 1, second - 1]] = second - 1, first - 1
    return replace(table, **{n: v[:, order] for n, v in table.series() if n in signals})


def positions_in_degrees(table: Table) -> Table:
    return replace(table, q=np.rad2deg(table.q))


def velocities_in_degrees(table: Table) -> Table:
    return replace(table, dq=np.rad2deg(table.dq))


def gravity_torque(table: Table, robot: Robot, gravity: Array | None = None) -> Array:
    """g(q) of an arm whose base feels `gravity` [m/s²]. (T, n) [N·m]"""
    chain = robot.loaded_chain
    chain = chain if gravity is None else replace(chain, gravity=gravity)
    return momentum_terms(chain, table.q, np.zeros_like(table.q)).gravity


def with_more_torque(table: Table, more: Array) -> Table:
    return replace(table, effort=table.effort + more / table.constant)


def without_gravity(table: Table) -> Table:
    torque = table.torque - gravity_torque(table, table.arm)
    return replace(table, effort=torque, signal="tau")


def mounted(table: Table, angle: float) -> Table:
    """The base turned by `angle` about x. [degrees]"""
    tilt, down = np.deg2rad(angle), np.asarray(table.arm.chain.gravity)
    turned = np.cos(tilt) * down + np.sin(tilt) * np.cross([1.0, 0.0, 0.0], down)
    more = gravity_torque(table, table.arm, turned) - gravity_torque(table, table.arm)
    return with_more_torque(table, more)


def acceleration(table: Table) -> Array:
    """Smoothed rate of the velocities: central differences over 50 ms. (T, n) [rad/s²]"""
    half = max(1, round(0.025 / float(np.median(np.diff(table.t)))))
    rows = np.arange(len(table.t))
    before, after = np.maximum(rows - half, 0), np.minimum(rows + half, len(rows) - 1)
    moved, passed = table.dq[after] - table.dq[before], table.t[after] - table.t[before]
    return np.asarray(moved / passed[:, None])


def payload(table, mass=2.8, com=(0.0, 0.0, 0.05)) -> Table:
    """A load that nobody names, its weight and its inertia."""
    load = Payload(mass=mass, com=np.array(com), inertia=0.002 * mass * np.eye(3))
    chain = table.arm.loaded_chain
    regressor = torque_regressor(chain, table.q, table.dq, acceleration(table))
    more = chain_parameters(chain.with_payload(load)) - chain_parameters(chain)
    return with_more_torque(table, regressor @ more)


def effort_offset(table: Table, joint: int = 3, share: float = 0.2) -> Table:
    column = table.effort[:, joint - 1]
    more = share * np.max(np.abs(column))
    return replace(table, effort=edited(table.effort, joint, column + more))


def saturated(table: Table, joint: int = 2, share: float = 0.6) -> Table:
    column = table.effort[:, joint - 1]
    level = share * float(np.max(np.abs(column)))
    return replace(table, effort=edited(table.effort, joint, np.clip(column, -level, level)))


def late(table: Table, signal: str, samples: int) -> Table:
    rows = np.maximum(np.arange(len(table.t)) - samples, 0)
    return replace(table, **{signal: getattr(table, signal)[rows]})


def velocity_filtered(table: Table, cut_off: float = 1.0) -> Table:
    """A first-order low-pass, as a filter in a driver does it. [Hz]"""
    keep = float(np.exp(-2 * np.pi * cut_off * np.median(np.diff(table.t))))
    start = keep * table.dq[:1]
    return replace(table, dq=lfilter([1 - keep], [1, -keep], table.dq, axis=0, zi=start)[0])


def stuck(table: Table, signal: str, joint: int, start: float = 0.5) -> Table:
    """One joint's signal stands still from a share `start` of the log on."""
    column = np.array(getattr(table, signal)[:, joint - 1])
    first = int(start * len(column))
    column[first:] = column[first]
    return replace(table, **{signal: edited(getattr(table, signal), joint, column)})


def dropped(table: Table, share: float = 0.05, seed: int = 0) -> Table:
    keep = np.random.default_rng(seed).random(len(table.t)) >= share
    return table.selected(np.flatnonzero(keep))


def dropped_span(table: Table, start: float = 0.5, seconds: float = 1.0) -> Table:
    first = table.t[0] + start * (table.t[-1] - table.t[0])
    return table.selected(np.flatnonzero((table.t < first) | (table.t >= first + seconds)))


def duplicate_rows(table: Table, share: float = 0.1, seed: int = 0) -> Table:
    twice = np.random.default_rng(seed).random(len(table.t)) < share
    return table.selected(np.repeat(np.arange(len(table.t)), 1 + twice))


def stale_rows(table: Table, share: float = 0.1, seed: int = 0) -> Table:
    """Rows whose values are those of the row before, under their own stamps."""
    rows = np.arange(len(table.t))
    again = np.random.default_rng(seed).random(len(rows)) < share
    again[0] = False
    fresh = np.maximum.accumulate(np.where(again, 0, rows))
    return replace(table.selected(fresh), t=table.t)


def time_reset(table: Table, start: float = 0.5) -> Table:
    t = np.array(table.t)
    first = int(start * len(t))
    t[first:] += t[0] - t[first]
    return replace(table, t=t)


def nan_burst(table: Table, rows: int = 30) -> Table:
    first = len(table.t) // 2
    gone = slice(first, first + rows)
    signals = {name: np.array(value) for name, value in table.series()}
    for value in signals.values():
        value[gone] = np.nan
    return replace(table, **signals)


Maker = Callable[[Table], Table]
READER = ""
"""Stands among the codes for a refusal by the reader, which names the fault in words."""


class Fault(NamedTuple):
    plant: Maker
    codes: tuple[str, ...]  # of the findings that name it
    joints: tuple[int, ...] = ()  # from 1, that a finding which tells joints has to tell
    signal: str = ""  # the effort that a log must have, "" for any

    def is_named_by(self, finding: Remark) -> bool:
        """Whether a finding has a code of the fault and is about its joints, or about none."""
        about, own = set(finding.where.joints), set(self.joints)
        return finding.code in self.codes and (not about or not own or about == own)


FAULTS: Mapping[str, Fault] = {
    "wrong_robot": Fault(
        lambda t: replace(t, given=NEIGHBOURS[t.robot]), ("other-robot", "no-robot-fits")
    ),
    "one_sign_J2": Fault(partial(turned, signals=("effort",)), ("joint-sign",), (2,)),
    "all_signs": Fault(lambda t: replace(t, effort=-t.effort), ("effort-sign",)),
    "degrees": Fault(
        lambda t: positions_in_degrees(velocities_in_degrees(t)), ("degrees", READER)
    ),
    "positions_degrees_only": Fault(positions_in_degrees, ("degrees", "velocity-unit", READER)),
    "time_ms": Fault(lambda t: replace(t, t=np.round(1e3 * t.t, 3)), ("time-unit",)),
    "effort_swapped_J2_J3": Fault(partial(swapped, signals=Effort), ("effort-order",), (2, 3)),
    # On a plane circle both orders explain the same: either says which joints are swapped.
    "all_swapped_J2_J3": Fault(
        partial(swapped, signals=Signals), ("joint-order", "effort-order"), (2, 3)
    ),
    "velocity_swapped_J2_J3": Fault(partial(swapped, signals=Speed), ("velocity-order",), (2, 3)),
    "velocity_lag_3": Fault(partial(late, signal="dq", samples=3), ("velocity-lag",)),
    "velocity_1Hz_filtered": Fault(velocity_filtered, ("velocity-filtered",)),
    "velocity_held_8": Fault(
        lambda t: replace(t, dq=np.repeat(t.dq[::8], 8, axis=0)[: len(t.t)]), ("velocity-held",)
    ),
    "effort_lag_5": Fault(partial(late, signal="effort", samples=5), ("effort-lag",)),
    "payload_2.8kg": Fault(payload, ("unmodelled-load",)),
    "gravity_compensated": Fault(
        without_gravity, ("torque-without-gravity", "current-without-gravity")
    ),
    "torque_called_current": Fault(
        lambda t: replace(t, effort=t.torque), ("current-as-torque",), signal="current"
    ),
    "current_called_torque": Fault(
        lambda t: replace(t, signal="tau"), ("torque-as-current",), signal="current"
    ),
    "current_mA": Fault(
        lambda t: replace(t, effort=1e3 * t.effort), ("milliamperes",), signal="current"
    ),
    "clock_skew_5%": Fault(
        lambda t: replace(t, t=t.t[0] + 1.05 * (t.t - t.t[0])), ("clock-rate",)
    ),
    "dropped_5%": Fault(dropped, ("missing-samples",)),
    "dropped_1s": Fault(dropped_span, ("gaps",)),
    "duplicate_rows_10%": Fault(duplicate_rows, ("repeated-stamps",)),
    "stale_rows_10%": Fault(stale_rows, ("stale-rows",)),
    "time_reset": Fault(time_reset, ("time-reset", READER)),
    "stuck_position_J4": Fault(partial(stuck, signal="q", joint=4), ("stuck-position",), (4,)),
    "stuck_effort_J3": Fault(partial(stuck, signal="effort", joint=3), ("stuck-effort",), (3,)),
    "saturated_J2": Fault(saturated, ("saturation",), (2,)),
    "quantised_1mrad": Fault(
        lambda t: replace(t, q=np.round(t.q / 1e-3) * 1e-3), ("coarse-positions",)
    ),
    "ceiling_mount": Fault(partial(mounted, angle=180.0), ("upside-down",)),
    "wall_mount_30deg": Fault(partial(mounted, angle=-30.0), ("tilted-base",)),
    "NaN_burst": Fault(nan_burst, (READER,)),
    "effort_zero_J5": Fault(
        lambda t: replace(t, effort=edited(t.effort, 5, 0.0)), ("zero-effort",), (5,)
    ),
    "offset_J3_20pct": Fault(effort_offset, ("effort-offset",), (3,)),
    "tau_ext_inverted": Fault(
        lambda t: replace(t, tau_ext=-t.tau_ext), ("vendor-sign",), signal="tau"
    ),
}
"""Fault → how it is planted and what names it."""


def simulated(scenario: str, seconds: float, robot: str) -> Table:
    made = simulate(load_scenario(scenario, [f"duration={seconds:g}"]), seed=3).recording
    return table_from(made, robot)


def table_from(recording: Recording, robot: str) -> Table:
    """The table of a recording; currents go before torques."""
    signal, effort = "current", recording.current
    if effort is None:
        signal, effort = "tau", recording.torque
    vendor = recording.tau_ext if signal == "tau" else None
    own = {"t": recording.t, "q": recording.q, "dq": recording.dq, "tau_ext": vendor}
    return Table(**own, effort=effort, signal=signal, robot=robot, given=robot)
