"""Long logs: block by block they are what they are in one piece, whatever comes at a time."""

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.readers import long_log, read_chosen
from vftcli.readers.reader import ReadChoice
from vftcli.signals.errors import ClockError, LogError
from vftcli.signals.recording import Recording

FIXTURES = Path(__file__).parents[2] / "fixtures"


@pytest.fixture(autouse=True)
def in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every log counts as a long one; few rows of it come at a time."""
    for name, value in (
        ("picking.WHOLE_ROWS", 0),
        ("parquet.BLOCK_ROWS", 7),
        ("delimited.BLOCK_BYTES", 3000),
        ("bags.reading.BLOCK_MESSAGES", 50),
    ):
        module, _, constant = name.rpartition(".")
        monkeypatch.setattr(importlib.import_module(f"vftcli.readers.{module}"), constant, value)
    reading = importlib.import_module("vftcli.readers.bags.reading")
    monkeypatch.setattr(reading, "WHOLE_BYTES", 0)


def table(rows: int = 300) -> pl.DataFrame:
    """A log of two joints at 100 Hz."""
    t = np.arange(rows) / 100
    columns = {"t": t}
    for j in (1, 2):
        columns |= {f"q/{j}": np.sin(j * t), f"dq/{j}": j * np.cos(j * t), f"tau/{j}": t + j}
    return pl.DataFrame(columns)


def both_ways(path: Path, choice: ReadChoice | None = None) -> tuple[Recording, Recording]:
    """The log in one piece, and in blocks."""
    choice = choice or ReadChoice()
    return read_chosen(path, choice), read_chosen(path, replace(choice, blocks=True))


def check_same(whole: Recording, long: Recording, size: int) -> None:
    """Check that a log's blocks are the whole log, and that the same is said of it."""
    assert long.long is not None
    blocks = list(long.long.blocks(size))
    assert [b.samples for b in blocks[:-1]] == [size] * (len(blocks) - 1)
    for name in ("t", *blocks[0].signals):
        joined = np.concatenate([getattr(block, name) for block in blocks])
        np.testing.assert_array_equal(joined, getattr(whole, name))
    assert long.all_samples == whole.samples
    assert long.median_step == whole.median_step
    for name in ("remarks", "rows", "duplicates", "t0", "t0_ns", "clock", "sha256"):
        assert getattr(long.source, name) == getattr(whole.source, name)
    assert (long.joint_names, long.robot_hint) == (whole.joint_names, whole.robot_hint)
    assert (long.payload_mass, long.payload_com) == (whole.payload_mass, whole.payload_com)


@pytest.mark.parametrize("size", [1, 7, 1000])
@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_same_in_blocks(tmp_path: Path, ending: str, size: int) -> None:
    """One at a time, seven, and all: the numbers of the whole."""
    path = tmp_path / f"log.{ending}"
    if ending == "csv":
        table().write_csv(path)
    else:
        table().write_parquet(path, row_group_size=64)
    check_same(*both_ways(path), size)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5_circle.csv"])
def test_same_of_fixtures(name: str) -> None:
    """The fixtures' own formats, their payload and clocks."""
    check_same(*both_ways(FIXTURES / name), 512)


def test_repeated_stamps_over_a_border(tmp_path: Path) -> None:
    """A row that repeats the last stamp of the block before is dropped, and one that differs told.

    Parquet comes seven rows at a time, so row 7 is the first of a block.
    """
    rows = table(100).with_columns(
        t=pl.Series([k / 100 if k not in {7, 21, 22} else (k - 1) / 100 for k in range(100)])
    )
    path = tmp_path / "log.parquet"
    rows.with_columns(t=pl.col("t").cum_max()).write_parquet(path)
    whole, long = both_ways(path)
    assert whole.source.duplicates == 2
    check_same(whole, long, 10)


def test_gaps_and_jitter(tmp_path: Path) -> None:
    """Gaps are counted over the whole log, the median of an uneven clock is that of all."""
    rng = np.random.default_rng(3)
    steps = 0.01 + 0.001 * rng.random(400)
    steps[[50, 51, 300]] = 0.3, 0.2, 0.5
    path = tmp_path / "log.parquet"
    table(400).with_columns(t=pl.Series(np.cumsum(steps))).write_parquet(path)
    whole, long = both_ways(path)
    check_same(whole, long, 64)
    assert long.long is not None
    assert not long.long.timing.uniform
    assert long.steps[:, 0].max() == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("row", "column", "value", "error"),
    [(150, "t", 0.0, ClockError), (150, "q/1", float("nan"), LogError)],
)
def test_odd_logs_are_told_by_the_whole(
    tmp_path: Path, row: int, column: str, value: float, error: type[Exception]
) -> None:
    """A clock that runs back and a number that is none are refused in the same words."""
    rows = table().with_columns(
        pl.when(pl.int_range(300) == row).then(value).otherwise(pl.col(column)).alias(column)
    )
    path = tmp_path / "log.parquet"
    rows.write_parquet(path)
    said = []
    for blocks in (False, True):
        with pytest.raises(error) as caught:
            read_chosen(path, ReadChoice(blocks=blocks))
        said.append(str(caught.value))
    assert said[0] == said[1]


def test_quoted_text_is_read_whole(tmp_path: Path) -> None:
    """A table with quotes is not cut at line ends."""
    path = tmp_path / "log.csv"
    path.write_text(table().write_csv().replace("t,q/1", '"t",q/1'), encoding="utf-8")
    whole, long = both_ways(path)
    assert long.long is None
    np.testing.assert_array_equal(long.t, whole.t)


def test_stretches_are_drawn_evenly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a log longer than the stretches its first and last samples, and some between them."""
    monkeypatch.setattr(long_log, "STRETCH_ROWS", 10)
    monkeypatch.setattr(long_log, "STRETCHES", 3)
    path = tmp_path / "log.parquet"
    table(5000).write_parquet(path)
    whole, long = both_ways(path)
    assert 30 <= long.samples <= 80
    assert (long.t[0], long.t[-1]) == (whole.t[0], whole.t[-1])
    assert long.duration == whole.duration
    rows = np.searchsorted(whole.t, long.t)
    np.testing.assert_array_equal(long.q, whole.q[rows])
    assert np.max(np.diff(rows)) < 5000 / 3


def test_blocks_change_as_the_recording_does(tmp_path: Path) -> None:
    """An effort that is taken for another kind is so in every block."""
    path = tmp_path / "log.parquet"
    table().write_parquet(path)
    whole, long = (r.with_effort("current", factor=2.0) for r in both_ways(path))
    check_same(whole, replace(long, source=whole.source), 100)


def test_log_that_grows_is_refused(tmp_path: Path) -> None:
    """A log that is other the second time it is read gives no numbers in silence."""
    path = tmp_path / "log.parquet"
    table().write_parquet(path)
    _, long = both_ways(path)
    table(200).write_parquet(path)
    assert long.long is not None
    with pytest.raises(LogError, match="changed while it was read"):
        list(long.long.blocks(100))


def test_a_last_row_that_is_cut_is_told_as_of_the_whole(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    table().write_csv(path)
    path.write_bytes(path.read_bytes()[:-5])
    whole, long = both_ways(path)
    check_same(whole, long, 7)
    assert [remark.code for remark in long.source.remarks] == ["row-cut"]
