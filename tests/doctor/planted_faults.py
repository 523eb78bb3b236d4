"""Faults planted one at a time in sound logs, as plain tables of signals.

A maker takes a `Table` and its own amounts and gives back the faulty one; it knows nothing of what
the doctor looks for. `KINDS` says which codes name what it makes, and with which other amounts it
is tried; `FAULTS` is the list of 34 that the doctor is held against.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
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
    """The columns of a log."""

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


# The arm, its order and its signs


def wrong_robot(table: Table, given: str = "") -> Table:
    return replace(table, given=given or NEIGHBOURS[table.robot])


def turned(table: Table, signals: tuple[str, ...], joint: int = 2) -> Table:
    """Some signals of one joint with the other sign."""
    sign = 1.0 - 2.0 * (np.arange(1, table.joints + 1) == joint)
    return replace(table, **{name: sign * getattr(table, name) for name in signals})


def swapped(table: Table, signals: tuple[str, ...], pair: tuple[int, int] = (2, 3)) -> Table:
    """Some of the signals that are there, two joints' columns exchanged."""
    first, second = pair
    order = np.arange(table.joints)
    order[[first - 1, second - 1]] = second - 1, first - 1
    return replace(table, **{n: v[:, order] for n, v in table.series() if n in signals})


# Units


def positions_in_degrees(table: Table) -> Table:
    return replace(table, q=np.rad2deg(table.q))


def velocities_in_degrees(table: Table) -> Table:
    return replace(table, dq=np.rad2deg(table.dq))


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


def late(table: Table, signal: str, samples: int) -> Table:
    """A signal `samples` later; its first value stands until then."""
    rows = np.maximum(np.arange(len(table.t)) - samples, 0)
    return replace(table, **{signal: getattr(table, signal)[rows]})


def velocity_filtered(table: Table, cut_off: float = 1.0) -> Table:
    """A first-order low-pass, as a filter in a driver does it. [Hz]"""
    keep = float(np.exp(-2 * np.pi * cut_off * np.median(np.diff(table.t))))
    start = keep * table.dq[:1]
    return replace(table, dq=lfilter([1 - keep], [1, -keep], table.dq, axis=0, zi=start)[0])


def velocity_held(table: Table, samples: int = 8) -> Table:
    rows = np.arange(len(table.t))
    return replace(table, dq=table.dq[rows - rows % samples])


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
    """A fault that is planted."""

    plant: Maker
    codes: tuple[str, ...]  # of the findings that name it; "" for a refusal by the reader
    joints: tuple[int, ...] = ()  # from 1, that a finding which tells joints has to tell
    signal: str = ""  # the effort that a log must have, "" for any; or "tau_ext"


class Kind(NamedTuple):
    """A kind of fault: its maker takes amounts."""

    maker: Callable[..., Table]
    codes: tuple[str, ...]
    #: Amount → the values that are tried; with () every joint, some pairs of them, or every other
    #: arm of as many joints.
    amounts: Mapping[str, tuple[Any, ...]] = {}
    signal: str = ""

    def fault(self, **amounts: Any) -> Fault:
        """The fault of some amounts; of joints that are among them a finding must tell."""
        one = (amounts["joint"],) if "joint" in amounts else ()
        joints = amounts.get("pair", one)
        return Fault(partial(self.maker, **amounts), self.codes, joints, self.signal)


READER = ""
"""Stands among the codes for a refusal by the reader, which names the fault in words."""

EACH: Mapping[str, tuple[Any, ...]] = {"joint": ()}
PAIRS: Mapping[str, tuple[Any, ...]] = {"pair": ()}
STUCK = {"joint": (), "start": (0.3, 0.7)}

