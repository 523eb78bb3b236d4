"""Several topics on one clock: which topic leads, which clock counts, what is interpolated."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.readers.aliases import RESIDUAL_TURNED
from vftcli.readers.bags.container import Integers
from vftcli.readers.bags.decode import Stream
from vftcli.readers.columns import SIGNALS, parse_columns
from vftcli.readers.joints import UR_NAMES, robot_of
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.series import median_step, resampled
from vftcli.signals.wrench import WrenchFrame

TARGETS = re.compile(r"desired|command|target|goal|reference", re.IGNORECASE)
VENDOR_WRENCH = re.compile(r"franka|F_ext$|external_wrench", re.IGNORECASE)
NEAR = 3.0
"""A wrench further than this many of its own sample times from a pose is not taken for it."""

OWN = "/vftcli/"
"""Topics that vftcli itself writes."""


@dataclass
class Account:
    """What was made of a bag's topics.

    Attributes:
        remarks: What was chosen, and what looks suspicious.
        taken: Topics other than the leading one of which a signal was taken.
    """

    remarks: list[Remark] = field(default_factory=list)
    taken: set[str] = field(default_factory=set)


def aligned(
    streams: Sequence[Stream], path: Path, request: ReadChoice, others: dict[str, str]
) -> RawLog:
    """Put the topics of a bag on the clock of the one with the joints' positions.

    Raises:
        LogError: If no topic has joint positions, or --columns names what is not there.
    """
    account = Account()
    lead = leading(streams, path, others)
    stamps, tick, clock, times = clock_of(lead)
    signals, names = _joint_signals(lead, account, request)
    for stream in streams:
        if stream.channel.topic.startswith(OWN):
            _own_topic(signals, stream, lead, times)
        elif stream is not lead and _same_arm(stream, lead):
            _supplement(signals, stream, lead, times, account)
    frame = _take_wrench(signals, streams, lead, times, account, request)
    _tell_left(streams, lead, account)
    hint = robot_of(names)
    if not names:
        names, hint = _names_elsewhere(streams, lead)
    wanted = {name: value for name, value in signals.items() if request.wants(name)}
    return RawLog(
        stamps=stamps,
        tick=tick,
        clock=clock,
        signals=wanted,
        wrench_frame=frame,
        joint_names=names,
        robot_hint=hint,
        remarks=tuple(account.remarks),
        payload_mass=next(iter(lead.constants.get("mass", ())), None),
        payload_com=lead.constants.get("com"),
    )


def _take_wrench(
    signals: dict[str, Array],
    streams: Sequence[Stream],
    lead: Stream,
    times: Integers,
    account: Account,
    request: ReadChoice,
) -> WrenchFrame | None:
    """Put a sensor's wrench in place of the vendor's estimate; return what is stated of it."""
    frame = lead.kind.wrench_frame
    sensor = _sensor(streams, lead)
    if sensor is None or "wrench" in _chosen(request):
        return frame
    if sensor.channel.topic.startswith(OWN):
        return WrenchFrame.parsed(sensor.frame) if sensor.frame else None
    values = interpolated(sensor, "wrench", lead, times, account)
    if values is None:
        return frame
    signals["wrench"] = values
    # A frame_id is a link's name, of which the moment's point is the origin.
    return WrenchFrame(sensor.frame, sensor.frame) if sensor.frame else None


def _tell_left(streams: Sequence[Stream], lead: Stream, account: Account) -> None:
    """Say which messages and topics were left out."""
    for stream in streams:
        if stream.channel == lead.channel and stream.names == lead.names and stream is not lead:
            account.remarks.append(
                caution(
                    "messages-left-out",
                    messages=stream.messages,
                    topic=lead.channel.topic,
                    signals=tuple(stream.signals) or ("names",),
                )
            )
    topics = {s.channel.topic for s in streams if not s.channel.topic.startswith(OWN)}
    left = sorted(topics - {lead.channel.topic} - account.taken)
    if left:
        account.remarks.append(fact("topics-left-out", topics=tuple(left[:6])))


def _own_topic(signals: dict[str, Array], stream: Stream, lead: Stream, times: Integers) -> None:
    """Take up a topic of an MCAP that vftcli convert wrote: /vftcli/SIGNAL, sample by sample."""
    name = stream.channel.topic.removeprefix(OWN)
    value = stream.signals.get("wrench" if name == "wrench" else "effort")
    same = stream.messages == lead.messages and np.array_equal(host_times(stream)[0], times)
    if value is None or not same or (name != "wrench" and name not in SIGNALS):
        return
    field_name = SIGNALS.get(name, name)
    if field_name in {"current", "torque"} and lead.kind.names:
        for other in {"current", "torque"} & set(signals):
            if np.array_equal(signals[other], value):
                del signals[other]  # the effort of /joint_states said the same without its kind
    signals[field_name] = value


def _names_elsewhere(streams: Sequence[Stream], lead: Stream) -> tuple[tuple[str, ...], str | None]:
    """Joint names, and the robot they settle, that only another topic about the arm has."""
    width = lead.signals["q"].shape[1]
    for stream in streams:
        if len(stream.names) == width and (hint := robot_of(stream.names)) is not None:
            return stream.names, hint
    return (), None


def leading(streams: Sequence[Stream], path: Path, others: dict[str, str]) -> Stream:
    """The topic whose positions lead: measured ones, of most messages; a robot state breaks ties.

    Raises:
        LogError: If there is none, or if two arms were recorded in one bag.
    """
    found = [
        s for s in streams
        if "q" in s.signals and s.messages > 1 and not TARGETS.search(s.channel.topic)
    ]  # fmt: skip
    found = [s for s in found if s.signals["q"].shape[1] > 2] or found
    if not found:
        there = [f"{s.channel.topic} ({s.channel.type})" for s in streams]
        there += [f"{topic} ({kind})" for topic, kind in others.items()]
        raise LogError(
            f"{path}: no topic with joint positions among {', '.join(there[:12]) or 'no topics'}. "
            "Record a JointState, FrankaState or FrankaRobotState topic."
        )
    most = max(s.messages for s in found)
    near = [s for s in found if s.messages >= 0.9 * most]
    best = max(near, key=lambda s: (s.kind.rank, "effort" in s.signals, s.messages))
    rivals = [s for s in near if s is not best and s.kind is best.kind and _rivals(s, best)]
    if rivals:
        topics = ", ".join(s.channel.topic for s in (best, *rivals))
        raise LogError(
            f"{path}: two arms were recorded: {topics} "
            f"({', '.join(best.names[:2])}… and {', '.join(rivals[0].names[:2])}…). Say which with "
            f"--columns 'q={best.channel.topic}.position'."
        )
    return best


def _rivals(one: Stream, other: Stream) -> bool:
    """Whether two streams of one type are about different arms of equally many joints."""
    same_width = one.signals["q"].shape[1] == other.signals["q"].shape[1]
    return same_width and bool(one.names) and set(one.names) != set(other.names)


def clock_of(stream: Stream) -> tuple[Any, float, str, Integers]:
    """A stream's best clock: the robot's own, else its header's, else the recorder's.

    Returns:
        The stamps, the length of their tick [s], which clock they are, and the header or receive
        stamps [ns] on which other topics are aligned.
    """
    host, words = host_times(stream)
    robot = stream.robot
    if robot is None or not runs(robot):
        return host, 1e-9, words, host
    words = f"robot clock (time of {stream.channel.topic})"
    milliseconds = np.rint(robot * 1e3)
    if np.all(np.abs(robot * 1e3 - milliseconds) < 1e-3) and abs(robot[-1]) < 1e12:
        return milliseconds.astype(np.int64), 1e-3, words, host
    return robot, 1.0, words, host


def runs(stamps: Any) -> bool:  # noqa: ANN401 - whole numbers or seconds
    """Whether stamps are set and never run back."""
    good = bool(np.all(np.isfinite(stamps))) and bool(np.all(np.diff(stamps) >= 0))
    return good and (len(stamps) < 2 or bool(stamps[-1] > stamps[0]))


def host_times(stream: Stream) -> tuple[Integers, str]:
    """Header stamps if they are set and never run back, else receive stamps. (T,) [ns]"""
    header = stream.header
    topic = stream.channel.topic
    if header is not None and header[0] > 0 and runs(header):
        return header, f"header stamps of {topic}"
    return stream.receive, f"receive stamps of {topic} (its header stamps are unset or run back)"


def _joint_signals(
    lead: Stream, account: Account, request: ReadChoice
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """The leading topic's signals, the vendor's signs turned into ours."""
    if lead.mixed:
        account.remarks.append(fact("joints-reordered", topic=lead.channel.topic))
    width = lead.signals["q"].shape[1]
    signals = {}
    for signal, value in lead.signals.items():
        if signal == "wrench":
            signals[signal] = value
        elif value.shape[1] == width and not _empty(signal, value, account):
            signals[signal] = 0.0 - value if signal in lead.kind.turned else value
    if lead.kind.turned & set(signals):
        account.remarks.append(RESIDUAL_TURNED)
    return _with_effort(signals, lead, account, request), lead.names


def _empty(signal: str, value: Array, account: Account) -> bool:
    """Whether a signal is NaN throughout, as drivers publish what they do not measure."""
    if np.isnan(value[0]).all() and np.isnan(value).all():
        account.remarks.append(fact("signal-empty", signal=signal))
        return True
    return False


def _chosen(request: ReadChoice) -> dict[str, tuple[str, float]]:
    """Signal → message field and factor, as --columns says: -tau=effort, current[mA]=effort."""
    if request.columns is None:
        return {}
    spec = parse_columns(request.columns)
    return {
        SIGNALS[item.signal]: (item.pattern or "", item.factor)
        for item in spec.items
        if item.signal in SIGNALS
    }


FIELDS = {"position": "q", "velocity": "dq", "effort": "effort"}


def _with_effort(
    signals: dict[str, Array], lead: Stream, account: Account, request: ReadChoice
) -> dict[str, Array]:
    """Decide what effort is: what --columns says, else current for UR joints, torque for others."""
    found = dict(signals)
    for signal, (pattern, factor) in _chosen(request).items():
        last = pattern.rpartition(".")[2]
        source = FIELDS.get(last, last)
        if source not in signals:
            there = [next((f for f, s in FIELDS.items() if s == name), name) for name in signals]
            raise LogError(
                f"--columns: {lead.channel.topic} has no field {last!r}; it has {', '.join(there)}."
            )
        found.pop(source, None)
        found[signal] = signals[source] * factor + 0.0
        code = "field-taken-turned" if factor < 0 else "field-taken"
        account.remarks.append(fact(code, field=last, signal=signal))
    if "effort" in found:
        names = lead.names
        is_ur = len(names) == len(UR_NAMES) and all(name.endswith(UR_NAMES) for name in names)
        found["current" if is_ur else "torque"] = found.pop("effort")
        if is_ur:
            account.remarks.append(fact("effort-is-current"))
    return found


def _same_arm(stream: Stream, lead: Stream) -> bool:
    """Whether a stream is about the leading topic's joints, or about no joints by name."""
    if "q" not in stream.signals and "effort" not in stream.signals:
        return False
    if not stream.names or not lead.names:
        return bool(
            stream.signals.get("q", lead.signals["q"]).shape[1] == lead.signals["q"].shape[1]
        )
    return set(stream.names) >= set(lead.names) and not TARGETS.search(stream.channel.topic)


