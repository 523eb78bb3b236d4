"""Arrow, JSON, MATLAB and HDF5 files: what is read of each, and what is refused by name."""

import json
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
import seed_containers as seeds
from scipy.io import savemat
from seed_logs import ROWS, libfranka_json, motion

from vftcli.readers.hdf5 import numbers_of
from vftcli.readers.opening import open_log
from vftcli.readers.parquet import ArrowTable, claims
from vftcli.readers.reader import ALL, ReadChoice
from vftcli.readers.reading import episode_numbers, read, read_chosen, recognise
from vftcli.signals.errors import LogError, ParameterError

FORMATS = {
    "arrow": "arrow", "arrow-stream": "arrow", "json": "json", "json-skills": "json",
    "json-lines": "json", "mat": "mat", "mat-struct": "mat", "mat-73": "mat", "hdf5": "hdf5",
    "aloha": "hdf5",
}  # fmt: skip


NO_H5PY = "h5py, the extra hdf5, is not installed"


@pytest.fixture
def h5py() -> None:
    pytest.importorskip("h5py", reason=NO_H5PY)


def made(name: str, path: Path) -> Path:
    if name in seeds.NEED_H5PY:
        pytest.importorskip("h5py", reason=NO_H5PY)
    return seeds.SEEDS[name][0](path)


WHOLE = ("arrow", "arrow-stream", "mat", "mat-struct", "mat-73", "hdf5")
"""Those of the whole motion of six joints."""


@pytest.mark.parametrize("name", FORMATS)
def test_the_content_decides_and_every_number_is_read(name, tmp_path):
    path, log = made(name, tmp_path / "log.csv"), motion()
    assert recognise(path).name == FORMATS[name]
    if name in WHOLE:
        recording = read(path)
        for signal in ("t", "q", "dq", "current"):
            np.testing.assert_array_equal(getattr(recording, signal), log[signal])


def test_joints_by_samples_are_turned_and_said(path):
    recording = read(seeds.matlab(path, turned=True))
    (turned,) = recording.source.remarks
    assert (turned.code, turned.values["signals"]) == ("signals-turned", "q, dq, current")
    # A struct is named by its fields.
    named = read(path, columns="t=log.time,q[deg]=log.q")
    np.testing.assert_allclose(named.q, np.radians(motion()["q"]), rtol=1e-15)
    unpacked = read(seeds.matlab(path, packed=False))
    assert unpacked.source.remarks == ()
    np.testing.assert_array_equal(unpacked.q, recording.q)


def test_a_square_log_is_not_turned(path):
    q = np.arange(36.0).reshape(6, 6) / 36  # six samples of six joints: which is which?
    with path.open("wb") as file:
        savemat(file, {"t": np.arange(6.0), "q": q})
    np.testing.assert_array_equal(read(path).q, q)


@pytest.mark.parametrize("shape", [(49, 6), (6, 49), (6, 7)])
def test_a_signal_of_neither_length_is_refused_by_name(path, shape):
    """As columns it would be of another width than q, and left out without a word."""
    held = {"t": motion()["t"][:50], "q": np.zeros((6, 50)), "gains": np.eye(4)}
    with path.open("wb") as file:
        savemat(file, held | {"current": np.ones(shape)})
    with pytest.raises(LogError, match=f"t 50, q 50, current {49 if 49 in shape else 7} rows"):
        read(path)


def test_lines_without_a_state_are_counted(path):
    libfranka_json(path)  # which ends with "Done."
    path.write_text("Ready.\n" + path.read_text() + "Bye.\n")
    (remark,) = [r for r in read(path).source.remarks if r.code == "lines-skipped"]
    assert str(remark) == "skipped lines that hold no state: 3"


def test_json_takes_columns(path):
    recording = read(seeds.json_lines(path), columns="t[ms]=time,q[mrad]=q,-tau=tau_J")
    np.testing.assert_allclose(recording.q, 1e-3 * motion(7)["q"], rtol=1e-15)
    np.testing.assert_array_equal(recording.torque, -motion(7)["tau"])


def test_a_list_of_objects_and_a_list_of_rows(path):
    lines = seeds.json_lines(path).read_text().splitlines()
    path.write_text(json.dumps([json.loads(line) for line in lines]))
    np.testing.assert_array_equal(read(path).q, motion(7)["q"])
    path.write_text(json.dumps(np.column_stack([motion()["t"], motion()["q"]]).tolist()))
    np.testing.assert_array_equal(read(path, columns="t,q:6").q, motion()["q"])


def test_a_column_of_wrenches_is_a_wrench(path):
    log = motion()
    held = {"t": log["t"], "q": log["q"].tolist(), "wrench": log["dq"].tolist()}
    np.testing.assert_array_equal(read(seeds.write_arrow(path, pa.table(held))).wrench, log["dq"])


