"""Mutations of containers: Arrow, JSON documents, MATLAB files, HDF5, and folders of them."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from array_mutants import Arrays, arrays_changed, changed_inside, parquet_mutant, table_changed
from bytes_mutants import bytes_mutant
from text_mutants import lines_mutant
from tokens import Mutant, Rng, Seed, pick


def arrow_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """An Arrow file or stream with one column changed."""
    import pyarrow as pa
    from seed_containers import write_arrow

    if rng.random() < 0.4:
        return bytes_mutant(seed, rng, path)
    data = seed.path.read_bytes()
    stream = not data.startswith(b"ARROW1")
    opened = (pa.ipc.open_stream if stream else pa.ipc.open_file)(pa.py_buffer(data))
    try:
        table, how, same_rows = table_changed(opened.read_all(), rng)
        write_arrow(path, table, stream=stream, codec=pick(rng, ("zstd", "lz4", None)))
    except (pa.ArrowException, TypeError, ValueError, OverflowError):
        return bytes_mutant(seed, rng, path)
    return Mutant(f"arrow {how}", table.num_rows if same_rows else None)


def json_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A document with one thing in it changed."""
    if rng.random() < 0.3:
        return bytes_mutant(seed, rng, path)
    log = changed_inside(json.loads(seed.path.read_bytes()), rng)
    path.write_text(json.dumps(log, default=str), encoding="utf-8")
    return Mutant("tree")


def matlab_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A MATLAB file of version 5 with one variable changed."""
    from scipy.io import loadmat, savemat

    if rng.random() < 0.4:
        return bytes_mutant(seed, rng, path)
    held = loadmat(str(seed.path), simplify_cells=True)
    log = {k: v for k, v in held.items() if not k.startswith("__") and k != "note"}
    inner = log.get("log")
    changed, how = arrays_changed(inner if isinstance(inner, dict) else log, rng)
    if isinstance(inner, dict):
        changed = {"log": changed}
    try:
        with path.open("wb") as file:
            savemat(file, changed, do_compression=bool(rng.random() < 0.5))
    except (TypeError, ValueError, NotImplementedError):
        return bytes_mutant(seed, rng, path)
    return Mutant(how)


def hdf5_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """An HDF5 file with one dataset changed, or claims, links and types that no log has."""
    import h5py

    if rng.random() < 0.4:
        return bytes_mutant(seed, rng, path)
    arrays: Arrays = {}
    with h5py.File(seed.path, "r") as file:
        file.visititems(lambda n, d: arrays.update({n: d[()]}) if hasattr(d, "shape") else None)
    changed, how = arrays_changed(arrays, rng)
    try:
        with h5py.File(path, "w") as file:
            for name, value in changed.items():
                packed = {"compression": "gzip"} if np.ndim(value) and rng.random() < 0.3 else {}
                file.create_dataset(name, data=value, **packed)
            if rng.random() < 0.3:
                how += odd_object(file, pick(rng, list(changed)), rng)
    except (TypeError, ValueError, OSError, KeyError, RuntimeError):
        return bytes_mutant(seed, rng, path)
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


IN_DATASET = {
    ".parquet": parquet_mutant, ".json": json_mutant, ".jsonl": lines_mutant, ".h5": hdf5_mutant,
}  # fmt: skip
"""Ending of a file in a data set → what changes it."""


def dataset_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A data set with one of its files changed, gone, or called like another."""
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
