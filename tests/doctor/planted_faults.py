"""Faults planted one at a time in sound logs, as plain tables of signals.

A maker takes a `Table` and its own amounts and gives back the faulty one; it knows nothing of what
the doctor looks for. `FAULTS` is the list of 34 that the doctor is held against, with the codes
that name each of them and the joints that such a finding has to be about.
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

Signals = ("q", "dq", "effort", "tau_ext")
NEIGHBOURS = {"ur10e": "ur5", "ur5": "ur10e", "panda": "fr3"}
"""Arm → another profile with as many joints."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """The columns of a log.

    Attributes:
        t: Time. (T,) [s]
        q: Positions. (T, n) [rad]
        dq: Velocities. (T, n) [rad/s]
        effort: What the drives report. (T, n) [A or N·m]
        signal: What the log calls it: "current" or "tau".
        tau_ext: The vendor's estimate, or None. (T, n) [N·m]
        robot: The profile of the arm that the log is from.
        given: The profile that the user names.
        sound_t: Each row's time in the sound log, NaN of a row that it lacks; None for `t`. (T,)
            [s]
    """

    t: Array
    q: Array
    dq: Array
    effort: Array
    signal: str
    tau_ext: Array | None = None
    robot: str
    given: str
    sound_t: Array | None = None

    @property
    def arm(self) -> Robot:
        """The arm that the log is from."""
        return robot_named(self.robot)

    @property
    def joints(self) -> int:
        """Number of joints n."""
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
        """The table with these rows, in this order."""
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
    """A profile, loaded once."""
    return load_robot(name)


def edited(signal: Array, joint: int, values: Any) -> Array:
    """A copy of a signal with one joint's column replaced; joints count from 1. (T, n)"""
    copy = np.array(signal)
    copy[:, joint - 1] = values
    return copy


def swapped(signal: Array, first: int, second: int) -> Array:
    """A copy of a signal with two joints' columns exchanged. (T, n)"""
    order = np.arange(signal.shape[1])
    order[[first - 1, second - 1]] = second - 1, first - 1
    return np.asarray(signal[:, order])


# The arm, its order and its signs


def wrong_robot(table: Table) -> Table:
    return replace(table, given=NEIGHBOURS[table.robot])


def one_sign(table: Table, joint: int = 2) -> Table:
    return replace(table, effort=edited(table.effort, joint, -table.effort[:, joint - 1]))


def all_signs(table: Table) -> Table:
    return replace(table, effort=-table.effort)


def effort_swapped(table: Table, first: int = 2, second: int = 3) -> Table:
    return replace(table, effort=swapped(table.effort, first, second))


def all_swapped(table: Table, first: int = 2, second: int = 3) -> Table:
    return replace(table, **{name: swapped(v, first, second) for name, v in table.series()})


def velocity_swapped(table: Table, first: int = 2, second: int = 3) -> Table:
    return replace(table, dq=swapped(table.dq, first, second))


def velocity_turned(table: Table, joints: tuple[int, ...] = (2,)) -> Table:
    turn = np.where(np.isin(np.arange(1, table.joints + 1), joints), -1.0, 1.0)
    return replace(table, dq=table.dq * turn)


def position_turned(table: Table, joint: int = 2) -> Table:
    return replace(table, q=edited(table.q, joint, -table.q[:, joint - 1]))


def joint_turned(table: Table, joint: int = 2) -> Table:
    """A joint that counts the other way: position and velocity, not effort."""
    return replace(
        position_turned(table, joint), dq=edited(table.dq, joint, -table.dq[:, joint - 1])
    )


def tau_ext_inverted(table: Table) -> Table:
    assert table.tau_ext is not None
    return replace(table, tau_ext=-table.tau_ext)


# Units


def degrees(table: Table) -> Table:
    return replace(table, q=np.rad2deg(table.q), dq=np.rad2deg(table.dq))


