"""Small logs of every format, made in code: the seeds of the reader tests and of the fuzzer."""

import gzip
import json
import pickle
import shutil
import struct
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

ROWS = 120
JOINTS = 6

FRANKA_STATE = """std_msgs/Header header
float64[7] q
float64[7] q_d
float64[7] dq
float64[7] dq_d
float64[7] tau_J
float64[6] O_F_ext_hat_K
float64[7] tau_ext_hat_filtered
float64 m_load
float64 time
"""


def motion(joints: int = JOINTS, rows: int = ROWS, step: float = 0.008) -> dict[str, np.ndarray]:
    """A smooth motion with currents and torques, all numbers exact in nine decimals."""
    t = step * np.arange(rows)
    phase = 2 * np.pi * t[:, None] / t[-1] + np.arange(joints)
    signals = {
        "q": np.sin(phase),
        "dq": np.cos(phase) * 2 * np.pi / t[-1],
        "current": 3 * np.cos(phase + 0.3),
        "tau": 30 * np.cos(phase + 0.2),
        "tau_ext": 2 * np.sin(2 * phase),
    }
    return {"t": t} | {name: np.round(value, 9) for name, value in signals.items()}


def ur_csv(path: Path, *, separator: str = " ", end: str = "\r\n", rows: int = ROWS) -> Path:
    """A log as the official RTDE client writes it (or ur_rtde, with commas)."""
    log = motion(rows=rows)
    groups = ("actual_q", "actual_qd", "actual_current")
    names = ["timestamp", *(f"{name}_{j}" for name in groups for j in range(6)), "robot_mode"]
    columns = [1000 + log["t"], log["q"], log["dq"], log["current"], np.full(rows, 7)]
    lines = [separator.join(names), *rows_of(*columns, separator=separator)]
    path.write_bytes((end.join(lines) + end).encode())
    return path


def rows_of(*columns: np.ndarray, separator: str = ",") -> list[str]:
    return [separator.join(map(repr, row)) for row in np.column_stack(columns).tolist()]


def ur_binary(path: Path) -> Path:
    """A log as the official client's --binary writes it."""
    log = motion()
    names = ["timestamp", *(f"actual_q_{j}" for j in range(6)), "robot_mode"]
    header = " ".join(names) + "\n" + " ".join(["DOUBLE"] * 7 + ["INT32"]) + "\n"
    rows = (struct.pack(">7di", 1000 + t, *q, 0) for t, q in zip(log["t"], log["q"], strict=True))
    path.write_bytes(header.encode() + b"".join(rows))
    return path


def libfranka_csv(path: Path, *, old: bool = False) -> Path:
    """A log as franka::logToCSV writes it, before or after 0.9.1."""
    log = motion(7)
    groups = ["q", "q_d", "dq", "dq_d", "tau_J", "tau_ext_hat_filtered"]
    keys = ["q", "q", "dq", "dq", "tau", "tau_ext"]
    state = np.hstack([log[key] for key in keys])
    times = 5000 + np.arange(ROWS)
    if old:
        names = ["duration", " success rate"]
        for group in groups:
            first = " q[0]" if group == "q" else f"{group}[0]"
            names += [first, *(f" {group}[{j}]" for j in range(1, 7))]
        names += ["sent commands", "q_d[0]", *(f" q_d[{j}]" for j in range(1, 7))]
        tail = [""] + ["0"] * 7
    else:
        names = ["time", "success_rate"]
        names += [f"state.{group}[{j}]" for group in groups for j in range(7)]
        names += [f"cmd.q_d[{j}]" for j in range(7)]
        tail = ["0"] * 7
    lines = [",".join(names)]
    for time, row in zip(times, state, strict=True):
        lines.append(",".join([str(time), "1", *(f"{v:.6g}" for v in row), *tail]))
    path.write_text("\n".join(lines) + "\n")
    return path


def libfranka_json(path: Path) -> Path:
    """Robot states as std::cout prints them."""
    log = motion(7)
    lines = []
    for k in range(ROWS):
        state = {"O_T_EE": [0] * 16, "tau_J": log["tau"][k].tolist(), "q": log["q"][k].tolist()}
        state |= {"dq": log["dq"][k].tolist(), "O_F_ext_hat_K": [0.0] * 6, "time": 5000 + k}
        lines.append(json.dumps(state))
    path.write_text("\n".join([*lines, "Done."]) + "\n")
    return path


