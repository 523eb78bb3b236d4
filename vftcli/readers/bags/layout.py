"""Layouts: where the numbers of a serialised ROS message lie, found once and used for thousands.

A layout is found by walking one message along its definition. Another message has the same layout
if and only if it is as long and all its length prefixes are equal; strings are required to be equal
too, so that joint names hold for every message of a group.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.bags.container import Bytes, Integers, strided
from vftcli.signals.arrays import Mask

MAX_DEPTH = 24
MAX_LEAVES = 20_000
#: Fields that a walk may visit beyond one a byte: messages without fields take none.
SPARE_VISITS = 1000
#: The longest definition of an arm's state, Franka's with all its errors, takes some 10 KiB.
MAX_DEFINITION = 64 * 1024
#: Primitive type → NumPy's code for it.
SIZES = {
    "bool": "u1", "byte": "u1", "octet": "u1", "char": "u1", "uint8": "u1", "int8": "i1",
    "uint16": "u2", "int16": "i2", "uint32": "u4", "int32": "i4", "uint64": "u8", "int64": "i8",
    "float32": "f4", "float64": "f8",
}  # fmt: skip


#: The numbers below a wrench.
VECTORS = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")


class Field(NamedTuple):
    """One field of a message type."""

    name: str  #: Its name.
    type: str  #: A primitive, `string`, or another message type as package/Name.
    many: int | None  #: How many: None for one, a number for a fixed array, −1 for a sequence.


Types = Mapping[str, Sequence[Field]]


class LayoutError(ValueError):
    """A message does not fit its definition."""


class Leaf(NamedTuple):
    """Numbers in a message: where, of which type, how many."""

    offset: int
    code: str
    numbers: int


@dataclass
class MessageLayout:
    """Where everything lies in messages of one shape."""

    leaves: dict[str, Leaf] = field(default_factory=dict)  #: Dotted path → numbers.
    #: Dotted path → strings, one or several.
    texts: dict[str, tuple[str, ...]] = field(default_factory=dict)
    #: Ranges of bytes that have to be equal for a message to have this layout.
    fixed: list[tuple[int, int]] = field(default_factory=list)
    length: int = 0  #: Length of the message. [B]
    uses: int = 0  #: Number of batches it was used for.
    #: The bytes of those ranges, one after another.
    expected: list[Bytes] = field(default_factory=list)

    def settle(self, message: Bytes) -> None:
        """Merge the fixed ranges and note their bytes."""
        merged: list[tuple[int, int]] = []
        for a, b in self.fixed:
            if merged and merged[-1][1] >= a:
                merged[-1] = (merged[-1][0], b)
            else:
                merged.append((a, b))
        self.fixed = merged
        self.expected = [message[a:b].copy() for a, b in merged]
        self.length = len(message)

    def fits(self, buffer: Bytes, offsets: Integers) -> Mask:
        """Which messages, all of this layout's length, have this layout. (k,)"""
        same = np.ones(len(offsets), dtype=bool)
        for (a, b), expected in zip(self.fixed, self.expected, strict=True):
            same &= (strided(buffer, offsets, a, b) == expected).all(axis=1)
        return same

    def numbers(
        self, paths: Sequence[str], buffer: Bytes, offsets: Integers
    ) -> NDArray[np.float64]:
        """The numbers of each message at the first path that is there. (k, count)

        At a path without numbers of its own are the six of a wrench, or none.
        """
        each = [[p] if p in self.leaves else [f"{p}.{part}" for part in VECTORS] for p in paths]
        found = next((names for names in each if self.leaves.keys() >= set(names)), [])
        columns = [np.empty((len(offsets), 0))]
        for leaf in map(self.leaves.__getitem__, found):
            dtype = np.dtype(leaf.code)
            raw = strided(buffer, offsets, leaf.offset, leaf.offset + leaf.numbers * dtype.itemsize)
            columns.append(np.ascontiguousarray(raw).view(dtype).astype(np.float64))
        return np.hstack(columns) if len(columns) != 2 else columns[1]


