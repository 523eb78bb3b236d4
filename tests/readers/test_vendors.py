"""The vendors' own files: UR's RTDE clients, libfranka, panda-py, LeRobot."""

import os
import pickle
from collections import OrderedDict
from pathlib import Path

import numpy as np
import pytest
import seed_logs
from seed_containers import json_arrays, json_lines

from vftcli.readers.reading import FORMATS, LogFormat, read
from vftcli.signals.errors import LogError
from vftcli.signals.wrench import WrenchFrame

SIX_DIGITS = 1e-5
"""libfranka prints six significant digits; the largest value of the motion is below ten."""


@pytest.mark.parametrize("end", ["\r\n", "\r\r\n", "\r", "\n"])
def test_official_text_keeps_every_digit(path, end):
    recording, log = read(seed_logs.ur_csv(path, end=end)), seed_logs.motion()
    assert (recording.source.format, recording.source.t0) == ("ur-csv", 1000)
    np.testing.assert_array_equal(recording.q, log["q"])
    np.testing.assert_array_equal(recording.current, log["current"])
    assert (recording.torque, recording.robot_hint) == (None, None)


@pytest.mark.parametrize(
    ("field", "shift", "point"),
    [
        ("ft_raw_wrench_0", 0.0, "controller"),  # only e-Series has it
        ("joint_mode_0", 0.0, "tool"),  # CB3 counts cycles of 8 ms
        ("joint_mode_0", 0.002, "controller"),
    ],
)
def test_the_point_of_the_controllers_moment(path, field, shift, point):
    """Of actual_TCP_force: the TCP on CB3, by its sensor on e-Series; fields or clock say which."""
    head, *lines = seed_logs.ur_csv(path, separator=",", end="\n").read_text().splitlines()
    out = [",".join([head, *(f"actual_TCP_force_{k}" for k in range(6)), field])]
    for k, line in enumerate(lines):
        _, *cells = line.split(",")  # the clock is the first
        out.append(",".join([f"{1000.0 + 0.008 * k + shift:.6f}", *cells, "1,2,3,.1,.2,.3", "0"]))
    path.write_text("\n".join(out) + "\n")
    assert read(path).source.format == "ur-rtde"
    assert read(path).wrench_frame == WrenchFrame("base", point)
    stated = read(path, columns="wrench[base@tool]")
    assert stated.wrench_frame == WrenchFrame("base", "tool")
    np.testing.assert_array_equal(stated.wrench, read(path).wrench)


def test_payload_that_the_controller_was_reported_of(path):
    head, *lines = seed_logs.ur_csv(path, separator=",", end="\n").read_text().splitlines()
    head += ",payload,payload_cog_0,payload_cog_1,payload_cog_2"
    path.write_text("\n".join([head, *(f"{line},1.5,0,0.01,0.05" for line in lines)]) + "\n")
    recording = read(path)
    assert (recording.payload_mass, recording.payload_com) == (1.5, (0, 0.01, 0.05))


@pytest.mark.parametrize(
    ("name", "other", "words"),
    [
        ("timestamp", "time_stamp", "t@125Hz"),
        ("actual_q_5", "target_q_0", "dq has 6 columns, q has 5"),
        ("actual_q_", "target_q_", "Add timestamp and actual_q to the recipe"),
    ],
)
def test_missing_positions_or_clock_say_what_to_record(path, name, other, words):
    seed_logs.ur_csv(path)
    path.write_text(path.read_text().replace(name, other))
    with pytest.raises(LogError, match=words):
        read(path)


def test_a_table_with_targets_of_its_own_is_no_recording_of_ur(tmp_path):
    """`target_q_0` beside names that are not RTDE's; it was refused for want of a timestamp."""
    names = [f"{name}_{j}" for name in ("q", "dq", "tau", "target_q") for j in range(6)]
    path = tmp_path / "own.csv"
    rows = (",".join(f"{0.01 * k + 0.1 * c:.3f}" for c in range(25)) for k in range(40))
    path.write_text("\n".join([",".join(["time", *names]), *rows]) + "\n")
    log = read(path)
    assert log.source.format == "table"
    assert {"q", "dq", "torque", "target_q"} <= set(log.signals)


def test_binary_records(path):
    seed_logs.ur_binary(path)
    np.testing.assert_array_equal(read(path).q, seed_logs.motion()["q"])
    content = path.read_bytes()
    path.write_bytes(content[:-10])
    recording = read(path)
    assert recording.samples == seed_logs.ROWS - 1
    assert "dropped the last record, 50 bytes" in recording.source.repairs[0]
    names, types, body = content.split(b"\n", 2)
    records = np.frombuffer(body, dtype="V60")
    # 119 records, because 120 of 61 bytes would also be 122 of 60
    joined = b"".join(b"\1" + record.tobytes() for record in records[:119])
    path.write_bytes(b"\n".join([names, types, joined]))
    recording = read(path)
    np.testing.assert_array_equal(recording.q, seed_logs.motion()["q"][:119])
    assert "recipe id" in recording.source.repairs[0]


@pytest.mark.parametrize("old", [False, True])
def test_libfranka_csv_turns_the_residual(path, old):
    recording = read(seed_logs.libfranka_csv(path, old=old))
    log = seed_logs.motion(7)
    assert recording.source.format == ("libfranka-csv-old" if old else "libfranka-csv")
    assert [remark.code for remark in recording.source.remarks] == ["residual-turned"]
    np.testing.assert_allclose(recording.tau_ext, -log["tau_ext"], atol=SIX_DIGITS)
    np.testing.assert_allclose(recording.torque, log["tau"], atol=10 * SIX_DIGITS)
    np.testing.assert_allclose(recording.t, 1e-3 * np.arange(seed_logs.ROWS), rtol=1e-12)


