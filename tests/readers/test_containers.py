"""Arrow, JSON, MATLAB and HDF5 files: what is read of each, and what is refused by name."""

import json
import pickle
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import seed_containers as seeds
from hypothesis import given
from hypothesis import strategies as st
from seed_logs import ROWS, libfranka_json, motion

from vftcli.readers.hdf5 import numbers_of
from vftcli.readers.opening import natural, open_log
from vftcli.readers.parquet import ArrowTable, claims
from vftcli.readers.reader import ALL, ReadChoice
from vftcli.readers.reading import episode_numbers, read, read_first_recording, recognise
from vftcli.signals.errors import LogError, ParameterError, UnknownFormatError

FORMATS = {
    "arrow": "arrow", "arrow-stream": "arrow", "json": "json", "json-skills": "json",
    "json-lines": "json", "mat": "mat", "mat-struct": "mat", "mat-73": "mat", "hdf5": "hdf5",
    "aloha": "hdf5",
}  # fmt: skip


@pytest.fixture
def h5py() -> None:
    pytest.importorskip("h5py", reason="h5py, the extra hdf5, is not installed")


def made(name: str, path: Path) -> Path:
    """A container by its name, or a skip where h5py is missing."""
    if name in seeds.NEED_H5PY:
        pytest.importorskip("h5py", reason="h5py, the extra hdf5, is not installed")
    return seeds.SEEDS[name][0](path)


@pytest.mark.parametrize("name", FORMATS)
def test_the_content_decides(name: str, tmp_path: Path) -> None:
    assert recognise(made(name, tmp_path / "log.csv")).name == FORMATS[name]


@pytest.mark.parametrize("name", ["arrow", "arrow-stream", "mat", "mat-struct", "mat-73", "hdf5"])
def test_every_number_is_read(name: str, tmp_path: Path) -> None:
    recording, log = read(made(name, tmp_path / "x")), motion()
    np.testing.assert_array_equal(recording.t, log["t"])
    for signal in ("q", "dq", "current"):
        np.testing.assert_array_equal(getattr(recording, signal), log[signal])


def test_joints_by_samples_are_turned_and_said(tmp_path: Path) -> None:
    recording = read(seeds.matlab(tmp_path / "x", turned=True))
    (turned,) = recording.source.remarks
    assert (turned.code, turned.values["signals"]) == ("signals-turned", "q, dq, current")
    assert read(seeds.matlab(tmp_path / "y")).source.remarks == ()


def test_a_square_log_is_not_turned(tmp_path: Path) -> None:
    from scipy.io import savemat

    q = (
        np.arange(36.0).reshape(6, 6) / 36
    )  # six samples of six joints: nothing says which is which
    with (tmp_path / "x").open("wb") as file:
        savemat(file, {"t": np.arange(6.0), "q": q})
    np.testing.assert_array_equal(read(tmp_path / "x").q, q)


def test_a_pickled_clock_of_numpy_scalars_is_a_clock(tmp_path: Path) -> None:
    t = 0.01 * np.arange(30)
    q = np.outer(np.sin(t), np.ones(7))
    (tmp_path / "x").write_bytes(pickle.dumps({"time": [*t], "q": [*q]}))
    recording = read(tmp_path / "x")
    np.testing.assert_array_equal(recording.t, t)
    np.testing.assert_array_equal(recording.q, q)


def test_an_unpacked_matlab_file_is_read_as_a_packed_one(tmp_path: Path) -> None:
    one = read(seeds.matlab(tmp_path / "x", packed=False))
    np.testing.assert_array_equal(one.q, read(seeds.matlab(tmp_path / "y")).q)


def test_a_struct_is_named_by_its_fields(tmp_path: Path) -> None:
    path = seeds.matlab(tmp_path / "x", turned=True)
    recording = read(path, columns="t=log.time,q[deg]=log.q")
    np.testing.assert_allclose(recording.q, np.radians(motion()["q"]), rtol=1e-15)


