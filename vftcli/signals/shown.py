"""Shown: a thing in a notebook, as one line and a small table without its arrays."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, dataclass_transform

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.parsing import printable

if TYPE_CHECKING:
    import polars as pl

LONGEST = 160  #: Letters of a line at most.
FEW = 7  #: Most numbers of an array that are shown; of a larger one its shape.
ALL = slice(None)  #: All rows of a table.
UNKNOWN = "–"  #: The text for a number that is not known.


Kind = TypeVar("Kind")


if TYPE_CHECKING:

    @dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
    def record(kind: type[Kind]) -> type[Kind]:
        """The class as a frozen dataclass of named fields, with the `repr` of `Shown`."""
else:
    record = partial(dataclass, frozen=True, kw_only=True, repr=False)


class Shown:
    """A thing with a `repr` of one line, which a notebook shows as a small table.

    A dataclass of this kind is a `record`; `_headline` and `_rows` come from its fields.
    """

    def _headline(self) -> str:
        """Its contents in words, behind the name of its class."""
        return ", ".join(f"{name} {text}" for name, text in field_texts(self))

    def _rows(self) -> Iterable[Sequence[object]]:
        """The rows of its table, the headings first."""
        return [("field", "value"), *field_texts(self)]

    def __repr__(self) -> str:
        line = printable(f"{type(self).__name__} {self._headline()}".rstrip())
        return f"<{line if len(line) <= LONGEST else line[: LONGEST - 1] + '…'}>"

    def _repr_html_(self) -> str:
        """The thing as a small table with a caption, for notebooks."""
        head, *rows = [[escape(printable(cell(x))) for x in row] for row in self._rows()]
        heads = "".join(f"<th>{text}</th>" for text in head)
        lines = "".join(f"<tr>{''.join(f'<td>{text}</td>' for text in row)}</tr>" for row in rows)
        caption = escape(repr(self)[1:-1])
        return (
            f"<table><caption>{caption}</caption><thead><tr>{heads}</tr></thead>"
            f"<tbody>{lines}</tbody></table>"
        )


def cell(value: object) -> str:
    """A value in a table: a dash for unknown, four digits of a number."""
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return UNKNOWN
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def field_texts(owner: object) -> list[tuple[str, str]]:
    """Name and text of every field of a dataclass that says something."""
    if not is_dataclass(owner):
        return []
    shown = [(f.name, getattr(owner, f.name)) for f in fields(owner) if f.repr]
    return [(name, text) for name, value in shown if (text := value_text(value))]


def value_text(value: object) -> str:
    """A value in a few letters, "" for none."""
    if value is None or (isinstance(value, (str, tuple, list, Mapping)) and not value):
        return ""
    if isinstance(value, np.ndarray):
        few = value.ndim == 1 and len(value) <= FEW
        return f"[{joined(value)}]" if few else f"array {value.shape}"
    if isinstance(value, (tuple, list, Mapping)):
        first, count = next(iter(value)), len(value)
        few = count <= FEW and isinstance(first, (str, int, float))
        return " ".join(map(cell, value)) if few else f"{count} × {type(first).__name__}"
    plain = isinstance(value, (str, int, float, Path))
    return cell(value) if plain else type(value).__name__


def joined(values: Iterable[float]) -> str:
    """Numbers with blanks between."""
    return " ".join(cell(float(value)) for value in values)


def per_joint(name: str, values: Array) -> Iterator[tuple[str, Array]]:
    """One contiguous column a joint, named from 1."""
    for j, column in enumerate(np.ascontiguousarray(values.T), start=1):
        yield f"{name}/{j}", column


def frame_of(columns: Iterable[tuple[str, Any]]) -> "pl.DataFrame":
    """A polars frame of named columns; what is not known is null."""
    import polars as pl

    given = dict(columns)
    table = pl.DataFrame(given)
    # Only columns that need it: to fill all takes longer than to write.
    floats = {s.name: np.asarray(given[s.name], float) for s in table if s.dtype == pl.Float64}
    unknown = [name for name, x in floats.items() if x.size and np.isnan(x.min())]
    return table.with_columns(pl.col(unknown).fill_nan(None)) if unknown else table


class Several(tuple[Kind, ...]):
    """Series of one log, with one table."""

    __slots__ = ()

    def to_polars(self) -> "pl.DataFrame":
        """Their tables side by side, with one ``t``."""
        import polars as pl

        frames: list[Any] = [each.to_polars() for each in self]  # type: ignore[attr-defined]
        later = (frame.drop("t") for frame in frames[1:])
        return pl.concat([*frames[:1], *later], how="horizontal") if frames else pl.DataFrame()


class TimeSeries(Shown):
    """Columns along a clock."""

    t: Array  #: Time. (T,) [s]

    def columns(self, rows: slice = ALL) -> Iterator[tuple[str, Array]]:
        """Name and values of each column, named as in the files that we write."""
        raise NotImplementedError

    def to_polars(self) -> "pl.DataFrame":
        """Time ``t`` and every column; what is not known is null."""
        return frame_of([("t", self.t), *self.columns()])