class Walker:
    """Walks one message along its definition and writes down where everything lies."""

    def __init__(self, types: Types, message: Bytes, *, cdr: bool) -> None:
        self.types = types
        self.message = message
        self.cdr = cdr
        self.layout = MessageLayout()
        self.order = "<"
        self.position = 0
        self.visits = 0
        if self.cdr:
            self._encapsulation()

    def walk(self, root: str) -> MessageLayout:
        """Walk the whole message."""
        self._message("", root, 0)
        # Some writers pad a message at its end.
        if len(self.message) - self.position > (8 if self.cdr else 0):
            raise LayoutError(f"{len(self.message) - self.position} bytes too many")
        self.layout.settle(self.message)
        return self.layout

    def _encapsulation(self) -> None:
        """The four bytes before CDR: representation and byte order."""
        if len(self.message) < 4 or self.message[0] != 0 or self.message[1] > 1:
            raise LayoutError("unknown encapsulation")
        self.order = "<" if self.message[1] == 1 else ">"
        self.layout.fixed.append((0, 2))
        self.position = 4

    def _message(self, path: str, name: str, depth: int) -> None:
        """Walk the fields of one message."""
        if depth > MAX_DEPTH:
            raise LayoutError("nested too deeply")
        # Empty messages take no bytes: a few nested types of them would be visited without end.
        self.visits += 1
        if self.visits > len(self.message) + SPARE_VISITS:
            raise LayoutError("more parts than bytes")
        if name not in self.types:
            raise LayoutError(f"no definition of {name}")
        for part in self.types[name]:
            self._field(f"{path}.{part.name}" if path else part.name, part, depth)

    def _field(self, path: str, part: Field, depth: int) -> None:
        """Walk one field: numbers, text, or messages."""
        many = part.many
        if many == -1:
            many = self._count()
        if part.type in SIZES:
            self._numbers(path, SIZES[part.type], 1 if many is None else many)
        elif part.type == "string":
            self._texts(path, 1 if many is None else many)
        elif many is None:
            self._message(path, part.type, depth + 1)
        else:
            for k in range(many):
                self._message(f"{path}[{k}]", part.type, depth + 1)

    def _numbers(self, path: str, code: str, count: int) -> None:
        """Note where the numbers of a field lie."""
        dtype = np.dtype(code)
        if self.cdr and count:
            self.position = 4 + (self.position - 4 + dtype.itemsize - 1) // dtype.itemsize * (
                dtype.itemsize
            )
        end = self.position + count * dtype.itemsize
        if end > len(self.message) or len(self.layout.leaves) > MAX_LEAVES:
            raise LayoutError(f"{path} lies outside the message")
        self.layout.leaves[path] = Leaf(self.position, self.order + code, count)
        self.position = end

    def _count(self) -> int:
        """A length prefix, which every message of this layout must repeat."""
        if self.cdr:
            self.position = 4 + (self.position - 1) // 4 * 4
        start, self.position = self.position, self.position + 4
        if self.position > len(self.message):
            raise LayoutError("a length lies outside the message")
        self.layout.fixed.append((start, self.position))
        count = int(self.message[start : self.position].view(f"{self.order}u4")[0])
        # An element takes a byte or more: a larger count is damage, not data.
        if count > len(self.message) - self.position:
            raise LayoutError("a count larger than what is left of the message")
        return count

    def _texts(self, path: str, count: int) -> None:
        """Note the strings of a field, which every message of this layout must repeat."""
        texts = []
        for _ in range(count):
            length = self._count()
            start, self.position = self.position, self.position + length
            if self.position > len(self.message):
                raise LayoutError(f"{path} lies outside the message")
            self.layout.fixed.append((start, self.position))
            raw = self.message[start : self.position].tobytes()
            texts.append(raw.removesuffix(b"\0").decode("utf-8", "replace"))
        self.layout.texts[path] = tuple(texts)


@lru_cache(maxsize=64)  # many channels may share one definition, and parsing takes its time
def types_of(definition: str, name: str, *, idl: bool) -> dict[str, tuple[Field, ...]]:
    """Parse a message definition with rosbags' parsers. Type → fields."""
    from rosbags.typesys import TypesysError, get_types_from_idl, get_types_from_msg

    if len(definition) > MAX_DEFINITION:
        raise LayoutError(f"a definition of more than {MAX_DEFINITION >> 10} KiB")
    try:
        parsed = get_types_from_idl(definition) if idl else get_types_from_msg(definition, name)
    except (TypesysError, ValueError, KeyError, TypeError, RecursionError, AssertionError) as error:
        reason = str(error).split("\n", maxsplit=1)[0][:60]
        raise LayoutError(f"no message definition: {reason}") from None
    return {short(kind): fields_of(fields) for kind, (_, fields) in parsed.items()}


def fields_of(fields: Any) -> tuple[Field, ...]:  # noqa: ANN401 - rosbags' nested tuples
    """Fields as rosbags describes them, in our terms."""
    return tuple(Field(str(name), *_described(kind)) for name, kind in fields)


def _described(kind: Any) -> tuple[str, int | None]:  # noqa: ANN401
    """Type and number of a field as rosbags describes it."""
    node, inner = int(kind[0]), kind[1]
    if node == 1:  # a primitive with a bound
        return str(inner[0]), None
    if node == 2:  # another message
        return short(str(inner)), None
    element, bound = inner
    name, many = _described(element)
    if many is not None:
        raise LayoutError("an array of arrays")
    return name, int(bound) if node == 3 else -1


def short(name: str) -> str:
    """A type's name without the middle part: std_msgs/msg/Header → std_msgs/Header."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}"
