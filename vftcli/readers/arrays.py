"""Named arrays: NumPy's files, JSON of any shape, dictionaries that panda-py and frankapy give."""

import json
import re
import tokenize
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.readers.formats import FORMATS, LogFormat
from vftcli.readers.opening import check_unpacked
from vftcli.readers.pickles import load_arrays_only
from vftcli.readers.reader import Episodes, LogFile, RawLog, ReadChoice
from vftcli.readers.table import Column
from vftcli.readers.tables import ArrayTable, from_table, read_layout
from vftcli.signals.errors import LogError, NoLogError
from vftcli.signals.parsing import printable
from vftcli.signals.remarks import Remark, fact

SKILL = "skill_state_dict"  #: What frankapy calls the states of a skill.
#: What NumPy raises for a header or content that is no array.
NOT_AN_ARRAY = (
    ValueError, EOFError, OSError, MemoryError, SyntaxError, TypeError, KeyError, OverflowError,
    RecursionError, tokenize.TokenError,
)  # fmt: skip
#: Bytes of objects that a document may be parsed into; one a line may be of any length.
MEMORY_LIMIT = 768 * 1024 * 1024
#: Letter → bytes of the object that it begins, at most.
COSTS = {b"[": 64, b"{": 72, b",": 40, b":": 110}
LONGEST_LINE = 1 << 20  #: Letters of one sample.
CHUNK_LINES = 8192  #: Lines whose objects are in memory at a time.
#: Numbers that are none as C++ streams print them, libfranka's among them.
NOT_JSON = re.compile(rb"(?<=[\[,:\s])(-?)(nan|inf)(?=[\],}\s])")

Objects = list[dict[str, Any]]


def read(file: LogFile, request: ReadChoice, layout: LogFormat) -> RawLog:
    """Read an .npy or .npz file, or states that libfranka printed one a line."""
    if layout.name == "npz":
        return read_arrays(file, npz_arrays(file), request)
    if layout.name == "npy":
        array = npy_array(file.path, file.head, file.content)
        if not array.dtype.names:
            return read_rows(file, array, request)
        columns = {name: array[name] for name in array.dtype.names}
        return from_table(ArrayTable(path=file.path, columns=columns), request)
    lines = list(lines_of(file.content))
    states = [each for each in lines if each[1].startswith(b"{")]
    columns, remarks = columns_of_lines(file, states)
    if skipped := len(lines) - len(states):
        remarks = (fact("lines-skipped", lines=skipped), *remarks)
    return read_layout(
        ArrayTable(path=file.path, columns=columns, remarks=remarks), layout, request
    )


@contextmanager
def episodes(file: LogFile) -> Iterator[Episodes]:
    """The logs of JSON or a pickle: the skills of frankapy's, or the one of whichever shape."""
    packed = file.head.startswith(b"\x80")
    first = file.first_line.strip()
    # One object a line: the first line is one by itself, and is not all.
    if not packed and len(file.lines) > 1 and first.startswith(b"{") and first.endswith(b"}"):
        yield {0: partial(read_lines, file)}
        return
    log = load_arrays_only(file) if packed else parsed(file)
    if isinstance(log, dict):
        yield dictionary_episodes(file, log)
    elif packed:
        raise LogError(
            f"{file.path}: the pickle holds a {type(log).__name__}, not a dictionary of arrays. "
            "Save the log with np.savez."
        )
    else:
        yield {0: partial(read_list, file, log)}


def dictionary_episodes(file: LogFile, log: Mapping[Any, Any]) -> Episodes:
    """The logs of a dictionary of arrays or lists: frankapy's skills, else the one.

    frankapy has one dictionary a skill, {0: {skill_state_dict: {…}}}; panda-py's get_log() is one.
    """
    held = [value.get(SKILL) for value in log.values() if isinstance(value, dict)]
    if skills := [states for states in held if isinstance(states, dict)]:
        return {k: partial(read_skill, file, states) for k, states in enumerate(skills)}
    if len(log) == 1 and isinstance(inner := next(iter(log.values())), dict):
        log = inner
    return {0: lambda request: read_arrays(file, arrays_of_lists(file, log), request)}


