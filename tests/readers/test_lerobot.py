"""LeRobot datasets: which episode, which joints, which arm; and what contradicts itself."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from seed_logs import motion

from vftcli.readers.reader import ALL, ReadChoice
from vftcli.readers.reading import Library, read
from vftcli.signals.errors import LogError, ParameterError
from vftcli.signals.recording import refuse_repeated_logs

JOINTS = [f"joint_{j}" for j in range(1, 8)]
ROWS = (30, 20, 25)
FPS = 25
LOG = motion(7, rows=sum(ROWS), step=1 / FPS)
STATE = [*(f"{joint}.pos" for joint in JOINTS), "gripper.pos"]

Features = dict[str, tuple[np.ndarray, Any]]
"""Feature → its numbers, and its elements' names."""

USUAL: Features = {
    "observation.state": (np.hstack([LOG["q"], np.full((sum(ROWS), 1), 9.0)]), STATE),
    "observation.velocity": (LOG["dq"], [f"{joint}.vel" for joint in JOINTS]),
    "observation.effort": (LOG["tau"], [f"{joint}.effort" for joint in JOINTS]),
    "action": (LOG["q"], STATE[:7]),
}


def dataset(
    folder: Path,
    features: Features = USUAL,
    *,
    version: int = 3,
    files: tuple[int, ...] = (0, 0, 1),
) -> Path:
    """A dataset of three episodes, in data files of these numbers (version 3) or one each."""
    import pyarrow as pa
    from pyarrow.parquet import write_table

    index, episode = np.arange(sum(ROWS)), np.repeat(np.arange(3), ROWS)
    first = np.cumsum([0, *ROWS[:-1]])
    frame = index - first[episode]
    columns = {name: list(numbers) for name, (numbers, _) in features.items()}
    columns |= {"timestamp": (frame / FPS).astype(np.float32), "frame_index": frame}
    table = pa.table(columns | {"episode_index": episode, "index": index})
    numbered = [f"chunk-{k // 2:03d}/episode_{k:06d}" for k in range(3)]
    place = [f"chunk-000/file-{k:03d}" for k in files] if version == 3 else numbered
    meta = folder / "meta"
    (meta / "episodes" / "chunk-000").mkdir(parents=True)
    for name in set(place):
        path = folder / "data" / f"{name}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_table(table.take(np.flatnonzero([place[k] == name for k in episode])), path)
    if version == 3:
        reported = {"episode_index": [0, 1, 2], "length": ROWS, "data/file_index": files}
        reported |= {"dataset_from_index": first, "dataset_to_index": first + ROWS}
        reported |= {"data/chunk_index": [0] * 3}
        write_table(pa.table(reported), meta / "episodes" / "chunk-000" / "file-000.parquet")
    else:
        lines = ({"episode_index": k, "tasks": [], "length": ROWS[k]} for k in range(3))
        (meta / "episodes.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    info = {
        "codebase_version": f"v{version}.0", "robot_type": "fr3", "fps": FPS, "total_episodes": 3,
        "chunks_size": 2,
        "features": {name: {"names": names} for name, (_, names) in features.items()},
    }  # fmt: skip
    (meta / "info.json").write_text(json.dumps(info))
    return folder


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("episode", [0, 1, 2])
def test_an_episode_is_its_rows(version, episode, tmp_path):
    recording = read(dataset(tmp_path, version=version), episode=episode)
    rows = slice(sum(ROWS[:episode]), sum(ROWS[: episode + 1]))
    for signal, name in (("q", "q"), ("dq", "dq"), ("torque", "tau")):
        np.testing.assert_array_equal(getattr(recording, signal), LOG[name][rows])
    # frame_index / fps, not its rounding to 32 bits.
    np.testing.assert_array_equal(recording.t, np.arange(ROWS[episode]) * (1 / FPS))
    assert recording.joint_names == tuple(JOINTS)
    assert (recording.robot_hint, recording.source.remarks) == ("fr3", ())
    assert recording.source.clock == "column frame_index at 25 Hz"
    turned = read(tmp_path, columns="-tau", episode=episode)
    np.testing.assert_array_equal(turned.torque, -recording.torque)
    np.testing.assert_array_equal(turned.q, recording.q)


