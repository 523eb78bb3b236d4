"""Conversion: what is written reads back, equal to the format's own precision."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from vftcli.analysis import Analysis
from vftcli.outputs import conversion
from vftcli.outputs.conversion import WRITERS, convert, ros_name, stamps_of, write_mcap
from vftcli.readers.reading import read
from vftcli.robots.terms import drive_torque
from vftcli.signals.errors import OutputError
from vftcli.signals.recording import JOINT_SIGNALS, Recording, Source
from vftcli.signals.wrench import WrenchFrame

NANOSECOND = 1e-9


def full(joints: int = 7, *, names: tuple[str, ...] = ()) -> Recording:
    rng = np.random.default_rng(joints)
    signals = {name: rng.normal(size=(50, joints)) for name in JOINT_SIGNALS}
    signals |= {"t": 0.004 * np.arange(50), "wrench": rng.normal(size=(50, 6))}
    frame = WrenchFrame("base", "tool", "by-robot")
    source = Source(t0=1_700_000_000.25, t0_ns=1_700_000_000_250_000_000)
    return Recording(wrench_frame=frame, joint_names=names, source=source, **signals)


FRANKA = tuple(f"fr3_joint{j}" for j in range(1, 8))


@pytest.mark.parametrize("ending", WRITERS)
@pytest.mark.parametrize("names", [(), FRANKA])
def test_every_signal_reads_back(tmp_path: Path, ending: str, names: tuple[str, ...]) -> None:
    recording = full(names=names)
    convert(recording, tmp_path / f"x{ending}")
    back = read(tmp_path / f"x{ending}")
    assert back.signals == recording.signals
    for name in (*JOINT_SIGNALS, "wrench"):
        np.testing.assert_array_equal(getattr(back, name), getattr(recording, name))
    np.testing.assert_allclose(back.t, recording.t, atol=NANOSECOND / 2)
    # the stamps are nanoseconds, but a float64 of today's date holds no more than 240 of them
    assert back.source.t0 == pytest.approx(recording.source.t0, abs=3e-7)
    if ending != ".csv":
        assert back.wrench_frame == recording.wrench_frame
        assert names in ((), back.joint_names)


@pytest.mark.parametrize("ending", WRITERS)
@pytest.mark.parametrize("kept", [("current",), ("torque",), ()])
def test_the_kind_of_effort_survives(tmp_path: Path, ending: str, kept: tuple[str, ...]) -> None:
    log = full(6)
    log = Recording(t=log.t, q=log.q, **{name: getattr(log, name) for name in kept})
    convert(log, tmp_path / f"x{ending}")
    assert read(tmp_path / f"x{ending}").signals == ("q", *kept)


def test_what_is_converted_is_read_by_rosbags(tmp_path: Path) -> None:
    """The effort of /joint_states is the torque [N·m], not the current; joints have names."""
    recording = full()
    convert(recording, tmp_path / "x.mcap")
    found = messages_of(tmp_path / "x.mcap")["/joint_states"]
    assert found[0][1].name == [f"joint_{j}" for j in range(1, 8)]
    assert found[0][1].header.stamp.nanosec == 250_000_000
    for field, signal in (("position", "q"), ("velocity", "dq"), ("effort", "torque")):
        values = [getattr(message, field) for _, message in found]
        np.testing.assert_array_equal(values, getattr(recording, signal))


def test_unknown_endings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"\.parquet, \.mcap, \.csv"):
        convert(full(), tmp_path / "x.xlsx")
    assert list(tmp_path.iterdir()) == []


def test_columns_say_what_they_hold(tmp_path: Path) -> None:
    """Also the sign of the log's own wrench: the force by the robot here."""
    convert(full(), tmp_path / "x.parquet")
    found = json.loads(pl.read_parquet_metadata(tmp_path / "x.parquet")["vftcli"])
    names = pl.read_parquet_schema(tmp_path / "x.parquet")
    assert {name.partition("/")[0] for name in names} == set(found["columns"])
    assert (found["columns"]["current"], found["columns"]["tau"]) == ("A", "N·m")
    assert found["wrench_frame"] == "base@tool,by-robot"