def positions_in_degrees(table: Table) -> Table:
    return replace(table, q=np.rad2deg(table.q))


def velocities_in_degrees(table: Table) -> Table:
    return replace(table, dq=np.rad2deg(table.dq))


def milliseconds(table: Table) -> Table:
    return replace(table, t=np.round(1e3 * table.t, 3))


def torque_called_current(table: Table) -> Table:
    return replace(table, effort=table.torque)


def current_called_torque(table: Table) -> Table:
    return replace(table, signal="tau")


def milliamperes(table: Table) -> Table:
    return replace(table, effort=1e3 * table.effort)


# Gravity, loads and offsets


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


def mounted(table: Table, angle: float, about: float = 0.0) -> Table:
    """The base turned by `angle` about a level axis `about` from x. [degrees]"""
    chain = table.arm.chain
    tilt, heading = np.deg2rad(angle), np.deg2rad(about)
    axis = np.array([np.cos(heading), np.sin(heading), 0.0])
    down = np.asarray(chain.gravity)
    # Rodrigues; the axis is level and gravity upright, so their product along the axis is zero.
    turned = np.cos(tilt) * down + np.sin(tilt) * np.cross(axis, down)
    more = gravity_torque(table, table.arm, turned) - gravity_torque(table, table.arm)
    return with_more_torque(table, more)


def acceleration(table: Table) -> Array:
    """Smoothed rate of the velocities: central differences over 50 ms. (T, n) [rad/s²]"""
    half = max(1, round(0.025 / float(np.median(np.diff(table.t)))))
    rows = np.arange(len(table.t))
    before, after = np.maximum(rows - half, 0), np.minimum(rows + half, len(rows) - 1)
    return np.asarray(
        (table.dq[after] - table.dq[before]) / (table.t[after] - table.t[before])[:, None]
    )


def payload(
    table: Table, mass: float = 2.8, com: tuple[float, float, float] = (0.0, 0.0, 0.05)
) -> Table:
    """A load that nobody names, its weight and its inertia."""
    load = Payload(mass=mass, com=np.array(com), inertia=0.002 * mass * np.eye(3))
    chain = table.arm.loaded_chain
    regressor = torque_regressor(chain, table.q, table.dq, acceleration(table))
    more = chain_parameters(chain.with_payload(load)) - chain_parameters(chain)
    return with_more_torque(table, regressor @ more)


def effort_offset(table: Table, joint: int = 3, share: float = 0.2) -> Table:
    column = table.effort[:, joint - 1]
    return replace(
        table, effort=edited(table.effort, joint, column + share * np.max(np.abs(column)))
    )


def effort_zero(table: Table, joint: int = 5) -> Table:
    return replace(table, effort=edited(table.effort, joint, 0.0))


def saturated(table: Table, joint: int = 2, share: float = 0.6) -> Table:
    column = table.effort[:, joint - 1]
    level = share * float(np.max(np.abs(column)))
    return replace(table, effort=edited(table.effort, joint, np.clip(column, -level, level)))


# Velocities and efforts that come late, slow or not at all


def late(signal: Array, samples: int) -> Array:
    """A signal `samples` later; its first value stands until then. (T, n)"""
    return np.asarray(signal[np.maximum(np.arange(len(signal)) - samples, 0)])


def velocity_lag(table: Table, samples: int = 3) -> Table:
    return replace(table, dq=late(table.dq, samples))


def velocity_filtered(table: Table, cut_off: float = 1.0) -> Table:
    """A first-order low-pass, as a filter in a driver does it. [Hz]"""
    keep = float(np.exp(-2 * np.pi * cut_off * np.median(np.diff(table.t))))
    start = keep * table.dq[:1]
    return replace(table, dq=lfilter([1 - keep], [1, -keep], table.dq, axis=0, zi=start)[0])


def velocity_held(table: Table, samples: int = 8) -> Table:
    rows = np.arange(len(table.t))
    return replace(table, dq=table.dq[rows - rows % samples])