def test_all_episodes_are_logs_of_their_own(tmp_path):
    path = dataset(tmp_path / "set")
    logs = list(Library([path]).open_each([path], ReadChoice(episode=ALL)))
    assert [log.name for log in logs] == ["set episode 0", "set episode 1", "set episode 2"]
    assert [log.samples for log in logs] == list(ROWS)
    with pytest.raises(ParameterError, match="commands that take several logs"):
        Library([path]).open(path, ReadChoice(episode=ALL))
    with pytest.raises(ParameterError, match="are one run"):
        refuse_repeated_logs(list(Library([path]).open_each([path, path], ReadChoice(episode=1))))


def test_the_first_is_taken_and_said(tmp_path):
    path = dataset(tmp_path / "set")
    recording = read(path)
    assert recording.source.warnings == ("episode 0, of 3 in all: --episode K|all",)
    assert recording.name == "set episode 0"
    file = path / "data" / "chunk-000" / "file-000.parquet"
    alone = read(file, columns="t=timestamp,q=observation.state[0:7]", episode=1)
    np.testing.assert_array_equal(alone.q, LOG["q"][30:50])
    for place, words in ((path, "it holds 3, from 0 to 2"), (file, "it holds 2, from 0 to 1")):
        with pytest.raises(LogError, match=f"no episode 3; {words}"):
            read(place, episode=3)


def test_a_file_elsewhere_than_the_table_says_is_found(tmp_path):
    path = dataset(tmp_path)
    data = path / "data" / "chunk-000"
    (data / "file-001.parquet").rename(data / "episode_000002.parquet")
    np.testing.assert_array_equal(read(path, episode=2).q, LOG["q"][50:])


def test_stamps_are_the_clock_of_rows_without_numbers_of_frames(tmp_path):
    path = dataset(tmp_path)
    for file in path.rglob("data/*/*.parquet"):
        pl.read_parquet(file).drop("frame_index").write_parquet(file)
    recording = read(path, episode=0)
    assert recording.source.clock == "column timestamp"
    np.testing.assert_allclose(recording.t, np.arange(30) / FPS, atol=1e-7)  # float32


def test_rows_count_and_not_what_is_said_of_them_beside(tmp_path):
    """Episodes are those of the rows; a file of one that holds another's is refused."""
    path = dataset(tmp_path, version=2)
    (path / "meta" / "episodes.jsonl").write_text('{"episode_index": 7}')
    first, second, third = sorted(path.rglob("*.parquet"))
    third.rename(first)
    with pytest.raises(LogError, match="no row is of episode 0, which its name promises"):
        read(path, episode=0)
    np.testing.assert_array_equal(read(path, episode=1).q, LOG["q"][30:50])
    second.rename(second.with_name("file-000.parquet"))
    np.testing.assert_array_equal(read(path, episode=1).q, LOG["q"][30:50])


def test_numbers_of_the_state_are_reported_apart_by_their_names(tmp_path):
    """One state for all, joints in no order, a wrist's wrench behind them."""
    order = [3, 0, 6, 1, 5, 2, 4]
    parts = {"positions": LOG["q"], "velocities": LOG["dq"], "efforts": LOG["tau"]}
    names = [f"joint_{kind}.{j}" for kind in parts for j in order]
    state = np.hstack([numbers[:, order] for numbers in parts.values()] + [LOG["q"][:, :3]])
    names += [f"wrist_wrench.force.{axis}" for axis in "xyz"]
    path = dataset(tmp_path, {"observation.state": (state, {"motors": names})})
    recording = read(path, episode=0)
    np.testing.assert_array_equal(recording.q, LOG["q"][:30])
    np.testing.assert_array_equal(recording.torque, LOG["tau"][:30])
    assert recording.joint_names == tuple(f"joint_{j}" for j in range(7))
    assert [remark.code for remark in recording.source.remarks] == ["wrench-left-out"]