def read_skill(file: LogFile, log: Mapping[Any, Any], request: ReadChoice) -> RawLog:
    """Read the states of one of frankapy's skills."""
    if "time_since_skill_started" in log:
        arrays = arrays_of_lists(file, {**log, "time": log["time_since_skill_started"]})
        usual = {"time": "t[s]", "q": "q[rad]", "dq": "dq", "tau_J": "tau"}
        items = [f"{signal}={name}" for name, signal in usual.items() if name in arrays]
        request = replace(request, columns=request.columns or ",".join(items))
        log = {name: arrays[name] for name in usual if name in arrays}
    return read_arrays(file, arrays_of_lists(file, log), request)


def read_lines(file: LogFile, request: ReadChoice) -> RawLog:
    """Read objects of JSON, one a line."""
    columns, remarks = columns_of_lines(file, lines_of(file.content))
    return read_arrays(file, columns, request, *remarks)


def read_list(file: LogFile, log: list[Any], request: ReadChoice) -> RawLog:
    """Read a list of objects, or a list of rows."""
    if log and all(isinstance(row, dict) for row in log):
        return read_arrays(file, columns_of(file, log, 1), request)
    return read_rows(file, arrays_of_lists(file, {"rows": log})["rows"], request)


def read_rows(file: LogFile, rows: Column, request: ReadChoice) -> RawLog:
    """Read a matrix, a row a sample."""
    if rows.ndim != 2 or rows.size == 0:
        raise NoLogError(
            f"{file.path}: an array of shape {rows.shape}; a log is a matrix, a row a sample."
        )
    columns = {str(k): rows[:, k] for k in range(rows.shape[1])}
    return from_table(ArrayTable(path=file.path, columns=columns, headed=False), request)


def read_arrays(
    file: LogFile, arrays: Mapping[str, Column], request: ReadChoice, *remarks: Remark
) -> RawLog:
    """Read named arrays as panda-py's log, by --columns, or by alias."""
    # Rows of matrices are laid out flat, a column of single numbers is a row of them.
    shaped = {n: a.reshape(len(a), -1) if a.ndim == 3 else a for n, a in arrays.items() if a.ndim}
    shaped = {n: a[:, 0] if a.shape[1:] == (1,) else a for n, a in shaped.items() if a.ndim < 3}
    table = ArrayTable(path=file.path, columns=shaped, remarks=remarks)
    if request.columns is not None and not request.spec.named:
        raise LogError(
            f"{file.path}: its arrays have names ({', '.join(list(arrays)[:20])}); --columns must "
            "name them, as in t[ms]=time,q=q,tau=tau_J."
        )
    panda = {"q", "time"} <= set(shaped) and {"tau_J", "O_T_EE", "dq"} & set(shaped)
    if panda and request.columns is None:
        return read_layout(table, FORMATS["npz"], request)
    return from_table(table, request)


def arrays_of_lists(file: LogFile, log: Mapping[Any, Any]) -> dict[str, Column]:
    """The arrays of a dictionary of arrays or of lists of equally long arrays."""
    arrays = {}
    for name, value in log.items():
        rows = value.shape[0] if isinstance(value, np.ndarray) and value.ndim else 0
        if not (rows or (isinstance(value, list) and value)):
            continue
        try:
            array = np.asarray(value)
        except ValueError:
            raise LogError(f"{file.path}: {name!s:.40} holds rows of different lengths.") from None
        if array.dtype.kind in "fiub":
            arrays[str(name)] = array
    if not arrays:
        raise NoLogError(f"{file.path}: holds no arrays of numbers, so no log.")
    return arrays


