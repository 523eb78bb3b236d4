"""JSON logs: an object a line, a list of objects, or one object of arrays (panda-py, frankapy)."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from vftcli.readers.arrays_file import arrays_of_lists, dictionary_episodes, read_arrays
from vftcli.readers.reader import Episodes, LogFile, RawLog, ReadChoice
from vftcli.readers.table import Column
from vftcli.readers.tables import ArrayTable, from_table
from vftcli.signals.errors import LogError, NoLogError
from vftcli.signals.letters import printable
from vftcli.signals.remarks import fact

#: Bytes of objects that a document may be parsed into; one a line may be of any length.
MEMORY_LIMIT = 768 * 1024 * 1024
#: Letter → bytes of the object that it begins, at most.
COSTS = {b"[": 64, b"{": 72, b",": 40, b":": 110}
LONGEST_LINE = 1 << 20  #: Letters of one sample.
CHUNK_LINES = 8192  #: Lines whose objects are in memory at a time.

Objects = list[dict[str, Any]]


@contextmanager
def episodes(file: LogFile) -> Iterator[Episodes]:
    """The logs of a JSON file: the skills of frankapy's, or the one of whichever of the shapes."""
    if is_lines(file):
        yield {0: partial(read_lines, file)}
    elif isinstance(log := parsed(file), dict):
        yield dictionary_episodes(file, log)
    else:
        yield {0: partial(read_list, file, log)}


def read_list(file: LogFile, log: list[Any], request: ReadChoice) -> RawLog:
    """Read a list of objects, or a list of rows."""
    if log and all(isinstance(row, dict) for row in log):
        return read_arrays(file, columns_of(file, log, 1), request)
    rows = arrays_of_lists(file, {"rows": log})["rows"]
    if rows.ndim != 2:
        raise NoLogError(
            f"{file.path}: a JSON list that is neither of objects nor of rows; no log."
        )
    columns = {str(k): rows[:, k] for k in range(rows.shape[1])}
    return from_table(ArrayTable(path=file.path, columns=columns, headed=False), request)


def is_lines(file: LogFile) -> bool:
    """Whether a file is one object a line: its first line is one by itself, and is not all."""
    first = file.first_line.strip()
    return len(file.lines) > 1 and first.startswith(b"{") and first.endswith(b"}")


def read_lines(file: LogFile, request: ReadChoice) -> RawLog:
    """Read objects, one a line; a last one that is cut is left out and said."""
    blocks: list[dict[str, Column]] = []
    objects: Objects = []
    waiting: int | None = None
    first = number = 1
    for number, line in lines_of(file.content):
        if waiting is not None:
            raise LogError(f"{file.path}: line {waiting} is not one JSON object.")
        if (found := object_in(line)) is None:
            waiting = number
            continue
        objects.append(found)
        if len(objects) == CHUNK_LINES:
            blocks.append(columns_of(file, objects, first))
            objects, first = [], number + 1
    if objects:
        blocks.append(columns_of(file, objects, first))
    if not blocks:
        raise LogError(f"{file.path}: no line holds a JSON object.")
    if any(block.keys() != blocks[0].keys() for block in blocks):
        raise LogError(f"{file.path}: its lines do not hold the same fields.")
    try:
        columns = {name: np.concatenate([b[name] for b in blocks]) for name in blocks[0]}
    except ValueError:
        raise LogError(f"{file.path}: a field differs in length from line to line.") from None
    cut = (fact("line-cut"),) if waiting is not None else ()
    return read_arrays(file, columns, request, *cut)


def lines_of(content: memoryview) -> Iterator[tuple[int, bytes]]:
    """The lines that are not empty, with their numbers from 1."""
    start, number = 0, 0
    data: Any = content.obj
    while start < len(content):
        number += 1
        end = data.find(b"\n", start)
        end = len(content) if end < 0 else end
        line = bytes(content[start : min(end, start + LONGEST_LINE + 1)]).strip()
        if line:
            yield number, line
        start = end + 1


def object_in(line: bytes) -> dict[str, Any] | None:
    """The object that a line holds, the fields of those in it as outer.inner; None for none."""
    if len(line) > LONGEST_LINE:
        return None
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict):
        return None
    flat: dict[str, Any] = {}
    for name, value in found.items():
        inner = value.items() if isinstance(value, dict) else ()
        flat |= {f"{name}.{key}": v for key, v in inner} if inner else {name: value}
    return flat


def columns_of(file: LogFile, objects: Objects, first: int) -> dict[str, Column]:
    """The numeric fields of some objects, a row an object."""
    columns: dict[str, Column] = {}
    for name, value in objects[0].items():
        if not is_numeric(value):
            continue
        try:
            column = np.array([entry[name] for entry in objects], dtype=np.float64)
        except (KeyError, ValueError, TypeError, OverflowError):
            shown = printable(name[:40])
            raise LogError(
                f"{file.path}: {shown} is not the same numbers in each of the objects from "
                f"{first} to {first + len(objects) - 1}."
            ) from None
        columns[name] = column
    return columns


def is_numeric(value: Any) -> bool:  # noqa: ANN401 - of JSON
    """Whether a value is a number, or a list of them."""
    if isinstance(value, list):
        return bool(value) and all(isinstance(v, int | float) for v in value)
    return isinstance(value, int | float)


def parsed(file: LogFile) -> Any:  # noqa: ANN401 - of JSON
    """The one value of a file: an object or a list."""
    content = bytes(file.content)
    if sum(cost * content.count(letter) for letter, cost in COSTS.items()) > MEMORY_LIMIT:
        raise LogError(
            f"{file.path}: a JSON document of {len(file.content) >> 20} MiB, too many values to "
            "hold. Save the log with np.savez, or an object a line."
        )
    try:
        return json.loads(content)
    except RecursionError:
        raise LogError(f"{file.path}: JSON nested too deeply to be a log.") from None
    except ValueError as error:
        reason = printable(str(error).split("\n")[0][:120])
        raise LogError(f"{file.path}: looks like JSON and is not ({reason}).") from None