def test_a_line_that_is_cut_is_dropped_at_the_end_and_refused_elsewhere(path):
    text = seeds.json_lines(path).read_text()
    path.write_text(text[:-30])
    recording = read(path)
    assert recording.samples == ROWS - 1
    assert "line-cut" in {remark.code for remark in recording.source.remarks}
    lines = text.split("\n")
    path.write_text("\n".join([*lines[:5], lines[5][:40], *lines[6:]]))
    with pytest.raises(LogError, match="line 6 is not one JSON object"):
        read(path)


def test_the_blocks_of_a_long_file_are_joined(path):
    line = '{{"t": {}, "q": [{}, 0.5], "state": {{"dq": 1}}}}'
    rows = 20_001  # two whole blocks and a part of one
    path.write_text("\n".join(line.format(k, k % 3) for k in range(rows)))
    recording = read(path)
    assert recording.samples == rows
    np.testing.assert_array_equal(recording.q[:, 0], np.arange(rows) % 3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"a": 1', "looks like JSON and is not"),
        ('{"a": 1}', "holds no arrays of numbers"),
        ('{"t": [1, 2], "q": [[1, 2], [3]]}', "rows of different lengths"),
        ('{"t": 1, "q": [1]}\n{"t": 2, "q": [1, 2]}\n', "differs in kind or length"),
        ('{"t": 1, "q": [1]}\n{"t": 2}\n', "differs in kind or length"),
        ("[[1, 2], [3]]", "rows of different lengths"),
        ('[{"t": 1}, 3]', "no arrays of numbers"),
        ('{"t": ' + "9" * 5000 + "}", "looks like JSON and is not"),
        ("[" * 200_000, "nested too deeply"),
    ],
)
def test_what_is_no_log_in_json_is_refused_in_a_line(text, words, path):
    path.write_text(text)
    with pytest.raises(LogError, match=words):
        read(path)


def test_skills_are_episodes(path):
    seeds.json_skills(path, skills=3)
    assert list(episode_numbers(path, ReadChoice())) == [0, 1, 2]
    first, third = read(path), read(path, episode=2)
    said = [str(remark) for remark in first.source.remarks]
    assert said == ["episode 0, of 3 in all: --episode K|all"]
    assert third.source.remarks == ()
    np.testing.assert_allclose(third.q - first.q, 0.2, atol=1e-15)


def test_groups_without_numbers_are_counted():
    assert list(numbers_of(("a/", "b/"))) == [0, 1]
    assert list(numbers_of(("run2/x1/", "run3/x1/"))) == [0, 1]
    assert list(numbers_of(("",))) == [0]


