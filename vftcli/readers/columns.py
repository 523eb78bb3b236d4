"""The --columns grammar: the signal, unit and sign of each column of a table.

And a guess, as a text of that grammar, from the values of a table without a header.
"""

import re
from collections.abc import Sequence
from contextlib import suppress
from itertools import permutations
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, integral, median_step, root_mean_squares
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark

#: Name in --columns → field of Recording. `t` is the clock and `_` skips.
SIGNALS = {
    "q": "q", "dq": "dq", "current": "current", "tau": "torque", "tau+g": "torque_without_gravity",
    "target_q": "target_q", "target_dq": "target_dq", "target_current": "target_current",
    "target_torque": "target_torque", "tau_ext": "tau_ext", "wrench": "wrench",
    "temperature": "temperature",
}  # fmt: skip

DEGREE = 0.017453292519943295

#: Kind of signal → unit in brackets → factor to SI.
UNITS: dict[str, dict[str, float]] = {
    "t": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "q": {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "°": DEGREE, "rev": 360 * DEGREE},
    "dq": {
        "rad/s": 1.0, "rad": 1.0, "deg/s": DEGREE, "deg": DEGREE, "°/s": DEGREE,
        "rpm": 6 * DEGREE,
    },
    "current": {"A": 1.0, "mA": 1e-3},
    "tau": {"Nm": 1.0, "N·m": 1.0, "N.m": 1.0, "N*m": 1.0, "mNm": 1e-3, "Ncm": 1e-2},
    "temperature": {"C": 1.0, "°C": 1.0, "degC": 1.0},
}  # fmt: skip
#: Torques of every kind have the same units.
TORQUES = ("tau+g", "torque", "torque_without_gravity", "tau_ext")
UNITS |= dict.fromkeys(TORQUES, UNITS["tau"])

ITEM = re.compile(
    r"(?P<minus>-)?(?P<name>tau\+g|[A-Za-z_]+)(?:\[(?P<unit>[^\]]*)\])?"
    r"(?:@(?P<rate>[0-9.eE+]+)(?:Hz)?|:(?P<count>\d{1,9}|\*)|=(?P<pattern>.+))?"
)


class Cell(NamedTuple):
    """A column, or one element of a column of lists; `turned` where its sign is."""

    column: int
    element: int | None = None
    turned: bool = False


Cells = tuple[Cell, ...]  #: The cells of a signal.


class Item(NamedTuple):
    """One item of a --columns text, and in a table the cells that it means."""

    #: A key of SIGNALS, `t`, or `_`; of cells found without a text also their field.
    signal: str
    #: What a value is multiplied with to be in SI units and in our sign.
    factor: float = 1.0
    unit: str | None = None  #: The unit as written, or None; of a wrench its frame.
    #: Columns that it covers in a headerless table; 0 for all others.
    width: int = 1
    #: The column names it means, None for those found without it.
    pattern: str | None = None
    rate: float | None = None  #: Rate of a table without a clock. [Hz]
    cells: Cells = ()  #: One cell a joint, base to tip; one or two of the clock.
    remark: Remark | None = None  #: What is to be said of it, if anything is.

    @property
    def field(self) -> str:
        """The field of Recording, else the name itself."""
        return SIGNALS.get(self.signal, self.signal)


class ColumnSpec(NamedTuple):
    """A parsed --columns text: the items, and whether they name columns or count them.

    `segment` is the number of the recording that is wanted of a file that holds several.
    """

    items: tuple[Item, ...] = ()
    named: bool = False
    segment: int | None = None

    def item(self, signal: str) -> Item | None:
        """The item of a signal, or None."""
        return next((item for item in self.items if item.signal == signal), None)

    @property
    def width(self) -> int:
        """Number of columns of a counting text, without ``_:*``."""
        return sum(item.width for item in self.items if item.rate is None)


def parse_columns(text: str, *, log: bool = True) -> ColumnSpec:
    """A parsed --columns text of a `log`, or of a reference without positions."""
    parts = [part.strip() for part in re.split(r",(?![^\[]*\])", text) if part.strip()]
    if not parts:
        raise LogError(
            "--columns is empty. Say which column is which, as in t,q:6,dq:6,current:6."
        )
    numbers = [part.removeprefix("segment=") for part in parts if part.startswith("segment=")]
    if numbers and (len(numbers) > 1 or not re.fullmatch(r"[0-9]+", numbers[0])):
        raise LogError(f"--columns: segment={numbers[0]} must be one whole number, from 1.")
    segment = int(numbers[0][:9]) if numbers else None
    items = tuple(_parse_item(part) for part in parts if not part.startswith("segment="))
    names = [item.signal for item in items if item.signal != "_"]
    # Nothing can be counted without positions: what is left says a unit or a sign.
    single = all(item.width == 1 or item.signal == "wrench" for item in items)
    alone = log and single and "q" not in names and len(names) == len(items)
    named = alone or any(item.pattern is not None for item in items)
    for item in items:
        if named and not alone and item.pattern is None and item.rate is None:
            raise LogError(
                f"--columns: {item.signal} has no column name: name every signal, or count (t,q:6)."
            )
        if names.count(item.signal) > 1:
            raise LogError(
                f"--columns: {item.signal} is given twice. Skip the other columns with _."
            )
    if sum(item.width == 0 for item in items) > 1:
        raise LogError("--columns: _:* covers all columns that are left; give it once.")
    if log and items and "q" not in names and not named:
        raise LogError(
            "--columns: no q; a log needs joint positions, as in t,q:6,dq:6,current:6."
        )
    return ColumnSpec(items=items, named=named, segment=segment)