def test_states_as_json_lines(path):
    seed_logs.libfranka_json(path)
    recording = read(path)
    np.testing.assert_array_equal(recording.q, seed_logs.motion(7)["q"])
    assert recording.wrench_frame == WrenchFrame("base", "base", "by-robot")
    lines = path.read_text().splitlines()
    lines[50] = lines[50].replace('"q": [', '"q": [nan, ', 1)
    path.write_text("\n".join(lines))
    with pytest.raises(LogError, match="q differs in kind or length between the objects"):
        read(path)


@pytest.mark.parametrize("state", ["[" * 50_000, '"' + "x" * (1 << 20) + '"}'])
def test_json_that_is_nested_or_endless_is_refused(path, state):
    path.write_text(f'{{"O_T_EE": {state}\n' * 2)
    with pytest.raises(LogError, match="line 1 is not one JSON object"):
        read(path)


def other_byte_order(path: Path) -> Path:
    """A pickle of arrays in the byte order that most machines have not."""
    log = seed_logs.panda_py_log()
    path.write_bytes(pickle.dumps({name: a.astype(">f8") for name, a in log.items()}))
    return path


def clock_of_scalars(path: Path) -> Path:
    log = seed_logs.panda_py_log()
    path.write_bytes(pickle.dumps(log | {"time": [*log["time"][:, 0]], "q": [*log["q"]]}))
    return path


@pytest.mark.parametrize(
    "make",
    [seed_logs.panda_py_npz, seed_logs.panda_py_pickle, json_arrays, json_lines,
     other_byte_order, clock_of_scalars],
)  # fmt: skip
def test_panda_pys_log_reads_the_same_in_every_container(path, make):
    recording, log = read(make(path)), seed_logs.motion(7)
    for signal in ("q", "dq"):
        np.testing.assert_array_equal(getattr(recording, signal), log[signal])
    np.testing.assert_array_equal(recording.torque, log["tau"])
    np.testing.assert_array_equal(recording.tau_ext, 0.0 - log["tau_ext"])  # libfranka's sign
    t = 1e-3 * np.arange(seed_logs.ROWS)
    np.testing.assert_allclose(recording.t, t, atol=1e-12)  # ms as float64


def test_array_files(path):
    seed_logs.matrix_npy(path)
    found = read(path, columns=seed_logs.HEADERLESS_COLUMNS)
    np.testing.assert_array_equal(found.q, seed_logs.motion()["q"])
    with pytest.raises(LogError, match="without a header"):
        read(path)
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(LogError, match="it is cut"):
        read(path, columns=seed_logs.HEADERLESS_COLUMNS)


def test_arrays_of_objects_are_refused(tmp_path):
    np.save(tmp_path / "x.npy", np.array([[1, "a"]], dtype=object), allow_pickle=True)
    with pytest.raises(LogError, match=r"not a readable|cut, damaged"):
        read(tmp_path / "x.npy", columns="t,q")
    np.savez(tmp_path / "x.npz", log={"q": [1.0]})
    with pytest.raises(LogError, match=r"no arrays of numbers \(.*by name: np\.savez\(FILE, t="):
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
def test_pickles_of_anything_but_arrays_are_refused(tmp_path, held):
    trap = tmp_path / "trap"
    (tmp_path / "x").write_bytes(pickle.dumps({"q": Evil(trap)} if held == "evil" else held))
    with pytest.raises(LogError, match=r"np\.savez|no arrays|not a dictionary"):
        read(tmp_path / "x")
    assert not trap.exists()


def test_a_pickle_larger_than_what_is_held_is_refused(path, monkeypatch):
    monkeypatch.setattr("vftcli.readers.objects.PICKLE_LIMIT", 1 << 21)
    path.write_bytes(pickle.dumps({"q": bytes(3 << 20)}))
    with pytest.raises(LogError, match=r"x: a pickle of 3 MiB\. Save it with np\.savez\.$"):
        read(path)


def test_a_format_that_nobody_has_yet_is_one_entry(path, monkeypatch):
    """A table of a maker's own names, unit, sign and payload: an entry as in layouts.toml."""
    acme = LogFormat(
        name="acme", title="ACME controller", recording="acme log", takes="angles, torques",
        pitfalls="none", module="tables", line="tick;ang_1;", payload="load",
        columns="t[ms]=tick,q[deg]=ang_{i},-tau=trq_{i}", clock="controller clock",
    )  # fmt: skip
    monkeypatch.setitem(FORMATS, "acme", acme)
    log = seed_logs.motion()
    names = [f"{word}_{j}" for word in ("ang", "trq") for j in range(1, 7)]
    ticks, load = 8.0 * np.arange(seed_logs.ROWS), np.full(seed_logs.ROWS, 1.25)
    rows = seed_logs.rows_of(ticks, log["q"], log["tau"], load, separator=";")
    path.write_text("\n".join([";".join(["tick", *names, "load"]), *rows]) + "\n")
    recording = read(path)
    assert (recording.source.format, recording.source.clock) == ("acme", "controller clock [ms]")
    assert recording.payload_mass == 1.25
    np.testing.assert_allclose(recording.q, np.radians(log["q"]), rtol=1e-15)  # one product
    np.testing.assert_array_equal(recording.torque, 0.0 - log["tau"])
    np.testing.assert_allclose(recording.t, log["t"], atol=1e-12)  # whole ms as float64