def effort_lag(table: Table, samples: int = 5) -> Table:
    return replace(table, effort=late(table.effort, samples))


def stuck(table: Table, signal: str, joint: int, start: float = 0.5) -> Table:
    """One joint's signal stands still from a share `start` of the log on."""
    column = np.array(getattr(table, signal)[:, joint - 1])
    first = int(start * len(column))
    column[first:] = column[first]
    return replace(table, **{signal: edited(getattr(table, signal), joint, column)})


def quantised(table: Table, step: float = 1e-3) -> Table:
    return replace(table, q=np.round(table.q / step) * step)


# Clocks and rows


def clock_skew(table: Table, share: float = 0.05) -> Table:
    """The clock counts (1 + share) seconds a second."""
    return replace(table, t=table.t[0] + (1 + share) * (table.t - table.t[0]))


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


class Fault(NamedTuple):
    """A fault that is planted.

    Attributes:
        plant: Makes the faulty table.
        codes: Codes of the findings that name it; "" stands for a refusal by the reader.
        joints: Joints, from 1, that a finding which tells joints has to tell, and no others.
        signals: The effort that a log must have for it to be planted, "" for any; or "tau_ext".
    """

    plant: Maker
    codes: tuple[str, ...]
    joints: tuple[int, ...] = ()
    signal: str = ""


READER = ""
"""Stands among the codes for a refusal by the reader, which names the fault in words."""

FAULTS: Mapping[str, Fault] = {
    "wrong_robot": Fault(wrong_robot, ("other-robot", "no-robot-fits")),
    "one_sign_J2": Fault(one_sign, ("joint-sign",), (2,)),
    "all_signs": Fault(all_signs, ("effort-sign",)),
    "degrees": Fault(degrees, ("degrees", READER)),
    "positions_degrees_only": Fault(positions_in_degrees, ("degrees", "velocity-unit", READER)),
    "time_ms": Fault(milliseconds, ("time-unit",)),
    "effort_swapped_J2_J3": Fault(effort_swapped, ("effort-order",), (2, 3)),
    # On a plane circle both orders explain the same: either says that J2 and J3 are swapped.
    "all_swapped_J2_J3": Fault(all_swapped, ("joint-order", "effort-order"), (2, 3)),
    "velocity_swapped_J2_J3": Fault(velocity_swapped, ("velocity-order",), (2, 3)),
    "velocity_lag_3": Fault(velocity_lag, ("velocity-lag",)),
    "velocity_1Hz_filtered": Fault(velocity_filtered, ("velocity-filtered",)),
    "velocity_held_8": Fault(velocity_held, ("velocity-held",)),
    "effort_lag_5": Fault(effort_lag, ("effort-lag",)),
    "payload_2.8kg": Fault(payload, ("unmodelled-load",)),
    "gravity_compensated": Fault(
        without_gravity, ("torque-without-gravity", "current-without-gravity")
    ),
    "torque_called_current": Fault(torque_called_current, ("current-as-torque",), (), "current"),
    "current_called_torque": Fault(current_called_torque, ("torque-as-current",), (), "current"),
    "current_mA": Fault(milliamperes, ("milliamperes",), (), "current"),
    "clock_skew_5%": Fault(clock_skew, ("clock-rate",)),
    "dropped_5%": Fault(dropped, ("missing-samples",)),
    "dropped_1s": Fault(dropped_span, ("gaps",)),
    "duplicate_rows_10%": Fault(duplicate_rows, ("repeated-stamps",)),
    "stale_rows_10%": Fault(stale_rows, ("stale-rows",)),
    "time_reset": Fault(time_reset, ("time-reset", READER)),
    "stuck_position_J4": Fault(partial(stuck, signal="q", joint=4), ("stuck-position",), (4,)),
    "stuck_effort_J3": Fault(partial(stuck, signal="effort", joint=3), ("stuck-effort",), (3,)),
    "saturated_J2": Fault(saturated, ("saturation",), (2,)),
    "quantised_1mrad": Fault(quantised, ("coarse-positions",)),
    "ceiling_mount": Fault(partial(mounted, angle=180.0), ("upside-down",)),
    "wall_mount_30deg": Fault(partial(mounted, angle=-30.0), ("tilted-base",)),
    "NaN_burst": Fault(nan_burst, (READER,)),
    "effort_zero_J5": Fault(effort_zero, ("zero-effort",), (5,)),
    "offset_J3_20pct": Fault(effort_offset, ("effort-offset",), (3,)),
    "tau_ext_inverted": Fault(tau_ext_inverted, ("vendor-sign",), (), "tau_ext"),
}
"""Fault → how it is planted and what names it."""

