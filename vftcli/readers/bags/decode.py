"""Bulk decoding: messages of one layout become arrays at once, others singly."""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from itertools import compress
from typing import NamedTuple

import numpy as np

from vftcli.readers.aliases import along_arm
from vftcli.readers.bags.container import Batch, Bytes, Channel, Integers, ReadBudget
from vftcli.readers.bags.ros_messages import LayoutError, MessageLayout, types_for
from vftcli.readers.table import Columns, JoinedRows, Names, Signals
from vftcli.signals.arrays import Array


def _paths_by_name(text: str) -> dict[str, Names]:
    """Name → paths, of words as "q=position|q": a path for each release's name."""
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


TIMES = ("receive", "header", "robot")  #: What a stream has beside its signals.


class Stream:
    """Messages of one topic about the same joints, part by part and then whole.

    Attributes:
        channel: The topic.
        names: The joints' names, base to tip, or empty.
        frame: Frame of its stamps' headers, or nothing.
        mixed: Whether the messages had the joints in another order, or others among them.
        constants: Last value of each constant.
        series: The times and signals that came in, and each message's number among all.
    """

    def __init__(self, channel: Channel, names: Names, frame: str) -> None:
        self.channel, self.names, self.frame, self.mixed = channel, names, frame, False
        self.constants: dict[str, tuple[float, ...]] = {}
        self.series: dict[str, JoinedRows] = defaultdict(JoinedRows)

    @cached_property
    def columns(self) -> Columns:
        """Times and signals of all messages, of one width, in order of recording."""
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
    def kind(self) -> Kind:
        """The meaning of its type."""
        return KINDS[self.channel.type]

    @property
    def topic(self) -> str:
        """The topic's name."""
        return self.channel.topic

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
    """Turns batches into streams, keeping only the numbers a Recording can hold."""

    def __init__(self, budget: ReadBudget) -> None:
        self.budget = budget
        #: By topic, joints' names, frame and signals.
        self.streams: dict[tuple[Channel, Names, str, Names], Stream] = {}
        #: Topic → length of a message → layouts of that length.
        self.layouts: dict[Channel, dict[int, list[MessageLayout]]] = defaultdict(dict)
        self.others: dict[str, str] = {}

    def take(self, batch: Batch, places: Integers) -> None:
        """Decode messages with these places (k, 2); note topics without a decoder."""
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
        # float64 holds both whole.
        stamp = [numbers([f"header.stamp.{p}"]) for p in ("sec", "nanosec")]
        if all(number.size for number in stamp):
            part["header"] = np.hstack(stamp).astype(np.int64) @ (10**9, 1)
        for name, value in part.items():
            stream.series[name].add(value)