KINDS: Mapping[str, Kind] = {
    "wrong robot": Kind(wrong_robot, ("other-robot", "no-robot-fits"), {"given": ()}),
    "one sign": Kind(partial(turned, signals=("effort",)), ("joint-sign",), EACH),
    "all signs": Kind(lambda t: replace(t, effort=-t.effort), ("effort-sign",)),
    "effort swapped": Kind(partial(swapped, signals=("effort",)), ("effort-order",), PAIRS),
    # On a plane circle both orders explain the same: either says which joints are swapped.
    "all swapped": Kind(
        partial(swapped, signals=Signals), ("joint-order", "effort-order"), PAIRS
    ),
    "velocity swapped": Kind(partial(swapped, signals=("dq",)), ("velocity-order",), PAIRS),
    "velocity turned": Kind(
        partial(turned, signals=("dq",)), ("velocity-mismatch", "velocity-sign"), EACH
    ),
    "position turned": Kind(
        partial(turned, signals=("q",)), ("velocity-mismatch", "velocity-sign"), EACH
    ),
    "position and velocity turned": Kind(
        partial(turned, signals=("q", "dq")), ("joint-sign",), EACH
    ),
    "degrees": Kind(
        lambda t: positions_in_degrees(velocities_in_degrees(t)), ("degrees", READER)
    ),
    "positions in degrees": Kind(positions_in_degrees, ("degrees", "velocity-unit", READER)),
    "velocities in degrees": Kind(velocities_in_degrees, ("velocity-unit", READER)),
    "milliseconds": Kind(lambda t: replace(t, t=np.round(1e3 * t.t, 3)), ("time-unit",)),
    "velocity lag": Kind(
        partial(late, signal="dq"), ("velocity-lag",), {"samples": (2, 3, 5, 10, 20)}
    ),
    "velocity filtered": Kind(
        velocity_filtered, ("velocity-filtered", "velocity-lag"), {"cut_off": (0.5, 1, 2, 5)}
    ),
    "velocity held": Kind(velocity_held, ("velocity-held",), {"samples": (4, 8, 16)}),
    "effort lag": Kind(
        partial(late, signal="effort"), ("effort-lag",), {"samples": (2, 5, 10, 20)}
    ),
    "load": Kind(payload, ("unmodelled-load",), {"mass": (0.5, 1, 2, 4, 8)}),
    "gravity": Kind(without_gravity, ("torque-without-gravity", "current-without-gravity")),
    "torque as current": Kind(
        lambda t: replace(t, effort=t.torque), ("current-as-torque",), {}, "current"
    ),
    "current as torque": Kind(
        lambda t: replace(t, signal="tau"), ("torque-as-current",), {}, "current"
    ),
    "mA": Kind(lambda t: replace(t, effort=1e3 * t.effort), ("milliamperes",), {}, "current"),
    "clock": Kind(clock_skew, ("clock-rate",), {"share": (-0.2, -0.05, -0.02, 0.02, 0.1, 0.2)}),
    "time reset": Kind(time_reset, ("time-reset", READER), {"start": (0.3, 0.7)}),
    "tilt": Kind(
        mounted,
        ("tilted-base",),
        {"angle": (15.0, 30.0, 60.0, 90.0), "about": (0.0, 90.0, 225.0)},
    ),
    "upside down": Kind(mounted, ("upside-down",), {"angle": (180.0,)}),
    "offset": Kind(effort_offset, ("effort-offset",), {"joint": (), "share": (-0.2, 0.1, 0.5)}),
    "zero effort": Kind(effort_zero, ("zero-effort",), EACH),
    "saturated": Kind(
        saturated, ("saturation",), {"joint": (1, 2, 3, 4), "share": (0.4, 0.6, 0.8)}
    ),
    "tau_ext": Kind(lambda t: replace(t, tau_ext=-t.tau_ext), ("vendor-sign",), {}, "tau_ext"),
    "stuck position": Kind(partial(stuck, signal="q"), ("stuck-position",), STUCK),
    "stuck velocity": Kind(partial(stuck, signal="dq"), ("stuck-velocity",), STUCK),
    "stuck effort": Kind(partial(stuck, signal="effort"), ("stuck-effort",), STUCK),
}


def planted(kind: str, **amounts: Any) -> Fault:
    return KINDS[kind].fault(**amounts)


