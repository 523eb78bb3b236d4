"""One thing changed in what a file holds: bytes, a list, an array, or a tree of them."""

from collections.abc import Callable
from typing import Any

import numpy as np
from tokens import NUMBERS, WORDS, Rng, pick, some

Change = Callable[[Any, Rng], Any]
"""Makes another value of a value."""

# Bytes

TOKENS = (
    b"nan", b"inf", b"-", b"1e999", b"", b"\n", b"\r", b",", b" ", b'"', b"#", b"\0", b"{",
    b"[" * 2000, b'{"a":' * 500, b"9" * 400, b"\xff\xfe", b"\xef\xbb\xbf",
)  # fmt: skip


def flip(data: bytes, rng: Rng) -> bytes:
    out = bytearray(data)
    for place in rng.integers(0, len(out), rng.integers(1, 9)):
        out[place] ^= 1 << int(rng.integers(8))
    return bytes(out)


def flip_early(data: bytes, rng: Rng) -> bytes:
    return flip(data[:512], rng) + data[512:]


def cut(data: bytes, rng: Rng) -> bytes:
    return data[: int(rng.integers(1, max(2, len(data))))]


def cut_middle(data: bytes, rng: Rng) -> bytes:
    a, b = sorted(rng.integers(0, len(data), 2))
    return data[: int(a)] + data[int(b) :]


def repeat(data: bytes, rng: Rng) -> bytes:
    a, b = sorted(rng.integers(0, len(data), 2))
    return data[: int(b)] + data[int(a) :]


