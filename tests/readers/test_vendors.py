"""The vendors' own files: UR's RTDE clients, libfranka, panda-py, LeRobot."""

import json
import os
import pickle
import tomllib
import zipfile
from collections import OrderedDict
from pathlib import Path

import numpy as np
import pytest
from seed_logs import (
    HEADERLESS_COLUMNS,
    ROWS,
    libfranka_csv,
    libfranka_json,
    matrix_npy,
    motion,
    panda_py_log,
    panda_py_npz,
    panda_py_pickle,
    parquet,
    ur_binary,
    ur_csv,
)

from vftcli.readers.reading import FORMATS, LogFormat, read
from vftcli.signals.errors import LogError
from vftcli.signals.wrench import WrenchFrame

SIX_DIGITS = 1e-5
"""libfranka prints six significant digits; the largest value of the motion is below ten."""


def test_official_text_keeps_every_digit(tmp_path: Path) -> None:
    recording = read(ur_csv(tmp_path / "x"))
    log = motion()
    assert recording.source.format == "ur-csv"
    np.testing.assert_array_equal(recording.q, log["q"])
    np.testing.assert_array_equal(recording.current, log["current"])
    assert recording.torque is None
    assert recording.robot_hint is None
    assert recording.source.t0 == 1000


@pytest.mark.parametrize("end", ["\r\r\n", "\r", "\n"])
def test_official_text_of_every_line_end(tmp_path: Path, end: str) -> None:
    recording = read(ur_csv(tmp_path / "x", end=end))
    np.testing.assert_array_equal(recording.q, motion()["q"])


def test_commas_show_ur_rtde(tmp_path: Path) -> None:
    assert read(ur_csv(tmp_path / "x", separator=",", end="\n")).source.format == "ur-rtde"


@pytest.mark.parametrize(
    ("field", "shift", "point"),
    [
        ("ft_raw_wrench_0", 0.0, "controller"),  # only e-Series has it
        ("joint_mode_0", 0.0, "tool"),  # CB3 counts cycles of 8 ms
        ("joint_mode_0", 0.002, "controller"),
    ],
)
def test_the_point_of_the_controllers_moment(
    tmp_path: Path, field: str, shift: float, point: str
) -> None:
    """Of actual_TCP_force: the TCP on CB3, by its sensor on e-Series; fields or clock say which."""
    path = ur_csv(tmp_path / "x", separator=",", end="\n")
    lines = path.read_text().splitlines()
    clock = lines[0].split(",").index("timestamp")
    wrench = ",".join(f"actual_TCP_force_{k}" for k in range(6))
    out = [f"{lines[0]},{wrench},{field}"]
    for k, line in enumerate(lines[1:]):
        cells = line.split(",")
        cells[clock] = f"{1000.0 + 0.008 * k + shift:.6f}"
        out.append(",".join([*cells, "1,2,3,.1,.2,.3", "0"]))
    path.write_text("\n".join(out) + "\n")
    assert read(path).wrench_frame == WrenchFrame("base", point)
    stated = read(path, columns="wrench[base@tool]")
    assert stated.wrench_frame == WrenchFrame("base", "tool")
    np.testing.assert_array_equal(stated.wrench, read(path).wrench)


def test_payload_that_the_controller_was_reported_of(tmp_path: Path) -> None:
    path = ur_csv(tmp_path / "x", separator=",", end="\n")
    lines = path.read_text().splitlines()
    lines[0] += ",payload,payload_cog_0,payload_cog_1,payload_cog_2"
    lines[1:] = [f"{line},1.5,0,0.01,0.05" for line in lines[1:]]
    path.write_text("\n".join(lines) + "\n")
    recording = read(path)
    assert recording.payload_mass == 1.5
    assert recording.payload_com == (0, 0.01, 0.05)


def test_missing_positions_or_clock_say_what_to_record(tmp_path: Path) -> None:
    path = ur_csv(tmp_path / "x")
    text = path.read_text()
    path.write_text(text.replace("timestamp", "time_stamp"))
    with pytest.raises(LogError, match="t@125Hz"):
        read(path)
    path.write_text(text.replace("actual_q_5", "target_q_0"))
    with pytest.raises(LogError, match="dq has 6 columns, q has 5"):
        read(path)
    path.write_text(text.replace("actual_q_", "target_q_"))
    with pytest.raises(LogError, match="Add timestamp and actual_q to the recipe"):
        read(path)