HARMLESS: Mapping[str, frozenset[str]] = {
    "ur10e": frozenset(
        {"dropped_5%", "dropped_1s", "duplicate_rows_10%", "stale_rows_10%", "quantised_1mrad"}
    ),
    "ur5": frozenset(
        {"dropped_5%", "dropped_1s", "duplicate_rows_10%", "stale_rows_10%", "quantised_1mrad"}
        | {"stuck_position_J4"}
    ),
    "panda": frozenset(
        {"dropped_5%", "dropped_1s", "duplicate_rows_10%", "stale_rows_10%", "quantised_1mrad"}
        | {"stuck_position_J4", "time_ms", "effort_lag_5", "effort_zero_J5"}
    ),
}
"""Log → faults that move its estimate by less than 0.1 N·m and 2 % of the effort."""


def fits_log(fault: Fault, table: Table) -> bool:
    """Whether a fault can be planted in a log."""
    if fault.signal == "tau_ext":
        return table.tau_ext is not None
    return fault.signal in {"", table.signal}


SCENARIOS: Mapping[str, tuple[str, float, str]] = {
    "ur5": ("ur5-circle", 16.0, "current"),
    "panda": ("panda-bearing", 14.0, "tau"),
}
"""Simulated log → its scenario, how much of it is run [s] and its effort."""

SEED = 3


def simulated(log: str, folder: Path) -> Table:
    """A simulated log, made in `folder` unless it is there; `truth_path` of it is beside it."""
    from vftcli.simulation import load_scenario
    from vftcli.simulation.experiment import simulate

    scenario, seconds, signal = SCENARIOS[log]
    path = folder / f"{log}.npz"
    if not path.exists():
        made = simulate(load_scenario(scenario, [f"duration={seconds:g}"]), SEED)
        seen = made.recording
        effort = seen.current if signal == "current" else seen.torque
        assert effort is not None
        signals = {"t": seen.t, "q": seen.q, "dq": seen.require("dq"), "effort": effort}
        if signal == "tau":
            signals["tau_ext"] = seen.require("tau_ext")
        true = {f"tau_ext{j + 1}": column for j, column in enumerate(made.truth.tau_ext.T)}
        pl.DataFrame({"t": made.truth.t, **true}).write_csv(truth_path(log, folder))
        np.savez(path, **signals)
    with np.load(path) as arrays:
        return Table(**dict(arrays), signal=signal, robot=log, given=log)


def truth_path(log: str, folder: Path) -> Path:
    """The true external torque of a simulated log, as a table."""
    return folder / f"{log}.truth.csv"


def ur10e_log(path: Path, start: float = 2.0, stop: float = 24.0) -> Table:
    """A span of a real UR10e log without a header: t, q, dq, current and more. [s]"""
    rows = np.loadtxt(path, delimiter=",")
    table = Table(
        t=rows[:, 0],
        q=rows[:, 1:7],
        dq=rows[:, 7:13],
        effort=rows[:, 13:19],
        signal="current",
        robot="ur10e",
        given="ur10e",
    )
    return table.between(start, stop)
