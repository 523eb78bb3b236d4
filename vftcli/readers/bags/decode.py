"""Bulk decoding: messages of one layout become arrays at once, the odd ones one by one."""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from vftcli.readers.bags.container import Batch, Channel, Ingest, Integers
from vftcli.readers.bags.layout import LayoutError, MessageLayout, Types, Walker
from vftcli.readers.bags.ros_messages import types_for
from vftcli.readers.joining import JoinedRows
from vftcli.readers.joints import in_order, kinematic_order
from vftcli.readers.table import Column
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.wrench import FRANKA_FRAME, WrenchFrame

VECTORS = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One message type."""

    #: Signal → dotted paths to try in turn; a path that ends in `.wrench` means its six numbers.
    #: `effort` is decided later, by the joints' names.
    signals: Mapping[str, tuple[str, ...]]
    names: tuple[str, ...] = ()  #: Path of the joints' names.
    robot_time: str = "time"  #: Path of the robot's own clock. [s]
    frame: str = ""  #: Path of the frame's name.
    #: Name → path of a number of which the last value counts.
    constants: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    rank: int = 0  #: Which type is preferred as the clock when two run at one rate; the larger.
    turned: frozenset[str] = frozenset()  #: Signals whose sign has to be turned.
    wrench_frame: WrenchFrame | None = None  #: What is known of its wrench.


#: Message type → the signals that are read from it.
KINDS: dict[str, Kind] = {
    "sensor_msgs/JointState": Kind(
        signals={"q": ("position",), "dq": ("velocity",), "effort": ("effort",)},
        names=("name",),
        rank=1,
    ),
    "franka_msgs/FrankaState": Kind(
        signals={
            "q": ("q",),
            "dq": ("dq",),
            "torque": ("tau_J",),
            "target_q": ("q_d",),
            "target_dq": ("dq_d",),
            "tau_ext": ("tau_ext_hat_filtered",),
            "wrench": ("O_F_ext_hat_K",),
        },
        constants={
            "mass": ("m_load",),
            "com": ("F_x_Cload",),
        },
        rank=2,
        turned=frozenset({"tau_ext"}),
        wrench_frame=FRANKA_FRAME,
    ),
    "franka_msgs/FrankaRobotState": Kind(
        signals={
            "q": ("measured_joint_state.position", "q"),
            "dq": ("measured_joint_state.velocity", "dq"),
            "torque": ("measured_joint_state.effort", "tau_j"),
            "target_q": ("desired_joint_state.position", "q_d"),
            "target_dq": ("desired_joint_state.velocity", "dq_d"),
            "tau_ext": ("tau_ext_hat_filtered.effort", "tau_ext_hat_filtered"),
            "wrench": ("o_f_ext_hat_k.wrench", "o_f_ext_hat_k"),
        },
        names=("measured_joint_state.name",),
        constants={"mass": ("inertia_load.inertia.m", "m_load"), "com": ("f_x_cload",)},
        rank=2,
        turned=frozenset({"tau_ext"}),
        wrench_frame=FRANKA_FRAME,
    ),
    "geometry_msgs/WrenchStamped": Kind(signals={"wrench": ("wrench",)}, frame="header.frame_id"),
}


def paths_in(kind: Kind, signal: str, leaves: Mapping[str, object]) -> tuple[str, ...]:
    """The paths of a signal that a message has: one, or the six of a wrench; () if none."""
    for path in kind.signals[signal]:
        if path in leaves:
            return (path,)
        if all(f"{path}.{part}" in leaves for part in VECTORS):
            return tuple(f"{path}.{part}" for part in VECTORS)
    return ()


#: Layouts that messages of one topic may have: joint names, and lengths of lists, hardly vary.
LAYOUTS = 512
#: Random messages of some batches that are walked one by one to confirm their layout.
CHECKED_ROWS = 4


@dataclass
class Stream:
    """Messages of one topic about the same joints, as arrays.

    Attributes:
        messages: How many messages.
    """

    channel: Channel  #: The topic.
    kind: Kind  #: What its type means.
    names: tuple[str, ...]  #: The joints' names, base to tip, or empty.
    mixed: bool  #: Whether the messages had them in another order, or other joints among them.
    frame: str  #: Frame of its stamps' headers, or nothing.
    receive: Integers  #: When each was recorded. (T,) [ns]
    header: Integers | None  #: Stamp in each header. (T,) [ns]
    robot: Array | None  #: The robot's own clock, or None. (T,) [s]
    signals: dict[str, Array]  #: Signal → (T, k).
    constants: dict[str, tuple[float, ...]]  #: Last value of each constant.

    @property
    def messages(self) -> int:
        """Number of messages."""
        return len(self.receive)

    def series(self) -> Iterator[tuple[str, Column]]:
        """Its times and signals, by name."""
        times = (("receive", self.receive), ("header", self.header), ("robot", self.robot))
        yield from ((name, value) for name, value in times if value is not None)
        yield from self.signals.items()


#: What tells streams of a topic apart: the joints' names, the frame, the signals.
_Key = tuple[tuple[str, ...], str, tuple[str, ...]]


@dataclass
class _Topic:
    """What is known of a channel while its batches come in."""

    types: Types
    layouts: dict[int, list[MessageLayout]] = field(default_factory=dict)
    #: Times and signals by name, and `place` in the topic, of each layout of the batch at hand.
    parts: dict[_Key, list[dict[str, Column]]] = field(default_factory=dict)
    #: The times and signals of all batches.
    series: dict[_Key, dict[str, JoinedRows]] = field(default_factory=dict)
    mixed: set[_Key] = field(default_factory=set)
    constants: dict[str, tuple[float, ...]] = field(default_factory=dict)
    seen: int = 0


class Decoder:
    """Turns batches into streams, keeping only the numbers a Recording can hold."""

    def __init__(self, ingest: Ingest) -> None:
        self.ingest = ingest
        self.topics: dict[Channel, _Topic] = {}
        self.others: dict[str, str] = {}
        self._chance = np.random.default_rng(0)

    def take(self, batch: Batch) -> None:
        """Decode one batch, or remember that its type carries nothing we hold."""
        channel = batch.channel
        if channel.type not in KINDS or channel.encoding not in {"ros1", "cdr"}:
            self.others[channel.topic] = channel.type or channel.encoding
            return
        topic = self.topics.get(channel)
        try:
            if topic is None:
                topic = self.topics[channel] = _Topic(types=types_for(channel))
            for length in np.unique(batch.lengths):
                self._of_length(batch, topic, int(length))
            topic.seen += len(batch.offsets)
            for key, parts in topic.parts.items():
                series = topic.series.setdefault(key, defaultdict(JoinedRows))
                for name, value in in_recorded_order(parts):
                    series[name].add(value)
            topic.parts.clear()
        except LayoutError as error:
            raise LogError(
                f"{self.ingest.path}: a message of {channel.topic} does not fit the definition of "
                f"{channel.type} ({error}). The bag is damaged, or its definition is another's."
            ) from None

    def _of_length(self, batch: Batch, topic: _Topic, length: int) -> None:
        """Decode the messages of one length, layout by layout."""
        rows = np.flatnonzero(batch.lengths == length)
        known = topic.layouts.setdefault(length, [])
        for layout in known:
            rows = self._matching(batch, topic, layout, rows)
        while rows.size:
            layout = self._walked(batch, topic, int(rows[0]))
            known.append(layout)
            if sum(map(len, topic.layouts.values())) > LAYOUTS:
                raise LayoutError(f"its messages have more than {LAYOUTS} layouts")
            rows = self._matching(batch, topic, layout, rows)

    def _matching(
        self, batch: Batch, topic: _Topic, layout: MessageLayout, rows: Integers
    ) -> Integers:
        """Decode the rows that have a layout and return the others."""
        if rows.size == 0:
            return rows
        fits = layout.fits(batch.buffer, batch.offsets[rows])
        if fits.any():
            self._decode(batch, topic, layout, rows[fits])
        return rows[~fits]

    def _walked(self, batch: Batch, topic: _Topic, row: int) -> MessageLayout:
        """The layout of one message."""
        start = int(batch.offsets[row])
        message = batch.buffer[start : start + int(batch.lengths[row])]
        cdr = batch.channel.encoding == "cdr"
        return Walker(topic.types, message, cdr=cdr).walk(batch.channel.type)

    def _decode(self, batch: Batch, topic: _Topic, layout: MessageLayout, rows: Integers) -> None:
        """Decode messages of one layout into a part of their stream."""
        layout.uses += 1
        if layout.uses & (layout.uses - 1) == 0:  # the first, second, fourth, eighth … batch
            for row in self._chance.choice(rows, min(CHECKED_ROWS, len(rows)), replace=False):
                if self._walked(batch, topic, int(row)).leaves != layout.leaves:
                    raise LayoutError("two walks of one message differ")
        kind = KINDS[batch.channel.type]
        offsets = batch.offsets[rows]
        signals = {}
        for signal in kind.signals:
            paths = paths_in(kind, signal, layout.leaves)
            columns = [layout.numbers(path, batch.buffer, offsets) for path in paths]
            if columns and (value := np.hstack(columns)).shape[1]:
                signals[signal] = value
        for name, places in kind.constants.items():
            if path := next((place for place in places if place in layout.leaves), None):
                last = layout.numbers(path, batch.buffer, offsets[-1:])[0]
                topic.constants[name] = tuple(float(value) for value in last)
        names = next((layout.texts[p] for p in kind.names if p in layout.texts), ())
        order = kinematic_order(names)
        # Some drivers publish joints alphabetically; every message of a layout has one order.
        mixed = order != tuple(range(len(names)))
        if mixed:
            # Of an arm of six joints the wrench has as many columns, but they are no joints.
            signals = {
                n: v if n == "wrench" else in_order(v, order, len(names))
                for n, v in signals.items()
            }
            names = tuple(names[k] for k in order)
        frame = "".join(layout.texts.get(kind.frame, ()))
        has_clock = kind.robot_time in layout.leaves
        clock = layout.numbers(kind.robot_time, batch.buffer, offsets)[:, 0] if has_clock else None
        own = {"header": _stamps(layout, batch, offsets), "robot": clock}
        part = {name: values for name, values in own.items() if values is not None} | signals
        part |= {"place": topic.seen + rows, "receive": batch.times[rows]}
        key = names, frame, tuple(signals)
        topic.parts.setdefault(key, []).append(part)
        topic.mixed |= {key} if mixed else set()

    def streams(self) -> Iterator[Stream]:
        """All streams that were decoded, each in the order of recording."""
        for channel, topic in self.topics.items():
            for key, series in topic.series.items():
                names, frame, signals = key
                count = series["receive"].count
                # What every message has, and of one width.
                found = {
                    name: rows.whole()
                    for name, rows in series.items()
                    if len(rows.shapes) == 1 and rows.count == count
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


def _stamps(layout: MessageLayout, batch: Batch, offsets: Integers) -> Integers | None:
    """Header stamps in nanoseconds, or None if the type has no header. (k,)"""
    if "header.stamp.sec" not in layout.leaves or "header.stamp.nanosec" not in layout.leaves:
        return None
    seconds = layout.whole_numbers("header.stamp.sec", batch.buffer, offsets)
    return seconds * 1_000_000_000 + layout.whole_numbers(
        "header.stamp.nanosec", batch.buffer, offsets
    )


def in_recorded_order(parts: list[dict[str, Column]]) -> Iterator[tuple[str, Column]]:
    """The times and signals that all parts of a batch have, in the order of recording."""
    order = np.argsort(np.concatenate([part.pop("place") for part in parts]), kind="stable")
    for name, value in parts[0].items():
        values = [part[name] for part in parts if name in part]
        if len(parts) == 1:
            yield name, value  # one layout's rows rise already
        elif len(values) == len(parts) and len({each.shape[1:] for each in values}) == 1:
            yield name, np.concatenate(values)[order]