def _supplement(
    signals: dict[str, Array], stream: Stream, lead: Stream, times: Integers, account: Account
) -> None:
    """Add the signals that only another topic about the same joints has, interpolated."""
    for signal in stream.signals:
        if signal in signals or signal == "effort":
            continue
        values = interpolated(stream, signal, lead, times, account)
        if values is None:
            continue
        signals[signal] = 0.0 - values if signal in stream.kind.turned else values


def _sensor(streams: Sequence[Stream], lead: Stream) -> Stream | None:
    """The wrench topic to take: a sensor's before the vendor's estimate; the fullest of several."""
    found = [s for s in streams if s.channel.type == "geometry_msgs/WrenchStamped"]
    sensors = [s for s in found if not VENDOR_WRENCH.search(s.channel.topic)]
    if not sensors and "wrench" in lead.signals:
        return None
    return max(sensors or found, key=lambda s: s.messages, default=None)


def interpolated(
    stream: Stream, signal: str, lead: Stream, times: Integers, account: Account
) -> Array | None:
    """A smooth signal of another topic at the leading topic's times, held at the ends. (T, k)

    None, and a warning, where the other topic does not cover the leading one's time.
    """
    own, _ = host_times(stream)
    if (lead.header is None or times is not lead.header) and own is not stream.receive:
        own = stream.receive  # one of the two has receive stamps only: compare like with like
    elif own is stream.receive and times is lead.header:
        times = lead.receive
    fresh = np.concatenate([[True], np.diff(own) > 0])
    own, values = own[fresh], stream.signals[signal][fresh]
    topic = stream.channel.topic
    usual = median_step(own.astype(np.float64)) if len(own) > 1 else 0.0
    outside = (times < own[0] - NEAR * usual) | (times > own[-1] + NEAR * usual)
    if len(own) < 2 or np.mean(outside) > 0.05 or np.any(np.diff(own) < 0):
        account.remarks.append(caution("topic-too-short", signal=signal, topic=topic))
        return None
    start = int(own[0])
    x, xp = np.asarray((times - start) * 1e-9, float), np.asarray((own - start) * 1e-9, float)
    result = resampled(x, xp, values)
    account.taken.add(topic)
    account.remarks.append(
        fact(
            "signal-interpolated",
            signal=signal,
            topic=topic,
            rate_Hz=1e9 / usual,
            lead=lead.channel.topic,
        )
    )
    return result
