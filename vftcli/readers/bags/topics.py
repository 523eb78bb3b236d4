"""Bags read: the leading topic, its clock, and the other topics interpolated."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.readers.aliases import RESIDUAL_TURNED, effort_of, robot_of
from vftcli.readers.bags.container import ReadBudget, storage_files
from vftcli.readers.bags.decode import Decoder, Stream, runs
from vftcli.readers.bags.documents import Documents
from vftcli.readers.bags.records import batches
from vftcli.readers.columns import SIGNALS
from vftcli.readers.opening import LogFile, open_log
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.readers.reading import LogFormat
from vftcli.signals.arrays import Array, median_step, release, resample_columns
from vftcli.signals.errors import LogError
from vftcli.signals.recording import EFFORTS, pieces
from vftcli.signals.remarks import Remark, caution, fact, warning
from vftcli.signals.wrench import FRANKA_FRAME, WrenchFrame

TARGETS = re.compile(r"(?i)desired|command|target|goal|reference")
VENDOR_WRENCH = re.compile(r"(?i)franka|F_ext$|external_wrench")
#: Topics and types that may hold a wrench: left out, they are named.
FORCES = re.compile(r"(?i)wrench|force|\bft\b|F_ext")
#: A wrench belongs to no pose that is more than this many of its sample times away.
NEAR = 3.0
OWN = "/vftcli/"  #: Topics that vftcli itself writes.


def aligned(
    streams: Sequence[Stream], path: Path, request: ReadChoice, others: dict[str, str]
) -> RawLog:
    """Put the topics of a bag on the clock of the one with the joints' positions."""
    lead = leading(streams, path, others, request)
    gathering = Gathering(lead, request, path)
    for stream in streams:
        gathering.take(stream)
        for values in stream.columns.values():
            release(values)
    frame = gathering.take_wrench(streams)
    gathering.report_left_out(streams, others)
    # Another topic about the arm may have the names.
    named = (s.names for s in streams if len(s.names) == lead.width and robot_of(s.names))
    names = lead.names or next(named, ())
    return RawLog(
        **clock_of(lead),
        signals={name: v for name, v in gathering.signals.items() if request.wants(name)},
        wrench_frame=frame,
        joint_names=names,
        robot_hint=robot_of(names),
        remarks=tuple(gathering.remarks),
        payload_mass=next(iter(lead.constants.get("mass", ())), None),
        payload_com=lead.constants.get("com"),
    )


