"""Parquet by polars, where pyarrow is missing: the same numbers, the same words."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.readers.columnar import ColumnarTable
from vftcli.readers.parquet import PolarsParquet, PyarrowParquet
from vftcli.readers.reader import open_log
from vftcli.signals.errors import LogError

EITHER = pytest.mark.parametrize("kind", [PyarrowParquet, PolarsParquet])

ROWS = 40


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Columns of every kind that a log may have, and some that it may not."""
    row = np.arange(ROWS)
    first = datetime(2026, 1, 1)
    columns = {
        "t": 1_767_225_600_000_000_000 + 8_000_001 * row,  # more digits than a double has
        "stamp": [first + timedelta(microseconds=8000 * k) for k in range(ROWS)],
        "q": np.sin(row[:, None] + np.arange(6)),
        "listed": [[float(k), None] for k in range(ROWS)],
        "gap": [None if k == 3 else k for k in range(ROWS)],
        "flag": row % 2 == 0,
        "word": ["a"] * ROWS,
        "uneven": [[0.0] * (1 + (k == 5)) for k in range(ROWS)],
        "episode_index": row // 20,
    }
    table = pl.DataFrame(columns)
    table.write_parquet(tmp_path / "x", metadata={"vftcli": '{"joint_names": ["a"]}'})
    return tmp_path / "x"


def test_the_numbers_are_pyarrows(path: Path) -> None:
    ours, theirs = PolarsParquet(open_log(path)), PyarrowParquet(open_log(path))
    assert (ours.names, ours.width, ours.told()) == (theirs.names, theirs.width, theirs.told())
    assert dict(ours.lists) == dict(theirs.lists) == {2: 6, 3: 2, 7: 1}
    np.testing.assert_array_equal(ours.episodes(), theirs.episodes())
    for rows in (None, np.arange(20, ROWS)):
        for clock in (0, 1, None):
            for table in (ours, theirs):
                table.keep(rows)
            found, expected = (t.load([0, 1, 2, 3, 4, 5], clock) for t in (ours, theirs))
            for column, values in expected.items():
                assert found[column].dtype == values.dtype
                np.testing.assert_array_equal(found[column], values)


@EITHER
@pytest.mark.parametrize(
    ("column", "words"), [(6, "column word holds .*, not numbers"), (7, "are not all 1 long")]
)
def test_what_is_no_signal_is_refused(
    path: Path, kind: type[ColumnarTable], column: int, words: str
) -> None:
    with pytest.raises(LogError, match=words):
        kind(open_log(path)).load([column], None)


@EITHER
def test_a_damaged_file_is_named(path: Path, kind: type[ColumnarTable]) -> None:
    path.write_bytes(path.read_bytes()[:-200] + bytes(200))
    with pytest.raises(LogError, match="a damaged Parquet or Arrow file"):
        kind(open_log(path))


@EITHER
def test_a_table_without_rows_is_refused(tmp_path: Path, kind: type[ColumnarTable]) -> None:
    pl.DataFrame({"t": [], "q": []}).write_parquet(tmp_path / "x")
    with pytest.raises(LogError, match="has no rows"):
        kind(open_log(tmp_path / "x"))


@EITHER
def test_more_rows_than_a_file_can_hold_are_refused(
    tmp_path: Path, kind: type[ColumnarTable]
) -> None:
    """18 million zeros, run-length encoded, are 144 MB of numbers in some kilobytes."""
    pl.DataFrame({"q": pl.zeros(18_000_000, pl.Int8, eager=True)}).write_parquet(tmp_path / "x")
    with pytest.raises(LogError, match="unpack to more than 128 MiB"):
        kind(open_log(tmp_path / "x")).load([0], None)
