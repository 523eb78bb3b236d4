"""Text tables: comma, semicolon, tab or space separated, with any line end."""

import ast
import csv
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from itertools import dropwhile
from typing import Any

import numpy as np

from vftcli.readers.opening import HEAD_BYTES, LogFile
from vftcli.readers.table import Arrow, Blocks, Column, Names, Places, Table, numbers_of
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact

SEPARATORS = (",", ";", "\t", " ")
TAIL_BYTES = 128 * 1024
BLOCK_BYTES = 1 << 22  #: Text that is parsed at a time.
COMPARED_ROWS = 20  #: Rows that tell whether the last number is whole.


def is_number(text: str) -> bool:
    """Whether a cell holds a number."""
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def split_cells(line: str, separator: str) -> list[str]:
    """The cells of one line, without quotes and blanks around them."""
    if '"' in line:
        with suppress(csv.Error):  # a line end inside of it, or a cell over 128 KiB
            return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
    return [cell.strip() for cell in line.split(separator)]


class TextTable(Table):
    """A delimited text table; only the columns asked for are parsed, as float64."""

    def __init__(self, file: LogFile) -> None:
        self.file, self.path = file, file.path
        lines = [decoded(line).removeprefix("\ufeff") for line in file.lines[:200]]
        if not lines:
            raise LogError(f"{self.path}: not a table of text; `vftcli inspect` says what it is.")
        if 1 < len(file.lines) <= 200 and len(file.content) > len(file.head):
            lines.pop()  # the head may end inside a line
        rows = list(dropwhile(re.compile(r"\s*#").match, lines))  # np.savetxt's header
        #: The first lines that hold something, without comments but for one of names.
        self.sample = rows or lines
        comment = lines[-len(rows) - 1].lstrip("# ") if len(lines) > len(rows) > 0 else ""
        names, cells = (re.split(r"[,;\t ]+", line.strip()) for line in (comment, self.sample[0]))
        named = len(names) == len(cells) and not any(map(is_number, names))
        if comment and named and all(map(is_number, cells)):
            self.sample = [comment, *rows]
        self._is_quoted = any('"' in line for line in self.sample)
        cells = self.cells(self.sample[0])
        self.width = len(cells)
        numbers = all(not cell or self.is_number(cell) for cell in cells)
        self.names = () if numbers else tuple(cells)
        #: Whether the names are a line of their own.
        self.is_headed = not numbers and len(self.sample) == len(rows)

    @cached_property
    def separator(self) -> str:
        """The separator that splits the first two lines into as many cells."""
        lines = self.sample[:2]
        for separator in SEPARATORS:
            counts = {len(split_cells(line.strip(" "), separator)) for line in lines}
            decimal = separator == "," and ";" in lines[0]  # commas between semicolons
            if len(counts) == 1 and max(counts) > 1 and not decimal:
                return separator
        return " " if len(lines[0].split()) > 1 else ","

    @cached_property
    def decimal_comma(self) -> bool:
        """Whether numbers are written 0,5: between semicolons or tabs."""
        rows = self.sample[1:3] if len(self.sample) > 1 else self.sample
        return self.separator in ";\t" and any(re.search(r"\d,\d", row) for row in rows)

    def cells(self, line: str) -> list[str]:
        """The cells of one line."""
        line = line.strip(" \r")
        return line.split() if self.separator == " " else split_cells(line, self.separator)

    def is_number(self, cell: str) -> bool:
        """Whether a cell holds a number as this table writes them."""
        return is_number(cell.replace(",", ".") if self.decimal_comma else cell)

    def blocks(self, columns: Places, clock: int | None) -> Blocks:
        """Parsed columns; a clock of nanoseconds or dates comes as integers."""
        kinds = dict.fromkeys(columns, "float64")
        if clock is not None:
            row = self.sample[1] if self.names and len(self.sample) > 1 else self.sample[0]
            cells = self.cells(row)
            text = cells[clock] if clock < len(cells) else ""
            # float64 holds nanoseconds since 1970 only to 256 ns.
            if re.fullmatch(r"\d{16,19}", text):
                kinds[clock] = "int64"
            elif re.match(r"\d{4}-\d\d-\d\d", text):
                kinds[clock] = "string"
        for found in self._parsed(kinds):
            yield {c: self._numbers(found[c]) for c in columns}

    def _numbers(self, column: Arrow) -> Column:
        """A parsed column; dates as nanoseconds since 1970."""
        if column.type != "string":
            return numbers_of(column)
        from pyarrow import timestamp

        for zone in (None, "UTC"):  # a zone is in all dates or in none
            with suppress(ValueError):
                return numbers_of(column.cast(timestamp("ns", zone)).cast("int64"))
        raise LogError(f"{self.path}: the clock's column holds no times. Name it: t=…")

    def words(self, column: int) -> Names:
        """The different texts that a column holds, in order."""
        parts = (found[column] for found in self._parsed({column: "string"}))
        each = (part.unique().to_pylist() for part in parts)
        words = dict.fromkeys(str(word or "").strip() for part in each for word in part)
        if not words:
            raise self._diagnosed({})
        return tuple(words)

    def _parsed(self, kinds: Mapping[int, str]) -> Iterator[dict[int, Arrow]]:
        for text in self._pieces():
            # Most texts parse as they are: mending waits for a failure, but for doubled blanks.
            doubled = self.separator == " " and re.search(rb"  |\n | \r?\n", text[:HEAD_BYTES])
            found = None if doubled else self._parse(text, kinds)
            found = found or self._parse(self._mended(text), kinds, mended=True)
            if found is None:
                raise self._diagnosed(kinds)
            yield found
            self.file.release()

    def _parse(
        self, text: bytes, kinds: Mapping[int, str], *, mended: bool = False
    ) -> dict[int, Arrow] | None:
        import pyarrow as pa
        from pyarrow import csv as arrow

        if not text:  # a header alone
            return {c: pa.array([], kind) for c, kind in kinds.items()}
        quote = '"' if self._is_quoted or (mended and b'"' in text) else False
        try:
            table = arrow.read_csv(
                pa.BufferReader(text),
                arrow.ReadOptions(
                    column_names=[str(c) for c in range(self.width)],
                    use_threads=False,
                    # A row has to fit into a block; larger ones than pyarrow's are slower.
                    block_size=min(len(text), 1 << 30) if mended else None,
                ),
                arrow.ParseOptions(
                    delimiter=self.separator, quote_char=quote, newlines_in_values=bool(quote)
                ),
                arrow.ConvertOptions(
                    column_types={str(c): kind for c, kind in kinds.items()},
                    include_columns=[str(c) for c in kinds],
                    null_values=[""],
                    strings_can_be_null=True,
                    decimal_point="," if self.decimal_comma else ".",
                ),
            )
        except pa.ArrowException:
            return None
        if quote and not self._is_quoted and table.num_rows <= text.count(b"\n"):
            return None  # a quote that is not closed took lines for a cell
        found = {c: table[str(c)].combine_chunks() for c in kinds}
        if all(column.null_count for column in found.values()):  # as in every blank row
            blank = np.all([column.is_null() for column in found.values()], axis=0).any()
            return None if blank else found
        return found

    def _pieces(self) -> Iterator[bytes]:
        """The text of the rows; in one piece where a line's end may not be a row's."""
        content: Any = self.file.content.obj
        place, end = self._start(), self._end()
        while True:
            stop = -1 if self._is_quoted else content.find(b"\n", place + BLOCK_BYTES, end)
            stop = stop + 1 or end
            yield content[place:stop]
            if (place := stop) >= end:
                return

    def _mended(self, text: bytes) -> bytes:
        """A text with plain line ends and whole rows, without blank lines and blanks."""
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if self.separator == " ":
            text = re.sub(rb"[ \t]+", b" ", text).replace(b"\n ", b"\n").replace(b" \n", b"\n")
        else:
            text = re.sub(rb"(?<=[,;\t\n]) +", b"", text)
        rows = re.sub(rb"\n\s*\n", b"\n", text.lstrip(b"\n ")).split(b"\n")
        between, count = self.separator.encode(), self.width - 1
        if count * len(rows) - text.count(between) > len(text) + BLOCK_BYTES:
            count = 0  # a wide table of short rows would fill the memory
        return b"\n".join(row + between * (count - row.count(between)) for row in rows if row)

    def _start(self) -> int:
        pattern = rb"(\xef\xbb\xbf)?([ \t]*(#[^\r\n]*)?[\r\n]+)*"
        pattern += rb"[^\r\n]*[\r\n]*" if self.is_headed else b""
        match = re.match(pattern, self.file.content)
        return match.end() if match else 0

    def _end(self) -> int:
        """Where the last row ends, or begins if it is cut, so that it has to go."""
        content, rows = self.file.content, list[bytes]()
        for size in (TAIL_BYTES, len(content)):  # all of it where rows are very long
            if len(rows) < 3:
                tail = bytes(content[-size:])
                rows = re.split(rb"[\r\n]+", tail.rstrip(b"\r\n"))
        ended = tail.endswith((b"\r", b"\n"))
        if len(rows) < 2 or not rows[-1].strip() or not self._ends_inside(rows, ended=ended):
            return len(content)
        self.remarks = (fact("row-cut"),)
        return len(content) - len(tail) + len(tail.rstrip(b"\r\n")) - len(rows[-1])

    def _ends_inside(self, rows: list[bytes], *, ended: bool) -> bool:
        """Whether the last row lacks cells, or may lack digits of its last number."""
        *above, last = (self.cells(decoded(row)) for row in rows[-COMPARED_ROWS - 1 :])
        if len(last) < self.width:
            return len(above[-1]) == self.width or len(rows) == 2
        if ended:
            return False
        ends = {cells[-1] for cells in above if cells and cells[-1] not in self.names[-1:]}
        # Loggers print one number of decimals: fewer than above means digits are lost.
        if "." in last[-1] or "," in last[-1]:
            decimals = {len(end.partition(".")[2]) for end in ends}
            return decimals != {len(last[-1].partition(".")[2])}
        return ends != {last[-1]}

    def _diagnosed(self, kinds: Mapping[int, str]) -> LogError:
        """Look at the table row by row for what the parser could not take."""
        rows = self._mended(bytes(self.file.content[self._start() : self._end()]))
        for number, row in enumerate(rows.split(b"\n"), start=1):
            cells = self.cells(decoded(row))
            if len(cells) > self.width:
                return LogError(
                    f"{self.path}: row {number} has {len(cells)} cells, the first line "
                    f"{self.width}. Two logs in one file, or a damaged row: cut it out."
                )
            for column in sorted(c for c, kind in kinds.items() if kind != "string"):
                cell = cells[column] if column < len(cells) else ""
                if cell and not self.is_number(cell):
                    name = f" ({self.names[column]})" if self.names else ""
                    return LogError(
                        f"{self.path}: row {number}, column {column + 1}{name}: {cell[:40]!r} is "
                        "not a number. Cut the row out, or leave the column out with _."
                    )
        return LogError(f"{self.path}: cannot be parsed as a table of numbers; is it a log?")