class Gathering:
    """The signals of a recording at the leading topic's times, topic by topic.

    `used` are topics beside the leading one that gave a signal.
    """

    def __init__(self, lead: Stream, request: ReadChoice, path: Path) -> None:
        self.lead, self.path = lead, path
        self.items = request.spec.items
        self.signals: dict[str, Array] = {}
        self.used: set[str] = set()
        self.remarks: list[Remark] = []
        if lead.mixed:
            self.remarks.append(fact("joints-reordered", topic=lead.topic))
        for signal, value in lead.signals.items():
            if signal != "wrench" and value.shape[1] != lead.width:
                continue
            if signal == "wrench" or not np.isnan(value).all():
                self.signals[signal] = value
            elif signal == "q":
                raise LogError(
                    f"{self.path}: the positions in {lead.topic} are NaN in all "
                    f"{lead.messages} messages. Record another topic."
                )
            else:  # drivers publish NaN for what they do not measure
                self.remarks.append(fact("signal-empty", signal=signal))
        if lead.kind.franka and "tau_ext" in self.signals:
            self.remarks.append(RESIDUAL_TURNED)
        self._settle_effort()

    def _settle_effort(self) -> None:
        """Name the effort: as --columns says, else current for UR joints, else torque.

        --columns names a field or none, as in -tau=effort, current[mA]=effort, -tau.
        """
        there, lead = dict(self.signals), self.lead
        for item in self.items:
            # A wrench without a field is the one that is read anyway, of whichever topic.
            signal = SIGNALS.get(item.signal)
            if signal is None or (signal == "wrench" and not item.pattern):
                continue
            own = "effort" if signal in EFFORTS and "effort" in there else signal
            last = (item.pattern or "").rpartition(".")[2] or own
            source = FIELDS.get(last, last)
            if source not in there:
                fields = {signal: name for name, signal in FIELDS.items()}
                listed = ", ".join(fields.get(name, name) for name in there)
                raise LogError(f"--columns: {lead.topic} has no field {last!r}; it has {listed}.")
            self.signals.pop(source, None)
            self.signals[signal] = there[source] * item.factor + 0.0
            minus = "-" if item.factor < 0 else ""
            self.remarks.append(fact("field-used", field=f"{minus}{last}", signal=signal))
        if "effort" in self.signals:
            kind = effort_of(lead.names)
            self.signals[kind] = self.signals.pop("effort")
            if kind == "current":
                self.remarks.append(fact("effort-is-current"))

    def take(self, stream: Stream) -> None:
        """Take what another topic has of the same joints, and the leading one has not."""
        lead = self.lead
        if not stream.topic.startswith(OWN):
            if stream is not lead and same_arm(stream, lead):
                for signal in [s for s in stream.signals if s not in {"effort", *self.signals}]:
                    self.interpolate(stream, signal)
            return
        # Of an MCAP by vftcli convert, /vftcli/SIGNAL, sample by sample.
        name = stream.topic.removeprefix(OWN)
        signal = SIGNALS.get(name, name)
        value = stream.signals.get("wrench" if signal == "wrench" else "effort")
        if value is None or signal not in SIGNALS.values():
            return
        if not np.array_equal(stream.host, lead.host):
            return
        if signal in EFFORTS and lead.kind.names:
            # /joint_states' effort said the same without its kind.
            for other in set(EFFORTS) & set(self.signals):
                if all(map(np.array_equal, pieces(self.signals[other]), pieces(value))):
                    del self.signals[other]
        self.signals[signal] = value

    def take_wrench(self, streams: Sequence[Stream]) -> WrenchFrame | None:
        """Add a sensor's or the vendor's wrench; its frame, by --columns or the bag."""
        said = next((item for item in self.items if item.signal == "wrench"), None)
        named = said is not None and said.pattern is not None
        frame = FRANKA_FRAME if self.lead.kind.franka else None
        # A sensor's topic goes before the vendor's, the fullest before the others.
        found = [s for s in streams if s.channel.type == "geometry_msgs/WrenchStamped"]
        sensors = [s for s in found if not VENDOR_WRENCH.search(s.topic)]
        sensor = max(sensors or found, key=lambda s: s.messages, default=None)
        if sensor is None or named or (not sensors and "wrench" in self.lead.signals):
            pass
        elif sensor.topic.startswith(OWN):
            frame = WrenchFrame.of_conversion(sensor.frame)
        elif self.interpolate(sensor, "wrench"):
            # A frame_id is a link's name, of which the moment's point is the origin.
            frame = WrenchFrame(sensor.frame, sensor.frame) if sensor.frame else None
        if said is None:
            return frame
        if "wrench" not in self.signals:
            raise LogError(
                f"{self.path}: --columns has a wrench, and no topic has one; leave it out."
            )
        if not named:
            self.signals["wrench"] = self.signals["wrench"] * said.factor + 0.0
        return frame if said.unit is None else WrenchFrame.parsed(said.unit)

    def interpolate(self, stream: Stream, signal: str) -> bool:
        """Whether a signal of another topic was interpolated at the leading times."""
        lead, topic = self.lead, stream.topic
        times, own, values = lead.host, stream.host, stream.signals[signal]
        # One of the two may have receive stamps only.
        if (times is lead.receive) != (own is stream.receive):
            times, own = lead.receive, stream.receive
        if signal != "wrench":
            # Another topic may hold other joints, or another order.
            if stream.names and lead.names and values.shape[1] == len(stream.names):
                values = values[:, [stream.names.index(name) for name in lead.names]]
            if values.shape[1] != lead.width:
                return False
        fresh = np.diff(own, prepend=own[0] - 1) > 0
        own, values = own[fresh], values[fresh]
        usual = median_step(own.astype(np.float64)) if len(own) > 1 else 0.0
        outside = (times < own[0] - NEAR * usual) | (times > own[-1] + NEAR * usual)
        if len(own) < 2 or np.mean(outside) > 0.05 or np.any(np.diff(own) < 0):
            self.remarks.append(caution("topic-too-short", signal=signal, topic=topic))
            return False
        # Whole nanoseconds are subtracted before they are scaled.
        x, xp = (np.asarray((stamps - own[0]) * 1e-9, float) for stamps in (times, own))
        self.signals[signal] = resample_columns(x, xp, values)
        self.used.add(topic)
        rate, leads = 1e9 / usual, lead.topic
        said = fact("signal-interpolated", signal=signal, topic=topic, rate_Hz=rate, lead=leads)
        self.remarks.append(said)
        return True

    def report_left_out(self, streams: Sequence[Stream], unread: dict[str, str]) -> None:
        """Remark messages and topics that were left out, forces first."""
        lead, topic = self.lead, self.lead.topic
        rest = (s for s in streams if s is not lead and s.channel == lead.channel)
        for stream in (s for s in rest if s.names == lead.names):
            there, count = tuple(stream.signals) or ("names",), stream.messages
            left = caution("messages-left-out", messages=count, topic=topic, signals=there)
            self.remarks.append(left)
        topics = {s.topic for s in streams if not s.topic.startswith(OWN)}
        topics |= {t for t, kind in unread.items() if FORCES.search(t) or FORCES.search(kind)}
        others = sorted(topics - {topic} - self.used, key=lambda t: (not FORCES.search(t), t))
        if others:
            self.remarks.append(fact("topics-left-out", topics=tuple(others[:6])))


#: Field of a JointState → signal.
FIELDS = {"position": "q", "velocity": "dq", "effort": "effort"}