def npz_arrays(file: LogFile) -> dict[str, Column]:
    """The arrays of an .npz file by name, unpacked within bounds."""
    arrays = {}
    try:
        with zipfile.ZipFile(BytesIO(file.content)) as bundle:
            total = sum(member.file_size for member in bundle.infolist())
            check_unpacked(file.path, total, len(file.content))
            for member in bundle.infolist():
                if member.filename.endswith(".npy"):
                    with bundle.open(member) as stream:
                        content = stream.read(total + 1)
                    name = member.filename.removesuffix(".npy")
                    arrays[name] = npy_array(file.path, content, content)
    except (
        zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError, ValueError,
    ) as e:  # fmt: skip
        reason = str(e).split("\n")[0][:120]
        raise LogError(f"{file.path}: a damaged .npz file ({reason})") from None
    return arrays


def npy_array(path: Path, head: bytes, content: Any) -> Column:  # noqa: ANN401 - a buffer
    """One array of an .npy file, never executing what it may carry.

    What the header claims is compared with the file's size before it is believed.
    """
    stream = BytesIO(head)
    try:
        version = np.lib.format.read_magic(stream)
        header = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }[version]
        shape, _, dtype = header(stream)
        claimed = int(np.prod([int(s) for s in shape], dtype=object)) * dtype.itemsize
    except NOT_AN_ARRAY as error:
        reason = str(error).split("\n")[0][:120]
        raise LogError(f"{path}: not a readable .npy file ({reason})") from None
    if claimed != len(content) - stream.tell() or any(s < 0 for s in shape):
        raise LogError(
            f"{path}: the header claims {claimed} bytes of numbers, the file holds "
            f"{len(content) - stream.tell()}; it is cut, damaged, or holds more than one array."
        )
    try:
        return np.asarray(np.lib.format.read_array(BytesIO(content), allow_pickle=False))
    except NOT_AN_ARRAY as error:
        reason = str(error).split("\n")[0][:120]
        raise LogError(f"{path}: not a readable array ({reason}). Save it with np.save.") from None


def lines_of(content: memoryview) -> Iterator[tuple[int, bytes]]:
    """The lines that are not empty, with their numbers from 1."""
    start, number = 0, 0
    data: Any = content.obj
    if data.find(b"\n") < 0:
        data = bytes(data).replace(b"\r", b"\n")
    while start < len(content):
        number += 1
        end = data.find(b"\n", start)
        end = len(content) if end < 0 else end
        if line := data[start : min(end, start + LONGEST_LINE + 1)].strip():
            yield number, line
        start = end + 1


def columns_of_lines(
    file: LogFile, lines: Iterable[tuple[int, bytes]]
) -> tuple[dict[str, Column], tuple[Remark, ...]]:
    """The numbers of objects, one a line; a last one that is cut is left out and said."""
    blocks: list[dict[str, Column]] = []
    objects: Objects = []
    waiting: int | None = None
    first = number = 1
    for number, line in lines:
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
    return columns, (fact("line-cut"),) if waiting is not None else ()


def object_in(line: bytes) -> dict[str, Any] | None:
    """The object that a line holds, the fields of those in it as outer.inner; None for none."""
    if len(line) > LONGEST_LINE:
        return None
    words = {b"nan": b"NaN", b"inf": b"Infinity"}
    try:
        found = json.loads(NOT_JSON.sub(lambda m: m[1] + words[m[2]], line))
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
        held = value if isinstance(value, list) and value else [value]
        if not all(isinstance(v, int | float) for v in held):
            continue
        try:
            columns[name] = np.array([entry[name] for entry in objects], dtype=np.float64)
        except (KeyError, ValueError, TypeError, OverflowError):
            shown = printable(name[:40])
            raise LogError(
                f"{file.path}: {shown} is not the same numbers in each of the objects from "
                f"{first} to {first + len(objects) - 1}."
            ) from None
    return columns


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
