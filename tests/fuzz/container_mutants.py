"""Mutations of files that hold arrays and trees, and of folders of them: each is taken apart, one
thing in it is changed, and it is written as another program would write it.
"""

import gzip
import io
import json
import pickle
import shutil
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from changes import array_changed, bytes_changed, dict_changed, list_changed, tree_changed
from text_mutants import bytes_mutant, lines_mutant
from tokens import WORDS, Mutant, Rng, Seed, pick, some

Arrays = dict[str, Any]
UNWRITTEN = (TypeError, ValueError, OverflowError, NotImplementedError, KeyError, RuntimeError,
             OSError)  # fmt: skip
"""What a library says of a change that it cannot write."""


def taken_apart(bytes_share: float) -> Callable[[Callable[..., Mutant]], Callable[..., Mutant]]:
    """A mutator that changes bytes for a share of the inputs, and where it cannot write."""

    def wrap(mutant: Callable[[Seed, Rng, Path], Mutant]) -> Callable[[Seed, Rng, Path], Mutant]:
        def tried(seed: Seed, rng: Rng, path: Path) -> Mutant:
            if rng.random() >= bytes_share:
                try:
                    return mutant(seed, rng, path)
                except UNWRITTEN:
                    pass
            return bytes_mutant(seed, rng, path)

        return tried

    return wrap


def arrays_changed(arrays: Arrays, rng: Rng) -> tuple[Arrays, str]:
    """The arrays with one of them changed, gone, renamed, or with the first rows of all."""
    if rng.random() < 0.1:
        size = int(rng.integers(0, 4))
        return {name: np.atleast_1d(array)[:size] for name, array in arrays.items()}, "few rows"
    return dict_changed(arrays, rng, lambda array, rng: array_changed(np.asarray(array), rng))


@taken_apart(0.2)
def archive_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """An .npz of named arrays, or one matrix."""
    made, file = np.load(io.BytesIO(seed.path.read_bytes())), io.BytesIO()
    if seed.family == "npy":
        np.save(file, array_changed(made, rng), allow_pickle=True)
        how = "matrix"
    else:
        arrays, how = arrays_changed(dict(made), rng)
        save = np.savez_compressed if rng.random() < 0.3 else np.savez
        save(file, **{name: np.asarray(array) for name, array in arrays.items()})
    path.write_bytes(file.getvalue())
    return Mutant(how)


@taken_apart(0.2)
def pickle_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A pickle of a log: of lists or of arrays, or with an object anywhere in it changed."""

    def odd(_old: Any, rng: Rng) -> Any:
        values = (
            None, [], {}, (), np.zeros(()), np.zeros((0, 7)), "x", b"\0", 10**30, 3 + 4j, {1, 2},
            True, np.nan, np.array([None, "a"], dtype=object), [[1, 2], [3]], range(3), slice(1),
        )  # fmt: skip
        return pick(rng, values)

    log = pickle.loads(seed.path.read_bytes())
    if isinstance(log, dict) and rng.random() < 0.5:
        log = {key: np.array(value) for key, value in log.items()}
    log = tree_changed(log, rng, odd)
    data = pickle.dumps(log, protocol=int(rng.integers(2, 6)))
    path.write_bytes(gzip.compress(data, mtime=0) if rng.random() < 0.05 else data)
    return Mutant("tree")


def table_changed(table: Any, rng: Rng) -> tuple[Any, str, bool]:
    """An Arrow table with one thing changed, what was done, and whether its rows are the same."""
    import pyarrow as pa

    if rng.random() < 0.15:
        order = list(range(table.num_rows))
        kind = list_changed(order, rng, lambda _, rng: int(rng.integers(table.num_rows)))
        return table.take(pa.array(order, pa.int64())), f"rows {kind}", False
    names, same = table.column_names, rng.random() < 0.5
    change = cells_changed if same else recast
    columns, how = dict_changed(dict(zip(names, table.columns, strict=True)), rng, change)
    return pa.table(columns), how, same and how.startswith("changed")


def cells_changed(column: Any, rng: Rng) -> Any:
    """A column with some of its cells changed, numbers, nulls, lists cut or emptied; or encoded."""
    import pyarrow as pa

    if rng.random() < 0.2:
        return column.dictionary_encode()
    values = column.to_pylist()
    number = pick(rng, (None, 0.0, np.nan, np.inf, 1e308, 5e-324, -1.0, 2**53))
    kind = int(rng.integers(4))
    for k in some(rng, len(values)):
        old = values[k]
        if isinstance(old, list) and old:
            values[k] = ([*old[:-1], number], [], old[:-1], [number] * len(old))[kind]
        else:
            values[k] = None if isinstance(old, str) else number
    return pa.array(values)


def recast(column: Any, rng: Rng) -> Any:
    """A column whose values are of another type, or all the same odd one."""
    import pyarrow as pa

    types = (pa.float32(), pa.int8(), pa.string(), pa.bool_(), pa.decimal128(38, 5), pa.float16(),
             pa.list_(pa.float64(), 3))  # fmt: skip
    wraps: tuple[Callable[[Any], Any], ...] = (
        lambda value: [value] * 3, lambda value: {"x": value}, str, bool,
        lambda value: datetime.fromtimestamp(value, UTC),
    )  # fmt: skip
    kind = rng.random()
    if kind < 0.3:
        odd = pick(rng, ([], [[]], None, [None], {}, "x", 3, [[1.0], [2.0]]))
        return pa.array([odd] * len(column))
    if kind < 0.6:
        return pa.array(list(map(pick(rng, wraps), column.to_pylist())))
    return column.cast(pick(rng, types), safe=False)


@taken_apart(0.2)
def parquet_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A Parquet table, as other writers would have it."""
    import pyarrow.parquet as pq

    table = pq.read_table(io.BytesIO(seed.path.read_bytes()), use_threads=False)
    table, how, same_rows = table_changed(table, rng)
    codec = pick(rng, ("snappy", "zstd", "gzip", "none", "lz4"))
    pq.write_table(table, path, compression=codec, row_group_size=pick(rng, (7, 100, 10**6)))
    return Mutant(f"parquet {how}", table.num_rows if same_rows else None)