@pytest.mark.parametrize("name", ["json", "json-lines"])
def test_panda_py_in_json_is_as_in_npz(name: str, tmp_path: Path) -> None:
    recording, log = read(made(name, tmp_path / "x")), motion(7)
    np.testing.assert_allclose(recording.t, 1e-3 * np.arange(ROWS), atol=1e-12)  # ms as float64
    np.testing.assert_array_equal(recording.torque, log["tau"])
    np.testing.assert_array_equal(recording.tau_ext, -log["tau_ext"] + 0.0)  # libfranka's sign


def test_lines_without_a_state_are_counted(tmp_path: Path) -> None:
    path = libfranka_json(tmp_path / "x")  # which ends with "Done."
    path.write_text("Ready.\n" + path.read_text() + "Bye.\n")
    (remark,) = [r for r in read(path).source.remarks if r.code == "lines-skipped"]
    assert str(remark) == "skipped lines that hold no state: 3"


def test_json_takes_columns(tmp_path: Path) -> None:
    recording = read(seeds.json_lines(tmp_path / "x"), columns="t[ms]=time,q[mrad]=q,-tau=tau_J")
    np.testing.assert_allclose(recording.q, 1e-3 * motion(7)["q"], rtol=1e-15)
    np.testing.assert_array_equal(recording.torque, -motion(7)["tau"])


def test_a_list_of_objects_and_a_list_of_rows(tmp_path: Path) -> None:
    objects = [
        json.loads(line) for line in seeds.json_lines(tmp_path / "x").read_text().split("\n")[:-1]
    ]
    (tmp_path / "list").write_text(json.dumps(objects))
    np.testing.assert_array_equal(read(tmp_path / "list").q, motion(7)["q"])
    rows = np.column_stack([motion()["t"], motion()["q"]]).tolist()
    (tmp_path / "rows").write_text(json.dumps(rows))
    np.testing.assert_array_equal(read(tmp_path / "rows", columns="t,q:6").q, motion()["q"])


def test_a_column_of_wrenches_is_a_wrench(tmp_path: Path) -> None:
    import pyarrow as pa

    log = motion()
    held = {"t": log["t"], "q": log["q"].tolist(), "wrench": log["dq"].tolist()}
    recording = read(seeds.write_arrow(tmp_path / "x", pa.table(held)))
    np.testing.assert_array_equal(recording.wrench, log["dq"])


def test_a_line_that_is_cut_is_dropped_at_the_end_and_refused_elsewhere(tmp_path: Path) -> None:
    path = seeds.json_lines(tmp_path / "x")
    text = path.read_text()
    path.write_text(text[:-30])
    recording = read(path)
    assert recording.samples == ROWS - 1
    assert "line-cut" in {remark.code for remark in recording.source.remarks}
    lines = text.split("\n")
    path.write_text("\n".join([*lines[:5], lines[5][:40], *lines[6:]]))
    with pytest.raises(LogError, match="line 6 is not one JSON object"):
        read(path)


def test_the_blocks_of_a_long_file_are_joined(tmp_path: Path) -> None:
    line = '{{"t": {}, "q": [{}, 0.5], "state": {{"dq": 1}}}}'
    rows = 20_001  # two whole blocks and a part of one
    (tmp_path / "x").write_text("\n".join(line.format(k, k % 3) for k in range(rows)))
    recording = read(tmp_path / "x")
    assert recording.samples == rows
    np.testing.assert_array_equal(recording.q[:, 0], np.arange(rows) % 3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"a": 1', "looks like JSON and is not"),
        ('{"a": 1}', "holds no arrays of numbers"),
        ('{"t": [1, 2], "q": [[1, 2], [3]]}', "rows of different lengths"),
        ('{"t": 1, "q": [1]}\n{"t": 2, "q": [1, 2]}\n', "not the same numbers"),
        ('{"t": 1, "q": [1]}\n{"t": 2}\n', "not the same numbers"),
        ("[[1, 2], [3]]", "rows of different lengths"),
        ('[{"t": 1}, 3]', "no arrays of numbers"),
        ('{"t": ' + "9" * 5000 + "}", "looks like JSON and is not"),
        ('{"q": ' + "[" * 200_000, "nested too deeply"),
        ("[" * 200_000, "nested too deeply"),
    ],
)
def test_what_is_no_log_in_json_is_refused_in_a_line(
    text: str, words: str, tmp_path: Path
) -> None:
    (tmp_path / "x").write_text(text)
    with pytest.raises(LogError, match=words):
        read(tmp_path / "x")


