"""Bulk decoding: messages of one layout become arrays at once, others singly.

Bags of ROS 2 Humble and older hold no definitions, and a written bag needs them. A layout
is found by walking one message along its definition. It is another message's if and only
if that is as long and all its length prefixes are equal; strings must be equal too, so
that joint names hold for a group.
"""

from collections import defaultdict
from collections.abc import Callable, Container, Mapping, Sequence
from functools import cache, cached_property, lru_cache, partial
from itertools import compress
from typing import Any, Literal, NamedTuple

import numpy as np

from vftcli.readers.aliases import along_arm
from vftcli.readers.bags.container import Batch, Bytes, Channel, Integers, ReadBudget
from vftcli.readers.opening import DAMAGE, reason_of
from vftcli.readers.table import Columns, JoinedRows, Names, Signals
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
    """The first path there, or a wrench's six numbers below it; or none."""
    each = ([p] if p in there else [f"{p}.{part}" for part in VECTORS] for p in paths)
    return next((names for names in each if all(name in there for name in names)), [])


class MessageLayout:
    """Where everything lies in serialised messages of one shape, a row of bytes each.

    `kind` is their structure, each number under its dotted path.
    """

    def __init__(self, types: Types, message: bytes, kind: str, *, cdr: bool) -> None:
        #: Dotted path → code and count of numbers, and where they begin.
        self.paths: dict[str, tuple[tuple[str, tuple[int]], int]] = {}
        self.texts: dict[str, Names] = {}  #: Dotted path → strings.
        self._types, self._message, self._cdr = types, message, cdr
        self._order, self._position, self._visits = "<", 0, 0
        #: Ranges of bytes that all messages of this layout have.
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


@lru_cache(maxsize=64)  # many channels may share one definition
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
    """A field's type or its elements', and count: None for one, −1 for any."""
    node, inner = described
    if node == 1:  # a primitive with a bound
        return str(inner[0]), None
    if node == 2:  # another message
        return str(inner), None
    name, many = element_of(inner[0])
    if many is not None:
        raise LayoutError("an array of arrays")
    return name, int(inner[1]) if node == 3 else -1


#: Definitions that ROS 2 lacks: Franka's state.
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
    """All types of a channel's messages, the container's own first."""
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


def _paths_by_name(text: str) -> dict[str, Names]:
    """Name → paths, of words as "q=position|q", one a release."""
    words = (word.split("=") for word in text.split())
    return {name: tuple(paths.split("|")) for name, paths in words}


class Kind(NamedTuple):
    """One message type."""

    #: Signal → dotted paths to try, a wrench's above its six numbers; `effort` is settled later.
    signals: Mapping[str, Names]
    names: str = ""  #: Path of the joints' names.
    frame: str = ""  #: Path of the frame's name.
    #: Name → paths to try of the load's numbers, of which the last value counts.
    constants: Mapping[str, Names] = {}
    #: Whether it is Franka's, with its residual and frame.
    franka: bool = False


#: Message type → what is read from it.
KINDS = {
    "sensor_msgs/JointState": Kind(
        _paths_by_name("q=position dq=velocity effort=effort"), names="name"
    ),
    "franka_msgs/FrankaState": Kind(
        _paths_by_name(
            "q=q dq=dq torque=tau_J target_q=q_d target_dq=dq_d tau_ext=tau_ext_hat_filtered "
            "wrench=O_F_ext_hat_K"
        ),
        constants=_paths_by_name("mass=m_load com=F_x_Cload"),
        franka=True,
    ),
    "franka_msgs/FrankaRobotState": Kind(
        _paths_by_name(
            "q=measured_joint_state.position|q dq=measured_joint_state.velocity|dq "
            "torque=measured_joint_state.effort|tau_j target_q=desired_joint_state.position|q_d "
            "target_dq=desired_joint_state.velocity|dq_d "
            "tau_ext=tau_ext_hat_filtered.effort|tau_ext_hat_filtered "
            "wrench=o_f_ext_hat_k.wrench|o_f_ext_hat_k"
        ),
        names="measured_joint_state.name",
        constants=_paths_by_name("mass=inertia_load.inertia.m|m_load com=f_x_cload"),
        franka=True,
    ),
    "geometry_msgs/WrenchStamped": Kind(_paths_by_name("wrench=wrench"), frame="header.frame_id"),
}

#: Layouts of one topic: names and lengths hardly vary.
LAYOUTS = 512


TIMES = ("receive", "header", "robot")  #: Beside its signals.


