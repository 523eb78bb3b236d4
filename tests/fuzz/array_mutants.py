"""Mutations of logs that hold arrays: Parquet, NumPy archives, matrices, pickles, UR's binary."""

import gzip
import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np
from bytes_mutants import bytes_mutant
from tokens import NUMBERS, WORDS, Mutant, Rng, Seed, pick, some

Arrays = dict[str, Any]
DTYPES = (
    "f4", "f2", "i1", "i8", "u1", "?", ">f8", "c16", "O", "U8", "S4", "M8[ms]", "m8[s]", ">i4",
)  # fmt: skip


def numbers_changed(value: np.ndarray, rng: Rng) -> np.ndarray:
    """The array with some of its numbers changed."""
    out = np.array(value, dtype=float)
    if out.size == 0:
        return out
    with np.errstate(all="ignore"):
        put = np.float64(min(max(pick(rng, NUMBERS), -1.7e308), 1.7e308))
        kind = int(rng.integers(6))
        if kind == 0:
            out.reshape(-1)[some(rng, out.size)] = put
        elif kind == 1:
            out[some(rng, len(out))] = put
        elif kind == 2:
            out[...] = put
        elif kind == 3:
            out *= put
        elif kind == 4:
            out = np.round(out)
        else:
            out = out[::-1].copy()
    return out