def test_a_table_with_targets_of_its_own_is_no_recording_of_ur(tmp_path: Path) -> None:
    """`target_q_0` beside names that are not RTDE's; it was refused for want of a timestamp."""
    names = [f"{name}_{j}" for name in ("q", "dq", "tau", "target_q") for j in range(6)]
    path = tmp_path / "own.csv"
    rows = (",".join(f"{0.01 * k + 0.1 * c:.3f}" for c in range(25)) for k in range(40))
    path.write_text("\n".join([",".join(["time", *names]), *rows]) + "\n")
    log = read(path)
    assert log.source.format == "table"
    assert {"q", "dq", "torque", "target_q"} <= set(log.signals)


def test_binary_records(tmp_path: Path) -> None:
    path = ur_binary(tmp_path / "x.csv")
    np.testing.assert_array_equal(read(path).q, motion()["q"])
    path.write_bytes(path.read_bytes()[:-10])
    recording = read(path)
    assert recording.samples == ROWS - 1
    assert "dropped the last record, 50 bytes" in recording.source.repairs[0]


def test_binary_records_with_a_leading_identifier(tmp_path: Path) -> None:
    path = ur_binary(tmp_path / "x")
    names, types, body = path.read_bytes().split(b"\n", 2)
    records = np.frombuffer(body, dtype="V60")
    # 119 records, because 120 of 61 bytes would also be 122 of 60
    joined = b"".join(b"\1" + record.tobytes() for record in records[:119])
    path.write_bytes(b"\n".join([names, types, joined]))
    recording = read(path)
    np.testing.assert_array_equal(recording.q, motion()["q"][:119])
    assert "recipe id" in recording.source.repairs[0]


@pytest.mark.parametrize("old", [False, True])
def test_libfranka_csv_turns_the_residual(tmp_path: Path, old: bool) -> None:
    recording = read(libfranka_csv(tmp_path / "x", old=old))
    log = motion(7)
    assert recording.source.format == ("libfranka-csv-old" if old else "libfranka-csv")
    assert [remark.code for remark in recording.source.remarks] == ["residual-turned"]
    np.testing.assert_allclose(recording.tau_ext, -log["tau_ext"], atol=SIX_DIGITS)
    np.testing.assert_allclose(recording.torque, log["tau"], atol=10 * SIX_DIGITS)
    np.testing.assert_allclose(recording.t, 1e-3 * np.arange(ROWS), rtol=1e-12)


def test_states_as_json_lines(tmp_path: Path) -> None:
    path = libfranka_json(tmp_path / "x")
    recording = read(path)
    np.testing.assert_array_equal(recording.q, motion(7)["q"])
    assert recording.wrench_frame == WrenchFrame("base", "base", "by-robot")
    lines = path.read_text().splitlines()
    lines[50] = lines[50].replace('"q": [', '"q": [nan, ', 1)
    path.write_text("\n".join(lines))
    with pytest.raises(LogError, match="q is not the same numbers in each of the objects"):
        read(path)


def test_json_that_is_nested_or_endless_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x"
    for line in ('{"O_T_EE": ' + "[" * 50_000, '{"O_T_EE": "' + "x" * (1 << 20) + '"}'):
        path.write_text(f"{line}\n{line}\n")
        with pytest.raises(LogError, match="line 1 is not one JSON object"):
            read(path)


def test_panda_py_bundle_and_pickle_read_the_same(tmp_path: Path) -> None:
    log = panda_py_log()
    for recording in (read(panda_py_npz(tmp_path / "x")), read(panda_py_pickle(tmp_path / "y"))):
        np.testing.assert_array_equal(recording.torque, log["tau_J"])
        np.testing.assert_array_equal(recording.tau_ext, -log["tau_ext_hat_filtered"])
        np.testing.assert_allclose(recording.t, 1e-3 * np.arange(ROWS), rtol=1e-12)


def test_array_files(tmp_path: Path) -> None:
    path = matrix_npy(tmp_path / "x")
    np.testing.assert_array_equal(read(path, columns=HEADERLESS_COLUMNS).q, motion()["q"])
    with pytest.raises(LogError, match="without a header"):
        read(path)
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(LogError, match="it is cut"):
        read(path, columns=HEADERLESS_COLUMNS)


def test_arrays_of_objects_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "x.npy", np.array([[1, "a"]], dtype=object), allow_pickle=True)
    with pytest.raises(LogError, match=r"not a readable|cut, damaged"):
        read(tmp_path / "x.npy", columns="t,q")


@pytest.mark.slow
def test_a_bundle_that_unpacks_beyond_reason_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "x.npz", "w", zipfile.ZIP_DEFLATED) as bundle:
        bundle.writestr("q.npy", bytes(300 << 20))
    with pytest.raises(LogError, match="unpacks to more than 128 MiB"):
        read(tmp_path / "x.npz")