def table_csv(path: Path) -> Path:
    log = motion()
    names = ["t"] + [f"{name}_{j}" for name in ("q", "dq", "tau") for j in range(6)]
    lines = [",".join(names), *rows_of(log["t"], log["q"], log["dq"], log["tau"])]
    path.write_text("\n".join(lines) + "\n")
    return path


def table_gz(path: Path) -> Path:
    path.write_bytes(gzip.compress(table_csv(path).read_bytes(), mtime=0))
    return path


def headerless_csv(path: Path) -> Path:
    log = motion()
    matrix = np.column_stack([log["t"], log["q"], log["dq"], log["current"]])
    path.write_text("\n".join(",".join(f"{v:.6f}" for v in row) for row in matrix) + "\n")
    return path


def matrix_npy(path: Path) -> Path:
    log = motion()
    with path.open("wb") as file:
        np.save(file, np.column_stack([log["t"], log["q"], log["dq"], log["current"]]))
    return path


def panda_py_log() -> dict[str, np.ndarray]:
    """What panda-py's get_log() gives, as arrays."""
    log = motion(7)
    return {
        "time": (5000.0 + np.arange(ROWS))[:, None],
        "q": log["q"],
        "dq": log["dq"],
        "tau_J": log["tau"],
        "tau_ext_hat_filtered": log["tau_ext"],
    }


def panda_py_npz(path: Path) -> Path:
    with path.open("wb") as file:
        np.savez(file, **panda_py_log())
    return path


def panda_py_pickle(path: Path) -> Path:
    path.write_bytes(pickle.dumps({name: list(value) for name, value in panda_py_log().items()}))
    return path


def parquet(path: Path) -> Path:
    """A table with a column of lists, as LeRobot writes it."""
    import polars as pl

    log = motion(7)
    pl.DataFrame(
        {"timestamp": log["t"], "observation.state": log["q"].tolist(), "dq": log["dq"].tolist()}
    ).write_parquet(path)
    return path


Schema = tuple[str, str, bytes]
"""Name of a type, the encoding of its definition, its definition."""


def write_mcap(
    path: Path,
    messages: Iterable[tuple[str, int, bytes]],
    *,
    encoding: str = "json",
    schemas: Mapping[str, Schema] | None = None,
    chunk_size: int = 1 << 20,
) -> Path:
    """An MCAP of messages: topic, time [ns], content. `schemas` are by topic."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_size)
        writer.start(profile="ros2" if encoding == "cdr" else "", library="test")
        channels: dict[str, int] = {}
        for k, (topic, time, content) in enumerate(messages):
            if topic not in channels:
                number = writer.register_schema(*schemas[topic]) if schemas else 0
                channels[topic] = writer.register_channel(topic, encoding, number)
            writer.add_message(channels[topic], time, content, time, k)
        writer.finish()
    return path


def mcap_json(path: Path) -> Path:
    log, messages = motion(), []
    for k in range(ROWS):
        stamp = 10**9 + round(log["t"][k] * 1e9)
        document = {"timestamp": {"sec": stamp // 10**9, "nsec": stamp % 10**9}}
        document |= {"q": log["q"][k].tolist(), "tau": log["tau"][k].tolist()}
        messages.append(("/joints", stamp, json.dumps(document).encode()))
    return write_mcap(path, messages, chunk_size=4096)


def bag_messages(ros1: bool) -> tuple[object, list[tuple[str, str, int, object]]]:
    """A typestore, and messages of a Franka arm: topic, type, time [ns], message."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    name = "franka_msgs/msg/FrankaState"
    store.register(get_types_from_msg(FRANKA_STATE, name))
    types = store.types
    log = motion(7, step=0.001)
    messages = []
    for k in range(ROWS):
        stamp = 1_700_000_000 * 10**9 + k * 10**6
        head = {"seq": k} if ros1 else {}
        time = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
        header = types["std_msgs/msg/Header"](**head, stamp=time, frame_id="base")
        state = types[name](
            header=header,
            q=log["q"][k], q_d=log["q"][k], dq=log["dq"][k], dq_d=log["dq"][k],
            tau_J=log["tau"][k], O_F_ext_hat_K=np.zeros(6),
            tau_ext_hat_filtered=log["tau_ext"][k], m_load=0.5, time=100 + k / 1000,
        )  # fmt: skip
        messages.append(("/franka_states", name, stamp + 300_000, state))
        order = [3, 0, 6, 1, 2, 4, 5]
        joint_state = types["sensor_msgs/msg/JointState"](
            header=header,
            name=[f"panda_joint{j + 1}" for j in order],
            position=log["q"][k][order],
            velocity=log["dq"][k][order],
            effort=log["tau"][k][order],
        )
        kind = "sensor_msgs/msg/JointState"
        messages.append(("/joint_states", kind, stamp + 310_000, joint_state))
    return store, messages


