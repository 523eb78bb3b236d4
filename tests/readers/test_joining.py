"""Long logs: part by part they are what they are in one piece, whatever comes at a time."""

import importlib
import re
import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from seed_logs import bare_db3, bare_mcap

from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import read_chosen
from vftcli.signals.errors import ClockError, LogError, VftError
from vftcli.signals.recording import Recording

FIXTURES = Path(__file__).parents[2] / "fixtures"
PARTS = {
    "parquet.BLOCK_ROWS": 7,
    "tables.BLOCK_ROWS": 7,
    "delimited.BLOCK_BYTES": 3000,
    "table.HELD": 500,
    "bags.container.BATCH_BYTES": 10_000,
}


@pytest.fixture(autouse=True)
def in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every log counts as a long one; few rows of it come at a time, and wait in memory."""
    for name, value in PARTS.items():
        module, _, constant = name.rpartition(".")
        monkeypatch.setattr(importlib.import_module(f"vftcli.readers.{module}"), constant, value)


def table(rows: int = 300) -> pl.DataFrame:
    """A log of two joints at 100 Hz."""
    t = np.arange(rows) / 100
    columns = {"t": t}
    for j in (1, 2):
        columns |= {f"q/{j}": np.sin(j * t), f"dq/{j}": j * np.cos(j * t), f"tau/{j}": t + j}
    return pl.DataFrame(columns)


@contextmanager
def one_piece() -> Iterator[None]:
    """Every log comes in one piece, and waits in memory."""
    with pytest.MonkeyPatch.context() as patch:
        for name in PARTS:
            module, _, constant = name.rpartition(".")
            patch.setattr(importlib.import_module(f"vftcli.readers.{module}"), constant, 1 << 30)
        yield


def both_ways(path: Path, choice: ReadChoice | None = None) -> tuple[Recording, Recording]:
    """The log in one piece, and in parts."""
    with one_piece():
        whole = read_chosen(path, choice or ReadChoice())
    return whole, read_chosen(path, choice or ReadChoice())


def check_same(whole: Recording, long: Recording) -> None:
    """Check that a log in parts is the whole log, and that the same is said of it."""
    assert long.signals == whole.signals
    for name in ("t", *whole.signals):
        np.testing.assert_array_equal(getattr(long, name), getattr(whole, name))
    for name in ("remarks", "rows", "duplicates", "t0", "t0_ns", "clock", "sha256"):
        assert getattr(long.source, name) == getattr(whole.source, name)
    np.testing.assert_array_equal(long.source.row_samples, whole.source.row_samples)
    assert (long.joint_names, long.robot_hint) == (whole.joint_names, whole.robot_hint)
    assert (long.payload_mass, long.payload_com) == (whole.payload_mass, whole.payload_com)


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_same_in_parts(tmp_path: Path, ending: str) -> None:
    """The numbers of the whole, and its blocks are those of both."""
    path = tmp_path / f"log.{ending}"
    if ending == "csv":
        table().write_csv(path)
    else:
        table().write_parquet(path, row_group_size=64)
    whole, long = both_ways(path)
    check_same(whole, long)
    for size in (1, 7, 1000):
        blocks = list(long.blocks(size))
        assert [block.samples for block in blocks[:-1]] == [size] * (len(blocks) - 1)
        np.testing.assert_array_equal(np.concatenate([block.q for block in blocks]), whole.q)


@pytest.mark.parametrize("name", ["ur5_circle.csv"])
def test_same_of_fixtures(name: str) -> None:
    """The fixtures' own formats, their payload and clocks."""
    check_same(*both_ways(FIXTURES / name))


@pytest.mark.parametrize("made", [bare_mcap, bare_db3])
def test_same_of_bags(tmp_path: Path, made: Callable[[Path], Path]) -> None:
    """Of every topic each batch of messages is a part."""
    check_same(*both_ways(made(tmp_path / "log")))


