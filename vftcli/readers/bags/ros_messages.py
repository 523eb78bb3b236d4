"""ROS 2 messages that vftcli knows by itself: their definitions, for reading bags and for writing.

Bags of ROS 2 Humble and older hold no definitions, and a bag that is written needs them.
"""

import struct
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.bags.container import Bytes, Channel, type_name
from vftcli.readers.opening import reason_of
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


#: The definitions of ROS 2's own types that are written, and of Franka's state.
ROS, FRANKA = tables_beside(__file__, "messages.toml").values()
DEFINITIONS: dict[str, str] = {**ROS, **FRANKA}  #: Message type as package/Name → its definition.


def long_name(kind: str) -> str:
    """A type's name as ROS 2 has it: std_msgs/Header → std_msgs/msg/Header."""
    return kind.replace("/", "/msg/")


@cache
def own_types() -> Types:
    """The fields of every type of `DEFINITIONS`."""
    found: Types = {}
    for kind, text in DEFINITIONS.items():
        found |= types_of(text, long_name(kind), idl=False)
    return found


def schema_text(kind: str) -> str:
    """A type's definition followed by those of the types it is made of, as bags embed them."""
    parts = (f"{'=' * 80}\nMSG: {name}\n{DEFINITIONS[name].rstrip()}" for name in parts_of(kind))
    return "\n".join([DEFINITIONS[kind].rstrip(), *parts]) + "\n"


def parts_of(kind: str) -> Sequence[str]:
    """The types of `DEFINITIONS` that a type is made of, each once, in the order they are met."""
    found: dict[str, None] = {}
    for field in own_types()[kind]:
        if field.type in DEFINITIONS:
            found |= dict.fromkeys([field.type, *parts_of(field.type)])
    return tuple(found)


@cache
def known_types() -> Types:
    """The fields of ROS 2 Humble's types, from rosbags' store, and of those defined here."""
    from rosbags.typesys import Stores, get_typestore

    found = {}
    for name, (_, fields) in get_typestore(Stores.ROS2_HUMBLE).fielddefs.items():
        try:
            found[type_name(name)] = fields_of(fields)
        except LayoutError:
            continue
    return found | own_types()


def types_for(channel: Channel) -> Types:
    """All types that a channel's messages are made of: the container's own first."""
    known = dict(known_types())
    if channel.definition:
        known |= types_of(channel.definition, long_name(channel.type), idl=channel.idl)
    if channel.encoding == "ros1":
        # ROS 1 has no int32 seconds in a message of their own: time is a primitive of two
        # words.
        time = own_types()["builtin_interfaces/Time"]
        known |= {"builtin_interfaces/Time": time, "builtin_interfaces/Duration": time}
    if channel.type not in known:
        raise LogError(
            f"topic {channel.topic}: the bag holds no definition of {channel.type}. Convert it "
            "with ros2 bag convert on a machine that has the package."
        )
    return known


#: Text, names, a number, or numbers: one row a message, or one row for all.
Value = str | Sequence[str] | float | NDArray[Any]


def serialised(
    kind: str, values: Mapping[str, Value], rows: int, types: Types | None = None
) -> Bytes:
    """Many messages of one type and one layout in CDR, little-endian. (T, size)

    The definition is walked once; every message has the same bytes but for the numbers,
    which are put in column by column.
    """
    message = Serialiser(types if types is not None else own_types(), values)
    message.walk("", kind)
    if unknown := set(values) - message.met:
        raise OutputError(f"{kind} has no field {sorted(unknown)[0]}")
    out = np.tile(np.frombuffer(bytes(message.template), dtype=np.uint8), (rows, 1))
    for start, numbers in message.numbers:
        packed = numbers.view(np.uint8)
        out[:, start : start + packed.shape[1]] = packed
    return out


def stamped(times: NDArray[np.int64], path: str = "header.stamp") -> dict[str, Value]:
    """The values of a stamp, of times since 1970. (T,) [ns]"""
    return {f"{path}.sec": times // 10**9, f"{path}.nanosec": times % 10**9}


def in_parts(path: str, names: str, columns: NDArray[Any]) -> dict[str, Value]:
    """The values of a vector's parts: ``in_parts("force", "xyz", …)`` gives force.x and so on."""
    return {f"{path}.{name}": column for name, column in zip(names, columns.T, strict=True)}


class Serialiser:
    """Walks a definition and lays its fields one behind the other.

    Attributes:
        template: The bytes of a message, zeros where numbers go.
        numbers: Where numbers go, and one row of them a message or one for all.
        met: Paths of all fields that were walked.
    """

    def __init__(self, types: Types, values: Mapping[str, Value]) -> None:
        self.types = types
        self.values = values
        self.template = bytearray(b"\0\1\0\0")  # CDR, little-endian
        self.numbers: list[tuple[int, NDArray[Any]]] = []
        self.met: set[str] = set()

    def walk(self, path: str, kind: str) -> None:
        """Lay the fields of one message: numbers, text, or other messages."""
        for field in self.types[kind]:
            inner = f"{path}.{field.name}" if path else field.name
            value: Any = self.values.get(inner)
            self.met.add(inner)
            if field.type in SIZES:
                self._numbers(value, np.dtype(f"<{SIZES[field.type]}"), field.many)
            elif field.type == "string":
                texts = [value or ""] if field.many is None else value or ()
                if field.many == -1:
                    self._count(len(texts))
                for text in texts:
                    raw = str(text).encode() + b"\0"
                    self._count(len(raw))
                    self.template += raw
            elif field.many is None:
                self.walk(inner, field.type)
            else:
                self._count(0)  # sequences of messages stay empty

    def _numbers(self, value: Value | None, dtype: np.dtype[Any], many: int | None) -> None:
        given = np.zeros(0) if value is None else np.asarray(value, dtype=dtype)
        width = given.shape[-1] if many == -1 else many or 1
        if many == -1:
            self._count(width)
        if not width:
            return
        self._align(dtype.itemsize)
        if value is not None:
            table = np.ascontiguousarray(given.reshape(-1, width), dtype=dtype)
            self.numbers.append((len(self.template), table))
        self.template += bytes(width * dtype.itemsize)

    def _count(self, count: int) -> None:
        self._align(4)
        self.template += struct.pack("<I", count)

    def _align(self, size: int) -> None:
        self.template += bytes(-(len(self.template) - 4) % size)
