"""The folder of a batch: whose it is, what counts as done, what is gathered."""

import json
from pathlib import Path

import polars as pl
import pytest

from vftcli.outputs.batch_folder import BatchFolder
from vftcli.signals.errors import OutputError

KEY, OTHER = "ab" + 62 * "0", "cd" + 62 * "1"
LOGS = {"log": pl.String, "episode": pl.Int64, "key": pl.String}


def rows(key: str, *joints: int) -> pl.DataFrame:
    return pl.DataFrame({"key": key, "joint": joints})


@pytest.fixture
def folder(tmp_path: Path) -> BatchFolder:
    made = BatchFolder(tmp_path / "out")
    with made.opened("options", {"command": "vftcli batch"}, force=False):
        made.put_rows(KEY, rows(KEY, 1, 2))
    return made


def test_the_table_is_in_the_logs_order_and_equal_logs_share_rows(folder: BatchFolder) -> None:
    assert folder.keys() == {KEY}
    folder.put_rows(OTHER, rows(OTHER, 7))
    found = {"log": ["z", "b", "a"], "episode": [None, 1, None], "key": [OTHER, KEY, KEY]}
    (table,) = folder.gather(pl.DataFrame(found, schema=LOGS), {})
    assert list(table.select("log", "joint").iter_rows()) == [
        ("z", 7), ("b", 1), ("b", 2), ("a", 1), ("a", 2)
    ]  # fmt: skip
    schema = {"key": pl.String, "joint": pl.Int64}
    (table,) = folder.gather(pl.DataFrame(schema=LOGS), schema)  # no log
    assert table.columns == ["log", "episode", "key", "joint"]


def test_the_seal_is_the_last_file_and_lists_the_others(folder: BatchFolder) -> None:
    table = rows(KEY, 1)
    folder.put_gathered(iter([table, rows(KEY, 2)]), table, lambda: "<html>", {"command": "x"})
    assert pl.read_parquet(folder.path / "batch.parquet").equals(rows(KEY, 1, 2))
    record = json.loads((folder.path / "run.json").read_text())
    assert set(record["files"]) == {"batch.parquet", "failures.parquet", "index.html"}


def test_other_options_are_refused_if_it_has_rows(folder: BatchFolder, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="other options"):
        folder.opened("others", {}, force=False).__enter__()
    with folder.opened("others", {}, force=True):
        assert folder.keys() == {KEY}
    empty = BatchFolder(tmp_path / "empty")
    for options in ("one", "two"):
        with empty.opened(options, {}, force=False):
            pass


def test_a_folder_of_others_or_busy_is_refused(folder: BatchFolder, tmp_path: Path) -> None:
    (tmp_path / "run.json").touch()
    with pytest.raises(OutputError, match="no batch wrote"):
        BatchFolder(tmp_path).opened("options", {}, force=False).__enter__()
    busy = folder.opened("options", {}, force=False)
    with busy, pytest.raises(OutputError, match="another batch"):
        BatchFolder(folder.path).opened("options", {}, force=False).__enter__()