@taken_apart(0.4)
def arrow_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    import pyarrow as pa
    from seed_containers import write_arrow

    data = seed.path.read_bytes()
    stream = not data.startswith(b"ARROW1")
    opened = (pa.ipc.open_stream if stream else pa.ipc.open_file)(pa.py_buffer(data))
    table, how, same_rows = table_changed(opened.read_all(), rng)
    write_arrow(path, table, stream=stream, codec=pick(rng, ("zstd", "lz4", None)))
    return Mutant(f"arrow {how}", table.num_rows if same_rows else None)


@taken_apart(0.3)
def json_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    log = tree_changed(json.loads(seed.path.read_bytes()), rng)
    path.write_text(json.dumps(log, default=str), encoding="utf-8", errors="replace")
    return Mutant("tree")


@taken_apart(0.4)
def matlab_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A MATLAB file of version 5 with one variable changed."""
    from scipy.io import loadmat, savemat

    held = loadmat(str(seed.path), simplify_cells=True)
    log = {k: v for k, v in held.items() if not k.startswith("__") and k != "note"}
    inner = log.get("log")
    changed, how = arrays_changed(inner if isinstance(inner, dict) else log, rng)
    with path.open("wb") as file:
        changed = {"log": changed} if isinstance(inner, dict) else changed
        savemat(file, changed, do_compression=bool(rng.random() < 0.5))
    return Mutant(how)


@taken_apart(0.4)
def hdf5_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """An HDF5 file with one dataset changed, or claims, links and types that no log has."""
    import h5py

    arrays: Arrays = {}
    with h5py.File(seed.path, "r") as file:
        file.visititems(lambda n, d: arrays.update({n: d[()]}) if hasattr(d, "shape") else None)
    changed, how = arrays_changed(arrays, rng)
    with h5py.File(path, "w") as file:
        for name, value in changed.items():
            packed = {"compression": "gzip"} if np.ndim(value) and rng.random() < 0.3 else {}
            file.create_dataset(name, data=value, **packed)
        if rng.random() < 0.3:
            how += odd_object(file, pick(rng, list(changed)), rng)
    return Mutant(how)


def odd_object(file: Any, name: str, rng: Rng) -> str:
    """Something else where a dataset was: a claim, a link, a circle, references, texts."""
    import h5py

    del file[name]
    kind = int(rng.integers(7))
    if kind == 0:
        file.create_dataset(name, shape=(10**9, 6), dtype="f8", chunks=(1000, 6))
    elif kind == 1:
        file[name] = h5py.ExternalLink("/etc/passwd", "/q")
    elif kind == 2:
        file[name] = h5py.SoftLink("/nowhere")
    elif kind == 3:
        file.require_group("round")["again"] = file["/"]
    elif kind == 4:
        file.create_dataset(name, data=["a", "b"], dtype=h5py.string_dtype())
    elif kind == 5:
        layout = h5py.VirtualLayout(shape=(60, 6), dtype="f8")
        layout[:] = h5py.VirtualSource("elsewhere.h5", "q", shape=(60, 6))
        file.create_virtual_dataset(name, layout)
    else:
        file.create_dataset(name, data=np.array([file.ref] * 3, dtype=h5py.ref_dtype))
    return f" odd{kind}"


RECORD_KINDS = (b"DOUBLE", b"INT32", b"VECTOR6D", b"BOOL", b"UINT64", b"NONE", b"", b"UINT8")


@taken_apart(0.3)
def record_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A UR binary: its names, its types, or its records changed."""
    words = [word.encode("utf-8", "replace")[:50] for word in WORDS]
    parts = [line.split(b" ") for line in seed.path.read_bytes().split(b"\n", 2)[:2]]
    body = seed.path.read_bytes().split(b"\n", 2)[2]
    if (k := int(rng.integers(3))) < 2:
        how = list_changed(parts[k], rng, lambda _, rng: pick(rng, (words, RECORD_KINDS)[k]))
    else:
        body, how = bytes_changed(body, rng)
    path.write_bytes(b"\n".join([*map(b" ".join, parts), body]))
    return Mutant(f"records{k} {how}")


IN_DATASET = {
    ".parquet": parquet_mutant, ".json": json_mutant, ".jsonl": lines_mutant, ".h5": hdf5_mutant,
}  # fmt: skip
"""Ending of a file in a data set → what changes it."""


def dataset_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    shutil.copytree(seed.path, path)
    files = sorted(file for file in path.rglob("*") if file.is_file())
    file, kind = pick(rng, files), rng.random()
    if kind < 0.1:
        file.unlink()
        return Mutant(f"without {file.name}", path=path)
    if kind < 0.2:
        file.replace(pick(rng, files))
        return Mutant(f"moved {file.name}", path=path)
    sound = seed.path / file.relative_to(path)
    how = IN_DATASET[file.suffix](seed._replace(path=sound), rng, file).how
    return Mutant(f"{file.name}: {how}", path=path)