def decoded(line: bytes) -> str:
    """A line as text: UTF-8, else Latin-1."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


#: Columns before the names of ros2 topic echo --csv.
STAMP = ("sec", "nanosec", "frame_id")


class EchoTable(TextTable):
    """A table by ``ros2 topic echo --csv``: a message's fields in order, no header.

    Stamp and frame, then names, positions, velocities, efforts, as many of each or none.
    """

    def __init__(self, file: LogFile) -> None:
        super().__init__(file)
        cells = split_cells(self.sample[0], ",")
        kinds = "".join("0" if is_number(cell) else "x" for cell in cells)
        match = re.fullmatch("00x(x+)(0+)", kinds)
        count = len(match[1]) if match and all(cell.isdigit() for cell in cells[:2]) else 0
        #: Number of names in the first row; 0 where it is no such row.
        self.joints = count if match and count and not len(match[2]) % count else 0
        fields = ("name", "position", "velocity", "effort")
        each = [f"{field}{k}" for field in fields for k in range(self.joints)]
        each += [f"_{k}" for k in range(self.width)]
        self.names, self.is_headed = (*STAMP, *each)[: self.width], False


def joint_names(table: TextTable) -> Names:
    """The joints' names that the rows hold, in the order of the columns."""
    columns = [k for k, n in enumerate(table.names) if n.removeprefix("field.")[:4] == "name"]
    found = [table.words(column) for column in columns]
    for words in found:
        if len(words) > 1:
            raise LogError(
                f"{table.path}: the rows name different joints ({words[0][:60]} and "
                f"{words[1][:60]}). Keep one controller's."
            )
    names: Any = tuple(words[0] for words in found)
    if len(names) == 1 and names[0].startswith(("[", "(")):
        with suppress(ValueError, SyntaxError, RecursionError, MemoryError):
            names = ast.literal_eval(names[0])  # a list as Python prints it
    positions = sum("position" in name for name in table.names)
    listed = isinstance(names, list | tuple) and all(isinstance(name, str) for name in names)
    if not listed or len(names) != positions:
        raise LogError(
            f"{table.path}: the column name holds no list of joints, one for each of {positions} "
            f"positions: {str(names)[:60]!r}"
        )
    return tuple(names)
