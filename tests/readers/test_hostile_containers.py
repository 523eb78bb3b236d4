"""Hostile containers: what claims or unpacks to gigabytes, leads elsewhere, or has no end."""

import struct
import zlib
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import seed_containers as seeds
from reading_child import Reading, read_apart
from seed_logs import ROWS, motion

LARGEST_MIB = 1024
"""What a reading may take."""

GIGANTIC = (10**9, 6)
"""Shape of 48 GB of numbers."""


def claim(path: Path) -> Path:
    """48 GB of positions in some kilobytes: no chunk of them is stored."""
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("t", shape=GIGANTIC[:1], dtype="f8", chunks=(1000,))
        file.create_dataset("q", shape=GIGANTIC, dtype="f8", chunks=(1000, 6))
    return path


def claims_of_many(path: Path) -> Path:
    """Signals that each claim what one may, and together a gigabyte."""
    import h5py

    rows = 2_500_000  # 120 MB of six columns
    with h5py.File(path, "w") as file:
        file.create_dataset("t", shape=(rows,), dtype="f8", chunks=(1000,))
        for name in ("q", "dq", "current", "tau", "tau_ext", "target_q", "target_dq", "tau_d"):
            file.create_dataset(name, shape=(rows, 6), dtype="f8", chunks=(1000, 6))
    return path


def claim_of_matlab(path: Path) -> Path:
    """The same in a file of version 7.3."""
    claim(path)
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_dataset("t", shape=(1, 10**9), dtype="f8", chunks=(1, 1000))
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(512))
    return path


def circle(path: Path) -> Path:
    """A group that holds the file's root, beside a sound log."""
    import h5py

    seeds.hdf5(path, {name: motion()[name] for name in ("t", "q")})
    with h5py.File(path, "a") as file:
        file.create_group("round")["again"] = file["/"]
    return path


def leads_out(path: Path) -> Path:
    """Positions in another file, and positions that are a view of another."""
    import h5py

    other = seeds.hdf5(path.with_suffix(".other"), {"q": motion()["q"]})
    with h5py.File(path, "w") as file:
        file["t"] = motion()["t"]
        file["q"] = h5py.ExternalLink(other.name, "/q")
        layout = h5py.VirtualLayout(shape=motion()["q"].shape, dtype="f8")
        layout[:] = h5py.VirtualSource(other.name, "q", shape=motion()["q"].shape)
        file.create_virtual_dataset("joint_pos", layout)
    return path


def one_chunk(path: Path, rows: int, packed: bytes, deflated: int = 1) -> Path:
    """Positions in one chunk of some rows, with a content that need not fit."""
    import h5py

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


def large_chunk(path: Path) -> Path:
    """Some rows in a chunk of ten million, which is unpacked whole."""
    return one_chunk(path, 10_000_000, zlib.compress(b""))


def lying_chunk(path: Path) -> Path:
    """A chunk of the rows that are there, whose content inflates to 480 MB."""
    return one_chunk(path, ROWS, zlib.compress(bytes(480_000_000)))


def deflated_twice(path: Path) -> Path:
    """Some kilobytes that inflate to half a megabyte, and these to 480 MB."""
    packed = zlib.compress(zlib.compress(bytes(480_000_000)))
    return one_chunk(path, ROWS, packed, deflated=2)


def matlab_bomb(path: Path) -> Path:
    """187 kB of version 5 that unpack to 192 MB."""
    from scipy.io import savemat

    with path.open("wb") as file:
        savemat(file, {"t": np.zeros(1), "q": np.zeros((4_000_000, 6))}, do_compression=True)
    return path


def matlab_struct_bomb(path: Path) -> Path:
    """The same inside a struct, of unknown size before it is unpacked."""
    from scipy.io import savemat

    with path.open("wb") as file:
        savemat(file, {"log": {"q": np.zeros((4_000_000, 6))}}, do_compression=True)
    return path


def matlab_claim(path: Path) -> Path:
    """A matrix of 48 GB in a hundred bytes."""
    shape = struct.pack("<IIii", 5, 8, *GIGANTIC)
    body = struct.pack("<IIII", 6, 8, 6, 0) + shape + struct.pack("<HHI", 1, 1, ord("q"))
    body += struct.pack("<II", 9, 8) + bytes(8)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    path.write_bytes(head + struct.pack("<II", 14, len(body)) + body)
    return path