def rosbag1(path: Path, *, compression: str = "") -> Path:
    from rosbags.rosbag1 import Writer

    store, messages = bag_messages(ros1=True)
    writer = Writer(path)
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression])
    writer.chunk_threshold = 16 * 1024
    write_messages(writer, messages, store, store.serialize_ros1)
    return path


def patched(path: Path, place: bytes, put: bytes, *, behind: bool = True) -> Path:
    """The file with some of its bytes replaced: where it holds others, or behind them."""
    content = path.read_bytes()
    at = content.index(place) + behind * len(place)
    path.write_bytes(content[:at] + put + content[at + len(put) :])
    return path


def write_messages(
    writer: Any, messages: Iterable[Any], store: Any, serialise: Callable[[Any, str], Any]
) -> None:
    """Write messages into a bag, each topic's connection made when it is first needed."""
    with writer:
        connections = {}
        for topic, kind, time, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], time, serialise(message, kind))


def rosbag2(folder: Path, *, storage: str = "mcap", mode: str = "", method: str = "") -> Path:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    store, messages = bag_messages(ros1=False)
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    writer = Writer(folder, version=9, storage_plugin=plugin)
    if mode:
        writer.set_compression(CompressionMode[mode], CompressionFormat[method or "ZSTD"])
    write_messages(writer, messages, store, store.serialize_cdr)
    return folder


def bare_mcap(path: Path) -> Path:
    """The MCAP inside a ROS 2 bag folder, chunked anew so that it has several chunks."""
    from mcap.reader import make_reader

    folder = rosbag2(path.with_suffix(".folder"))
    with next(folder.glob("*.mcap")).open("rb") as source:
        found = list(make_reader(source).iter_messages())
    shutil.rmtree(folder)
    schemas = {c.topic: (s.name, s.encoding, s.data) for s, c, _ in found}
    messages = ((c.topic, m.log_time, m.data) for _, c, m in found)
    return write_mcap(path, messages, encoding="cdr", schemas=schemas, chunk_size=16 * 1024)


def bare_db3(path: Path) -> Path:
    """The database inside a ROS 2 bag folder."""
    folder = rosbag2(path.with_suffix(".folder"), storage="sqlite3")
    next(folder.glob("*.db3")).replace(path)
    shutil.rmtree(folder)
    return path


HEADERLESS_COLUMNS = "t,q:6,dq:6,current:6"

SEEDS: dict[str, tuple[Callable[[Path], Path], str | None]] = {
    "ur-csv": (ur_csv, None),
    "ur-binary": (ur_binary, None),
    "ur-rtde": (lambda path: ur_csv(path, separator=",", end="\n"), None),
    "libfranka-csv": (libfranka_csv, None),
    "libfranka-csv-old": (lambda path: libfranka_csv(path, old=True), None),
    "libfranka-json": (libfranka_json, None),
    "table": (table_csv, None),
    "table-gz": (table_gz, None),
    "headerless": (headerless_csv, HEADERLESS_COLUMNS),
    "npy": (matrix_npy, HEADERLESS_COLUMNS),
    "npz": (panda_py_npz, None),
    "pickle": (panda_py_pickle, None),
    "parquet": (parquet, None),
    "rosbag1": (rosbag1, None),
    "rosbag1-lz4": (lambda path: rosbag1(path, compression="LZ4"), None),
    "db3": (bare_db3, None),
    "mcap": (bare_mcap, None),
    "mcap-json": (mcap_json, None),
}
"""Name → how a log of that format is made, and its --columns."""
