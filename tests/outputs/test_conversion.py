"""Conversion: what is written reads back, equal to the format's own precision."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from vftcli.outputs.conversion import WRITERS, convert
from vftcli.readers import read
from vftcli.signals.errors import OutputError
from vftcli.signals.recording import JOINT_SIGNALS, Recording, Source
from vftcli.signals.wrench import WrenchFrame

NANOSECOND = 1e-9


def full(joints: int = 7, *, names: tuple[str, ...] = ()) -> Recording:
    rng = np.random.default_rng(joints)
    samples = 50
    signals = {name: rng.normal(size=(samples, joints)) for name in JOINT_SIGNALS}
    return Recording(
        t=0.004 * np.arange(samples),
        **signals,
        wrench=rng.normal(size=(samples, 6)),
        wrench_frame=WrenchFrame("base", "tool", "by-robot"),
        joint_names=names,
        source=Source(t0=1_700_000_000.25, t0_ns=1_700_000_000_250_000_000),
    )


FRANKA = tuple(f"fr3_joint{j}" for j in range(1, 8))


@pytest.mark.parametrize("ending", WRITERS)
@pytest.mark.parametrize("names", [(), FRANKA])
def test_every_signal_reads_back(tmp_path: Path, ending: str, names: tuple[str, ...]) -> None:
    recording = full(names=names)
    path = tmp_path / f"x{ending}"
    convert(recording, path)
    back = read(path)
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
    recording = full(6)
    recording = Recording(t=recording.t, q=recording.q, **{k: getattr(recording, k) for k in kept})
    convert(recording, tmp_path / f"x{ending}")
    assert read(tmp_path / f"x{ending}").signals == ("q", *kept)


def test_mcap_is_read_by_rosbags(tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    recording = full(names=FRANKA)
    convert(recording, tmp_path / "x.mcap")
    with AnyReader([tmp_path / "x.mcap"]) as reader:
        messages = [
            reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages()
            if connection.topic == "/joint_states"
        ]
    assert messages[0].name == list(FRANKA)
    np.testing.assert_array_equal([m.position for m in messages], recording.q)
    np.testing.assert_array_equal([m.effort for m in messages], recording.torque)
    assert messages[0].header.stamp.nanosec == 250_000_000


def test_what_exists_is_kept_and_unknown_endings_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("mine")
    with pytest.raises(OutputError, match="--force"):
        convert(full(), path)
    assert path.read_text() == "mine"
    convert(full(), path, force=True)
    assert path.read_text().startswith("t,t_src_ns,q/1")
    with pytest.raises(OutputError, match=r"\.parquet, \.mcap, \.csv"):
        convert(full(), tmp_path / "x.xlsx")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x.csv"]


def test_columns_say_what_they_hold(tmp_path: Path) -> None:
    """Also whose force the log's own wrench is, which is the robot's here."""
    convert(full(), tmp_path / "x.parquet")
    schema = pq.read_schema(tmp_path / "x.parquet")
    assert all((field.metadata or {}).get(b"unit") for field in schema)
    assert schema.field("current/1").metadata[b"unit"] == b"A"
    assert schema.field("wrench/fx").metadata[b"sign"] == b"by-robot"
    assert b"base axes" in schema.field("wrench/fx").metadata[b"frame"]
