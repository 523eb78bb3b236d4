"""ROS messages: their definitions, where the numbers of a serialised one lie, and many at once.

Bags of ROS 2 Humble and older hold no definitions, and a bag that is written needs them.
A layout is found by walking one message along its definition. Another message has the
same layout if and only if it is as long and all its length prefixes are equal; strings
are required to be equal too, so that joint names hold for every message of a group.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.bags.container import Bytes, Channel, Integers, strided, type_name
from vftcli.readers.opening import reason_of
from vftcli.readers.table import Names
from vftcli.signals.arrays import Mask
from vftcli.signals.errors import LogError, OutputError
from vftcli.signals.parsing import tables_beside

#: The longest definition of an arm's state, Franka's with all its errors, takes some 10
#: KiB.
MAX_DEFINITION = 64 * 1024
#: Primitive type → NumPy's code for it.
SIZES = {
    "bool": "u1", "byte": "u1", "octet": "u1", "char": "u1", "uint8": "u1", "int8": "i1",
    "uint16": "u2", "int16": "i2", "uint32": "u4", "int32": "i4", "uint64": "u8", "int64": "i8",
    "float32": "f4", "float64": "f8",
}  # fmt: skip


class Field(NamedTuple):
    """One field of a message type."""

    name: str  #: Its name.
    type: str  #: A primitive, `string`, or another message type as package/Name.
    many: int | None  #: How many: None for one, a number for a fixed array, −1 for a sequence.


Types = dict[str, tuple[Field, ...]]  #: Message type as package/Name → its fields.
Described = Any  #: Fields or their type as nested tuples of rosbags.


class LayoutError(ValueError):
    """A message does not fit its definition."""


MAX_DEPTH = 24
MAX_LEAVES = 20_000
#: Fields that a walk may visit beyond one a byte: messages without fields take none.
SPARE_VISITS = 1000
#: The numbers below a wrench.
VECTORS = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")


class Leaf(NamedTuple):
    """Numbers in a message: where, of which type, how many."""

    offset: int
    code: str
    numbers: int


class MessageLayout:
    """Where everything lies in messages of one shape.

    Attributes:
        leaves: Dotted path → numbers.
        texts: Dotted path → strings, one or several.
        fixed: Ranges of bytes that have to be equal for a message to have this layout.
    """

    def __init__(self, types: Types, message: Bytes, kind: str, *, cdr: bool) -> None:
        self.leaves: dict[str, Leaf] = {}
        self.texts: dict[str, Names] = {}
        self.fixed: list[tuple[int, int]] = []
        self._types, self._message, self._cdr = types, message, cdr
        self._order, self._position, self._visits = "<", 0, 0
        if cdr:  # four bytes: representation and byte order
            if len(message) < 4 or message[0] != 0 or message[1] > 1:
                raise LayoutError("unknown encapsulation")
            self._order = "<" if message[1] == 1 else ">"
            self.fixed.append((0, 2))
            self._position = 4
        self._walk("", kind, 0)
        # Some writers pad a message at its end.
        if len(message) - self._position > (8 if cdr else 0):
            raise LayoutError(f"{len(message) - self._position} bytes too many")
        self._expected = [message[a:b].copy() for a, b in self.fixed]
        del self._message  # a part of a batch, all of which would stay in memory

    def fits(self, buffer: Bytes, offsets: Integers) -> Mask:
        """Which messages, all of this layout's length, have this layout. (k,)"""
        same = np.ones(len(offsets), dtype=bool)
        for (a, b), expected in zip(self.fixed, self._expected, strict=True):
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

    def _walk(self, path: str, kind: str, depth: int) -> None:
        if depth > MAX_DEPTH:
            raise LayoutError("nested too deeply")
        # Empty messages take no bytes: a few nested types of them would be visited
        # without end.
        self._visits += 1
        if self._visits > len(self._message) + SPARE_VISITS:
            raise LayoutError("more parts than bytes")
        if kind not in self._types:
            raise LayoutError(f"no definition of {kind}")
        for part in self._types[kind]:
            inner = f"{path}.{part.name}" if path else part.name
            many = self._count() if part.many == -1 else part.many
            if part.type in SIZES:
                self._numbers(inner, part, 1 if many is None else many)
            elif part.type == "string":
                texts = [self._text(inner) for _ in range(1 if many is None else many)]
                self.texts[inner] = tuple(texts)
            elif many is None:
                self._walk(inner, part.type, depth + 1)
            else:
                for k in range(many):
                    self._walk(f"{inner}[{k}]", part.type, depth + 1)

    def _take(self, size: int, what: str) -> int:
        start, self._position = self._position, self._position + size
        if self._position > len(self._message):
            raise LayoutError(f"{what} is outside the message")
        return start

    def _take_fixed(self, size: int, what: str) -> Bytes:
        """The next bytes, which every message of this layout must repeat."""
        start = self._take(size, what)
        if self.fixed and self.fixed[-1][1] == start:
            start, _ = self.fixed.pop()
        self.fixed.append((start, self._position))
        return self._message[self._position - size : self._position]

    def _align(self, size: int) -> None:
        if self._cdr:
            self._position += -(self._position - 4) % size

    def _numbers(self, path: str, part: Field, count: int) -> None:
        code = SIZES[part.type]
        size = np.dtype(code).itemsize
        if count:
            self._align(size)
        start = self._take(count * size, path)
        if len(self.leaves) > MAX_LEAVES:
            raise LayoutError(f"{path} is outside the message")
        self.leaves[path] = Leaf(start, self._order + code, count)

    def _count(self) -> int:
        self._align(4)
        count = int(self._take_fixed(4, "a length").view(f"{self._order}u4")[0])
        # An element takes a byte or more: a larger count is damage, not data.
        if count > len(self._message) - self._position:
            raise LayoutError("a count larger than what is left of the message")
        return count

    def _text(self, path: str) -> str:
        raw = self._take_fixed(self._count(), path).tobytes()
        return raw.removesuffix(b"\0").decode("utf-8", "replace")


