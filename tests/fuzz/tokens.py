"""What is put where a number, a name or a row was, and the input that comes of it."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

Rng = np.random.Generator

NUMBERS: tuple[float | int, ...] = (
    0, 1, -1, -0.0, 5e-324, 1e-320, 1e-30, 1e-9, 0.5, 7.0, 180.0, 1e5, 1e9, 1e16, 1e20, 1e154,
    1e200, 1e308, -1e308, math.nan, math.inf, -math.inf, 2**31, 2**53 + 1, 2**63, 2**64, 10**30,
)  # fmt: skip

WORDS = (
    "", " ", "nan", "NaN", "inf", "-inf", "null", "None", "true", "1_5", "1,5", "1e999", "0x10",
    "١٢", "heavy", "<b>", "a\tb", "{", "[", '"', "'", "é", "1 2 3 4", "-", "--", "1..2", "a|b",
    "q[0]", "{i}", "x" * 3000, "\x1b[31m", "\\", "%s", "t", "q_0", "dq_0", "time", "9" * 400,
)  # fmt: skip


class Seed(NamedTuple):
    """A small sound file, or the folder of a bag, and the family of its mutator to start from."""

    name: str
    family: str
    path: Path
    columns: str | None = None
    """Its --columns, None where its names say them."""
    samples: int | None = None
    """Samples that a reader takes from it and its joints, None before it was read."""
    joints: int | None = None
    model: Any = None
    """What its mutator takes apart, where that is made beforehand."""


class Mutant(NamedTuple):
    """What was done to a file; where it is if elsewhere, and its rows where they are known."""

    how: str
    rows: int | None = None
    path: Path | None = None


def pick(rng: Rng, items: Any) -> Any:
    return items[int(rng.integers(len(items)))]


def some(rng: Rng, count: int) -> list[int]:
    """A few places among `count`: one, some, or all."""
    share = pick(rng, (0.0, 0.0, 0.05, 0.5, 1.0))
    chosen = np.flatnonzero(rng.random(count) < share)
    return chosen.tolist() if len(chosen) else [int(rng.integers(count))]