def test_repeated_stamps_over_a_border(tmp_path: Path) -> None:
    """A row that repeats the last stamp of the block before is dropped; another one is reported.

    Parquet comes seven rows at a time, so row 7 is the first of a block.
    """
    rows = table(100).with_columns(
        t=pl.Series([k / 100 if k not in {7, 21, 22} else (k - 1) / 100 for k in range(100)])
    )
    path = tmp_path / "log.parquet"
    rows.with_columns(t=pl.col("t").cum_max()).write_parquet(path)
    whole, long = both_ways(path)
    assert whole.source.duplicates == 2
    check_same(whole, long)


def test_gaps_and_jitter(tmp_path: Path) -> None:
    """Gaps are counted over the whole log, the median of an uneven clock is that of all."""
    rng = np.random.default_rng(3)
    steps = 0.01 + 0.001 * rng.random(400)
    steps[[50, 51, 300]] = 0.3, 0.2, 0.5
    path = tmp_path / "log.parquet"
    table(400).with_columns(t=pl.Series(np.cumsum(steps))).write_parquet(path)
    whole, long = both_ways(path)
    check_same(whole, long)
    assert [remark.values["gaps"] for remark in long.source.remarks] == [3]


@pytest.mark.parametrize(
    ("row", "column", "value", "error"),
    [(150, "t", 0.0, ClockError), (150, "q/1", float("nan"), LogError)],
)
def test_odd_logs_are_reported_by_the_whole(
    tmp_path: Path,
    row: int,
    column: str,
    value: float,
    error: type[Exception],
) -> None:
    """A clock that runs back and a number that is none are refused in the same words."""
    rows = table().with_columns(
        pl.when(pl.int_range(300) == row).then(value).otherwise(pl.col(column)).alias(column)
    )
    path = tmp_path / "log.parquet"
    rows.write_parquet(path)
    with pytest.raises(error) as refusal, one_piece():
        read_chosen(path, ReadChoice())
    with pytest.raises(error, match=re.escape(str(refusal.value))):
        read_chosen(path, ReadChoice())


@pytest.mark.parametrize(
    ("column", "values", "word"),
    [
        ("q/1", np.r_[np.full(270, 0.3), np.linspace(0.3, 90.0, 30)], "looks like degrees"),
        ("t", np.r_[np.arange(270), np.arange(30)] / 100, "the clock starts anew 1×"),
    ],
)
def test_what_the_last_tenth_says_counts(
    tmp_path: Path, column: str, values: np.ndarray, word: str
) -> None:
    """Positions that are degrees and a clock that restarts, behind nine tenths without a sign."""
    path = tmp_path / "log.parquet"
    table().with_columns(pl.Series(column, values)).write_parquet(path)
    with pytest.raises(VftError, match=word):
        read_chosen(path, ReadChoice())


@pytest.mark.parametrize("room", [0, 2000])
@pytest.mark.parametrize("made", [bare_mcap, lambda path: table().write_csv(path) or path])
def test_what_temporary_files_have_no_room_for_stays_in_memory(
    tmp_path: Path, made: Callable[[Path], Path], room: int
) -> None:
    path, (_, most) = made(tmp_path / "log"), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, most))
    try:
        check_same(*both_ways(path))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))


def test_quoted_text_is_read_whole(tmp_path: Path) -> None:
    """A table with quotes is not cut at line ends."""
    path = tmp_path / "log.csv"
    path.write_text(table().write_csv().replace("t,q/1", '"t",q/1'), encoding="utf-8")
    whole, long = both_ways(path)
    check_same(whole, long)


def test_a_last_row_that_is_cut_is_reported_as_of_the_whole(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    table().write_csv(path)
    path.write_bytes(path.read_bytes()[:-5])
    whole, long = both_ways(path)
    check_same(whole, long)
    assert [remark.code for remark in long.source.remarks] == ["row-cut"]
