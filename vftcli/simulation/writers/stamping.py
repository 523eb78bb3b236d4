"""Many messages of one layout at once: one is serialised, the numbers are put in its copies."""

import struct
from typing import Any, NamedTuple

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import OutputError

MARK = 7.3e211
"""First of the numbers that mark a place; no message holds them otherwise."""


class Blank(NamedTuple):
    """A value of a message to be filled in later: its marks, to be written in its place."""

    marks: Array

    @property
    def fields(self) -> list[float]:
        """The marks one by one."""
        return [float(mark) for mark in self.marks]


class Marks:
    """Hands out marks, each once, and remembers whose they are."""

    def __init__(self) -> None:
        self.blanks: dict[str, Blank] = {}
        self.used = 0

    def take(self, name: str, count: int) -> Array:
        """`count` marks for the numbers called `name`. (count,)"""
        marks: Array = np.arange(self.used + 1, self.used + count + 1, dtype=np.float64)
        marks = MARK * (1.0 + 1e-9 * marks)
        self.used += count
        self.blanks[name] = Blank(marks)
        return marks


def fill(template: bytes, marks: Marks, values: dict[str, Array], stamp_ns: list[int]) -> Any:  # noqa: ANN401
    """Return one little-endian CDR message a row, the header's stamp first. (M, size) uint8

    Args:
        template: A serialised message that starts with a header and holds the marks.
        marks: The marks.
        values: Name of the marks → numbers, one row a message. (M, count)
        stamp_ns: Header stamps. [ns]

    Raises:
        OutputError: If a mark is not in the template exactly once.
    """
    rows = len(stamp_ns)
    out = np.tile(np.frombuffer(template, dtype=np.uint8), (rows, 1))
    stamps = np.array([divmod(ns, 10**9) for ns in stamp_ns], dtype="<u4")
    out[:, 4:12] = stamps.view(np.uint8)
    for name, blank in marks.blanks.items():
        columns = np.ascontiguousarray(values[name].reshape(rows, -1), dtype="<f8")
        for mark, column in zip(blank.fields, columns.T, strict=True):
            place = template.find(struct.pack("<d", mark))
            if place < 0 or template.find(struct.pack("<d", mark), place + 1) >= 0:
                raise OutputError(f"the message layout has no single place for {name}")
            out[:, place : place + 8] = np.ascontiguousarray(column).view(np.uint8).reshape(rows, 8)
    return out
