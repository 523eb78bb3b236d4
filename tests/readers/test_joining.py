"""Long logs: part by part they are what they are in one piece, whatever comes at a time."""

import importlib
import re
import resource
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from seed_logs import bare_db3, bare_mcap

from vftcli.readers.reading import read
from vftcli.signals.errors import VftError
from vftcli.signals.recording import Recording

FIXTURES = Path(__file__).parents[2] / "fixtures"
PARTS = {
    "parquet.BLOCK_ROWS": 7,
    "tables.BLOCK_ROWS": 7,
    "delimited.BLOCK_BYTES": 3000,
    "table.HELD": 500,
    "bags.container.BATCH_BYTES": 10_000,
}
"""Few rows of a log come at a time, and wait in memory."""


@contextmanager
def constants(parts: Mapping[str, int]) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for name, value in parts.items():
            module, _, constant = name.rpartition(".")
            patch.setattr(importlib.import_module(f"vftcli.readers.{module}"), constant, value)
        yield


@pytest.fixture(autouse=True)
def in_parts() -> Iterator[None]:
    """Every log counts as a long one."""
    with constants(PARTS):
        yield


def one_piece() -> AbstractContextManager[None]:
    """Every log comes in one piece, and waits in memory."""
    return constants(dict.fromkeys(PARTS, 1 << 30))


def table(rows: int = 300, **changed: Any) -> pl.DataFrame:
    """A log of two joints at 100 Hz, some of its columns changed."""
    t = np.arange(rows) / 100
    columns = {"t": t}
    for j in (1, 2):
        columns |= {f"q/{j}": np.sin(j * t), f"dq/{j}": j * np.cos(j * t), f"tau/{j}": t + j}
    return pl.DataFrame(columns | changed)


def check_same(path: Path) -> tuple[Recording, Recording]:
    """Check that a log in parts is the whole log, and that the same is said of it."""
    with one_piece():
        whole = read(path)
    long = read(path)
    assert long.signals == whole.signals
    for name in ("t", *whole.signals):
        np.testing.assert_array_equal(getattr(long, name), getattr(whole, name))
    for name in ("remarks", "rows", "duplicates", "t0", "t0_ns", "clock", "sha256"):
        assert getattr(long.source, name) == getattr(whole.source, name)
    np.testing.assert_array_equal(long.source.row_samples, whole.source.row_samples)
    assert (long.joint_names, long.robot_hint) == (whole.joint_names, whole.robot_hint)
    assert (long.payload_mass, long.payload_com) == (whole.payload_mass, whole.payload_com)
    return whole, long


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_same_in_parts(path, ending):
    """The numbers of the whole, and its blocks are those of both."""
    if ending == "csv":
        table().write_csv(path)
    else:
        table().write_parquet(path, row_group_size=64)
    whole, long = check_same(path)
    for size in (1, 7, 1000):
        blocks = list(long.blocks(size))
        assert [block.samples for block in blocks[:-1]] == [size] * (len(blocks) - 1)
        np.testing.assert_array_equal(np.concatenate([block.q for block in blocks]), whole.q)


def test_same_of_formats_of_their_own(path):
    """Their payload and clocks; of every topic of a bag each batch of messages is a part."""
    check_same(FIXTURES / "ur5_circle.csv")
    for make in (bare_mcap, bare_db3):
        check_same(make(path))


def test_repeated_stamps_over_a_border(path):
    """A row that repeats the last stamp of the block before is dropped; another one is reported.

    Parquet comes seven rows at a time, so row 7 is the first of a block.
    """
    t = [k / 100 if k not in {7, 21, 22} else (k - 1) / 100 for k in range(100)]
    table(100, t=np.maximum.accumulate(t)).write_parquet(path)
    whole, _ = check_same(path)
    assert whole.source.duplicates == 2


def test_gaps_and_jitter(path):
    """Gaps are counted over the whole log, the median of an uneven clock is that of all."""
    steps = 0.01 + 0.001 * np.random.default_rng(3).random(400)
    steps[[50, 51, 300]] = 0.3, 0.2, 0.5
    table(400, t=np.cumsum(steps)).write_parquet(path)
    _, long = check_same(path)
    assert [remark.values["gaps"] for remark in long.source.remarks] == [3]


K = np.arange(300)


@pytest.mark.parametrize(
    ("column", "values", "word"),
    [
        ("t", np.where(K == 150, 0.5, K / 100), "runs backwards 1×, first at sample 151 "),
        ("q/1", np.where(K == 150, np.nan, 0.3), "nan in sample 151"),
        # what the last tenth says counts
        ("q/1", np.r_[np.full(270, 0.3), np.linspace(0.3, 90.0, 30)], "looks like degrees"),
        ("t", np.r_[np.arange(270), np.arange(30)] / 100, "the clock restarts 1×"),
    ],
)
def test_odd_logs_are_refused_in_the_words_of_the_whole(path, column, values, word):
    table(**{column: values}).write_parquet(path)
    with pytest.raises(VftError, match=word) as refusal, one_piece():
        read(path)
    with pytest.raises(type(refusal.value), match=re.escape(str(refusal.value))):
        read(path)


@pytest.mark.parametrize("room", [0, 2000])
@pytest.mark.parametrize("made", [bare_mcap, lambda path: table().write_csv(path) or path])
def test_what_temporary_files_have_no_room_for_stays_in_memory(path, made, room):
    made(path)
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, most))
    try:
        check_same(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))


def test_a_quoted_table_is_not_cut_at_line_ends_and_a_cut_row_is_said(path):
    path.write_text(table().write_csv().replace("t,q/1", '"t",q/1'), encoding="utf-8")
    check_same(path)
    path.write_bytes(table().write_csv().encode()[:-5])
    _, long = check_same(path)
    assert [remark.code for remark in long.source.remarks] == ["row-cut"]
