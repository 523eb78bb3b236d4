"""BatchFolder: results of many logs, a file a log, and tables of all.

``rows/<key[:2]>/<key>.parquet`` is the last file of a log's result, and marks it as
complete. ``logs/<key[:2]>/<key>/`` holds the log's other files.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import polars as pl

from vftcli.outputs import Record
from vftcli.outputs.files import (
    SEAL,
    atomic,
    check_letters,
    check_writable,
    digest,
    held,
    table_file,
    write_text,
    writing,
)
from vftcli.outputs.run_record import to_json
from vftcli.signals.errors import OutputError

#: Command and options of the rows; the first file of a batch.
MARKER = "batch.json"

TABLE, FAILURES, PAGE = "batch.parquet", "failures.parquet", "index.html"

GATHERED = (TABLE, FAILURES, PAGE, SEAL)  #: Files made anew by every run.
PIECE = 500  #: Logs with rows in memory at a time.


class BatchFolder:
    """The folder of a batch; `table` names its gathered table."""

    def __init__(self, path: Path, table: str = TABLE) -> None:
        self.path, self.table = Path(path), table
        self.rows = self.path / "rows"

    def row_file(self, key: str) -> Path:
        """Place of a log's rows."""
        return self.rows / key[:2] / f"{key}.parquet"

    @staticmethod
    def place(key: str) -> str:
        """Place of a log's result, relative to the folder."""
        return f"logs/{key[:2]}/{key}"

    def made(self, name: str) -> Path:
        """A folder `name` for files made before the work."""
        place = self.path / "made" / name
        place.mkdir(parents=True, exist_ok=True)
        return place

    @contextmanager
    def opened(self, options: str, record: Record, *, force: bool) -> Iterator[None]:
        """Make or resume the folder, held for a block."""
        with writing(self.path):
            check_letters(self.path)
            self._check(options, force=force)
            self.rows.mkdir(parents=True, exist_ok=True)
            check_writable(self.rows)
            try:
                with held(self.rows, wait=False):
                    text = to_json({**record, "options_sha256": options})
                    write_text(self.path / MARKER, text, force=True)
                    yield
            except BlockingIOError:
                raise OutputError(
                    f"another batch writes into {self.path}; wait for its end, or give another -o"
                ) from None

    def _check(self, options: str, *, force: bool) -> None:
        """Raise an OutputError if the folder is another batch's."""
        if not (self.path / MARKER).is_file():
            there = [name for name in (*GATHERED, "rows", "logs") if (self.path / name).exists()]
            if there and not force:
                raise OutputError(
                    f"{self.path} holds {there[0]}, which no batch wrote; give another -o, or "
                    "--force to overwrite it"
                )
            return
        try:
            made_with = json.loads((self.path / MARKER).read_text("utf-8"))
            same = made_with.get("options_sha256") == options
            command = made_with.get("command", "")
        except (ValueError, AttributeError):
            same, command = False, ""
        if not same and not force and self.keys():
            raise OutputError(
                f"{self.path} holds a batch of other options or another version ({command}); give "
                "another -o, or --force: finished logs of those options are kept beside"
            )

    def keys(self) -> set[str]:
        """Keys of finished logs."""
        found = self.rows.glob("*/*.parquet") if self.rows.is_dir() else ()
        return {path.stem for path in found}

    def put_rows(self, key: str, rows: pl.DataFrame) -> None:
        """Write a log's rows: with them its result is complete."""
        path = self.row_file(key)
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic(path, force=True) as temporary, table_file(temporary) as file:
            rows.write_parquet(file, compression="zstd", statistics=False)

    def read_rows(self, keys: Iterable[str], schema: Record) -> pl.DataFrame:
        """Rows of finished logs, one log after another."""
        files = [self.row_file(key) for key in keys]
        return pl.read_parquet(files) if files else pl.DataFrame(schema=schema)

    def gather(self, logs: pl.DataFrame, schema: Record) -> Iterator[pl.DataFrame]:
        """Rows of all logs in their order, `PIECE` logs at a time."""
        for part in logs.iter_slices(PIECE) if logs.height else (logs,):
            rows = self.read_rows(part["key"].unique(maintain_order=True), schema)
            yield part.join(rows, on="key", how="left", maintain_order="left_right")

    def put_gathered(
        self,
        tables: Iterable[pl.DataFrame],
        failures: pl.DataFrame,
        page: Callable[[], str],
        record: Record,
    ) -> None:
        """Write tables, a row group a piece, then page, then seal."""
        from pyarrow.parquet import ParquetWriter

        (self.path / SEAL).unlink(missing_ok=True)
        for name, pieces in ((self.table, tables), (FAILURES, (failures,))):
            with atomic(self.path / name, force=True) as temporary, ExitStack() as stack:
                writer = None
                for piece in pieces:
                    # Text of the kind that Arrow has always had.
                    table = piece.to_arrow(compat_level=pl.CompatLevel.oldest())
                    if writer is None:
                        writer = ParquetWriter(temporary, table.schema, compression="zstd")
                        stack.enter_context(writer)
                    writer.write_table(table)
        write_text(self.path / PAGE, page(), force=True)
        files = {name: digest(self.path / name) for name in (self.table, FAILURES, PAGE)}
        write_text(self.path / SEAL, to_json({**record, "files": files}), force=True)
