"""Bulk decoding: messages of one layout become arrays at once, the odd ones one by one.

A layout says where the numbers of a serialised ROS message lie. It is found by walking
one message along its definition. Another message has the same layout if and only if it is
as long and all its length prefixes are equal; strings are required to be equal too, so
that joint names hold for every message of a group.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.aliases import along_arm
from vftcli.readers.bags.container import Batch, Bytes, Channel, Integers, ReadBudget, strided
from vftcli.readers.bags.ros_messages import SIZES, Field, LayoutError, Types, types_for
from vftcli.readers.table import Column, Columns, JoinedRows, Names, Signals
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import LogError

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


def _paths_by_name(text: str) -> dict[str, Names]:
    """Name → paths, of words as "q=position|q": two paths are two releases' names of one field."""
    words = (word.split("=") for word in text.split())
    return {name: tuple(paths.split("|")) for name, paths in words}


class Kind(NamedTuple):
    """One message type."""

    #: Signal → dotted paths to try in turn; a path of six numbers means force and torque
    #: below it. `effort` is decided later, by the joints' names.
    signals: Mapping[str, Names]
    names: str = ""  #: Path of the joints' names.
    frame: str = ""  #: Path of the frame's name.
    #: Name → paths to try of the load's numbers, of which the last value counts.
    constants: Mapping[str, Names] = {}
    #: Whether it is Franka's: it leads, its residual is turned, its wrench's frame is
    #: known.
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

#: Layouts that messages of one topic may have: joint names, and lengths of lists, hardly
#: vary.
LAYOUTS = 512


@dataclass
class Stream:
    """Messages of one topic about the same joints, as arrays."""

    channel: Channel  #: The topic.
    kind: Kind  #: What its type means.
    names: Names  #: The joints' names, base to tip, or empty.
    mixed: bool  #: Whether the messages had them in another order, or other joints among them.
    frame: str  #: Frame of its stamps' headers, or nothing.
    receive: Integers  #: When each was recorded. (T,) [ns]
    header: Integers | None  #: Stamp in each header. (T,) [ns]
    signals: Signals  #: Signal → (T, k).
    robot: Array | None = None  #: The robot's own clock, or None. (T,) [s]
    #: Last value of each constant.
    constants: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def topic(self) -> str:
        """The topic's name."""
        return self.channel.topic

    @property
    def messages(self) -> int:
        """Number of messages."""
        return len(self.receive)

    @property
    def width(self) -> int:
        """Number of positions."""
        return len(self.signals["q"].T)


#: What tells streams of a topic apart: the joints' names, the frame, the signals.
_Key = tuple[Names, str, Names]


@dataclass
class _Topic:
    """What is known of a channel while its batches come in."""

    types: Types
    layouts: dict[int, list[MessageLayout]] = field(default_factory=dict)
    #: Times and signals by name, and `place` in the batch at hand, of each layout in it.
    parts: dict[_Key, list[Columns]] = field(default_factory=dict)
    #: The times and signals of all batches.
    series: dict[_Key, dict[str, JoinedRows]] = field(default_factory=dict)
    mixed: set[_Key] = field(default_factory=set)
    constants: dict[str, tuple[float, ...]] = field(default_factory=dict)


