"""Bombs: files that claim or unpack to gigabytes, lead elsewhere, or have no end, read apart."""

import gzip
import io
import pickle
import struct
import zipfile
import zlib
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import seed_containers as seeds
import zstandard
from pyarrow.parquet import write_table
from reading_child import Reading, read_apart
from scipy.io import savemat
from seed_logs import ROWS, motion, patched
from test_hostile import database, mcap_of_type

h5py: Any = import_module("h5py") if find_spec("h5py") else None

MEMORY_MIB = 500.0
"""What any file may take."""

GIGANTIC = (10**9, 6)
"""Shape of 48 GB of numbers."""

SIGNALS = ("q", "dq", "current", "tau", "tau_ext", "target_q", "target_dq", "tau_d")


def claimed(path: Path, block: int = 0, **shapes: tuple[int, ...]) -> Path:
    """Data sets of some shapes in some kilobytes: no chunk of them is stored."""
    with h5py.File(path, "w", userblock_size=block) as file:
        for name, shape in shapes.items():
            chunks = tuple(min(size, 1000) for size in shape)
            file.create_dataset(name, shape=shape, dtype="f8", chunks=chunks)
    return path


def claims_of_many(path: Path) -> Path:
    """Signals that each claim what one may, 120 MB of six columns, and together a gigabyte."""
    rows = 2_500_000
    return claimed(path, t=(rows,), **dict.fromkeys(SIGNALS, (rows, 6)))


def claim_of_matlab(path: Path) -> Path:
    """A clock of 8 GB in a file of version 7.3."""
    with claimed(path, 512, t=(1, 10**9)).open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(512))
    return path


def circle(path: Path) -> Path:
    """A group that holds the file's root, beside a sound log."""
    seeds.hdf5(path, {name: motion()[name] for name in ("t", "q")})
    with h5py.File(path, "a") as file:
        file.create_group("round")["again"] = file["/"]
    return path


def leads_out(path: Path) -> Path:
    """Positions in another file, and positions that are a view of another."""
    other = seeds.hdf5(path.with_suffix(".other"), {"q": motion()["q"]})
    with h5py.File(path, "w") as file:
        file["t"] = motion()["t"]
        file["q"] = h5py.ExternalLink(other.name, "/q")
        layout = h5py.VirtualLayout(shape=motion()["q"].shape, dtype="f8")
        layout[:] = h5py.VirtualSource(other.name, "q", shape=motion()["q"].shape)
        file.create_virtual_dataset("joint_pos", layout)
    return path


def inflating(megabytes: int) -> bytes:
    return zlib.compress(bytes(megabytes * 10**6))


def one_chunk(path: Path, packed: bytes, rows: int = ROWS, deflated: int = 1) -> Path:
    """Positions in one chunk of some rows, with a content that need not fit."""
    with h5py.File(path, "w") as file:
        file["t"], file["dq"] = motion()["t"], motion()["dq"]
        settings = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        settings.set_chunk((rows, 6))
        for _ in range(deflated):
            settings.set_filter(h5py.h5z.FILTER_DEFLATE, 0, (1,))
        space = h5py.h5s.create_simple(motion()["q"].shape, (h5py.h5s.UNLIMITED, 6))
        q = h5py.h5d.create(file.id, b"q", h5py.h5t.NATIVE_DOUBLE, space, settings)
        q.write_direct_chunk((0, 0), packed)
    return path


def long_text() -> bytes:
    """Half a gibibyte, which shrinks a thousandfold."""
    return b"t,q1\n" + b"0.1,0.2\n" * (64 << 20)


def npz_bomb(path: Path) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as bundle:
        bundle.writestr("q.npy", bytes(300 << 20))
    return path


def matlab_bomb(path: Path, *, inside: bool = False) -> Path:
    """187 kB of version 5 that unpack to 192 MB; inside a struct their size is not known before."""
    held = {"t": np.zeros(1), "q": np.zeros((4_000_000, 6))}
    with path.open("wb") as file:
        savemat(file, {"log": held} if inside else held, do_compression=True)
    return path


def matlab_claim(path: Path) -> Path:
    """A matrix of 48 GB in a hundred bytes."""
    shape = struct.pack("<IIii", 5, 8, *GIGANTIC)
    body = struct.pack("<IIII", 6, 8, 6, 0) + shape + struct.pack("<HHI", 1, 1, ord("q"))
    body += struct.pack("<II", 9, 8) + bytes(8)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    path.write_bytes(head + struct.pack("<II", 14, len(body)) + body)
    return path


def zeros() -> pa.Table:
    """144 MB, which pages hold in some kilobytes."""
    column = pa.array(np.zeros(9_000_000))
    return pa.table({"t": column, "q1": column})


def arrow_lies(path: Path) -> Path:
    """A buffer that says to unpack to half of all memory there is."""
    claims = struct.pack("<q", 8 * 50)  # what the clock of a batch unpacks to
    return patched(seeds.arrow(path), claims, struct.pack("<q", 1 << 62), behind=False)


