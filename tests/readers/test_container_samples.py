"""The samples of containers: what `expected.json` says of each, and those of the data sets."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vftcli.doctor import examine
from vftcli.readers import ReadChoice, read, read_first_recording
from vftcli.readers.library import Library
from vftcli.robots import load_robot
from vftcli.signals.errors import LogError, UnknownFormatError
from vftcli.signals.recording import Recording

FORMATS = {
    "ur5_v5.mat": "mat", "ur5_v5_struct.mat": "mat", "ur5_v73.mat": "mat", "ur5.feather": "arrow",
    "ur5_stream.arrows": "arrow", "panda.jsonl": "json", "panda_py.json": "json",
    "frankapy.json": "json",
}  # fmt: skip
NEED_H5PY = {"ur5_v73.mat"}

ROUNDED = 2e-9
"""The samples' digits: the first and last values are told to nine decimals."""


@pytest.fixture(scope="module")
def expected(samples: Path) -> dict[str, Any]:
    """What is expected of each sample."""
    path = samples / "reach" / "expected.json"
    if not path.is_file():
        pytest.skip("the samples of containers are not beside VFT_LOGS")
    told: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return told


def check(recording: Recording, told: dict[str, Any]) -> None:
    """The first and last values are those that are told."""
    np.testing.assert_allclose(recording.t[[0, -1]], told["t"], rtol=0, atol=1e-9)
    for signal in ("q", "dq", "current", "torque", "tau_ext"):
        if signal in told:
            rows = getattr(recording, signal)[[0, -1]]
            wanted = [told[signal]["first"], told[signal]["last"]]
            np.testing.assert_allclose(rows, wanted, rtol=0, atol=ROUNDED)


@pytest.mark.parametrize("name", FORMATS)
def test_a_sample_is_read_as_expected(name: str, samples: Path, expected: dict[str, Any]) -> None:
    if name in NEED_H5PY:
        pytest.importorskip("h5py", reason="h5py, the extra hdf5, is not installed")
    recording, told = read(samples / "reach" / name), expected[name]
    assert recording.source.format == FORMATS[name]
    assert (recording.samples, recording.joints) == (told["samples"], told["joints"])
    assert 1 / recording.median_step == pytest.approx(told["rate_hz"], rel=1e-6)
    assert set(recording.signals) == set(told["signals"])
    check(recording, told)
    if "transposed" in told.get("must", ""):
        assert any(remark.code == "signals-turned" for remark in recording.source.remarks)


def test_a_workbook_is_refused_with_the_remedy(samples: Path, expected: dict[str, Any]) -> None:
    assert "save the sheet as CSV" in expected["ur5.xlsx"]["must"]
    with pytest.raises(UnknownFormatError, match="save the sheet as CSV"):
        read(samples / "reach" / "ur5.xlsx")


def test_aloha_has_two_arms(samples: Path, expected: dict[str, Any]) -> None:
    pytest.importorskip("h5py", reason="h5py, the extra hdf5, is not installed")
    path, told = samples / "reach" / "aloha_episode_0.hdf5", expected["aloha_episode_0.hdf5"]
    with pytest.raises(LogError, match="columns 0-5, right: columns 7-12"):
        read(path)
    for arm in ("left", "right"):
        recording = read(path, arm=arm)
        assert (recording.samples, recording.joints) == (told["samples"], told["joints"])
        check(recording, told[arm])
        assert recording.current is not None
        efforts = [told[arm]["effort"]["first"], told[arm]["effort"]["last"]]
        np.testing.assert_allclose(1e3 * recording.current[[0, -1]], efforts, rtol=1e-9)
    assert "arm-side-taken" in {remark.code for remark in read_first_recording(path).source.remarks}


def test_robomimic_has_episodes(samples: Path, expected: dict[str, Any]) -> None:
    pytest.importorskip("h5py", reason="h5py, the extra hdf5, is not installed")
    path, told = samples / "reach" / "robomimic_low_dim.hdf5", expected["robomimic_low_dim.hdf5"]
    for episode in (0, 1):
        recording = read(path, episode=episode)
        assert recording.samples == told["samples"][episode]
        assert (recording.joints, recording.robot_hint) == (told["joints"], "panda")
        assert set(recording.signals) == set(told["signals"])
        check(recording, told[f"demo_{episode}"])
    assert str(read(path).source.remarks[0]) == "episode 0 of 2: --episode K|all"


EPISODES = (700, 600, 650)
"""Frames of the LeRobot sample's episodes."""


@pytest.mark.parametrize(
    ("name", "episodes"), [("lerobot_v3_effort", 3), ("lerobot_v21_effort", 2)]
)
def test_a_lerobot_sample_is_read_by_episode(name: str, episodes: int, samples: Path) -> None:
    import pyarrow.parquet as pq

    logs = Library().open_logs([samples / name], ReadChoice(all_episodes=True))
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
    np.testing.assert_allclose(recording.t, seconds + 1e-9 * nanos, atol=1e-9)  # whole nanoseconds
    assert (recording.samples, recording.robot_hint) == (419, "panda")
    alone = read(path)
    np.testing.assert_array_equal(alone.q, recording.q)
    assert alone.robot_hint == "panda"
