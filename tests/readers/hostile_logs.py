"""Files that broke a reader, as code that makes them: one maker a class, small."""

import io
import pickle
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
from seed_logs import ROWS, bare_mcap, motion, panda_py_log, rosbag1, rows_of, write_mcap


def bag_cut_at_record(path: Path, compression: str = "") -> Path:
    """A closed bag of which all behind its second chunk and that one's index is gone."""
    from rosbags.rosbag1.reader import Header, RecordType, read_bytes, read_uint32

    content = rosbag1(path, compression=compression).read_bytes()
    file, chunks = io.BytesIO(content), 0
    position = file.seek(len(b"#ROSBAG V2.0\n"))
    while chunks < 3:
        header = Header.read(file)
        read_bytes(file, read_uint32(file))
        chunks += header.get_uint8("op") == RecordType.CHUNK
        if chunks < 3:
            position = file.tell()
    path.write_bytes(content[:position])
    return path


def mcap_without_its_middle(path: Path, keep_summary: bool) -> Path:
    """An MCAP whose second half of chunks is gone, with the summary behind it or its footer only.

    A record is an opcode, a 64-bit length and the content.
    """
    content = bare_mcap(path).read_bytes()
    records, position = [], 8
    while position < len(content) - 8:
        end = position + 9 + int(struct.unpack_from("<Q", content, position + 1)[0])
        records.append((content[position], content[position:end]))
        position = end
    chunks = [k for k, (opcode, _) in enumerate(records) if opcode == 6]
    data_end = next(k for k, (opcode, _) in enumerate(records) if opcode == 15)
    kept = records[: chunks[len(chunks) // 2]]
    kept += records[data_end if keep_summary else -1 :]
    path.write_bytes(content[:8] + b"".join(record for _, record in kept) + content[-8:])
    return path


JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def mcap_of_type(path: Path, definition: str, position: float = 0.1) -> Path:
    """Twenty joint states in an MCAP that says their type is what a text defines."""
    from rosbags.typesys import Stores, get_typestore

    kind, store = "sensor_msgs/msg/JointState", get_typestore(Stores.ROS2_HUMBLE)
    types, messages = store.types, []
    for k in range(20):
        time = types["builtin_interfaces/msg/Time"](sec=1, nanosec=8_000_000 * k)
        message = types[kind](
            header=types["std_msgs/msg/Header"](stamp=time, frame_id=""),
            name=[f"j{j}" for j in range(6)],
            position=np.full(6, position),
            velocity=np.zeros(6),
            effort=np.zeros(6),
        )
        messages.append(("/j", 8_000_000 * k, bytes(store.serialize_cdr(message, kind))))
    schemas = {"/j": (kind, "ros2msg", definition.encode())}
    return write_mcap(path, messages, encoding="cdr", schemas=schemas)


RULE = "=" * 80
EMPTY_ARRAY = f"pkg/E[2000000000] a\n{RULE}\nMSG: pkg/E\n\n"
"""Two thousand million messages without fields: no byte, and a visit each."""

NESTED = "".join(
    f"{RULE}\nMSG: pkg/T{k}\n" + "".join(f"pkg/T{k + 1} a{i}\n" for i in range(4))
    for k in range(20)
)
TYPE_BOMB = f"pkg/T0 a\n{NESTED}{RULE}\nMSG: pkg/T20\n\n"
"""Twenty types of four each: 4²⁰ messages without fields."""


def database(path: Path, messages: str, *more: str) -> Path:
    """A bag in SQLite whose table of messages is made by a statement, with one topic."""
    with closing(sqlite3.connect(path)) as db:
        db.execute(
            "CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, "
            "serialization_format TEXT)"
        )
        db.execute("INSERT INTO topics VALUES (1, '/j', 'sensor_msgs/msg/JointState', 'cdr')")
        db.execute(messages)
        for statement in more:
            db.execute(statement)
        db.commit()
    return path


def computed(expression: str) -> Callable[[Path], Path]:
    """A bag whose messages are computed when they are read."""
    return lambda path: database(
        path,
        "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
        f"data BLOB GENERATED ALWAYS AS ({expression}) VIRTUAL)",
        *(f"INSERT INTO messages (topic_id, timestamp) VALUES (1, {k})" for k in range(8)),
    )


def viewed(path: Path) -> Path:
    """A bag whose messages are a view."""
    return database(
        path,
        "CREATE VIEW messages AS SELECT 1 id, 1 topic_id, 1 timestamp, zeroblob(900000000) data",
    )


def pickled_with_byte_order(path: Path) -> Path:
    """panda-py's log in the other byte order than most machines have."""
    log = panda_py_log()
    path.write_bytes(pickle.dumps({name: a.astype(">f8") for name, a in log.items()}))
    return path


def pickled_laughs(path: Path) -> Path:
    """Lists that hold the one before fifty times over: 50⁶ numbers in a kilobyte."""
    held: list[object] = [1.0]
    for _ in range(6):
        held = [held] * 50
    path.write_bytes(pickle.dumps({"time": [1.0], "q": held}))
    return path


def pickled_texts(path: Path) -> Path:
    """One text of a megabyte that is encoded again and again: a gigabyte for two kilobytes more."""
    text = "a" * 1_000_000
    out = io.BytesIO()
    out.write(b"\x80\x02(c_codecs\nencode\nq\x00X" + struct.pack("<I", len(text)))
    out.write(text.encode() + b"q\x01\x85q\x02Rh\x00h\x02R" + b"h\x00h\x02R" * 1000 + b"l.")
    path.write_bytes(out.getvalue())
    return path


def pickled_itself(path: Path) -> Path:
    """A list that holds itself."""
    held: list[object] = []
    held.append(held)
    path.write_bytes(pickle.dumps({"time": held, "q": np.zeros((3, 6))}))
    return path


def parquet(path: Path, **changed: object) -> Path:
    """A table with columns of lists, some of them changed."""
    import pyarrow as pa
    from pyarrow.parquet import write_table

    log = motion(7)
    columns: dict[str, object] = {"t": log["t"], "q": log["q"].tolist(), "dq": log["dq"].tolist()}
    write_table(pa.table(columns | changed), path)
    return path


def lists(first: object = None) -> list[object]:
    """The positions as lists, the first replaced."""
    return [first, *motion(7)["q"].tolist()[1:]]


def parquet_of_zeros(path: Path) -> Path:
    """Nine million rows of zeros twice, 144 MB, which pages hold in some kilobytes."""
    import pyarrow as pa
    from pyarrow.parquet import write_table

    zeros = pa.array(np.zeros(9_000_000))
    write_table(pa.table({"t": zeros, "q1": zeros}), path)
    return path


def npz(path: Path, **changed: object) -> Path:
    """panda-py's arrays, some of them changed."""
    with path.open("wb") as file:
        np.savez(file, **(panda_py_log() | changed))
    return path


def table(path: Path, clock: Callable[[int], float], rows: int = ROWS) -> Path:
    """A text table whose clock is a function of the row."""
    log, times = motion(), [float(clock(k)) for k in range(rows)]
    names = ["t", *(f"{name}{j}" for name in ("q", "dq") for j in range(6))]
    lines = [",".join(names), *rows_of(np.array(times), log["q"][:rows], log["dq"][:rows])]
    path.write_text("\n".join(lines) + "\n")
    return path
