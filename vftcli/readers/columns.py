"""The --columns grammar: which column of a table holds which signal, in which unit and sign."""

import re
from dataclasses import dataclass

from vftcli.signals.errors import LogError

#: Name in --columns → field of Recording. `t` is the clock and `_` skips.
SIGNALS: dict[str, str] = {
    "q": "q",
    "dq": "dq",
    "current": "current",
    "tau": "torque",
    "tau+g": "torque_without_gravity",
    "target_q": "target_q",
    "target_dq": "target_dq",
    "target_current": "target_current",
    "target_torque": "target_torque",
    "tau_ext": "tau_ext",
    "wrench": "wrench",
    "temperature": "temperature",
}

DEGREE = 0.017453292519943295

#: Kind of signal → unit in brackets → factor to SI.
UNITS: dict[str, dict[str, float]] = {
    "t": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "q": {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "rev": 360 * DEGREE},
    "dq": {
        "rad/s": 1.0, "rad": 1.0, "deg/s": DEGREE, "deg": DEGREE, "rpm": 6 * DEGREE,
    },
    "current": {"A": 1.0, "mA": 1e-3},
    "tau": {"Nm": 1.0, "N·m": 1.0, "mNm": 1e-3, "Ncm": 1e-2},
    "temperature": {"C": 1.0, "°C": 1.0, "degC": 1.0},
}  # fmt: skip
#: Signals that share another signal's units.
KINDS = {
    "target_q": "q",
    "target_dq": "dq",
    "target_current": "current",
    "tau+g": "tau",
    "target_torque": "tau",
    "tau_ext": "tau",
}

ITEM = re.compile(
    r"(?P<minus>-)?(?P<name>tau\+g|[A-Za-z_]+)(?:\[(?P<unit>[^\]]*)\])?"
    r"(?:@(?P<rate>[0-9.eE+]+)(?:Hz)?|:(?P<count>\d{1,9}|\*)|=(?P<pattern>.+))?"
)


@dataclass(frozen=True, kw_only=True)
class Item:
    """One item of a --columns text."""

    signal: str  #: A key of SIGNALS, `t`, or `_`.
    factor: float = 1.0  #: What a value is multiplied with to be in SI units and in our sign.
    unit: str | None = None  #: The unit as written, or None.
    count: int = 1  #: Columns in a row that it covers, in a headerless table; 0 for all others.
    #: The column names it means, in a headed table; None for those found without it.
    pattern: str | None = None
    rate: float | None = None  #: Sampling rate of a table that has no clock. [Hz]


@dataclass(frozen=True, kw_only=True)
class ColumnSpec:
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
        """Number of columns that a counting text describes, those of ``_:*`` left out."""
        return sum(item.count for item in self.items if item.rate is None)


def parse_columns(text: str, *, log: bool = True) -> ColumnSpec:
    """Parse a --columns text, of a log unless it is of a reference, which has no positions."""
    if not _split(text):
        raise LogError("--columns is empty. Say which column is which, as in t,q:6,dq:6,current:6.")
    parts, segment = _without_segment(_split(text))
    items = tuple(_parse_item(part) for part in parts)
    signals = {item.signal for item in items}
    # Nothing can be counted without positions: what is left says a unit or a sign.
    single = all(item.count == 1 or item.signal == "wrench" for item in items)
    alone = log and single and not signals & {"q", "_"}
    named = alone or any(item.pattern is not None for item in items)
    for item in items:
        if named and not alone and item.pattern is None and item.rate is None:
            raise LogError(
                f"--columns: {item.signal} has no column name while others have one. Name every "
                "signal (q=joint_{i}), or count columns in file order (t,q:6), not both."
            )
    names = [item.signal for item in items if item.signal != "_"]
    for name in names:
        if names.count(name) > 1:
            raise LogError(f"--columns: {name} is given twice. Skip the other columns with _.")
    if sum(item.count == 0 for item in items) > 1:
        raise LogError("--columns: _:* covers all columns that are left; give it once.")
    if log and items and "q" not in names and not named:
        raise LogError("--columns: no q; a log needs joint positions, as in t,q:6,dq:6,current:6.")
    return ColumnSpec(items=items, named=named, segment=segment)


def _split(text: str) -> list[str]:
    """Split at the commas that stand outside brackets."""
    parts = re.split(r",(?![^\[]*\])", text)
    return [part.strip() for part in parts if part.strip()]


def _without_segment(parts: list[str]) -> tuple[list[str], int | None]:
    """The items but for segment=N, and that number."""
    numbers = [part.removeprefix("segment=") for part in parts if part.startswith("segment=")]
    if not numbers:
        return parts, None
    if len(numbers) > 1 or not numbers[0].isascii() or not numbers[0].isdigit():
        raise LogError(f"--columns: segment={numbers[0]} must be one whole number, from 1.")
    return [part for part in parts if not part.startswith("segment=")], int(numbers[0][:9])


def _parse_item(part: str) -> Item:
    """One item of the text."""
    match = ITEM.fullmatch(part)
    if match is None:
        raise LogError(
            f"--columns: cannot understand {part!r}. Items are t, q:6, q[deg]:7, -tau_ext:7, _:13 "
            "(in file order), or q=joint_pos_{i} (by name)."
        )
    name = match["name"]
    if name not in SIGNALS and name not in {"t", "_"}:
        raise LogError(
            f"--columns: no signal {name!r}. Signals: t {' '.join(SIGNALS)}, and _ to skip."
        )
    if name == "_" and (match["pattern"] or match["minus"]):
        raise LogError(f"--columns: {part!r}: _ only skips, as in _:13.")
    factor = unit_factor(name, match["unit"]) * (-1.0 if match["minus"] else 1.0)
    rate = _rate(part, name, match["rate"])
    if match["count"] == "*":
        if name != "_":
            raise LogError(f"--columns: {part!r}: only _:* covers all columns that are left.")
        return Item(signal=name, count=0)
    count = int(match["count"] or (6 if name == "wrench" and match["pattern"] is None else 1))
    if count == 0 or count > 10_000 or (name == "t" and count != 1):
        raise LogError(f"--columns: {part!r} covers {count} columns; it must cover at least one.")
    return Item(
        signal=name,
        factor=factor,
        unit=match["unit"],
        count=count,
        pattern=match["pattern"],
        rate=rate,
    )


def _rate(part: str, name: str, text: str | None) -> float | None:
    """The rate behind @, None where there is none. [Hz]"""
    if text is None:
        return None
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if name != "t" or not 0 < rate < 1e7:
        raise LogError(f"--columns: {part!r}: a table without a clock is given as t@125Hz.")
    return rate


def unit_factor(signal: str, unit: str | None) -> float:
    """Factor from a unit in brackets to SI; the bracket of a wrench names its frame instead."""
    if unit is None or signal in {"wrench", "_"}:
        return 1.0
    units = UNITS[KINDS.get(signal, signal)]
    if unit not in units:
        raise LogError(f"--columns: {signal} has no unit {unit!r}; units: {', '.join(units)}.")
    return units[unit]