class Decoder:
    """Turns batches into streams, keeping only the numbers a Recording can hold."""

    def __init__(self, budget: ReadBudget) -> None:
        self.budget = budget
        self.topics: dict[Channel, _Topic] = {}
        self.others: dict[str, str] = {}

    def take(self, batch: Batch) -> None:
        """Decode one batch, or remember that its type carries nothing we hold."""
        channel = batch.channel
        if channel.type not in KINDS or channel.encoding not in {"ros1", "cdr"}:
            self.others[channel.topic] = channel.type or channel.encoding
            return
        try:
            if channel not in self.topics:
                self.topics[channel] = _Topic(types=types_for(channel))
            topic = self.topics[channel]
            for length in np.unique(batch.lengths):
                self._of_length(batch, topic, int(length))
            for key, parts in topic.parts.items():
                series = topic.series.setdefault(key, defaultdict(JoinedRows))
                for name, value in _in_recorded_order(parts):
                    series[name].add(value)
            topic.parts.clear()
        except LayoutError as error:
            raise LogError(
                f"{self.budget.path}: a message of {channel.topic} does not fit the definition of "
                f"{channel.type} ({error}). The bag is damaged, or its definition is another's."
            ) from None

    def _of_length(self, batch: Batch, topic: _Topic, length: int) -> None:
        rows = np.flatnonzero(batch.lengths == length)
        known, place = topic.layouts.setdefault(length, []), 0
        while rows.size:
            if place == len(known):
                start, channel = int(batch.offsets[rows[0]]), batch.channel
                message, cdr = batch.buffer[start : start + length], channel.encoding == "cdr"
                known.append(MessageLayout(topic.types, message, channel.type, cdr=cdr))
                if sum(map(len, topic.layouts.values())) > LAYOUTS:
                    raise LayoutError(f"its messages have more than {LAYOUTS} layouts")
            fits = known[place].fits(batch.buffer, batch.offsets[rows])
            if fits.any():
                self._decode(batch, topic, known[place], rows[fits])
            rows, place = rows[~fits], place + 1

    def _decode(self, batch: Batch, topic: _Topic, layout: MessageLayout, rows: Integers) -> None:
        kind = KINDS[batch.channel.type]
        at = batch.buffer, batch.offsets[rows]
        each = {signal: layout.numbers(paths, *at) for signal, paths in kind.signals.items()}
        for name, paths in kind.constants.items():
            if (last := layout.numbers(paths, *at)[-1]).size:
                topic.constants[name] = tuple(last.tolist())
        # Some drivers publish joints alphabetically; every message of a layout has one
        # order.
        own = layout.texts.get(kind.names, ())
        names, signals = along_arm(own, {s: value for s, value in each.items() if value.shape[1]})
        if kind.franka and "tau_ext" in signals:
            signals["tau_ext"] = 0.0 - signals["tau_ext"]
        key = names, "".join(layout.texts.get(kind.frame, ())), tuple(signals)
        part = signals | {"place": rows, "receive": batch.times[rows]}
        if (clock := layout.numbers(["time"], *at)).size:  # a robot's own [s]
            part["robot"] = clock[:, 0]
        # float64 holds both whole.
        stamp = [layout.numbers([f"header.stamp.{part}"], *at) for part in ("sec", "nanosec")]
        if all(number.size for number in stamp):
            part["header"] = np.hstack(stamp).astype(np.int64) @ (10**9, 1)
        topic.parts.setdefault(key, []).append(part)
        if names != own:
            topic.mixed.add(key)

    def streams(self) -> Iterator[Stream]:
        """All streams that were decoded, each in the order of recording."""
        for channel, topic in self.topics.items():
            for key, series in topic.series.items():
                names, frame, signals = key
                # What every message has, and of one width.
                found = {
                    name: rows.whole()
                    for name, rows in series.items()
                    if len(rows.shapes) == 1 and rows.count == series["receive"].count
                }
                yield Stream(
                    channel=channel,
                    kind=KINDS[channel.type],
                    names=names,
                    mixed=key in topic.mixed,
                    frame=frame,
                    receive=found["receive"],
                    header=found.get("header"),
                    robot=found.get("robot"),
                    signals={name: found[name] for name in signals if name in found},
                    constants=topic.constants,
                )


def _in_recorded_order(parts: list[Columns]) -> Iterator[tuple[str, Column]]:
    order = np.argsort(np.concatenate([part.pop("place") for part in parts]), kind="stable")
    for name, value in parts[0].items():
        values = [part[name] for part in parts if name in part]
        if len(parts) == 1:
            yield name, value  # one layout's rows rise already
        elif len(values) == len(parts) and len({each.shape[1:] for each in values}) == 1:
            yield name, np.concatenate(values)[order]