class Evil:
    """A pickle that would make a folder if it were executed."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return (os.mkdir, (str(self.folder),))


@pytest.mark.parametrize(
    "held", ["evil", {"q": OrderedDict}, {"q": np.ndarray}, {"q": Path("x")}, [1, 2], {}]
)
def test_pickles_of_anything_but_arrays_are_refused(tmp_path: Path, held: object) -> None:
    trap = tmp_path / "trap"
    (tmp_path / "x").write_bytes(pickle.dumps({"q": Evil(trap)} if held == "evil" else held))
    with pytest.raises(LogError, match=r"np\.savez|no arrays|not a dictionary"):
        read(tmp_path / "x")
    assert not trap.exists()


def test_a_pickle_larger_than_what_is_held_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vftcli.readers.objects.PICKLE_LIMIT", 1 << 21)
    (tmp_path / "x").write_bytes(pickle.dumps({"q": bytes(3 << 20)}))
    with pytest.raises(LogError, match=r"x: a pickle of 3 MiB\. Save it with np\.savez\.$"):
        read(tmp_path / "x")


def test_a_pickle_cannot_fill_memory_through_ndarray(tmp_path: Path) -> None:
    # cnumpy\nndarray\n (I1000000000\n t R . : numpy.ndarray((10**9,)) without any data
    (tmp_path / "x").write_bytes(
        b"\x80\x02cnumpy\nndarray\n((I10000000000\ntt R.".replace(b" ", b"")
    )
    with pytest.raises(LogError, match="Pickles are opened only"):
        read(tmp_path / "x")


def test_parquet_with_lists_by_alias(tmp_path: Path) -> None:
    recording = read(parquet(tmp_path / "x"))
    np.testing.assert_array_equal(recording.q, motion(7)["q"])
    assert recording.source.format == "parquet"


def test_lerobot_reads_the_first_episode(tmp_path: Path) -> None:
    import polars as pl

    log = motion(7, rows=60)
    state = np.hstack([log["q"], np.zeros((60, 1))]).astype(np.float32)
    data = tmp_path / "data" / "chunk-000"
    data.mkdir(parents=True)
    pl.DataFrame(
        {
            "timestamp": np.tile(np.arange(30) / 30, 2).astype(np.float32),
            "observation.state": state.tolist(),
            "episode_index": np.repeat([0, 1], 30),
        }
    ).write_parquet(data / "file-000.parquet")
    (tmp_path / "meta").mkdir()
    names = [*(f"joint_{j}" for j in range(7)), "gripper"]
    info = {"fps": 30, "total_episodes": 2, "features": {"observation.state": {"names": names}}}
    (tmp_path / "meta" / "info.json").write_text(json.dumps(info))
    recording = read(tmp_path)
    assert recording.source.format == "lerobot"
    assert (recording.samples, recording.joints) == (30, 7)
    np.testing.assert_allclose(recording.q, log["q"][:30], atol=1e-7)  # float32
    assert recording.source.warnings[0] == "episode 0, of 2 in all: --episode K|all"
    second = read(
        data / "file-000.parquet", columns="t=timestamp,q=observation.state[0:7]", episode=1
    )
    np.testing.assert_allclose(second.q, log["q"][30:], atol=1e-7)  # float32
    with pytest.raises(LogError, match="no episode 2; it holds 2, from 0 to 1"):
        read(data / "file-000.parquet", episode=2)


def test_a_format_that_nobody_has_yet_is_one_entry(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A table of a maker's own names, unit, sign and payload: an entry as in layouts.toml."""
    entry = tomllib.loads(
        """
        title = "ACME controller"
        recording = "acme log"
        takes = "angles, torques"
        pitfalls = "none"
        [reader]
        module = "tables"
        line = 'tick;ang_1;'
        columns = "t[ms]=tick,q[deg]=ang_{i},-tau=trq_{i}"
        payload = "load"
        clock = "controller clock"
        """
    )
    made = LogFormat(name="acme", **entry.pop("reader"), **entry)
    monkeypatch.setitem(FORMATS, "acme", made)
    log = motion()
    names = [f"{word}_{j}" for word in ("ang", "trq") for j in range(1, 7)]
    lines = [";".join(["tick", *names, "load"])]
    for k, row in enumerate(np.hstack([log["q"], log["tau"]])):
        lines.append(";".join([str(8 * k), *map(repr, row.tolist()), "1.25"]))
    path = tmp_path / "x"
    path.write_text("\n".join(lines) + "\n")
    recording = read(path)
    assert (recording.source.format, recording.source.clock) == ("acme", "controller clock [ms]")
    assert recording.payload_mass == 1.25
    np.testing.assert_allclose(recording.q, np.radians(log["q"]), rtol=1e-15)  # one product
    np.testing.assert_array_equal(recording.torque, 0.0 - log["tau"])
    np.testing.assert_allclose(recording.t, log["t"], atol=1e-12)  # whole ms as float64
