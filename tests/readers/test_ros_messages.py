"""Messages are written as rosbags writes them, and the definitions are what it understands."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from vftcli.readers.bags.decode import long_name
from vftcli.signals.errors import OutputError
from vftcli.simulation.writers.rosbag2 import schema_text, serialised, stamped

STORE = get_typestore(Stores.ROS2_HUMBLE)
TIMES = np.array([0, 1_700_000_000_123_456_789, 4_000_000_000], dtype=np.int64)


def header(time, frame):
    stamp = STORE.types["builtin_interfaces/msg/Time"](sec=time // 10**9, nanosec=time % 10**9)
    return STORE.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


@pytest.mark.parametrize("kind", ["sensor_msgs/JointState", "geometry_msgs/WrenchStamped"])
def test_a_schema_embeds_every_type_it_needs(kind):
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schema_text(kind), long_name(kind)))
    message = serialised(kind, {**stamped(TIMES), "header.frame_id": "tool"}, len(TIMES))[1]
    header = store.deserialize_cdr(message.tobytes(), long_name(kind)).header
    assert (header.stamp.nanosec, header.frame_id) == (123_456_789, "tool")


@given(
    names=st.lists(st.text(max_size=9).filter(lambda text: "\0" not in text), max_size=8),
    joints=st.integers(0, 8),
    frame=st.text(max_size=7).filter(lambda text: "\0" not in text),
    seed=st.integers(0, 99),
)
def test_joint_states_are_the_bytes_that_rosbags_writes(names, joints, frame, seed):
    position, effort = np.random.default_rng(seed).normal(size=(2, len(TIMES), joints))
    values = {**stamped(TIMES), "header.frame_id": frame, "name": names}
    values |= {"position": position, "effort": effort}
    found = serialised("sensor_msgs/JointState", values, len(TIMES))
    kind = STORE.types["sensor_msgs/msg/JointState"]
    for k, time in enumerate(TIMES.tolist()):
        columns = {"position": position[k], "velocity": np.zeros(0), "effort": effort[k]}
        message = kind(header=header(time, frame), name=names, **columns)
        expected = bytes(STORE.serialize_cdr(message, "sensor_msgs/msg/JointState"))
        assert found[k].tobytes() == expected


def test_a_field_that_is_not_there_is_refused():
    with pytest.raises(OutputError, match="has no field positions"):
        serialised("sensor_msgs/JointState", {"positions": np.zeros((1, 6))}, 1)