def _parse_item(part: str) -> Item:
    if (match := ITEM.fullmatch(part)) is None:
        raise LogError(
            f"--columns: cannot understand {part!r}. Items are t, q:6, q[deg]:7, -tau_ext:7, _:13 "
            "(in file order), or q=joint_pos_{i} (by name)."
        )
    minus, name, unit, rate, width, pattern = match.groups()
    if name not in SIGNALS and name not in {"t", "_"}:
        raise LogError(
            f"--columns: no signal {name!r}. Signals: t {' '.join(SIGNALS)}, and _ to skip."
        )
    if name == "_" and (pattern or minus):
        raise LogError(f"--columns: {part!r}: _ only skips, as in _:13.")
    factor, hertz = unit_factor(name, unit) * (-1.0 if minus else 1.0), None
    if rate is not None:
        with suppress(ValueError):
            hertz = float(rate)
        if name != "t" or hertz is None or not 0 < hertz < 1e7:
            raise LogError(f"--columns: {part!r}: a table without a clock is given as t@125Hz.")
    if width == "*":
        if name != "_":
            raise LogError(f"--columns: {part!r}: only _:* covers all columns that are left.")
        return Item(name, width=0)
    count = int(width or (6 if name == "wrench" and pattern is None else 1))
    if not 0 < count <= 10_000 or (name == "t" and count != 1):
        raise LogError(f"--columns: {part!r} covers {count} columns; it must cover at least one.")
    return Item(name, factor, unit, count, pattern, hertz)


def unit_factor(signal: str, unit: str | None) -> float:
    """Factor from a unit to SI; 1 for a wrench, which has a frame."""
    if unit is None or signal in {"wrench", "_"}:
        return 1.0
    units = UNITS[signal.removeprefix("target_")]
    if unit not in units:
        raise LogError(f"--columns: {signal} has no unit {unit!r}; units: {', '.join(units)}.")
    return units[unit]


