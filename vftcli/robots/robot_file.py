"""The text of a robot file and its tables: read, bounds checked, written.

Numbers beyond the bounds are slips, or in another unit: the bounds are an order of
magnitude or more beyond the largest arm built (2.3 t payload, 12 t of its own, 4.7 m
reach) and beyond any motion of an arm. A file inside them may still be wrong, but its
torques are finite.
"""

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import date, time
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.parsing import shown, toml_tables


class ValueKind(NamedTuple):
    """One kind of value."""

    words: str  #: What such a value is, as it ends "it must be …".
    fits: Callable[[Any], bool]  #: Whether a value of TOML is one.

    def broken(self, name: str, value: object) -> str:
        """The complaint about a key's value, "" where it is of the kind."""
        return "" if self.fits(value) else f"{name} is {shown(value)}; it must be {self.words}"

    def check(self, name: str, value: object) -> None:
        """Raise a ParameterError unless the value of a key is of the kind."""
        if why := self.broken(name, value):
            raise ParameterError(why)


def is_finite(value: object) -> bool:
    """Whether a value of TOML is a finite number; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond the largest float
        return False


def is_table(value: object) -> bool:
    """Whether a value of TOML is a table."""
    return isinstance(value, Mapping)


def several(least: int) -> ValueKind:
    """The kind of a list of so many numbers or more."""
    words = f"a list of at least {least} finite numbers"
    return ValueKind(words, lambda v: LIST.fits(v) and len(v) >= least and all(map(is_finite, v)))


def vector(length: int) -> ValueKind:
    """The kind of a list of so many numbers."""
    words = f"{length} finite numbers"
    return ValueKind(words, lambda v: several(length).fits(v) and len(v) == length)


def one_each(of: str, fits: Callable[[Any], bool]) -> ValueKind:
    """The kind of a number, or a list with one for each."""
    words = f"a number or one {of}"
    return ValueKind(words, lambda v: v != [] and all(map(fits, v if LIST.fits(v) else [v])))


NUMBER = ValueKind("a finite number", is_finite)
WHOLE = ValueKind("a whole number", lambda v: isinstance(v, int) and not isinstance(v, bool))
SWITCH = ValueKind("true or false", lambda v: isinstance(v, bool))
TEXT = ValueKind("text in quotes", lambda v: isinstance(v, str))
LIST = ValueKind("a list", lambda v: isinstance(v, list | tuple))
TEXTS = ValueKind(
    "text in quotes, or a list of it",
    lambda v: TEXT.fits(v) or (LIST.fits(v) and all(map(TEXT.fits, v))),
)
TABLE = ValueKind("a section", is_table)
PER_JOINT = one_each("per joint", is_finite)
PER_AXIS = one_each("per axis", lambda v: is_finite(v) or v == math.inf)


class Bound(NamedTuple):
    """The range of a number of a robot file, its ends included."""

    low: float  #: Smallest value.
    high: float  #: Largest value.
    unit: str  #: What both are in, "" for a pure number.

    def broken(self, key: str, values: Sequence[float]) -> str:
        """Say which of the values of a key lies outside, or "" if none does."""
        for value in values:
            if not self.low <= value <= self.high:
                unit = f" {self.unit}" if self.unit else ""
                return (
                    f"{key} is {value:g}{unit}; on a robot it is within "
                    f"{self.low:g} to {self.high:g}{unit}"
                )
        return ""


def either_way(size: float, unit: str) -> Bound:
    """The bound of a number that may have either sign."""
    return Bound(-size, size, unit)


#: Smallest value of what is divided by: no drive constant, velocity or rate is smaller.
TINY = 1e-9
#: Key of a robot file → its bound; in a list every number is held to it.
BOUNDS: dict[str, Bound] = {
    key: bound
    for keys, bound in {
        "a d xyz com flange_d ee_xyz": either_way(100.0, "m"),
        # two turns; degrees written for radians are beyond them
        "alpha theta rpy ee_rpy": either_way(4.0 * math.pi, "rad"),
        "q_min q_max": either_way(1e4, "rad"),  # a joint may turn on and on, as a winch does
        "mass": Bound(0.0, 1e4, "kg"),
        "inertia": either_way(1e6, "kg·m²"),  # the heaviest body on a tenth of a lever
        "rotor_inertia": Bound(0.0, 1e4, "kg·m²"),  # a 1 kg·m² rotor behind a gear of 100
        "torque_constant": Bound(TINY, 1e5, "N·m/A"),  # 100 N·m/A behind a gear of 1000
        "gravity": either_way(100.0, "m/s²"),  # four times Jupiter's
        "sample_rate_hz": Bound(TINY, 1e6, "Hz"),
        "qd_max": Bound(TINY, 1e4, "rad/s"),
        "qdd_max": Bound(TINY, 1e6, "rad/s²"),
        "tau_max": Bound(TINY, 1e6, "N·m"),
        "noise_current": Bound(0.0, 1e4, "A"),
        "noise_tau": Bound(0.0, 1e4, "N·m"),
        "noise_q": Bound(0.0, 10.0, "rad"),
        "noise_qd": Bound(0.0, 1e3, "rad/s"),
        "coulomb offset amplitude stribeck logarithmic torques": either_way(1e6, "N·m"),
        "viscous": either_way(1e6, "N·m·s/rad"),
        "quadratic": either_way(1e6, "N·m·s²/rad²"),
        "load_coulomb": either_way(10.0, ""),  # a share of the torque that the gear carries
        "smoothing stribeck_velocity logarithmic_velocity speeds": Bound(TINY, 1e3, "rad/s"),
        "presliding": Bound(0.0, 1e6, "N·m"),
        "presliding_length": Bound(1e-7, 0.1, "rad"),  # a gear yields .1 to 10 mrad, then slides
        "temperature": either_way(1e3, ""),
        "temperature_at": Bound(1.0, 100.0, "°C"),
        "slope": either_way(1e6, "s/rad"),
        "shift": either_way(1e3, "rad/s"),
    }.items()
    for key in keys.split()
}
UNNAMED = either_way(1e6, "")  #: The bound of any other number.
#: Least moving mass: the lightest servos weigh some grams. [kg]
LIGHTEST = 0.05


def out_of_bounds(key: str, values: Sequence[float]) -> str:
    """Complaint about a number that no robot has, or ""."""
    return BOUNDS.get(key, UNNAMED).broken(key, values)


def weightless(mass: float) -> str:
    """Say why an arm with moving bodies of `mass` [kg] together is none, or ""."""
    if mass >= LIGHTEST:
        return ""
    return (
        f"all moving bodies together weigh {mass:g} kg, less than {LIGHTEST:g} kg; a model "
        "without mass explains no torque: give the links their mass"
    )


#: Endings of robot descriptions; what they are their content decides.
DESCRIPTIONS = (".urdf", ".xml", ".xacro", ".mjcf", ".sdf")
LARGEST = 16 << 20  #: Largest robot file; a long one has a hundredth. [B]


class RobotFile:
    """A parsed robot file with line numbers for its complaints."""

    def __init__(self, path: Path, what: str = "robot file", text: str | None = None) -> None:
        self.path = path
        self.text = robot_text(path, what) if text is None else text
        try:
            self.document = toml_tables(self.text)
        except ParameterError as error:
            raise RobotError(f"{path}: {error}") from None

    def line(self, table: str, index: int | None, key: str) -> int | None:
        """Line of `key` in `table`, from 1, or of the table's header.

        Keys before any table have the name ""; `index` is its ``[[joints]]``, from 0, or None.
        """
        header = 1 if table == "" else None
        assigns = re.compile(rf"[\"']?{re.escape(key)}[\"']?\s*=")
        joint, name = -1, ""
        for number, line in enumerate(self.text.splitlines(), start=1):
            stripped = line.strip()
            if stripped.startswith("["):
                name = stripped.split("#")[0].strip().strip("[]").strip()
                joint += stripped.startswith("[[joints]]")
                if name == table and index in {None, joint}:
                    header = number
            elif name == table and index in {None, joint} and key and assigns.match(stripped):
                return number
        if header is None and "." in table:
            return self.line(table.rpartition(".")[0], index, "")
        return header

    @property
    def root(self) -> "Section":
        """The keys before any table, and the tables under theirs."""
        return Section(self, self.document)


class Section(NamedTuple):
    """A table of a robot file; values are checked as they are read."""

    file: RobotFile
    values: Mapping[str, Any]  #: The table.
    table: str = ""  #: Its dotted name, "" for the whole document.
    #: Which ``[[joints]]`` it is or belongs to, from 0, or None outside of them.
    joint: int | None = None

    def refuse(self, message: str, key: str = "") -> NoReturn:
        """Raise a RobotError that names the file, the line and the joint."""
        line = self.file.line(self.table, self.joint, key)
        where = f"{self.file.path}" + (f", line {line}" if line else "")
        owner = ""
        if self.joint is not None:
            name = self.file.document["joints"][self.joint].get("name", "")
            owner = f"joint {self.joint + 1}{f' ({name})' if name else ''}: "
        raise RobotError(f"{where}: {owner}{message}")

    def value(self, key: str, kind: ValueKind, default: Any = None) -> Any:  # noqa: ANN401 - TOML's
        """The value of a key, `default` if absent, or a complaint."""
        if key in self.values:
            if why := kind.broken(key, self.values[key]):
                self.refuse(why, key)
        elif default is None:
            self.refuse(f"{key} is missing; it must be {kind.words}", key)
        return self.values.get(key, default)

    def bounded(
        self, key: str, kind: ValueKind, default: Sequence[float] | None = None
    ) -> list[float]:
        """The numbers of a key, each of them such as robots have."""
        found: list[float] = np.ravel(self.value(key, kind, default)).astype(float).tolist()
        if why := out_of_bounds(key, found):
            self.refuse(why, key)
        return found

    def number(self, key: str, default: float | None = None) -> float:
        """A finite number, `default` if the key is absent."""
        if key not in self.values and default is not None:
            return default
        return self.bounded(key, NUMBER)[0]

    def vector(self, key: str, length: int, default: Sequence[float] | None = None) -> Array:
        """So many finite numbers, `default` if the key is absent. (length,)"""
        return np.array(self.bounded(key, vector(length), default))

    def text(self, key: str, default: str = "") -> str:
        """A word or a sentence, `default` if the key is absent."""
        return str(self.value(key, TEXT, default))

    def choice(self, key: str, known: Iterable[str], default: str | None = None) -> str:
        """One of the known words, `default` if the key is absent."""
        there = list(known)
        kind = ValueKind(f"one of {', '.join(there)}", lambda v: v in there)
        return str(self.value(key, kind, default))

    def tables(self, key: str) -> tuple[Mapping[str, Any], ...]:
        """The ``[[key]]`` tables, none if there are none."""
        words = f"tables, each headed [[{key}]]"
        kind = ValueKind(words, lambda v: LIST.fits(v) and all(map(is_table, v)))
        return tuple(self.value(key, kind, ()))

    def section(self, name: str) -> "Section":
        """The section of a name in this one, empty if there is none."""
        values = self.value(name, TABLE, {})
        table = f"{self.table}.{name}" if self.table else name
        return Section(self.file, values, table, self.joint)

    def named_sections(self, *keys: str) -> dict[str, "Section"]:
        """Tables in this one by name, itself under "" if it has one of `keys`."""
        found = {
            name: self.section(name)
            for name, table in self.values.items()
            if isinstance(table, dict)
        }
        return {**found, "": self} if any(key in self.values for key in keys) else found


def robot_text(path: Path, what: str = "robot file") -> str:
    """The text of a robot file, whatever its format."""
    try:
        # A pipe of a shell's <(…) has no ending; a robot's file has.
        if not (path.is_file() or (path.is_fifo() and not path.suffix)):
            raise RobotError(f"{path}: no such {what}")
        if (size := path.stat().st_size) > LARGEST:
            raise RobotError(
                f"{path}: has {size >> 20} MiB; a {what} has at most {LARGEST >> 20} MiB"
            )
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise RobotError(f"{path}: cannot be read as a {what} ({reason})") from None


def lines_of(document: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[str]:
    """The lines of a table: values, then tables, then arrays of tables."""
    for key, value in document.items():
        if not is_table(value) and not is_tables(value):
            yield f"{bare(key)} = {value_text(value, '.'.join((*path, key)))}\n"
    for key, value in document.items():
        here = (*path, key)
        name = ".".join(map(bare, here))
        if is_table(value):
            if any(not is_table(v) and not is_tables(v) for v in value.values()):
                yield f"\n[{name}]\n" if path != ("joints",) else f"[{name}]\n"
            yield from lines_of(value, here)
        elif is_tables(value):
            for table in value:
                yield f"\n[[{name}]]\n"
                yield from lines_of(table, here)


def is_tables(value: Any) -> bool:  # noqa: ANN401 - TOML's
    """Whether a value is a list of tables, which may not be empty."""
    return LIST.fits(value) and bool(value) and all(map(is_table, value))


def bare(key: str) -> str:
    """A key as TOML writes it: bare where it may be, else quoted."""
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else quoted(key)


def quoted(text: str) -> str:
    """A string in TOML's double quotes, with the escapes that these need."""
    out = json.dumps(text, ensure_ascii=False)
    return "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in out)


def value_text(value: Any, key: str) -> str:  # noqa: ANN401 - whatever TOML can hold
    """A value as TOML; floats with the fewest exact digits."""
    match value:
        case str():
            return quoted(value)
        case int():  # true and false too
            return json.dumps(value)
        case float():
            return repr(value) if math.isfinite(value) else str(value)
        case list() | tuple():
            return f"[{', '.join(value_text(item, key) for item in value)}]"
        case Mapping():
            pairs = (f"{bare(name)} = {value_text(item, key)}" for name, item in value.items())
            return f"{{{', '.join(pairs)}}}"
        case date() | time():  # a datetime is a date
            return value.isoformat()
        case np.ndarray() | np.generic():
            return value_text(value.tolist(), key)
    raise RobotError(f"{key}: a robot file cannot hold a {type(value).__name__}")