FAULTS: Mapping[str, Fault] = {
    "wrong_robot": planted("wrong robot"),
    "one_sign_J2": planted("one sign", joint=2),
    "all_signs": planted("all signs"),
    "degrees": planted("degrees"),
    "positions_degrees_only": planted("positions in degrees"),
    "time_ms": planted("milliseconds"),
    "effort_swapped_J2_J3": planted("effort swapped", pair=(2, 3)),
    "all_swapped_J2_J3": planted("all swapped", pair=(2, 3)),
    "velocity_swapped_J2_J3": planted("velocity swapped", pair=(2, 3)),
    "velocity_lag_3": planted("velocity lag", samples=3),
    "velocity_1Hz_filtered": planted("velocity filtered", cut_off=1.0)._replace(
        codes=("velocity-filtered",)
    ),
    "velocity_held_8": planted("velocity held", samples=8),
    "effort_lag_5": planted("effort lag", samples=5),
    "payload_2.8kg": planted("load", mass=2.8),
    "gravity_compensated": planted("gravity"),
    "torque_called_current": planted("torque as current"),
    "current_called_torque": planted("current as torque"),
    "current_mA": planted("mA"),
    "clock_skew_5%": planted("clock", share=0.05),
    "dropped_5%": Fault(dropped, ("missing-samples",)),
    "dropped_1s": Fault(dropped_span, ("gaps",)),
    "duplicate_rows_10%": Fault(duplicate_rows, ("repeated-stamps",)),
    "stale_rows_10%": Fault(stale_rows, ("stale-rows",)),
    "time_reset": planted("time reset", start=0.5),
    "stuck_position_J4": planted("stuck position", joint=4),
    "stuck_effort_J3": planted("stuck effort", joint=3),
    "saturated_J2": planted("saturated", joint=2),
    "quantised_1mrad": Fault(quantised, ("coarse-positions",)),
    "ceiling_mount": planted("upside down", angle=180.0),
    "wall_mount_30deg": planted("tilt", angle=-30.0),
    "NaN_burst": Fault(nan_burst, (READER,)),
    "effort_zero_J5": planted("zero effort", joint=5),
    "offset_J3_20pct": planted("offset", joint=3),
    "tau_ext_inverted": planted("tau_ext"),
}
"""Fault → how it is planted and what names it."""


def variants(table: Table) -> dict[str, list[tuple[str, Fault]]]:
    """Kind → its faults of all amounts in a log, each with what it is."""
    n = table.joints
    arms = (name for name in ("ur5", "ur5e", "ur10e", "panda", "fr3") if name != table.robot)
    every: Mapping[str, tuple[Any, ...]] = {
        "joint": tuple(range(1, n + 1)),
        "pair": ((1, 2), (2, 3), (1, 3), (2, 4), (4, 5), (5, n)),
        "given": tuple(name for name in arms if robot_named(name).joints == n),
    }
    found: dict[str, list[tuple[str, Fault]]] = {}
    for name, kind in KINDS.items():
        values = [some or every[amount] for amount, some in kind.amounts.items()]
        found[name] = [
            (" ".join(map(str, one)), kind.fault(**dict(zip(kind.amounts, one, strict=True))))
            for one in product(*values)
        ]
    return found


OF_ROWS = frozenset(
    {"dropped_5%", "dropped_1s", "duplicate_rows_10%", "stale_rows_10%", "quantised_1mrad"}
)
HARMLESS: Mapping[str, frozenset[str]] = {
    "ur10e": OF_ROWS,
    "ur5": OF_ROWS | {"stuck_position_J4"},
    "panda": OF_ROWS | {"stuck_position_J4", "time_ms", "effort_lag_5", "effort_zero_J5"},
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
    """A simulated log, made in `folder` unless it is there."""
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
        np.savez(path, **signals)
    with np.load(path) as arrays:
        return Table(**dict(arrays), signal=signal, robot=log, given=log)


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
