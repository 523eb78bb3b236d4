"""Mutations of any file: bytes flipped, cut, moved, repeated, a count blown up, a word put in."""

from collections.abc import Callable
from pathlib import Path

from tokens import Mutant, Rng, Seed

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


def insert(data: bytes, rng: Rng) -> bytes:
    place = int(rng.integers(len(data)))
    return data[:place] + rng.bytes(int(rng.integers(1, 64))) + data[place:]


def repeat(data: bytes, rng: Rng) -> bytes:
    a, b = sorted(rng.integers(0, len(data), 2))
    return data[: int(b)] + data[int(a) :]


def huge_count(data: bytes, rng: Rng) -> bytes:
    out = bytearray(data)
    size = int(rng.choice([2, 4, 8]))
    place = int(rng.integers(0, max(1, len(out) - size)))
    values = (b"\xff" * size, b"\xff" * (size - 1) + b"\x7f", bytes(size))
    out[place : place + size] = values[int(rng.integers(3))]
    return bytes(out)


def token(data: bytes, rng: Rng) -> bytes:
    """Put something where a number or a name was."""
    place = int(rng.integers(len(data)))
    gone = int(rng.integers(0, 12))
    return data[:place] + TOKENS[int(rng.integers(len(TOKENS)))] + data[place + gone :]


MUTATIONS: tuple[Callable[[bytes, Rng], bytes], ...] = (
    flip, flip, flip_early, cut, cut_middle, insert, repeat, huge_count, token, token,
)  # fmt: skip


def mutate_bytes(data: bytes, rng: Rng) -> tuple[bytes, str]:
    """The bytes after one to three mutations, and what was done to them."""
    how = []
    for _ in range(int(rng.integers(1, 4))):
        mutation = MUTATIONS[int(rng.integers(len(MUTATIONS)))]
        data = mutation(data, rng) or b"\0"
        how.append(mutation.__name__)
    return data, "+".join(how)


def bytes_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """The file with some of its bytes changed."""
    data, how = mutate_bytes(seed.path.read_bytes(), rng)
    path.write_bytes(data)
    return Mutant(how)
