"""ROS messages: definitions, layouts, and the numbers of many at once.

Bags of ROS 2 Humble and older hold no definitions, and a written bag needs them. A layout
is found by walking one message along its definition. It is another message's if and only
if that is as long and all its length prefixes are equal; strings must be equal too, so
that joint names hold for a group.
"""

from collections.abc import Container, Sequence
from functools import cache, lru_cache
from typing import Any, Literal

import numpy as np

from vftcli.readers.bags.container import Bytes, Channel
from vftcli.readers.opening import DAMAGE, reason_of
from vftcli.readers.table import Names
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import LogError
from vftcli.signals.parsing import tables_beside

#: Franka's state with all its errors takes some 10 KiB.
MAX_DEFINITION = 64 * 1024
#: Primitive type → NumPy's code for it.
SIZES = {
    "bool": "u1", "byte": "u1", "octet": "u1", "char": "u1", "uint8": "u1", "int8": "i1",
    "uint16": "u2", "int16": "i2", "uint32": "u4", "int32": "i4", "uint64": "u8", "int64": "i8",
    "float32": "f4", "float64": "f8",
}  # fmt: skip


#: Type as package/msg/Name → constants; names, types of its fields.
Types = dict[str, Any]


class LayoutError(ValueError):
    """A message does not fit its definition."""


MAX_DEPTH = 24
MAX_LEAVES = 20_000
#: Fields that a walk may visit beyond one a byte: messages without fields take none.
SPARE_VISITS = 1000
#: The numbers below a wrench.
VECTORS = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")


def parts_at(paths: Sequence[str], there: Container[str]) -> list[str]:
    """The first path that exists, or a wrench's six numbers below it; or none."""
    each = ([p] if p in there else [f"{p}.{part}" for part in VECTORS] for p in paths)
    return next((names for names in each if all(name in there for name in names)), [])


class MessageLayout:
    """Where everything lies in serialised messages of one shape, a row of bytes each.

    Attributes:
        paths: Dotted path → code and count of numbers, and where they begin.
        texts: Dotted path → strings, one or several.
        kind: The messages' structure, each number under its dotted path.
    """

    def __init__(self, types: Types, message: bytes, kind: str, *, cdr: bool) -> None:
        self.paths: dict[str, tuple[tuple[str, tuple[int]], int]] = {}
        self.texts: dict[str, Names] = {}
        self._types, self._message, self._cdr = types, message, cdr
        self._order, self._position, self._visits = "<", 0, 0
        #: Ranges of bytes that have to be equal for a message to have this layout.
        self._fixed: list[tuple[int, int]] = []
        if cdr:  # four bytes: representation and byte order
            if len(message) < 4 or message[0] != 0 or message[1] > 1:
                raise LayoutError("unknown encapsulation")
            self._order = "<" if message[1] == 1 else ">"
            self._fixed.append((0, 2))
            self._position = 4
        self._walk("", long_name(kind), 0)
        # Some writers pad a message at its end.
        if len(message) - self._position > (8 if cdr else 0):
            raise LayoutError(f"{len(message) - self._position} bytes too many")
        self._first = np.frombuffer(message, np.uint8)
        formats, offsets = zip(*self.paths.values(), strict=True) if self.paths else ((), ())
        fields: Any = {"names": [*self.paths], "formats": formats, "offsets": offsets}
        self.kind = np.dtype(fields | {"itemsize": len(message)})

    def fits(self, messages: Bytes) -> Mask:
        """Whether messages, all as long as this layout, have it. (k,)"""
        same = np.ones(len(messages), dtype=bool)
        for a, b in self._fixed:
            same &= (messages[:, a:b] == self._first[a:b]).all(axis=1)
        return same

    def numbers(self, messages: Bytes, paths: Sequence[str]) -> Array:
        """The numbers of each message at the first path that is there. (k, count)"""
        table = messages.view(self.kind)[:, 0]
        each = (table[name] for name in parts_at(paths, self.paths))
        return np.hstack([np.empty((len(messages), 0)), *each])

    def _walk(self, path: str, kind: str, depth: int) -> None:
        if depth > MAX_DEPTH:
            raise LayoutError("nested too deeply")
        # Empty messages take no bytes and could nest without end.
        self._visits += 1
        if self._visits > len(self._message) + SPARE_VISITS:
            raise LayoutError("more parts than bytes")
        if kind not in self._types:
            raise LayoutError(f"no definition of {kind}")
        for name, described in self._types[kind][1]:
            inner, (part, many) = f"{path}.{name}" if path else name, element_of(described)
            count = 1 if many is None else many if many >= 0 else self._count()
            if part in SIZES:
                code, size = self._order + SIZES[part], int(SIZES[part][1])
                if count:
                    self._align(size)
                start = self._take(count * size, inner)
                if len(self.paths) > MAX_LEAVES:
                    raise LayoutError(f"{inner} is outside the message")
                self.paths[inner] = (code, (count,)), start
            elif part == "string":
                self.texts[inner] = tuple(self._text(inner) for _ in range(count))
            else:
                for k in range(count):
                    self._walk(inner if many is None else f"{inner}[{k}]", part, depth + 1)

    def _take(self, size: int, what: str) -> int:
        start, self._position = self._position, self._position + size
        if self._position > len(self._message):
            raise LayoutError(f"{what} is outside the message")
        return start

    def _take_fixed(self, size: int, what: str) -> bytes:
        """The next bytes, which every message of this layout must repeat."""
        start = self._take(size, what)
        before = self._fixed.pop()[0] if self._fixed and self._fixed[-1][1] == start else start
        self._fixed.append((before, self._position))
        return self._message[start : self._position]

    def _align(self, size: int) -> None:
        if self._cdr:
            self._position += -(self._position - 4) % size

    def _count(self) -> int:
        self._align(4)
        order: Literal["little", "big"] = "little" if self._order == "<" else "big"
        count = int.from_bytes(self._take_fixed(4, "a length"), order)
        # An element takes a byte or more: a larger count is damage, not data.
        if count > len(self._message) - self._position:
            raise LayoutError("a count larger than what is left of the message")
        return count

    def _text(self, path: str) -> str:
        return (
            self._take_fixed(self._count(), path).removesuffix(b"\0").decode("utf-8", "replace")
        )


