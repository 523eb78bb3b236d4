import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from vftcli.analysis import Analysis
from vftcli.outputs.log import mcap_output
from vftcli.outputs.log.mcap_output import ros_name, stamps_of, write_mcap
from vftcli.robots.drive import drive_torque
from vftcli.signals.recording import Recording, Source


@pytest.fixture(scope="module")
def messages(analysis: Analysis, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list]:
    """Topic → (stamp in the file, message), read by rosbags; three blocks of samples."""
    path = tmp_path_factory.mktemp("mcap") / "estimates.mcap"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mcap_output, "BLOCK", 256)
        write_mcap(path, analysis)
    found: dict[str, list] = {}
    with AnyReader([path]) as reader:
        for connection, stamp, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((stamp, message))
    return found


def test_every_topic_has_every_sample(messages: dict[str, list]) -> None:
    observers = ("best", "fdo", "gmo", "kfo_fe", "kfo_zoh", "reference")
    topics = ["/joint_states", *(f"/vftcli/external/{name}" for name in observers)]
    assert {topic: len(messages[topic]) for topic in topics} == dict.fromkeys(topics, 600)
    assert len(messages["/robot_description"]) == 1
    assert set(messages) == {*topics, "/robot_description"}


def test_joint_states_are_the_log(messages: dict[str, list], analysis: Analysis) -> None:
    states = [message for _, message in messages["/joint_states"]]
    recording = analysis.recording
    torque = drive_torque(recording, analysis.robot)
    np.testing.assert_array_equal([m.position for m in states], recording.q)
    np.testing.assert_array_equal([m.velocity for m in states], recording.dq)
    np.testing.assert_array_equal([m.effort for m in states], torque)
    assert {tuple(m.name) for m in states} == {analysis.robot.chain.names}


def test_estimates_are_efforts(messages: dict[str, list], analysis: Analysis) -> None:
    found = [message.effort for _, message in messages["/vftcli/external/kfo_fe"]]
    np.testing.assert_array_equal(found, analysis.estimates[3].tau)
    assert len(messages["/vftcli/external/kfo_fe"][0][1].position) == 0


def test_stamps_are_the_logs_own(messages: dict[str, list], analysis: Analysis) -> None:
    """The log's first stamp is 100.25 s."""
    expected = np.round(analysis.t * 1e9).astype(int) + 100_250_000_000
    for stamp, message in messages["/joint_states"][:1] + messages["/joint_states"][-1:]:
        inside = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        assert stamp == inside
    assert [stamp for stamp, _ in messages["/joint_states"]] == expected.tolist()


@pytest.mark.parametrize(
    ("name", "shown"), [("kfo-fe", "kfo_fe"), ("größe", "gr__e"), ("rts auto 2", "rts_auto_2")]
)
def test_names_as_ros_allows_them(name: str, shown: str) -> None:
    assert ros_name(name) == shown


def test_stamps_that_ros_cannot_count_begin_at_zero() -> None:
    t = np.array([0.0, 0.5])

    def stamps(t0: float) -> list[int]:
        return stamps_of(Recording(t=t, q=np.zeros((2, 1)), source=Source(t0=t0))).tolist()

    assert stamps(100.25) == [100_250_000_000, 100_750_000_000]
    assert stamps(-1.0) == [0, 500_000_000]
    last = 2.0**31 - 1  # seconds that a signed word of 32 bits can hold
    assert stamps(last)[0] == (2**31 - 1) * 10**9
    assert stamps(last + 0.75) == [0, 500_000_000]