def shape_changed(value: np.ndarray, rng: Rng) -> np.ndarray:
    """The array in another shape."""
    kind = int(rng.integers(9))
    if value.ndim == 0 or value.size == 0:
        return np.zeros((3, 3))
    shapes = (
        lambda: value.T, lambda: value[:0], lambda: value[:1], lambda: value[0],
        lambda: value[None], lambda: value[: len(value) // 2], lambda: value.reshape(-1)[0],
        lambda: value[..., None], lambda: np.concatenate([value, value]),
    )  # fmt: skip
    return np.asarray(shapes[kind]())


def type_changed(value: np.ndarray, rng: Rng) -> np.ndarray:
    """The array as another type."""
    dtype = pick(rng, DTYPES)
    with np.errstate(all="ignore"):
        try:
            out = np.asfortranarray(value) if rng.random() < 0.1 else value
            return out.astype(dtype)
        except (TypeError, ValueError):
            return value.astype(str)


def arrays_changed(arrays: Arrays, rng: Rng) -> tuple[Arrays, str]:
    """The arrays with one thing changed, and what."""
    out = dict(arrays)
    key = pick(rng, list(out))
    value = np.asarray(out[key])
    kind = int(rng.integers(8))
    if kind <= 2:
        out[key] = numbers_changed(value, rng)
    elif kind == 3:
        out[key] = shape_changed(value, rng)
    elif kind == 4:
        out[key] = type_changed(value, rng)
    elif kind == 5:
        del out[key]
    elif kind == 6:
        name = pick(rng, list(out)) if rng.random() < 0.5 else pick(rng, WORDS)[:100]
        out[name or "x"] = out.pop(key)
    else:
        size = int(rng.integers(0, 4))
        out = {name: np.asarray(array)[:size] for name, array in out.items()}
    return out, f"arrays{kind} {key}"


def archive_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """An .npz of named arrays, a pickle of them, or one matrix."""
    if rng.random() < 0.2:
        return bytes_mutant(seed, rng, path)
    data = seed.path.read_bytes()
    if seed.family == "npy":
        matrix = np.load(io.BytesIO(data))
        change = pick(rng, (numbers_changed, shape_changed, type_changed))
        np.save(file := io.BytesIO(), change(matrix, rng), allow_pickle=True)
        path.write_bytes(file.getvalue())
        return Mutant(change.__name__)
    if seed.family == "npz":
        arrays, how = arrays_changed(dict(np.load(io.BytesIO(data))), rng)
        save = np.savez_compressed if rng.random() < 0.3 else np.savez
        save(file := io.BytesIO(), **{k: np.asarray(v) for k, v in arrays.items()})
        path.write_bytes(file.getvalue())
        return Mutant(how)
    return pickle_mutant(pickle.loads(data), rng, path)


def pickle_mutant(log: Any, rng: Rng, path: Path) -> Mutant:
    """A pickle of a log: of arrays, or with an object anywhere in it changed."""
    how = "tree"
    if isinstance(log, dict) and rng.random() < 0.5:
        try:
            arrays = {key: np.array(value, dtype=float) for key, value in log.items()}
            log, how = arrays_changed(arrays, rng)
        except (TypeError, ValueError):
            log = changed_inside(log, rng)
    else:
        log = changed_inside(log, rng)
    data = pickle.dumps(log, protocol=int(rng.integers(2, 6)))
    path.write_bytes(gzip.compress(data, mtime=0) if rng.random() < 0.05 else data)
    return Mutant(how)


def changed_inside(tree: Any, rng: Rng, depth: int = 0) -> Any:
    """The tree with one thing in it changed."""
    odd: tuple[Any, ...] = (
        None, [], {}, (), np.zeros(()), np.zeros((0, 7)), "x", b"\0", 10**30, 3 + 4j, {1, 2}, True,
        float("nan"), np.array([None, "a"], dtype=object), [[1, 2], [3]], range(3), slice(1),
    )  # fmt: skip
    if depth > 4 or rng.random() < 0.25 or tree is None:
        return pick(rng, odd)
    if isinstance(tree, dict) and tree:
        key = pick(rng, list(tree))
        return {k: changed_inside(v, rng, depth + 1) if k == key else v for k, v in tree.items()}
    if isinstance(tree, list) and tree:
        place = int(rng.integers(len(tree)))
        kind = int(rng.integers(3))
        if kind == 0:
            return tree[:place]
        if kind == 1:
            return [changed_inside(tree[place], rng, depth + 1)] * len(tree)
        return [*tree[:place], changed_inside(tree[place], rng, depth + 1), *tree[place + 1 :]]
    if isinstance(tree, np.ndarray):
        change = pick(rng, (numbers_changed, shape_changed, type_changed))
        try:
            return change(tree, rng)
        except (TypeError, ValueError):
            return tree[:0] if tree.ndim else None
    return pick(rng, odd)


def parquet_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A Parquet table with one column changed, as other writers would have it."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if rng.random() < 0.2:
        return bytes_mutant(seed, rng, path)
    try:
        table = pq.read_table(io.BytesIO(seed.path.read_bytes()), use_threads=False)
        table, how, same_rows = table_changed(table, rng)
        codec = pick(rng, ("snappy", "zstd", "gzip", "none", "lz4"))
        group = pick(rng, (7, 100, 10**6))
        pq.write_table(table, path, compression=codec, row_group_size=group)
    except (pa.ArrowException, TypeError, ValueError, OverflowError):
        return bytes_mutant(seed, rng, path)
    return Mutant(f"parquet {how}", table.num_rows if same_rows else None)


def table_changed(table: Any, rng: Rng) -> tuple[Any, str, bool]:
    """An Arrow table with one column changed, what was done, and whether its rows are the same."""
    import pyarrow as pa

    k = int(rng.integers(table.num_columns))
    name, values = table.column_names[k], table.column(k).to_pylist()
    kind = int(rng.integers(9))
    if kind <= 1:
        table = table.set_column(k, name, pa.array(cells_changed(values, rng)))
    elif kind == 2:
        types = (pa.float32(), pa.int8(), pa.string(), pa.list_(pa.float64()), pa.bool_(),
                 pa.timestamp("us"), pa.decimal128(20, 5), pa.null(), pa.float16(),
                 pa.list_(pa.float64(), 3), pa.struct([("x", pa.float64())]))  # fmt: skip
        kind_of = pick(rng, types)
        table = table.set_column(k, name, pa.array(recast(values, kind_of), kind_of))
    elif kind == 3:
        table = table.drop_columns([name])
    elif kind == 4:
        other = pick(rng, table.column_names) if rng.random() < 0.4 else pick(rng, WORDS)
        names = [other[:100] if n == name else n for n in table.column_names]
        table = table.rename_columns(names)
    elif kind == 5:
        table = table.slice(0, int(rng.integers(0, 3)))
    elif kind == 6:
        table = table.set_column(k, name, table.column(k).dictionary_encode())
    elif kind == 7:
        order = rng.permutation(table.num_rows)
        table = table.take(pa.array(order[: int(rng.integers(1, len(order) + 1))]))
    else:
        put = pick(rng, ([], [[]], None, [None], {}, "x", 3, [[1.0], [2.0]]))
        table = table.set_column(k, name, pa.array([put] * table.num_rows))
    return table, f"{kind} {name}", kind in {0, 1, 6}


def cells_changed(values: list[Any], rng: Rng) -> list[Any]:
    """Some of a column's cells changed: numbers, nulls, lists cut or emptied."""
    put = pick(rng, (None, 0.0, float("nan"), float("inf"), 1e308, 5e-324, -1.0, 2**53))
    kind = int(rng.integers(4))
    for k in some(rng, len(values)):
        old = values[k]
        if not isinstance(old, list):
            values[k] = put if not isinstance(old, str) else None
        elif kind == 0 and old:
            values[k] = [*old[:-1], put]
        else:
            values[k] = (None, [], old[:-1], [put] * len(old))[kind]
    return values


def recast(values: list[Any], kind: Any) -> list[Any]:
    """A column's values as another Arrow type takes them."""
    makes: dict[str, Any] = {
        "list": lambda _, number: [number] * 3,
        "fixed": lambda _, number: [number] * 3,
        "struct": lambda _, number: {"x": number},
        "null": lambda *_: None,
        "string": lambda value, _: str(value),
        "int8": lambda _, number: int(number) % 100,
        "bool": lambda _, number: bool(number),
        "timestamp": lambda _, number: int(number * 1e6),
        "halffloat": lambda _, number: np.float16(number),
    }
    make = next((makes[k] for k in makes if str(kind).startswith(k)), lambda _, number: number)
    firsts = (value[0] if isinstance(value, list) and value else value for value in values)
    numbers = (float(first) if isinstance(first, int | float) else 0.0 for first in firsts)
    return [make(value, number) for value, number in zip(values, numbers, strict=True)]


RECORD_KINDS = (b"DOUBLE", b"INT32", b"VECTOR6D", b"BOOL", b"UINT64", b"NONE", b"", b"UINT8")


def record_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A UR binary: its names, its types, or its records changed."""
    if rng.random() < 0.3:
        return bytes_mutant(seed, rng, path)
    names, types, body = seed.path.read_bytes().split(b"\n", 2)
    kind = int(rng.integers(6))
    words, kinds = names.split(b" "), types.split(b" ")
    if kind == 0:
        words[int(rng.integers(len(words)))] = pick(rng, WORDS).encode("utf-8", "replace")[:50]
    elif kind == 1:
        kinds[int(rng.integers(len(kinds)))] = pick(rng, RECORD_KINDS)
    elif kind == 2:
        place = int(rng.integers(len(body) // 8)) * 8
        number = np.array([pick(rng, NUMBERS)], dtype=object).astype(">f8").tobytes()
        body = body[:place] + number + body[place + 8 :]
    elif kind == 3:
        body = body[: int(rng.integers(0, len(body)))]
    elif kind == 4:
        a, b = rng.integers(0, len(words), 2)
        words[a], words[b] = words[b], words[a]
    else:
        kinds = kinds[:-1]
    path.write_bytes(b" ".join(words) + b"\n" + b" ".join(kinds) + b"\n" + body)
    return Mutant(f"records{kind}")
