"""Bulk decoding: messages of one layout become arrays at once, the odd ones one by one."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import compress
from typing import NamedTuple

import numpy as np

from vftcli.readers.aliases import along_arm
from vftcli.readers.bags.container import Batch, Bytes, Channel, Integers, ReadBudget
from vftcli.readers.bags.ros_messages import LayoutError, MessageLayout, types_for
from vftcli.readers.table import Columns, JoinedRows, Names, Signals
from vftcli.signals.arrays import Array


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

    @property
    def host(self) -> Integers:
        """Header stamps if they are set and never run back, else receive stamps. (T,) [ns]"""
        header = self.header
        good = header is not None and header[0] > 0 and runs(header)
        return header if header is not None and good else self.receive


def runs(stamps: Array | Integers) -> bool:
    """Whether stamps are set and never run back."""
    good = bool(np.all(np.isfinite(stamps))) and bool(np.all(np.diff(stamps) >= 0))
    return good and (len(stamps) < 2 or bool(stamps[-1] > stamps[0]))


Numbers = Callable[[Sequence[str]], Array]
#: What tells streams of a topic apart: the joints' names, the frame, the signals.
_Key = tuple[Names, str, Names]


@dataclass
class _Topic:
    """What is known of a channel while its batches come in."""

    layouts: dict[int, list[MessageLayout]] = field(default_factory=dict)
    #: The times, signals, and numbers among all messages, of all batches.
    series: dict[_Key, dict[str, JoinedRows]] = field(default_factory=dict)
    mixed: set[_Key] = field(default_factory=set)
    constants: dict[str, tuple[float, ...]] = field(default_factory=dict)


class Decoder:
    """Turns batches into streams, keeping only the numbers a Recording can hold."""

    def __init__(self, budget: ReadBudget) -> None:
        self.budget = budget
        self.topics: dict[Channel, _Topic] = defaultdict(_Topic)
        self.others: dict[str, str] = {}

    def take(self, batch: Batch, places: Integers) -> None:
        """Decode messages with these places (k, 2), or remember that we hold none of their type."""
        channel = batch.channel
        if channel.type not in KINDS or channel.encoding not in {"ros1", "cdr"}:
            self.others[channel.topic] = channel.type or channel.encoding
            return
        lengths = np.array([len(content) for content in batch.contents])
        try:
            for length in np.unique(lengths):
                own = lengths == length
                content = b"".join(compress(batch.contents, own))
                messages = np.frombuffer(content, np.uint8).reshape(-1, max(length, 1))
                self._take_matrix(channel, messages, places[own])
        except LayoutError as error:
            raise self.budget.error(
                f"a message of {channel.topic} does not fit the definition of "
                f"{channel.type} ({error}). The bag is damaged, or its definition is another's."
            ) from None

    def _take_matrix(self, channel: Channel, messages: Bytes, places: Integers) -> None:
        layouts = self.topics[channel].layouts
        known, tried = layouts.setdefault(messages.shape[1], []), 0
        while len(messages):
            if tried == len(known):
                message, cdr = messages[0].tobytes(), channel.encoding == "cdr"
                known.append(MessageLayout(types_for(channel), message, channel.type, cdr=cdr))
                if sum(map(len, layouts.values())) > LAYOUTS:
                    raise LayoutError(f"its messages have more than {LAYOUTS} layouts")
            fits = known[tried].fits(messages)
            if fits.any():
                own = slice(None) if fits.all() else fits  # which copies none
                numbers = partial(known[tried].numbers, messages[own])
                self.add(channel, numbers, known[tried].texts, places[own])
            messages, places, tried = messages[~fits], places[~fits], tried + 1

    def add(
        self, channel: Channel, numbers: Numbers, texts: Mapping[str, Names], places: Integers
    ) -> None:
        """Take up messages of one shape.

        Args:
            channel: Their topic, of a type in `KINDS`.
            numbers: Gives the numbers of each at the first of some paths. (k, count)
            texts: Dotted path → strings, the same in each.
            places: Number among all messages, and time of recording [ns], of each. (k, 2)
        """
        kind, topic = KINDS[channel.type], self.topics[channel]
        each = {signal: numbers(paths) for signal, paths in kind.signals.items()}
        for name, paths in kind.constants.items():
            if (last := numbers(paths)[-1]).size:
                topic.constants[name] = tuple(last.tolist())
        # Some drivers publish joints alphabetically; every message of a layout has one
        # order.
        own = texts.get(kind.names, ())
        names, signals = along_arm(own, {s: value for s, value in each.items() if value.shape[1]})
        if kind.franka and "tau_ext" in signals:
            signals["tau_ext"] = 0.0 - signals["tau_ext"]
        key = names, "".join(texts.get(kind.frame, ())), tuple(signals)
        part: Columns = {**signals, "place": places[:, 0], "receive": places[:, 1]}
        if (clock := numbers(["time"])).size:  # a robot's own [s]
            part["robot"] = clock[:, 0]
        # float64 holds both whole.
        stamp = [numbers([f"header.stamp.{p}"]) for p in ("sec", "nanosec")]
        if all(number.size for number in stamp):
            part["header"] = np.hstack(stamp).astype(np.int64) @ (10**9, 1)
        series = topic.series.setdefault(key, defaultdict(JoinedRows))
        for name, value in part.items():
            series[name].add(value)
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
                place = found["place"]
                if np.any(place[1:] < place[:-1]):  # of several layouts in turn
                    order = np.argsort(place)
                    found = {name: value[order] for name, value in found.items()}
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
