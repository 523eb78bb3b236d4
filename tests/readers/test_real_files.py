"""Every sample and every real log is read as what it is, or refused with the right reason."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vftcli.readers.reader import ALL, ReadChoice
from vftcli.readers.reading import Library, read
from vftcli.signals.errors import VftError

TABLE_31 = "t,q:6,dq:6,current:6,target_current:6,target_torque:6"
FR3 = "t[ns],q:7,dq:7,tau:7,-tau_ext:7,_:13"

SAMPLES = {
    # by name: its format, joints, samples and rate in Hz
    "ur_official.csv": ("ur-csv", 6, 299, 125),
    "ur_official_win.csv": ("ur-csv", 6, 299, 125),
    "ur_official.bin": ("ur-binary", 6, 299, 125),
    "ur_rtde_sel.csv": ("ur-rtde", 6, 1494, 500),
    "ur_rtde_cb3.csv": ("ur-rtde", 6, 372, 125),
    "libfranka_0.8.csv": ("libfranka-csv-old", 7, 50, 1000),
    "libfranka_0.15.csv": ("libfranka-csv", 7, 50, 1000),
    "libfranka_0.8_state.jsonl": ("libfranka-json", 7, 50, 1000),
    "libfranka_0.15_state.jsonl": ("libfranka-json", 7, 50, 1000),
    "franka_ros1.bag": ("rosbag1", 7, 200, 1000),
    "x.bag.active": ("rosbag1", 7, 200, 1000),
    "ros2_mcap": ("rosbag2", 7, 200, 1000),
    "ros2_mcap_zfile": ("rosbag2", 7, 200, 1000),
    "ros2_mcap_zstor": ("rosbag2", 7, 200, 1000),
    "ros2_db3": ("rosbag2", 7, 200, 1000),
    "ros2_db3_zmsg": ("rosbag2", 7, 200, 1000),
    "humble_db3": ("rosbag2", 7, 200, 1000),
    "multi.mcap": ("mcap", 7, 200, 1000),
    "multi_trunc.mcap": ("mcap", 7, 137, 1000),
    "ros1prof.mcap": ("mcap", 7, 200, 1000),
    "json.mcap": ("mcap", 6, 100, 500),
    "panda_py.npz": ("npz", 7, 100, 1000),
    "panda_py.pkl": ("pickle", 7, 100, 1000),
    "frankapy.pkl": ("pickle", 7, 100, 100),
}

UR10E = (
    ("free_12harm", 5457), ("free_14harm", 5375), ("free_repeat_a", 759), ("free_repeat_b", 912),
    ("free_repeat_c", 660), ("jointwise_2", 6030), ("jointwise_4", 6288), ("load_14harm", 5307),
    ("push_pose", 1727),
)  # fmt: skip
"""Tables of 31 columns and their samples."""

LOGS = {
    **{f"ur10e/{name}.csv": (TABLE_31, "headerless", 6, samples, 100) for name, samples in UR10E},
    "fr3/run_a.npy": (FR3, "npy", 7, 10384, 974),
    "fr3/run_b.npy": (FR3, "npy", 7, 10048, 983),
    "franka_bags/calib_0108.bag": (None, "rosbag1", 7, 32, 29.4),
    "franka_bags/calib_0308.bag": (None, "rosbag1", 7, 23, 29.4),
    "libfranka_sim/pushes.csv.gz": (None, "table", 7, 28001, 1000),
    "mujoco_ur5e/circle.csv": (None, "table", 6, 2500, 125),
    "other_robot_yu_cobot.parquet": ("segment=1", "parquet", 6, 100, 99.4),
    "rtde/blank_lines.csv": (None, "ur-csv", 6, 10, 125),
    "rtde/static_cb3.csv": (None, "ur-csv", 6, 2590, 125),
    "rtde/ur3e_25hz_cr_line_ends.csv": (None, "ur-rtde", 6, 65, 25),
    "ur3/identification.bag": (None, "rosbag1", 6, 5941, 125),
    "ur3/repeat_a.bag": (None, "rosbag1", 6, 1872, 125),
    "ur3/repeat_b.bag": (None, "rosbag1", 6, 3156, 125),
}

REFUSED = {
    "samples/fox.mcap": "no joint positions",
    "samples/trunc.mcap": "no messages in any whole chunk",
    "samples/trunc.bag": "no messages in any whole chunk",
    "logs/fr3/run_a.npy": "42 columns without a header",
    "logs/other_robot_yu_cobot.parquet": "4 recordings one after another",
    "logs/panda_ati/press_1.csv": r"no joint positions .*compare --reference sensor --wrench",
    "logs/panda_ati/traj_raw.csv": r"no joint positions .*compare --reference sensor --wrench",
    "logs/libfranka_sim/pushes_truth.csv.gz": "no joint positions",
    **{f"logs/panda_exciting/exciting_traj_{name}.txt": "single column"
       for name in ("positions", "time", "torques", "velocity")},
}  # fmt: skip


@pytest.mark.parametrize("name", SAMPLES)
def test_samples(samples, name):
    recording = read(samples / name)
    found = (recording.source.format, recording.joints, recording.samples)
    assert found == SAMPLES[name][:3]
    assert 1 / recording.median_step == pytest.approx(SAMPLES[name][3], rel=1e-3)


@pytest.mark.parametrize("name", LOGS)
def test_real_logs(logs, name):
    columns, *expected, rate = LOGS[name]
    recording = read(logs / name, columns=columns)
    assert [recording.source.format, recording.joints, recording.samples] == expected
    assert 1 / recording.median_step == pytest.approx(rate, rel=1e-3)


@pytest.mark.parametrize("name", REFUSED)
def test_files_that_hold_no_log_or_need_a_word(logs, samples, name):
    kind, _, name_there = name.partition("/")
    with pytest.raises(VftError, match=REFUSED[name]):
        read((samples if kind == "samples" else logs) / name_there)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["logs", "samples"])
def test_every_file_there_is_read_or_refused_in_one_line(request, kind):
    """Files that no table above names, too: whatever is put there, nothing ends in a traceback."""
    folder: Path = request.getfixturevalue(kind)
    paths = [path for path in sorted(folder.rglob("*")) if path.suffix not in {".toml", ".md"}]
    assert paths
    for path in paths:
        try:
            assert read(path).samples > 0, path
        except VftError as error:
            said = str(error)
            assert said.startswith(f"{path}:"), path
            assert "\n" not in said, path


def test_text_and_binary_of_one_recording_agree(samples):
    text, binary = read(samples / "ur_official.csv"), read(samples / "ur_official.bin")
    for name in text.signals:
        np.testing.assert_array_equal(getattr(text, name), getattr(binary, name))


def typed_messages(path: Path, kind: str) -> list[Any]:
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        found = [(c.msgtype, raw) for c, _, raw in reader.messages() if kind in c.msgtype]
        return [reader.deserialize(raw, msgtype) for msgtype, raw in found]


@pytest.mark.parametrize("name", ["ros2_mcap", "ros2_db3", "franka_ros1.bag"])
def test_bulk_and_typed_decoding_agree_on_samples(samples, name):
    recording, states = read(samples / name), typed_messages(samples / name, "franka_msgs")
    measured = [getattr(s, "measured_joint_state", s) for s in states]
    q = [getattr(m, "position", getattr(m, "q", None)) for m in measured]
    np.testing.assert_array_equal(recording.q, q)
    residual = [getattr(s.tau_ext_hat_filtered, "effort", s.tau_ext_hat_filtered) for s in states]
    np.testing.assert_array_equal(recording.tau_ext, 0.0 - np.array(residual))


def test_bulk_and_typed_decoding_agree_on_a_real_bag(logs):
    path = logs / "ur3" / "identification.bag"
    recording, typed = read(path), typed_messages(path, "")
    np.testing.assert_array_equal(recording.q, [m.position for m in typed])
    np.testing.assert_array_equal(recording.torque, [m.effort for m in typed])
    stamp = typed[0].header.stamp
    assert recording.source.t0_ns == stamp.sec * 10**9 + stamp.nanosec


LEROBOT = {"lerobot_v3_effort": [700, 600, 650], "lerobot_v21_effort": [700, 600]}


@pytest.mark.parametrize("name", LEROBOT)
def test_a_lerobot_sample_is_read_by_episode(name, samples):
    import pyarrow.parquet as pq

    logs = list(Library().open_each([samples / name], ReadChoice(episode=ALL)))
    assert [log.samples for log in logs] == LEROBOT[name]
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


@pytest.mark.parametrize("episode", [0, 1])
def test_the_droid_sample_is_read_by_its_robot_s_clock(episode, samples):
    h5py = pytest.importorskip("h5py", reason="h5py, the extra hdf5, is not installed")
    recording = read(samples / "droid_raw", episode=episode)
    path = sorted((samples / "droid_raw").rglob("trajectory.h5"))[episode]
    with h5py.File(path) as file:
        state = file["observation/robot_state"]
        np.testing.assert_array_equal(recording.q, state["joint_positions"])
        np.testing.assert_array_equal(recording.torque, state["motor_torques_measured"])
        stamps = file["observation/timestamp/robot_state"]
        counts = (stamps[f"robot_timestamp_{unit}"][()] for unit in ("seconds", "nanos"))
        seconds, nanos = (count - count[0] for count in counts)
    # whole nanoseconds
    np.testing.assert_allclose(recording.t, seconds + 1e-9 * nanos, atol=1e-9)
    alone = read(path)
    assert (alone.samples, alone.robot_hint, recording.robot_hint) == (419, "panda", "panda")
    np.testing.assert_array_equal(alone.q, recording.q)
