"""Remark: a finding about the numbers, as data; its words come when it is shown.

A remark has a code, a level, values with units in their names, and a place. The words are
in the catalogue, `words/*.toml` beside this file, one table a code::

    [joint-rests]
    short = "rests in {share:.0%} of the samples and is marked"
    long = "... where it keeps its stiction, up to about {stiction_Nm:.2g} N·m rms ..."

`short` is one line for the terminal, `long`, if any, is for the page. Both are
`str.format` templates over the remark's values; a format applies to each item of a list.
"""

import string
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

import numpy as np

from vftcli.signals.arrays import Z_95
from vftcli.signals.parsing import counted
from vftcli.signals.shown import Shown

if TYPE_CHECKING:
    import polars as pl

    from vftcli.signals.arrays import Mask

#: A fact informs, a caution limits what can be said, a warning can make results wrong.
Level = Literal["fact", "caution", "warning"]
WORDS = Path(__file__).parent / "words"  #: The catalogue: a file a room.


class Where(NamedTuple):
    """The subject of a remark."""

    #: An observer, log or file by its name; "" where it is the run as a whole.
    about: str = ""
    joints: tuple[int, ...] = ()  #: Joints, from 1; none for all alike.
    #: First and last time, None where it holds throughout. [s]
    span: tuple[float, float] | None = None


@dataclass(frozen=True, repr=False)
class Remark(Shown):
    """A finding about the numbers."""

    code: str  #: Which remark it is: a table of the catalogue.
    level: Level = "fact"  #: How much it matters.
    #: Its numbers and names; a number's unit ends its key, as in ``shift_s``.
    values: Mapping[str, Any] = field(default_factory=dict)
    where: Where = field(default_factory=Where)  #: What it is about.

    def __post_init__(self) -> None:
        # Numbers and rows of NumPy become Python's, which JSON knows.
        plain = {k: v.tolist() if hasattr(v, "tolist") else v for k, v in self.values.items()}
        object.__setattr__(self, "values", MappingProxyType(plain))

    def __str__(self) -> str:
        return sentence(self)

    def _headline(self) -> str:
        return f"{self.level} {self.code}: {self.message}"

    @property
    def message(self) -> str:
        """Its sentence, "" where the catalogue does not have it."""
        try:
            return sentence(self)
        except LookupError:
            return ""


class Remarks(Shown, tuple[Remark, ...]):
    """Remarks in order: a tuple that a notebook shows as a table."""

    def _headline(self) -> str:
        counts = {level: sum(r.level == level for r in self) for level in get_args(Level)}
        parts = [counted(n, level) for level, n in counts.items() if n]
        return ", ".join(parts) or "none"

    def _rows(self) -> Iterator[Sequence[object]]:
        yield "level", "code", "message"
        yield from ((remark.level, remark.code, remark.message) for remark in self)

    def to_polars(self) -> "pl.DataFrame":
        """One row a remark: its level, code and message, and what it is about."""
        import polars as pl

        names = ("level", "code", "message", "about")
        rows = [(r.level, r.code, r.message, r.where.about or None) for r in self]
        joints = [list(remark.where.joints) for remark in self]
        table = pl.DataFrame(rows, dict.fromkeys(names, pl.String), orient="row")
        return table.with_columns(pl.Series("joints", joints, pl.List(pl.Int64)))


def on_joints(joints: "Iterable[int] | Mask", about: str = "") -> Where:
    """The place of a remark about some joints: a mask, or their numbers from zero."""
    numbers = np.array([*joints])
    numbers = np.flatnonzero(numbers) if numbers.dtype == bool else numbers
    return Where(about, tuple((numbers + 1).tolist()))


def made(level: Level, code: str, where: Where = Where(), /, **values: object) -> Remark:  # noqa: B008 - immutable
    """A remark of some level, code and place, with its values."""
    return Remark(code, level, values, where)


fact = partial(made, "fact")  #: A remark that informs.
caution = partial(made, "caution")  #: A remark on what limits the result.
warning = partial(made, "warning")  #: A remark on what can make the result wrong.


def sentence(remark: Remark, length: str = "short") -> str:
    """A remark's words of a length, or its short ones, headed by its subject."""
    entry, about = words(remark.code), remark.where.about
    return (f"{about}: " if about else "") + filled(entry.get(length, entry["short"]), remark)


def filled(template: str, remark: Remark) -> str:
    """A template with a remark's values, ``{joints}`` and ``{span}``."""
    where = remark.where
    joints = ", ".join(f"J{j}" for j in where.joints)
    return ListFormatter().vformat(
        template, (), {"joints": joints, "span": where.span, **remark.values}
    )


class ListFormatter(string.Formatter):
    """`str.format` for items of a list one by one; ``{x_sd:±.2f}`` is the 95 % band."""

    def format_field(self, value: Any, format_spec: str) -> str:  # noqa: ANN401 - any value
        """A value by its format; a list's items, numbers apart by spaces, words by commas."""
        if format_spec.startswith("±"):
            return f"± {Z_95 * value:{format_spec[1:]}}"
        if isinstance(value, str) or not isinstance(value, Iterable):
            text = str(super().format_field(value, format_spec))
            return text if isinstance(value, str) else text.replace("-", "−")
        items = (self.format_field(item, format_spec) for item in value)
        return (" " if format_spec else ", ").join(items)


def words(code: str) -> Mapping[str, str]:
    """A code's entry of the catalogue."""
    for text in catalogue():
        # Reading TOML takes longer than finding the file that has the code.
        if f"[{code}]" in text:
            return parsed(text)[code]
    raise LookupError(f"no words for the remark {code!r} in {WORDS}")


@cache
def catalogue() -> tuple[str, ...]:
    """The text of every file of the catalogue."""
    return tuple(path.read_text(encoding="utf-8") for path in sorted(WORDS.glob("*.toml")))


@cache
def parsed(text: str) -> Mapping[str, Mapping[str, str]]:
    """One file of the catalogue, by code."""
    return tomllib.loads(text)


def as_record(remark: Remark) -> dict[str, Any]:
    """A remark with its words, as `run.json` holds it."""
    where = remark.where
    return {
        "code": remark.code,
        "level": remark.level,
        "message": sentence(remark),
        "values": dict(remark.values),
        "about": where.about or None,
        "joints": list(where.joints),
        "span_s": None if where.span is None else list(where.span),
    }