@pytest.fixture(scope="module")
def path(touched: Analysis, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of three blocks of samples, with two contacts."""
    path = tmp_path_factory.mktemp("mcap") / "estimates.mcap"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(conversion, "BLOCK", 256)
        write_mcap(path, touched)
    return path


@pytest.fixture(scope="module")
def messages(path: Path) -> dict[str, list]:
    return messages_of(path)


def messages_of(path: Path) -> dict[str, list]:
    """Topic → (stamp in the file, message), read by rosbags."""
    found: dict[str, list] = {}
    with AnyReader([path]) as reader:
        for connection, stamp, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((stamp, message))
    return found


def test_mcap_and_rosbags_read_every_sample(path: Path, messages: dict[str, list]) -> None:
    """Every message of the file by the format's own reader, in the order of time as written."""
    observers = ("best", "fdo", "gmo", "kfo_fe", "kfo_zoh", "reference")
    topics = ["/joint_states", *(f"/vftcli/external/{name}" for name in observers)]
    counts = dict.fromkeys([*topics, "/vftcli/wrench/best"], 600)
    assert {topic: len(found) for topic, found in messages.items()} == counts
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        found = list(reader.iter_messages(log_time_order=False))
    assert len(found) == sum(counts.values())
    stamps = [message.log_time for _, _, message in found]
    assert stamps == sorted(stamps)
    assert {schema.encoding for schema, _, _ in found} == {"ros2msg"}


def test_the_best_wrench_is_at_the_flange(messages: dict[str, list], touched: Analysis) -> None:
    found = [message for _, message in messages["/vftcli/wrench/best"]]
    assert {message.header.frame_id for message in found} == {"flange"}
    force = [[m.wrench.force.x, m.wrench.force.y, m.wrench.force.z] for m in found]
    moment = [[m.wrench.torque.x, m.wrench.torque.y, m.wrench.torque.z] for m in found]
    np.testing.assert_array_equal(np.hstack([force, moment]), touched.wrenches[0].known)


def test_wrenches_in_base_axes_say_about_where(with_wrench: Analysis, tmp_path: Path) -> None:
    """The flange is where their moment refers to: the frame of base would be another."""
    write_mcap(tmp_path / "wrench.mcap", with_wrench)
    found = messages_of(tmp_path / "wrench.mcap")
    wrenches = [each for topic, each in found.items() if topic.startswith("/vftcli/wrench")]
    assert {m.header.frame_id for each in wrenches for _, m in each} == {"base@flange"}


def test_states_are_the_log_and_estimates(messages: dict[str, list], analysis: Analysis) -> None:
    """The log's first stamp is 100.25 s."""
    states = [message for _, message in messages["/joint_states"]]
    recording = analysis.recording
    torque = drive_torque(recording, analysis.robot)
    np.testing.assert_array_equal([m.position for m in states], recording.q)
    np.testing.assert_array_equal([m.velocity for m in states], recording.dq)
    np.testing.assert_array_equal([m.effort for m in states], torque)
    assert {tuple(m.name) for m in states} == {analysis.robot.chain.names}
    found = [message.effort for _, message in messages["/vftcli/external/kfo_fe"]]
    np.testing.assert_array_equal(found, analysis.estimates[3].tau)
    assert len(messages["/vftcli/external/kfo_fe"][0][1].position) == 0
    expected = np.round(analysis.t * 1e9).astype(int) + 100_250_000_000
    inside = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in states]
    stamps = [stamp for stamp, _ in messages["/joint_states"]]
    assert stamps == inside == expected.tolist()


def test_names_and_stamps_are_as_ros_allows_them() -> None:
    assert [ros_name(name) for name in ("größe", "rts auto 2")] == ["gr__e", "rts_auto_2"]
    t = np.array([0.0, 0.5])

    def stamps(t0: float) -> list[int]:
        return stamps_of(Recording(t=t, q=np.zeros((2, 1)), source=Source(t0=t0))).tolist()

    assert stamps(100.25) == [100_250_000_000, 100_750_000_000]
    assert stamps(-1.0) == [0, 500_000_000]
    last = 2.0**31 - 1  # seconds that a signed word of 32 bits can hold
    assert stamps(last)[0] == (2**31 - 1) * 10**9
    assert stamps(last + 0.75) == [0, 500_000_000]