def held(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def endless_line(path: Path) -> Path:
    """A first line that is an object, and then one without an end."""
    return held(path, b'{"t": 0, "q": [0, 1]}\n{"t": "' + b"x" * 50_000_000)


RULE = "=" * 80
EMPTY_ARRAY = f"pkg/E[2000000000] a\n{RULE}\nMSG: pkg/E\n\n"
"""Two thousand million messages without fields: no byte, and a visit each."""

NESTED = "".join(
    f"{RULE}\nMSG: pkg/T{k}\n" + "".join(f"pkg/T{k + 1} a{i}\n" for i in range(4))
    for k in range(20)
)
TYPE_BOMB = f"pkg/T0 a\n{NESTED}{RULE}\nMSG: pkg/T20\n\n"
"""Twenty types of four each: 4²⁰ messages without fields."""


def computed(path: Path) -> Path:
    """A bag whose messages are computed when they are read."""
    return database(
        path,
        "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
        "data BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL)",
        *(f"INSERT INTO messages (topic_id, timestamp) VALUES (1, {k})" for k in range(8)),
    )


def viewed(path: Path) -> Path:
    return database(
        path,
        "CREATE VIEW messages AS SELECT 1 id, 1 topic_id, 1 timestamp, zeroblob(900000000) data",
    )


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
    held: list[object] = []
    held.append(held)
    path.write_bytes(pickle.dumps({"time": held, "q": np.zeros((3, 6))}))
    return path


TOO_MUCH = "unpacks to more than 128 MiB"

Hostile = dict[str, tuple[Callable[[Path], Path], str | int]]
"""Name → what makes a file, and what is said of it or how many samples are read all the same."""

OF_HDF5: Hostile = {
    "claim": (lambda p: claimed(p, t=GIGANTIC[:1], q=GIGANTIC), TOO_MUCH),
    "claims_of_many": (claims_of_many, TOO_MUCH),
    "claim_of_matlab": (claim_of_matlab, TOO_MUCH),
    # Some rows in a chunk of ten million, which is unpacked whole.
    "large_chunk": (lambda p: one_chunk(p, zlib.compress(b""), rows=10_000_000),
                    "its chunks unpack to 457 MiB each"),
    # A chunk of the rows that are there; it inflates to 480 MB.
    "lying_chunk": (lambda p: one_chunk(p, inflating(480)), "a chunk unpacks to more than"),
    # Some kilobytes that inflate to half a megabyte, and these to 480 MB.
    "deflated_twice": (lambda p: one_chunk(p, zlib.compress(inflating(480)), deflated=2),
                       "packed by HDF5's filters [1, 1]"),
    "leads_out": (leads_out, "no joint positions (q) among t"),
    "circle": (circle, ROWS),
}  # fmt: skip
HOSTILE = OF_HDF5 | {
    "gzip_bomb": (lambda p: held(p, gzip.compress(long_text())), TOO_MUCH),
    "zstd_bomb": (lambda p: held(p, zstandard.compress(long_text())), TOO_MUCH),
    "npz_bomb": (npz_bomb, TOO_MUCH),
    "matlab_bomb": (matlab_bomb, TOO_MUCH),
    "matlab_struct_bomb": (lambda p: matlab_bomb(p, inside=True), TOO_MUCH),
    "matlab_claim": (matlab_claim, TOO_MUCH),
    "arrow_bomb": (lambda p: seeds.write_arrow(p, zeros(), codec="zstd", rows=10**7), TOO_MUCH),
    "arrow_lies": (arrow_lies, TOO_MUCH),
    "parquet_bomb": (lambda p: write_table(zeros(), p) or p, TOO_MUCH),
    "json_deep": (lambda p: held(p, b'{"q": ' + b"[" * 3_000_000), "nested too deeply"),
    "json_endless_line": (endless_line, 1),  # its cut end is dropped and said
    "empty_array": (lambda p: mcap_of_type(p, EMPTY_ARRAY), "more parts than bytes"),
    "type_bomb": (lambda p: mcap_of_type(p, TYPE_BOMB), "more parts than bytes"),
    "long_definition": (lambda p: mcap_of_type(p, "float64 a\n" * 7000), "more than 64 KiB"),
    "computed": (computed, "no stored column data"),
    "viewed": (viewed, "without plain tables of a ROS 2 bag"),
    "pickled_laughs": (pickled_laughs, "more numbers than a file of its size"),
    "pickled_texts": (pickled_texts, "more numbers than a file of its size"),
    "pickled_itself": (pickled_itself, "a list that holds itself"),
}  # fmt: skip


@pytest.fixture(scope="module")
def readings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Reading]:
    folder = tmp_path_factory.mktemp("hostile")
    there = [name for name in HOSTILE if name not in OF_HDF5 or find_spec("h5py")]
    return read_apart([HOSTILE[name][0](folder / name) for name in there])


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE)
def test_no_file_fills_memory_or_leads_elsewhere(name, readings):
    if name not in readings:
        pytest.skip("h5py, the extra hdf5, is not installed")
    found, (_, expected) = readings[name], HOSTILE[name]
    assert found.peak_mib < MEMORY_MIB
    if isinstance(expected, int):
        assert found.samples == expected, found
        return
    assert (found.samples, expected in found.said) == (-1, True), found
    assert "\n" not in found.said


FOUND_READ = {
    "cut_at_record.bag": 59, "cut_at_record_lz4.bag": 19, "cut_middle.mcap": 64, "one-row.csv": 1,
    "pk_bigendian.pkl": 400, "pk_bigendian_round.pkl": 400,
}  # fmt: skip
"""Samples of the files that were found by fuzzing and are read: all others are refused."""


@pytest.mark.slow
def test_files_that_were_found_by_fuzzing(logs):
    folder = logs.parent / "hostile"
    if not folder.is_dir():
        pytest.skip("the folder of hostile files is not beside VFT_LOGS")
    others = {".toml", ".urdf", ".md"}  # robot files, and what the folder says of itself
    found = read_apart(sorted(p for p in folder.iterdir() if p.suffix not in others))
    for name, reading in found.items():
        assert reading.samples == FOUND_READ.get(name, -1), (name, reading)
        assert "\n" not in reading.said
        assert reading.peak_mib < MEMORY_MIB, name
    assert "claims more memory than the file holds" in found["memory.db3"].said