def put(data: bytes, rng: Rng, new: bytes, gone: int, even: int = 1) -> bytes:
    """The data with new bytes in the place of some, at a multiple of `even`."""
    place = int(rng.integers(len(data) // even + 1)) * even
    return data[:place] + new + data[place + gone :]


def insert(data: bytes, rng: Rng) -> bytes:
    return put(data, rng, rng.bytes(int(rng.integers(1, 64))), 0)


def huge_count(data: bytes, rng: Rng) -> bytes:
    size = int(rng.choice([2, 4, 8]))
    counts = (b"\xff" * size, b"\xff" * (size - 1) + b"\x7f", bytes(size))
    return put(data, rng, pick(rng, counts), size)


def token(data: bytes, rng: Rng) -> bytes:
    """Something where a number or a name was."""
    return put(data, rng, pick(rng, TOKENS), int(rng.integers(0, 12)))


def double(data: bytes, rng: Rng) -> bytes:
    """A number of eight bytes, of either order, where one may stand."""
    number = np.array(min(pick(rng, NUMBERS), 1.7e308), dtype=pick(rng, ("<f8", ">f8")))
    return put(data, rng, number.tobytes(), 8, even=4)


MUTATIONS: tuple[Callable[[bytes, Rng], bytes], ...] = (
    flip, flip, flip_early, cut, cut_middle, insert, repeat, huge_count, token, token, double,
)  # fmt: skip


def bytes_changed(data: bytes, rng: Rng) -> tuple[bytes, str]:
    """The bytes after one to three mutations, and what was done to them."""
    how = []
    for _ in range(int(rng.integers(1, 4))):
        mutation = pick(rng, MUTATIONS)
        data = mutation(data or b"\0", rng) or b"\0"
        how.append(mutation.__name__)
    return data, "+".join(how)


def odd_bytes(value: Any, rng: Rng) -> Any:
    """Bytes after one mutation; what is none stays."""
    return pick(rng, MUTATIONS)(value, rng) if isinstance(value, bytes) and value else value


# Lists

SAME_LENGTH = {"changed", "swapped"}
KINDS = (*["changed"] * 6, "swapped", "lost", "repeated", "moved", "elsewhere", "few")
"""What is done to a list."""


def list_changed(items: list[Any], rng: Rng, change: Change) -> str:
    """Change a list in place, one of `KINDS`; where some items change, all do in the same way."""
    if not items:
        return "empty"
    kind, chosen = pick(rng, KINDS), some(rng, len(items))
    if kind == "changed":
        seed = int(rng.integers(2**32))
        for k in chosen:
            items[k] = change(items[k], np.random.default_rng(seed))
    elif kind == "swapped":
        a, b = rng.integers(0, len(items), 2)
        items[a], items[b] = items[b], items[a]
    elif kind == "elsewhere":
        items.insert(int(rng.integers(len(items))), items[chosen[0]])
    else:
        rows = np.arange(len(items))
        order = {
            "lost": np.setdiff1d(rows, chosen),
            "repeated": np.sort(np.append(rows, chosen)),
            "moved": pick(rng, (rows[::-1], rng.permutation(rows))),
            "few": rows[: int(rng.integers(0, 4))],
        }[kind]
        items[:] = [items[k] for k in order]
    return kind


# Arrays

DTYPES = (
    "f4", "f2", "i1", "i8", "u1", "?", ">f8", "c16", "O", "U8", "S4", "M8[ms]", "m8[s]", ">i4",
)  # fmt: skip


def numbers_changed(value: np.ndarray, rng: Rng) -> np.ndarray:
    """The array with some of its numbers changed, or its rows as another clock would have them."""
    out = np.array(value, dtype=float)
    if out.size == 0:
        return out
    odd = np.float64(min(max(pick(rng, NUMBERS), -1.7e308), 1.7e308))
    factor = pick(rng, (odd, 57.29577951308232, 1000.0, -1.0, 1e-12, 1e9, 1e-310))
    rows = np.arange(len(out)) if out.ndim else np.zeros((), int)
    late = (rows > rows.size // 2).reshape(-1, *[1] * (out.ndim - 1)) if out.ndim else False
    kind = int(rng.integers(12))
    with np.errstate(all="ignore"):
        if kind == 0:
            out.reshape(-1)[some(rng, out.size)] = odd
        elif kind == 1:
            out[some(rng, len(out)) if out.ndim else ...] = odd
        elif kind == 2:
            out[...] = odd
        elif kind <= 5:
            out *= factor
        else:
            out = (
                np.round(out), out[::-1].copy() if out.ndim else out, -out,
                out[rows // 2 * 2], out + odd * late, out - out[rows.size // 2] * late,
            )[kind - 6]  # fmt: skip
    return out


def shape_changed(value: np.ndarray, rng: Rng) -> np.ndarray:
    if value.ndim == 0 or value.size == 0:
        return np.zeros((3, 3))
    half, number = value[: len(value) // 2], value.reshape(-1)[0]
    shapes = (value.T, value[:0], value[:1], value[0], value[None], half, number, value[..., None],
              np.concatenate([value, value]))  # fmt: skip
    return np.asarray(pick(rng, shapes))


def type_changed(value: np.ndarray, rng: Rng) -> np.ndarray:
    dtype = pick(rng, DTYPES)
    with np.errstate(all="ignore"):
        try:
            out = np.asfortranarray(value) if rng.random() < 0.1 else value
            return out.astype(dtype)
        except (TypeError, ValueError):
            return value.astype(str)


def array_changed(value: np.ndarray, rng: Rng) -> np.ndarray:
    change = pick(rng, (*[numbers_changed] * 3, shape_changed, type_changed))
    try:
        return change(value, rng)
    except (TypeError, ValueError):
        return value[:0] if value.ndim else np.zeros((0, 7))


# Trees


def odd_value(_old: Any, rng: Rng) -> Any:
    """A value of another type or size, as JSON has them."""
    deep: Any = []
    for _ in range(50):
        deep = [deep]
    odd = (None, True, {}, [], [[]], {"a": 1}, [1] * 9, ["a"], [None], deep, "x")
    kind = rng.random()
    return pick(rng, odd) if kind < 0.5 else pick(rng, NUMBERS if kind < 0.8 else WORDS)


def dict_changed(tree: dict[Any, Any], rng: Rng, change: Change) -> tuple[dict[Any, Any], str]:
    """The tree with the value of a key changed, gone, or under another name; and how."""
    key, kind = pick(rng, list(tree)), rng.random()
    if kind < 0.65:
        return {k: change(v, rng) if k == key else v for k, v in tree.items()}, f"changed {key}"
    if kind < 0.8:
        return {k: v for k, v in tree.items() if k != key}, f"without {key}"
    new = pick(rng, list(tree)) if rng.random() < 0.5 else pick(rng, WORDS)[:100] or "x"
    return {new if k == key else k: v for k, v in tree.items()}, f"renamed {key}"


def tree_changed(tree: Any, rng: Rng, odd: Change = odd_value, depth: int = 0) -> Any:
    """A tree of dicts, lists, arrays and values with one thing in it changed."""

    def deeper(inner: Any, rng: Rng) -> Any:
        return tree_changed(inner, rng, odd, depth + 1)

    if depth > 4 or rng.random() < 0.15:
        return odd(tree, rng)
    if isinstance(tree, dict) and tree:
        return dict_changed(tree, rng, deeper)[0]
    if isinstance(tree, list) and tree:
        out = list(tree)
        list_changed(out, rng, deeper)
        return out
    return array_changed(tree, rng) if isinstance(tree, np.ndarray) else odd(tree, rng)