class Stream:
    """Messages of one topic about the same joints, part by part and then whole.

    `mixed` says whether the messages had other joints or another order; `series` has the
    times and signals that came in, and each message's number among all.
    """

    def __init__(self, channel: Channel, names: Names, frame: str) -> None:
        self.channel, self.names, self.frame, self.mixed = channel, names, frame, False
        self.topic, self.kind = channel.topic, KINDS[channel.type]
        self.constants: dict[str, tuple[float, ...]] = {}
        self.series: dict[str, JoinedRows] = defaultdict(JoinedRows)

    @cached_property
    def columns(self) -> Columns:
        """Times and signals of all messages, in order of recording."""
        count = self.series["place"].count
        found = {
            name: rows.whole()
            for name, rows in self.series.items()
            if len(rows.shapes) == 1 and rows.count == count
        }
        place = found.pop("place")
        if np.any(place[1:] < place[:-1]):  # of several layouts in turn
            order = np.argsort(place)
            found = {name: value[order] for name, value in found.items()}
        return found

    @cached_property
    def signals(self) -> Signals:
        """Signal → (T, k)."""
        return {name: value for name, value in self.columns.items() if name not in TIMES}

    @property
    def messages(self) -> int:
        """Number of messages."""
        return self.series["place"].count

    @property
    def width(self) -> int:
        """Number of positions."""
        return len(self.signals["q"].T)

    @property
    def receive(self) -> Integers:
        """When each was recorded. (T,) [ns]"""
        return self.columns["receive"]

    @cached_property
    def host(self) -> Integers:
        """Header stamps if they are set and never run back, else receive stamps. (T,) [ns]"""
        header = self.columns.get("header")
        good = header is not None and header[0] > 0 and runs(header)
        return header if header is not None and good else self.receive


def runs(stamps: Array | Integers) -> bool:
    """Whether stamps are set and never run back."""
    good = np.isfinite(stamps).all() and (np.diff(stamps) >= 0).all()
    return bool(good and (len(stamps) < 2 or stamps[-1] > stamps[0]))


Numbers = Callable[[Sequence[str]], Array]


class Decoder:
    """Turns batches into streams of the numbers a Recording can hold."""

    def __init__(self, budget: ReadBudget) -> None:
        self.budget = budget
        #: By topic, joints' names, frame and signals.
        self.streams: dict[tuple[Channel, Names, str, Names], Stream] = {}
        #: Topic → length of a message → layouts of that length.
        self.layouts: dict[Channel, dict[int, list[MessageLayout]]] = defaultdict(dict)
        self.others: dict[str, str] = {}

    def take(self, batch: Batch, places: Integers) -> None:
        """Decode messages at their places (k, 2); note other topics."""
        channel = batch.channel
        if channel.type not in KINDS or channel.encoding not in {"ros1", "cdr"}:
            self.others[channel.topic] = channel.type or channel.encoding
            return
        lengths = np.array([len(content) for content in batch.contents])
        try:
            for length in np.unique(lengths):
                own = lengths == length
                content = b"".join(compress(batch.contents, own))
                messages = np.frombuffer(content, np.uint8).reshape(own.sum(), length)
                self._take_matrix(channel, messages, places[own])
        except LayoutError as error:
            raise self.budget.error(
                f"a message of {channel.topic} does not fit the definition of {channel.type} "
                f"({error}). The bag is damaged, or its definition another's."
            ) from None

    def _take_matrix(self, channel: Channel, messages: Bytes, places: Integers) -> None:
        layouts = self.layouts[channel]
        known, tried = layouts.setdefault(messages.shape[1], []), 0
        while len(messages):
            if tried == len(known):
                message, cdr = messages[0].tobytes(), channel.encoding == "cdr"
                known.append(MessageLayout(types_for(channel), message, channel.type, cdr=cdr))
                if sum(map(len, layouts.values())) > LAYOUTS:
                    raise LayoutError(f"its messages have more than {LAYOUTS} layouts")
            fits = known[tried].fits(messages)
            if fits.any():
                own = slice(None) if fits.all() else fits
                numbers = partial(known[tried].numbers, messages[own])
                self.add(channel, numbers, known[tried].texts, places[own])
            messages, places, tried = messages[~fits], places[~fits], tried + 1

    def add(
        self, channel: Channel, numbers: Numbers, texts: Mapping[str, Names], places: Integers
    ) -> None:
        """Take up messages of one shape, of a type in `KINDS`.

        `numbers` gives those of each at the first of some paths, `texts` the strings that
        all have; `places` are number and time of recording [ns] of each. (k, 2)
        """
        kind = KINDS[channel.type]
        each = {signal: numbers(paths) for signal, paths in kind.signals.items()}
        # Some drivers sort joints by name; a layout has one order.
        own = texts.get(kind.names, ())
        names, signals = along_arm(own, {s: value for s, value in each.items() if value.shape[1]})
        if kind.franka and "tau_ext" in signals:
            signals["tau_ext"] = 0.0 - signals["tau_ext"]
        frame = "".join(texts.get(kind.frame, ()))
        key = channel, names, frame, tuple(signals)
        stream = self.streams.setdefault(key, Stream(channel, names, frame))
        stream.mixed |= names != own
        for name, paths in kind.constants.items():
            if (last := numbers(paths)[-1]).size:
                stream.constants[name] = tuple(last.tolist())
        part: Columns = {**signals, "place": places[:, 0], "receive": places[:, 1]}
        if (clock := numbers(["time"])).size:  # a robot's own [s]
            part["robot"] = clock[:, 0]
        stamp = [numbers([f"header.stamp.{p}"]) for p in ("sec", "nanosec")]
        if all(number.size for number in stamp):
            part["header"] = np.hstack(stamp).astype(np.int64) @ (10**9, 1)
        for name, value in part.items():
            stream.series[name].add(value)