def same_arm(stream: Stream, lead: Stream) -> bool:
    """Whether a stream is of the leading topic's joints, or names none."""
    if "q" not in stream.signals and "effort" not in stream.signals:
        return False
    if not stream.names or not lead.names:
        return "q" not in stream.signals or stream.width == lead.width
    return set(stream.names) >= set(lead.names) and not TARGETS.search(stream.topic)


def leading(
    streams: Sequence[Stream], path: Path, others: dict[str, str], request: ReadChoice
) -> Stream:
    """The leading topic: measured positions, most messages; a robot state if tied.

    One that --columns names, as in q=TOPIC.position, goes first.
    """
    measured = (s for s in streams if "q" in s.signals and not TARGETS.search(s.topic))
    found = [s for s in measured if s.messages > 1]
    found = [s for s in found if s.width > 2] or found
    named = {(i.pattern or "").rpartition(".")[0] for i in request.spec.items if i.signal == "q"}
    found = [s for s in found if s.topic in named] or found
    if not found:
        there = [f"{s.topic} ({s.channel.type})" for s in streams]
        there += [f"{topic} ({kind})" for topic, kind in others.items()]
        raise LogError(
            f"{path}: no topic with joint positions among {', '.join(there[:12]) or 'no topics'}. "
            "Record a JointState, FrankaState or FrankaRobotState topic."
        )
    most = max(s.messages for s in found)
    # Topics of one rate may differ by the messages lost at either end.
    near = [s for s in found if s.messages >= 0.9 * most]
    best = max(near, key=lambda s: (s.kind.franka, "effort" in s.signals, s.messages))
    # As many joints of other names, type and rate alike: another arm.
    like = (s for s in near if s.kind is best.kind and s.names and s.width == best.width)
    rivals = [s for s in like if set(s.names) != set(best.names)]
    if rivals:
        topics = ", ".join(s.topic for s in (best, *rivals))
        raise LogError(
            f"{path}: two arms were recorded: {topics} "
            f"({', '.join(best.names[:2])}… and {', '.join(rivals[0].names[:2])}…). Say which with "
            f"--columns 'q={best.topic}.position'."
        )
    return best


def clock_of(stream: Stream) -> dict[str, Any]:
    """A stream's best clock, as fields of RawLog: robot, header or recorder."""
    host, robot, topic = stream.host, stream.columns.get("robot"), stream.topic
    if robot is None or not runs(robot):
        unset = f"receive stamps of {topic} (its header stamps are unset or run back)"
        words = unset if host is stream.receive else f"header stamps of {topic}"
        return {"stamps": host, "tick": 1e-9, "clock": words}
    found = {"stamps": robot, "clock": f"robot clock (time of {topic})"}
    # Franka counts whole milliseconds, which seconds in float64 would blur.
    milliseconds = np.rint(robot * 1e3)
    if np.all(np.abs(robot * 1e3 - milliseconds) < 1e-3) and abs(robot[-1]) < 1e12:
        found |= {"stamps": milliseconds.astype(np.int64), "tick": 1e-3}
    return found


METADATA_BYTES = 1024 * 1024


def recognises(file: LogFile, _: LogFormat) -> bool:
    """Whether a folder holds files of a ROS 2 bag."""
    return bool(storage_files(file))


def read(file: LogFile, request: ReadChoice, _: LogFormat) -> RawLog:
    """Read any container of messages."""
    paths = [file.path / name for name in storage_files(file)]
    size = sum(path.stat().st_size for path in paths) if file.is_folder else len(file.content)
    budget = ReadBudget(path=file.path, size=size)
    decoder = Decoder(budget)
    documents = Documents(file.path, request, decoder)
    messages = 0
    for batch in batches([open_log(path) for path in paths] if paths else [file], budget):
        numbers = np.arange(messages, messages + len(batch.times))
        places = np.column_stack([numbers, batch.times])
        messages += len(numbers)
        if not documents.take(batch, places):
            decoder.take(batch, places)
    if "metadata.yaml" in file.entries:
        with (file.path / "metadata.yaml").open("rb") as metadata:
            text = metadata.read(METADATA_BYTES)
        match = re.search(rb"(?m)^  message_count: (\d{1,15})\s*$", text)
        if match and messages < (counted := int(match[1])):
            by = "metadata.yaml"
            budget.note(warning("messages-missing", kept=messages, counted=counted, by=by))
    if messages == 0:
        why = "; ".join(["no messages in any whole chunk", *map(str, budget.remarks)])
        raise LogError(f"{file.path}: {why}.")
    streams = [*decoder.streams.values()]
    topics = {channel.topic: channel.type or channel.encoding for channel in documents.found}
    # ROS messages go before documents: their types say what they hold.
    if documents.found and not any("q" in stream.signals for stream in streams):
        raw = documents.read({*topics, *(stream.topic for stream in streams)})
    else:
        raw = aligned(streams, file.path, request, decoder.others | topics)
    return replace(raw, remarks=(*budget.remarks, *raw.remarks))
