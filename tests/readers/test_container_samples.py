"""The samples of data sets, and a container of two arms; all others are in test_reach."""

from pathlib import Path

import numpy as np
import pytest

from vftcli.doctor import examine
from vftcli.readers.library import Library
from vftcli.readers.reader import ALL, ReadChoice
from vftcli.readers.reading import read, read_first_recording
from vftcli.robots import load_robot


def test_of_two_arms_the_first_is_described(samples: Path) -> None:
    pytest.importorskip("h5py", reason="h5py, the extra hdf5, is not installed")
    recording = read_first_recording(samples / "reach" / "aloha_episode_0.hdf5")
    assert "arm-side-chosen" in {remark.code for remark in recording.source.remarks}


EPISODES = (700, 600, 650)
"""Frames of the LeRobot sample's episodes."""


@pytest.mark.parametrize(
    ("name", "episodes"), [("lerobot_v3_effort", 3), ("lerobot_v21_effort", 2)]
)
def test_a_lerobot_sample_is_read_by_episode(name: str, episodes: int, samples: Path) -> None:
    import pyarrow.parquet as pq

    logs = list(Library().open_each([samples / name], ReadChoice(episode=ALL)))
    assert [log.samples for log in logs] == list(EPISODES[:episodes])
    files = sorted((samples / name / "data").rglob("*.parquet"))
    tables = [pq.read_table(file).to_pydict() for file in files]
    columns = {key: [v for table in tables for v in table[key]] for key in tables[0]}
    for k, log in enumerate(logs):
        rows = [r for r, number in enumerate(columns["episode_index"]) if number == k]
        for signal, feature in (("q", "state"), ("dq", "velocity"), ("torque", "effort")):
            stored = np.array(columns[f"observation.{feature}"])[rows, :7]
            np.testing.assert_array_equal(getattr(log, signal), stored)
        # frame / 25 Hz exactly; the stored stamps are that in 32 bits.
        np.testing.assert_array_equal(log.t, np.arange(log.samples) * (1 / 25))
        np.testing.assert_allclose(log.t, np.array(columns["timestamp"])[rows], atol=2e-6)
        assert (log.robot_hint, len(log.joint_names)) == ("panda", 7)


def test_an_effort_of_zeros_is_refused(samples: Path) -> None:
    recording = read(samples / "lerobot_v3_effort_zero")
    codes = {finding.code for finding in examine(recording, load_robot("panda")).refusals()}
    assert "zero-effort" in codes


@pytest.mark.parametrize("episode", [0, 1])
def test_the_droid_sample_is_read_by_its_robot_s_clock(episode: int, samples: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py, the extra hdf5, is not installed")
    recording = read(samples / "droid_raw", episode=episode)
    path = sorted((samples / "droid_raw").rglob("trajectory.h5"))[episode]
    with h5py.File(path) as file:
        state = file["observation/robot_state"]
        np.testing.assert_array_equal(recording.q, state["joint_positions"])
        np.testing.assert_array_equal(recording.torque, state["motor_torques_measured"])
        stamps = file["observation/timestamp/robot_state"]
        seconds = stamps["robot_timestamp_seconds"][()] - stamps["robot_timestamp_seconds"][0]
        nanos = stamps["robot_timestamp_nanos"][()] - stamps["robot_timestamp_nanos"][0]
    np.testing.assert_allclose(
        recording.t, seconds + 1e-9 * nanos, atol=1e-9
    )  # whole nanoseconds
    assert (recording.samples, recording.robot_hint) == (419, "panda")
    alone = read(path)
    np.testing.assert_array_equal(alone.q, recording.q)
    assert alone.robot_hint == "panda"