def tick_of(stamps: Array, name: str) -> tuple[float, str]:
    """Length and unit of a tick: by name, else by the size of stamps and steps.

    Whole numbers one apart are ms of a 1 kHz log, epoch stamps show by size, others are s.
    """
    units = UNITS["t"]
    if match := re.search(r"[_\[(.](ns|us|ms|s)[\])]?$", name.lower()):
        return units[match[1]], match[1]
    if len(stamps) == 0:
        return 1.0, "s"
    usual = abs(stamps[len(stamps) // 2])  # the first may be garbage
    # Counts since 1970 are near 1.7e18 ns, 1.7e15 µs and 1.7e12 ms.
    for size, unit in ((1e17, "ns"), (1e14, "us"), (1e11, "ms")):
        if size < usual < 1e20:
            return units[unit], unit
    step = median_step(stamps) if len(stamps) > 1 else 0.0
    whole = stamps.dtype.kind in "iu" or bool(np.all(np.mod(stamps[:1000], 1) == 0))
    return (1e-3, "ms") if whole and 0.8 <= step <= 1.2 else (1.0, "s")


ROWS = 20_000  #: Rows that are looked at; of more, the first.
FITTED = 2000  #: Rows, of these, from which a drive constant is found.
JOINTS = range(3, 13)  #: Numbers of joints that a table may be of.
#: Rows over which a velocity's integral is compared with the change of a position.
STEPS = (1, 4, 16, 64)
#: Share of a position's change that its own velocity may leave; another's leaves 1.
OPEN = 0.35
STILL = 0.02  #: Travel below which a joint need not show its velocity. [rad]
EVEN = 20.0  #: Most medians that all but a twentieth of a clock's steps take.
#: Misfit of a current to a torque: of a UR10e's target .02 to .09, of its measured .06 to .6.
DRIVEN = 0.12
CLEAR = 1.3  #: How much better than another current it must fit.
CONSTANTS = (3.0, 400.0)  #: Drive constants of geared joints. [N·m/A]
#: Slope and cosine of a target against what was measured.
ALIKE, NEAR = (0.5, 2.0), 0.9


class Guess(NamedTuple):
    """Columns guessed from the values of a table."""

    columns: str  #: The text for --columns.
    why: str  #: What was found, in words.
    #: Further texts that fit as well; empty where the values settle it.
    others: tuple[str, ...] = ()


def guess_columns(columns: Sequence[Array]) -> Guess | None:
    """The columns (T,) of a table without a header, by their values; or None.

    A clock steps evenly, velocities are the derivative of positions, and target torque is
    target current times a constant, but for friction. None without a clock, or positions
    followed by their velocities.
    """
    table = np.stack([np.asarray(column[:ROWS], dtype=np.float64) for column in columns], axis=1)
    clock = np.asarray(columns[0][:ROWS])
    if len(table) < 2 * STEPS[-1] or not np.isfinite(table).all():
        return None
    steps = np.diff(clock)
    if np.any(steps < 0) or np.quantile(steps, 0.95) >= EVEN * median_step(clock):
        return None
    t = (clock - clock[0]).astype(np.float64) * tick_of(clock, "")[0]
    width = table.shape[1]
    blocks = {
        n: [table[:, k : k + n] for k in range(1, width - n + 1, n)]
        for n in JOINTS
        if 2 * n < width
    }
    fitting = [n for n, each in blocks.items() if _begins_with_motion(t, each)]
    if len(fitting) != 1:
        return None
    joints, few = fitting[0], slice(None, None, len(table) // FITTED + 1)
    _, dq, *efforts = (block[few] for block in blocks[joints])
    left = (len(columns) - 1) % joints
    found, why = _efforts(efforts, dq)
    rest = left if found is not None else (len(efforts) - 1) * joints + left
    skipped = f",_:{rest}" if rest else ""
    texts = [
        ",".join(["t", *(f"{name}:{joints}" for name in ("q", "dq", *names))]) + skipped
        for names in (SINGLE if found is None else [found])
    ]
    others = tuple(texts[1:] or texts) if found is None or left else ()
    return Guess(texts[0], f"the first steps evenly, dq is the derivative of q{why}", others)


#: What the numbers behind the velocities may be, the likeliest first.
SINGLE = (("tau",), ("current",), ("tau+g",))
#: The order in which controllers record their targets, and what they are recorded behind.
TARGETS = ("current", "target_current", "target_torque")


def _begins_with_motion(t: Array, blocks: Sequence[Array]) -> bool:
    """Whether the second block is the derivative of the first, and no others are."""
    pairs = permutations(range(len(blocks)), 2)
    return _is_derivative(t, *blocks[:2]) and not any(
        _is_derivative(t, blocks[a], blocks[b]) for a, b in pairs if (a, b) != (0, 1)
    )


def _is_derivative(t: Array, x: Array, dx: Array) -> bool:
    """Whether all that moves in x is the integral of its own column of dx."""
    left = x - integral(t, dx)
    own = np.full(x.shape[1], False)
    for step in STEPS:
        rest, change = (np.sum(np.diff(each[::step], axis=0) ** 2, axis=0) for each in (left, x))
        own |= rest < OPEN**2 * change
    return bool(own.any() and own[np.ptp(x, axis=0) > STILL].all())


def _efforts(parts: Sequence[Array], dq: Array) -> tuple[tuple[str, ...] | None, str]:
    """Names of the blocks behind the velocities, or None; the reason."""
    if len(parts) != 3:
        return (None if parts else ()), ""
    current, target, torque = parts
    (misfit, constants), (rival, _) = (_driven(torque, x, dq) for x in (target, current))
    product = np.sum(current * target, axis=0)
    own, other = np.sum(current**2, axis=0), np.sum(target**2, axis=0)
    live = (own > 0) & (other > 0)
    slope = product[live] / other[live]
    cosine = product[live] / np.sqrt(own[live] * other[live])
    # Where a joint rests its stiction is in what was measured alone.
    alike = np.any((slope > ALIKE[0]) & (slope < ALIKE[1]) & (cosine > NEAR))
    if not (misfit < DRIVEN and CLEAR * misfit < rival and alike):
        return None, ""
    shown = " ".join(f"{constant:.3g}" for constant in constants)
    return TARGETS, f", target_torque is target_current times {shown} N·m/A but for friction"


def _driven(torque: Array, current: Array, dq: Array) -> tuple[float, list[float]]:
    """Misfit of a current to a torque, and drive constants."""
    constants, left = list[float](), list[float]()
    sizes = root_mean_squares(current)
    for x, y, speed, size in zip(torque.T, current.T, dq.T, sizes, strict=True):
        if size > 2e-3 * sizes.max():
            friction = (np.tanh(speed / 0.002), speed, speed * np.abs(speed))
            terms = np.stack([x, *friction], axis=1)
            values = np.linalg.lstsq(terms, y, rcond=None)[0]
            constants.append(1 / float(values[0]) if values[0] else 0.0)
            left.append(float(root_mean_squares(y - terms @ values) / size))
    good = left and CONSTANTS[0] < min(constants) <= max(constants) < CONSTANTS[1]
    return float(np.median(left)) if good else np.inf, constants