def test_signals_are_laid_together_by_the_joints_names(tmp_path):
    turned = {"observation.effort": (LOG["tau"][:, ::-1], [f"{j}.effort" for j in JOINTS[::-1]])}
    recording = read(dataset(tmp_path, USUAL | turned), episode=0)
    np.testing.assert_array_equal(recording.torque, LOG["tau"][:30])
    other = {"observation.effort": (LOG["tau"], [f"axis_{k}.effort" for k in range(7)])}
    with pytest.raises(LogError, match="torque is of the joints axis_0"):
        read(dataset(tmp_path / "other", USUAL | other))


def test_two_arms_are_reported_apart(tmp_path):
    names = [f"{side}_{joint}.pos" for side in ("left", "right") for joint in JOINTS]
    features: Features = {
        "observation.state": (np.hstack([LOG["q"], -LOG["q"]]), names),
        "observation.torque.left": (LOG["tau"], None),
        "observation.torque.right": (-LOG["tau"], None),
    }
    path = dataset(tmp_path / "set", features)
    with pytest.raises(LogError, match=r"two arms \(by name\); .* --arm left or --arm right"):
        read(path)
    right = read(path, arm="right", episode=1)
    np.testing.assert_array_equal(right.q, -LOG["q"][30:50])
    np.testing.assert_array_equal(right.torque, -LOG["tau"][30:50])
    assert right.name == "set episode 1 right arm"


def test_a_pose_is_no_joints(tmp_path):
    names = ["x", "y", "z", "roll", "pitch", "yaw", "gripper"]
    path = dataset(tmp_path, {"observation.state": (LOG["q"], names)})
    with pytest.raises(LogError, match=r"no joint positions among observation\.state"):
        read(path)


def test_degrees_are_refused_until_they_are_said(tmp_path):
    names = [f"{name}.pos" for name in ("pan", "lift", "elbow", "flex", "roll_", "turn", "end")]
    path = dataset(tmp_path, {"observation.state": (90 * LOG["q"], names)})
    with pytest.raises(LogError, match="degrees"):
        read(path)
    said = read(path, columns="q[deg]=observation.state", episode=0)
    np.testing.assert_allclose(said.q, np.radians(90 * LOG["q"][:30]), rtol=1e-15)


def test_a_wrench_is_named_and_taken_where_it_is_said_to_be_one(tmp_path):
    path = dataset(tmp_path, USUAL | {"observation.wrench": (LOG["q"][:, :6], None)})
    (remark,) = read(path, episode=0).source.remarks
    assert (remark.code, remark.values["features"]) == ("wrench-left-out", "observation.wrench")
    taken = read(path, columns="wrench[flange]=observation.wrench", episode=0)
    np.testing.assert_array_equal(taken.wrench, LOG["q"][:30, :6])
    assert taken.source.remarks == ()


@pytest.mark.parametrize("text", ["{", "\xe5", "[]", '{"features": []}'])
def test_a_damaged_description_is_refused(text, tmp_path):
    path = dataset(tmp_path, version=2)
    (path / "meta" / "info.json").write_text(text, encoding="latin-1")
    with pytest.raises(LogError, match="not a readable description"):
        read(path)


def test_a_description_beyond_64_mebibytes_is_refused_unread(tmp_path):
    path = dataset(tmp_path, version=2) / "meta" / "info.json"
    text = path.read_bytes()
    path.write_bytes(text.ljust(1 << 20))
    assert read(tmp_path, episode=0).samples == 30  # it may be as long as a mebibyte
    with path.open("r+b") as file:
        file.truncate((64 << 20) + 1)  # a hole, no bytes
    with pytest.raises(LogError, match=r"info\.json: larger than 64 MiB; no description is\.$"):
        read(tmp_path)