@lru_cache(maxsize=64)  # many channels may share one definition, and parsing takes its time
def types_of(definition: str, name: str, *, idl: bool) -> Types:
    """Parse a message definition with rosbags' parsers. Type → fields."""
    from rosbags.typesys import TypesysError, get_types_from_idl, get_types_from_msg

    if len(definition) > MAX_DEFINITION:
        raise LayoutError(f"a definition of more than {MAX_DEFINITION >> 10} KiB")
    try:
        parsed = get_types_from_idl(definition) if idl else get_types_from_msg(definition, name)
    except (TypesysError, *DAMAGE, AssertionError) as error:
        raise LayoutError(f"no message definition: {reason_of(error)[:60]}") from None
    return parsed


def element_of(described: Any) -> tuple[str, int | None]:  # noqa: ANN401 - nested tuples of rosbags
    """A field's type or its elements', and count: None for one, −1 for any number."""
    node, inner = described
    if node == 1:  # a primitive with a bound
        return str(inner[0]), None
    if node == 2:  # another message
        return str(inner), None
    name, many = element_of(inner[0])
    if many is not None:
        raise LayoutError("an array of arrays")
    return name, int(inner[1]) if node == 3 else -1


#: Definitions that ROS 2 lacks: Franka's state, Foxglove's log.
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


def types_for(channel: Channel) -> Types:
    """All types that a channel's messages are made of: the container's own first."""
    known: Types = dict(type_store().fielddefs)
    if channel.definition:
        known |= types_of(channel.definition, long_name(channel.type), idl=channel.idl)
    if channel.encoding == "ros1":
        # In ROS 1 a time is a primitive of two words.
        time = type_store().fielddefs["builtin_interfaces/msg/Time"]
        known |= {f"builtin_interfaces/msg/{name}": time for name in ("Time", "Duration")}
    if long_name(channel.type) not in known:
        raise LogError(
            f"topic {channel.topic}: the bag holds no definition of {channel.type}. Convert it "
            "with ros2 bag convert on a machine that has the package."
        )
    return known