def test_a_document_that_would_fill_memory_is_not_parsed(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(
        b'{"q": [' + b"[]," * (8 << 20) + b"[]]}"
    )  # 24 MiB, which would be .8 GB
    with pytest.raises(LogError, match="a JSON document of 24 MiB, too many values to hold"):
        read(tmp_path / "x")


def test_skills_are_episodes(tmp_path: Path) -> None:
    path = seeds.json_skills(tmp_path / "x", skills=3)
    assert list(episode_numbers(path, ReadChoice())) == [0, 1, 2]
    first, third = read(path), read(path, episode=2)
    assert [str(remark) for remark in first.source.remarks] == [
        "episode 0, of 3 in all: --episode K|all"
    ]
    assert third.source.remarks == ()
    np.testing.assert_allclose(third.q - first.q, 0.2, atol=1e-15)


@given(st.lists(st.integers(0, 99), min_size=1, max_size=9, unique=True).map(sorted))
def test_episodes_are_sorted_as_numbers_and_called_by_them(numbers: list[int]) -> None:
    groups = sorted((f"data/demo_{k}/" for k in numbers), key=natural)
    assert list(numbers_of(groups)) == numbers


def test_groups_without_numbers_are_counted() -> None:
    assert list(numbers_of(("a/", "b/"))) == [0, 1]
    assert list(numbers_of(("run2/x1/", "run3/x1/"))) == [0, 1]
    assert list(numbers_of(("",))) == [0]


@pytest.mark.usefixtures("h5py")
class TestHdf5:
    """HDF5 files."""

    def test_an_arm_of_two_is_asked_for(self, tmp_path: Path) -> None:
        path, log = seeds.aloha(tmp_path / "x"), motion()
        with pytest.raises(LogError, match="say which with --arm left or --arm right"):
            read(path)
        left, right = read(path, arm="left"), read(path, arm="right")
        np.testing.assert_array_equal(left.q, log["q"])
        np.testing.assert_array_equal(right.q, log["q"] / 2)
        np.testing.assert_allclose(left.current, log["current"], rtol=1e-15)  # mA and back
        assert right.source.label == "x right arm"
        np.testing.assert_allclose(left.t, np.arange(ROWS) / 50, rtol=1e-15)
        assert left.source.clock == "none: 50 Hz, ALOHA's convention"

    def test_an_examination_takes_the_left_arm_and_says_so(self, tmp_path: Path) -> None:
        seen = read_first_recording(seeds.aloha(tmp_path / "x"))
        assert "arm-side-chosen" in {remark.code for remark in seen.source.remarks}
        np.testing.assert_array_equal(seen.q, motion()["q"])

    def test_a_text_of_columns_goes_before_the_layout(self, tmp_path: Path) -> None:
        path = seeds.aloha(tmp_path / "x")
        named = read(path, columns="t@25Hz,q=observations/qpos[7:13]")
        assert named.source.clock == "none: 25 Hz as stated"
        np.testing.assert_array_equal(named.q, motion()["q"] / 2)
        assert named.t[1] == 0.04
        turned = read(path, columns="-current", arm="left")
        np.testing.assert_allclose(turned.current, -motion()["current"], rtol=1e-15)

    def test_a_file_of_several_is_read_by_episode(self, tmp_path: Path) -> None:
        path = seeds.aloha_set(tmp_path / "x")
        assert list(episode_numbers(path, ReadChoice())) == [0, 2, 10]
        first, last = read(path, arm="left"), read(path, episode=10, arm="left")
        labels = first.source.label, last.source.label
        assert labels == ("x episode 0 left arm", "x episode 10 left arm")
        np.testing.assert_allclose(last.q - first.q, 0.1, atol=1e-15)
        assert [r.code for r in first.source.remarks] == ["episode-chosen", "episode-place"]
        assert str(first.source.remarks[0]) == "episode 0, of 3 in all: --episode K|all"

    def test_an_episode_beyond_the_last_is_refused_with_their_number(
        self, tmp_path: Path
    ) -> None:
        with pytest.raises(LogError, match="no episode 3; it holds 3, from 0 to 10"):
            read(seeds.aloha_set(tmp_path / "x"), episode=3)

    @pytest.mark.parametrize(
        ("project", "place"),
        [("robomimic", "data/demo_0/obs/robot0_joint_pos"), ("roboset", "Trial0/data/qp_arm")],
    )
    def test_projects_that_record_no_torque_are_refused_by_name(
        self, project: str, place: str, tmp_path: Path
    ) -> None:
        path = seeds.hdf5(tmp_path / "x", {place: motion(7)["q"]})
        with pytest.raises(LogError, match=f"laid out as {project}'s, which hold no torque"):
            read(path)
        named = read(path, columns=f"t@20Hz,q={place}")
        np.testing.assert_array_equal(named.q, motion(7)["q"])

    def test_droid_takes_the_robots_clock_and_the_measured_torque(self, tmp_path: Path) -> None:
        path = seeds.droid(tmp_path / "a")
        recording = read(path)
        t = motion(7, rows=60, step=1 / 15)["t"]
        np.testing.assert_allclose(recording.t, t, atol=1e-9)  # whole nanoseconds
        np.testing.assert_array_equal(recording.torque, motion(7, rows=60, step=1 / 15)["tau"])
        assert recording.robot_hint == "panda"
        assert "computed-torque-left-out" in {remark.code for remark in recording.source.remarks}

    def test_a_release_is_a_folder_of_episodes(self, tmp_path: Path) -> None:
        for day in ("2023-07-07", "2023-07-08"):
            seeds.droid(tmp_path / "LAB" / "success" / day / "name", serial="fr3-1")
        assert recognise(tmp_path).name == "droid"
        second = read(tmp_path, episode=1)
        assert (second.source.format, second.robot_hint) == ("droid", "fr3")
        assert "2023-07-08" in str(second.source.remarks[0])
        with pytest.raises(LogError, match="no episode 2; it holds 2, from 0 to 1"):
            read(tmp_path, episode=2)

    def test_names_are_found_in_one_group_alone(self, tmp_path: Path) -> None:
        log = {"q": motion()["q"], "dq": motion()["dq"]}
        one = seeds.hdf5(
            tmp_path / "one", {"time": motion()["t"], "run/q": log["q"], "run/dq": log["dq"]}
        )
        np.testing.assert_array_equal(read(one).dq, log["dq"])
        two = seeds.hdf5(tmp_path / "two", {"t": motion()["t"], "a/q": log["q"], "b/q": log["q"]})
        with pytest.raises(LogError, match="a/q, b/q could each be the positions"):
            read(two)
        np.testing.assert_array_equal(read(two, columns="t=t,q=b/q").q, log["q"])

    def test_two_layouts_in_one_file_are_refused(self, tmp_path: Path) -> None:
        q = motion(7)["q"]
        places = "observations/qpos", "observation/robot_state/joint_positions"
        path = seeds.hdf5(tmp_path / "x", dict.fromkeys(places, q))
        with pytest.raises(LogError, match="could each be the positions"):
            read(path)

    def test_an_unknown_file_tells_its_datasets(self, tmp_path: Path) -> None:
        path = seeds.hdf5(tmp_path / "x", {"action": motion()["q"], "sensor/ft": motion()["q"]})
        with pytest.raises(LogError, match=r"among action, sensor/ft.*--columns"):
            read(path)

    def test_without_h5py_the_file_is_named_with_the_remedy(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = seeds.aloha(tmp_path / "x")
        monkeypatch.setitem(sys.modules, "h5py", None)
        with pytest.raises(LogError, match=r"an HDF5 file needs h5py, .*'vftcli\[hdf5\]'"):
            read(path)


def test_an_option_that_does_not_apply_is_refused(tmp_path: Path) -> None:
    path = seeds.arrow(tmp_path / "x")
    with pytest.raises(LogError, match="a log of one arm; leave --arm out"):
        read(path, arm="left")
    with pytest.raises(LogError, match="no episode 1; it holds 1, from 0 to 0"):
        read(path, episode=1)
    with pytest.raises(LogError, match="one recording, without episodes"):
        read(seeds.matlab(tmp_path / "y"), episode=0)
    with pytest.raises(ParameterError, match="--episode K"):
        read_first_recording(path, ReadChoice(episode=ALL))


@pytest.mark.parametrize("stream", [False, True])
@pytest.mark.parametrize("codec", ["lz4", "zstd", None])
def test_the_claims_of_a_batch_are_what_it_unpacks_to(
    stream: bool, codec: str | None, tmp_path: Path
) -> None:
    import pyarrow as pa

    table = pa.table({"t": motion()["t"], "q": motion()["q"].tolist()})
    path = seeds.write_arrow(tmp_path / "x", table, stream=stream, codec=codec)
    found = list(claims(pa.py_buffer(path.read_bytes()[0 if stream else 8 :])))
    assert [rows for rows, _ in found] == [50, 50, 20]
    # 50 rows: t and 6 positions of 8 B each, 51 offsets of 4 B; each padded to 8 B.
    assert all(50 * 56 + 204 <= size <= 50 * 56 + 204 + 8 * 8 for _, size in found[:2])
    assert ArrowTable(open_log(path)).names == ("t", "q")


def test_episodes_of_a_table_are_read_one_by_one(tmp_path: Path) -> None:
    import pyarrow as pa

    table = pa.table({"t": np.tile(np.arange(5) / 5, 2), "q": motion()["q"][:10].tolist(),
                      "episode_index": np.repeat([3, 7], 5)})  # fmt: skip
    path = seeds.write_arrow(tmp_path / "x", table, stream=False)
    np.testing.assert_array_equal(read(path, episode=7).q, motion()["q"][5:10])
    assert str(read(path).source.remarks[0]) == "episode 3, of 2 in all: --episode K|all"
    numbers = np.repeat([3.0, np.nan], 5)
    odd = table.set_column(2, "episode_index", pa.array(numbers))
    with pytest.raises(LogError, match="episode_index is not a number in every row"):
        read(seeds.write_arrow(tmp_path / "y", odd, stream=False))


def xlsx(path: Path) -> None:
    """The members that make a zip file an Excel workbook."""
    with zipfile.ZipFile(path, "w") as bundle:
        bundle.writestr("[Content_Types].xml", "<Types/>")
        bundle.writestr("xl/workbook.xml", "<workbook/>")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (xlsx, "an Excel workbook; save the sheet as CSV"),
        (lambda path: path.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(99)), "a PX4 ULog"),
    ],
)
def test_a_file_of_another_kind_is_reported_by_name(
    make: Callable[[Path], None], words: str, tmp_path: Path
) -> None:
    make(tmp_path / "x")
    with pytest.raises(UnknownFormatError, match=words):
        read(tmp_path / "x")