@pytest.mark.usefixtures("h5py")
class TestHdf5:
    """HDF5 files."""

    def test_an_arm_of_two_is_asked_for_but_to_examine(self, path):
        seeds.aloha(path)
        log = motion()
        with pytest.raises(LogError, match="say which with --arm left or --arm right"):
            read(path)
        left, right = read(path, arm="left"), read(path, arm="right")
        np.testing.assert_array_equal(left.q, log["q"])
        np.testing.assert_array_equal(right.q, log["q"] / 2)
        np.testing.assert_allclose(left.current, log["current"], rtol=1e-15)  # mA and back
        assert right.source.label == "x right arm"
        np.testing.assert_allclose(left.t, np.arange(ROWS) / 50, rtol=1e-15)
        assert left.source.clock == "none: 50 Hz, ALOHA's convention"
        seen = read_chosen(path, ReadChoice(examining=True))
        assert "arm-side-chosen" in {remark.code for remark in seen.source.remarks}
        np.testing.assert_array_equal(seen.q, log["q"])

    def test_a_text_of_columns_goes_before_the_layout(self, path):
        named = read(seeds.aloha(path), columns="t@25Hz,q=observations/qpos[7:13]")
        assert named.source.clock == "none: 25 Hz as stated"
        np.testing.assert_array_equal(named.q, motion()["q"] / 2)
        assert named.t[1] == 0.04
        turned = read(path, columns="-current", arm="left")
        np.testing.assert_allclose(turned.current, -motion()["current"], rtol=1e-15)

    def test_a_file_of_several_is_read_by_episode(self, path):
        seeds.aloha_set(path)
        assert list(episode_numbers(path, ReadChoice())) == [0, 2, 10]
        first, last = read(path, arm="left"), read(path, episode=10, arm="left")
        labels = first.source.label, last.source.label
        assert labels == ("x episode 0 left arm", "x episode 10 left arm")
        np.testing.assert_allclose(last.q - first.q, 0.1, atol=1e-15)
        assert [r.code for r in first.source.remarks] == ["episode-chosen", "episode-place"]
        with pytest.raises(LogError, match="no episode 3; it holds 3, from 0 to 10"):
            read(path, episode=3)

    @pytest.mark.parametrize(
        ("project", "place"),
        [("robomimic", "data/demo_0/obs/robot0_joint_pos"), ("roboset", "Trial0/data/qp_arm")],
    )
    def test_projects_that_record_no_torque_are_refused_by_name(self, project, place, path):
        seeds.hdf5(path, {place: motion(7)["q"]})
        with pytest.raises(LogError, match=f"has the layout of {project}, which has no torque"):
            read(path)
        named = read(path, columns=f"t@20Hz,q={place}")
        np.testing.assert_array_equal(named.q, motion(7)["q"])

    def test_droid_takes_the_robots_clock_and_the_measured_torque(self, tmp_path):
        recording, log = read(seeds.droid(tmp_path / "a")), motion(7, rows=60, step=1 / 15)
        np.testing.assert_allclose(recording.t, log["t"], atol=1e-9)  # whole nanoseconds
        np.testing.assert_array_equal(recording.torque, log["tau"])
        assert recording.robot_hint == "panda"
        assert "computed-torque-left-out" in {remark.code for remark in recording.source.remarks}

    def test_a_release_is_a_folder_of_episodes(self, tmp_path):
        for day in ("2023-07-07", "2023-07-08"):
            seeds.droid(tmp_path / "LAB" / "success" / day / "name", serial="fr3-1")
        second = read(tmp_path, episode=1)
        assert (second.source.format, second.robot_hint) == ("droid", "fr3")
        assert "2023-07-08" in str(second.source.remarks[0])
        with pytest.raises(LogError, match="no episode 2; it holds 2, from 0 to 1"):
            read(tmp_path, episode=2)

    def test_names_are_found_in_one_group_alone(self, path):
        t, q, dq = (motion()[name] for name in ("t", "q", "dq"))
        one = seeds.hdf5(path, {"time": t, "run/q": q, "run/dq": dq})
        np.testing.assert_array_equal(read(one).dq, dq)
        two = seeds.hdf5(path, {"t": t, "a/q": q, "b/q": q})
        with pytest.raises(LogError, match="a/q, b/q could each be the positions"):
            read(two)
        np.testing.assert_array_equal(read(two, columns="t=t,q=b/q").q, q)

    @pytest.mark.parametrize(
        ("one", "other", "words"),
        [
            ("observations/qpos", "observation/robot_state/joint_positions", "could each be"),
            ("action", "sensor/ft", r"among action, sensor/ft.*--columns"),
        ],
    )
    def test_layouts_that_cannot_be_told_are_refused(self, path, one, other, words):
        with pytest.raises(LogError, match=words):
            read(seeds.hdf5(path, dict.fromkeys((one, other), motion(7)["q"])))

    def test_without_h5py_the_file_is_named_with_the_remedy(self, path, monkeypatch):
        seeds.aloha(path)
        monkeypatch.setitem(sys.modules, "h5py", None)
        with pytest.raises(LogError, match=r"an HDF5 file needs h5py, .*'vftcli\[hdf5\]'"):
            read(path)


def test_an_option_that_does_not_apply_is_refused(path):
    with pytest.raises(LogError, match="no episode 1; it holds 1, from 0 to 0"):
        read(seeds.arrow(path), episode=1)
    with pytest.raises(ParameterError, match="--episode K"):
        read_chosen(path, ReadChoice(episode=ALL))
    with pytest.raises(LogError, match="one recording, without episodes"):
        read(seeds.matlab(path), episode=0)


@pytest.mark.parametrize("stream", [False, True])
@pytest.mark.parametrize("codec", ["lz4", "zstd", None])
def test_the_claims_of_a_batch_are_what_it_unpacks_to(stream, codec, path):
    table = pa.table({"t": motion()["t"], "q": motion()["q"].tolist()})
    seeds.write_arrow(path, table, stream=stream, codec=codec)
    found = list(claims(pa.py_buffer(path.read_bytes()[0 if stream else 8 :])))
    assert [rows for rows, _ in found] == [50, 50, 20]
    # 50 rows: t and 6 positions of 8 B each, 51 offsets of 4 B; each padded to 8 B.
    assert all(50 * 56 + 204 <= size <= 50 * 56 + 204 + 8 * 8 for _, size in found[:2])
    assert ArrowTable(open_log(path)).names == ("t", "q")


def test_episodes_of_a_table_are_read_one_by_one(path):
    table = pa.table({"t": np.tile(np.arange(5) / 5, 2), "q": motion()["q"][:10].tolist(),
                      "episode_index": np.repeat([3, 7], 5)})  # fmt: skip
    seeds.write_arrow(path, table)
    np.testing.assert_array_equal(read(path, episode=7).q, motion()["q"][5:10])
    assert str(read(path).source.remarks[0]) == "episode 3, of 2 in all: --episode K|all"
    odd = table.set_column(2, "episode_index", pa.array(np.repeat([3.0, np.nan], 5)))
    with pytest.raises(LogError, match="episode_index is not a number in every row"):
        read(seeds.write_arrow(path, odd))