@lru_cache(maxsize=64)  # many channels may share one definition, and parsing takes its time
def types_of(definition: str, name: str, *, idl: bool) -> Types:
    """Parse a message definition with rosbags' parsers. Type → fields."""
    from rosbags.typesys import TypesysError, get_types_from_idl, get_types_from_msg

    if len(definition) > MAX_DEFINITION:
        raise LayoutError(f"a definition of more than {MAX_DEFINITION >> 10} KiB")
    try:
        parsed = get_types_from_idl(definition) if idl else get_types_from_msg(definition, name)
    except (TypesysError, ValueError, KeyError, TypeError, RecursionError, AssertionError) as error:
        raise LayoutError(f"no message definition: {reason_of(error)[:60]}") from None
    return {type_name(kind): fields_of(fields) for kind, (_, fields) in parsed.items()}


def fields_of(fields: Described) -> tuple[Field, ...]:
    """Fields as rosbags describes them, in our terms."""
    return tuple(Field(str(name), *_described(kind)) for name, kind in fields)


def _described(kind: Described) -> tuple[str, int | None]:
    node, inner = int(kind[0]), kind[1]
    if node == 1:  # a primitive with a bound
        return str(inner[0]), None
    if node == 2:  # another message
        return type_name(str(inner)), None
    element, bound = inner
    name, many = _described(element)
    if many is not None:
        raise LayoutError("an array of arrays")
    return name, int(bound) if node == 3 else -1


#: The definitions of types that ROS 2 has not, by package/Name: Franka's state,
#: Foxglove's log.
DEFINITIONS: dict[str, str] = tables_beside(__file__, "messages.toml")


def long_name(kind: str) -> str:
    """A type's name as ROS 2 has it: std_msgs/Header → std_msgs/msg/Header."""
    return kind.replace("/", "/msg/")