def arrow_bomb(path: Path) -> Path:
    """144 MB of zeros in some kilobytes."""
    import pyarrow as pa

    zeros = pa.array(np.zeros(9_000_000))
    return seeds.write_arrow(
        path, pa.table({"t": zeros, "q1": zeros}), codec="zstd", rows=9_000_000
    )


def arrow_lies(path: Path) -> Path:
    """A buffer that says to unpack to half of all memory there is."""
    seeds.arrow(path)
    data = bytearray(path.read_bytes())
    place = data.index(struct.pack("<q", 8 * 50), 300)  # what the clock of a batch unpacks to
    data[place : place + 8] = struct.pack("<q", 1 << 62)
    path.write_bytes(data)
    return path


def json_deep(path: Path) -> Path:
    """Lists in lists."""
    path.write_bytes(b'{"q": ' + b"[" * 3_000_000)
    return path


def json_number(path: Path) -> Path:
    """A whole number of more digits than Python takes."""
    path.write_text('{"t": [0, ' + "1" * 5000 + '], "q": [[0], [0]]}', encoding="utf-8")
    return path


def json_laughs(path: Path) -> Path:
    """Twenty million empty lists in sixty megabytes."""
    path.write_bytes(b'{"q": [' + b"[]," * 20_000_000 + b"[]]}")
    return path


def json_endless_line(path: Path) -> Path:
    """A first line that is an object, and then one without an end."""
    path.write_bytes(b'{"t": 0, "q": [0, 1]}\n{"t": "' + b"x" * 50_000_000)
    return path


HOSTILE: dict[str, tuple[Callable[[Path], Path], str]] = {
    "claim": (claim, "unpacks to more than 128 MiB"),
    "claims_of_many": (claims_of_many, "unpacks to more than 128 MiB"),
    "claim_of_matlab": (claim_of_matlab, "unpacks to more than 128 MiB"),
    "large_chunk": (large_chunk, "its chunks unpack to 457 MiB each"),
    "lying_chunk": (lying_chunk, "a chunk unpacks to more than"),
    "deflated_twice": (deflated_twice, "packed by HDF5's filters [1, 1]"),
    "leads_out": (leads_out, "no joint positions (q) among t"),
    "matlab_bomb": (matlab_bomb, "unpacks to more than 128 MiB"),
    "matlab_struct_bomb": (matlab_struct_bomb, "unpacks to more than 128 MiB"),
    "matlab_claim": (matlab_claim, "unpacks to more than 128 MiB"),
    "arrow_bomb": (arrow_bomb, "unpacks to more than 128 MiB"),
    "arrow_lies": (arrow_lies, "unpacks to more than 128 MiB"),
    "json_deep": (json_deep, "nested too deeply"),
    "json_number": (json_number, "looks like JSON and is not"),
    "json_laughs": (json_laughs, "too many values to hold"),
}
"""What is made, and what is said of it."""

READ: dict[str, tuple[Callable[[Path], Path], int]] = {
    "circle": (circle, ROWS),
    "json_endless_line": (json_endless_line, 1),  # its cut end is dropped and said
}
"""What is made, and the samples that are read all the same."""

OF_HDF5 = {
    "claim", "claims_of_many", "claim_of_matlab", "large_chunk", "lying_chunk",
    "deflated_twice", "circle", "leads_out",
}  # fmt: skip


@pytest.fixture(scope="module")
def readings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Reading]:
    """What came of each file, in a process of its own."""
    folder = tmp_path_factory.mktemp("hostile")
    there = [name for name in HOSTILE | READ if name not in OF_HDF5 or find_spec("h5py")]
    return read_apart([(HOSTILE | READ)[name][0](folder / name) for name in there])


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE | READ)
def test_no_file_fills_memory_or_leads_elsewhere(name: str, readings: dict[str, Reading]) -> None:
    if name not in readings:
        pytest.skip("h5py, the extra hdf5, is not installed")
    found = readings[name]
    assert found.peak_mib < LARGEST_MIB
    if name in READ:
        assert found.samples == READ[name][1], found
        return
    assert (found.samples, HOSTILE[name][1] in found.said) == (-1, True), found
    assert "\n" not in found.said