@cache
def type_store() -> Any:  # noqa: ANN401 - rosbags makes its types as it goes
    """The types of ROS 2 Humble, of rosbags, and those defined here."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store, types = get_typestore(Stores.ROS2_HUMBLE), dict[str, Any]()
    for kind, text in DEFINITIONS.items():
        types |= get_types_from_msg(text, long_name(kind))
    store.register(types)
    return store


@cache
def known_types() -> Types:
    """The fields of every type of the store."""
    found = {}
    for name, (_, fields) in type_store().fielddefs.items():
        with suppress(LayoutError):
            found[type_name(name)] = fields_of(fields)
    return found


def schema_text(kind: str) -> str:
    """A type's definition followed by those of the types it is made of, as bags embed them."""
    text: str = type_store().generate_msgdef(long_name(kind), ros_version=2)[0]
    return text


def types_for(channel: Channel) -> Types:
    """All types that a channel's messages are made of: the container's own first."""
    known = dict(known_types())
    if channel.definition:
        known |= types_of(channel.definition, long_name(channel.type), idl=channel.idl)
    if channel.encoding == "ros1":
        # ROS 1 has no int32 seconds in a message of their own: time is a primitive of two
        # words.
        time = known["builtin_interfaces/Time"]
        known |= {"builtin_interfaces/Time": time, "builtin_interfaces/Duration": time}
    if channel.type not in known:
        raise LogError(
            f"topic {channel.topic}: the bag holds no definition of {channel.type}. Convert it "
            "with ros2 bag convert on a machine that has the package."
        )
    return known


#: Text, names, a number, or numbers: one row a message, or one row for all.
Value = str | Sequence[str] | float | NDArray[Any]


def serialised(kind: str, values: Mapping[str, Value], rows: int) -> Bytes:
    """Many messages of one type and one layout in CDR, little-endian. (T, size)

    One is made and laid out; every message has the same bytes but for the numbers, which
    are put in column by column.
    """
    template = type_store().serialize_cdr(template_of(kind, values), long_name(kind))
    layout = MessageLayout(known_types(), np.frombuffer(template, np.uint8), kind, cdr=True)
    if unknown := sorted({*values} - {*layout.leaves, *layout.texts}):
        raise OutputError(f"{kind} has no field {unknown[0]}")
    out = np.tile(np.frombuffer(template, np.uint8), (rows, 1))
    for path, leaf in layout.leaves.items():
        if path in values and leaf.numbers:
            table = np.asarray(values[path], dtype=leaf.code).reshape(-1, leaf.numbers)
            packed = np.ascontiguousarray(table).view(np.uint8)
            out[:, leaf.offset : leaf.offset + packed.shape[1]] = packed
    return out


def template_of(kind: str, values: Mapping[str, Value], path: str = "") -> Any:  # noqa: ANN401
    """A message with the texts of values, and as many zeros as they have numbers."""
    made: dict[str, Any] = {}
    for field in known_types()[kind]:
        inner = f"{path}.{field.name}" if path else field.name
        given: Any = values.get(inner)
        if field.type in SIZES and field.many is None:
            made[field.name] = 0
        elif field.type in SIZES:
            # A sequence is as long as the rows that it is given.
            width = field.many if field.many != -1 else 0 if given is None else given.shape[-1]
            made[field.name] = np.zeros(width, SIZES[field.type])
        elif field.type == "string":
            made[field.name] = str(given or "") if field.many is None else [*map(str, given or ())]
        else:  # sequences of messages stay empty
            deeper = field.many is None
            made[field.name] = template_of(field.type, values, inner) if deeper else []
    return type_store().types[long_name(kind)](**made)


def stamped(times: NDArray[np.int64], path: str = "header.stamp") -> dict[str, Value]:
    """The values of a stamp, of times since 1970. (T,) [ns]"""
    return {f"{path}.sec": times // 10**9, f"{path}.nanosec": times % 10**9}


def in_parts(path: str, names: str, columns: NDArray[Any]) -> dict[str, Value]:
    """The values of a vector's parts: ``in_parts("force", "xyz", …)`` gives force.x and so on."""
    return {f"{path}.{name}": column for name, column in zip(names, columns.T, strict=True)}
