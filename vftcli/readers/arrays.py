"""Named arrays: NumPy and MATLAB files, JSON, panda-py's and frankapy's logs.

SciPy reads MATLAB's version 5, h5py its 7.3: variables, or one level of structs.
"""

import re
import warnings
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from io import BytesIO
from tokenize import TokenError
from typing import Any, Literal

import numpy as np

from vftcli.readers.aliases import CLOCKS
from vftcli.readers.hdf5 import level_of, opened, table_of
from vftcli.readers.objects import (
    Data,
    columns_of,
    columns_of_lines,
    flat,
    lines_of,
    load_arrays_only,
    parsed,
)
from vftcli.readers.opening import LogFile, check_unpacked, naming_damage, unpacked_limit
from vftcli.readers.reader import Episodes, RawLog, ReadChoice
from vftcli.readers.reading import FORMATS, LogFormat
from vftcli.readers.table import Columns, Notes, listed
from vftcli.readers.tables import UR, ArrayTable, from_table
from vftcli.signals.errors import LogError, NoLogError
from vftcli.signals.remarks import fact

#: What to do where NumPy cannot read an array.
RESAVE = ". Save arrays of numbers by name: np.savez(FILE, t=…, q=…)."
SKILL = "skill_state_dict"  #: What frankapy calls the states of a skill.


def read(file: LogFile, request: ReadChoice, layout: LogFormat) -> RawLog:
    """The log of a NumPy, MATLAB or UR binary file, or of libfranka."""
    if layout.name == "mat":
        return _read_matlab(file, request)
    if layout.name == "ur-binary":
        return from_table(binary_table(file), request, UR)
    if layout.name == "npz":
        what = "damaged, or no arrays of numbers"
        with (
            naming_damage(file.path, what, zipfile.BadZipFile, remedy=RESAVE),
            np.load(BytesIO(file.content), allow_pickle=False) as bundle,
        ):
            total = sum(member.file_size for member in bundle.zip.infolist())
            check_unpacked(file.path, total, len(file.content))
            each = {name: bundle[name] for name in bundle.files}
        return _read_arrays(file, each, request)
    if layout.name == "npy":
        stream = BytesIO(file.content)
        with naming_damage(
            file.path, "it is cut, damaged or no array", TokenError, remedy=RESAVE
        ):
            array = np.lib.format.read_array(stream, allow_pickle=False)
        if left := len(file.content) - stream.tell():
            raise LogError(
                f"{file.path}: {left} bytes follow the array, so it holds more than one."
            )
        fields = array.dtype.names or ()
        return _read_arrays(file, {name: array[name] for name in fields} or array, request)
    lines = list(lines_of(file.content))
    states = [each for each in lines if each[1].startswith(b"{")]
    columns, remarks = columns_of_lines(file, states)
    if skipped := len(lines) - len(states):
        remarks = (fact("lines-skipped", lines=skipped), *remarks)
    table = ArrayTable(path=file.path, columns=columns, remarks=remarks)
    return from_table(table, request, layout)


@contextmanager
def episodes(file: LogFile) -> Iterator[Episodes]:
    """The logs of JSON or a pickle: one for each skill of frankapy, else one."""
    packed = file.head.startswith(b"\x80")
    first = file.first_line.strip()
    # One object a line: the first line is one by itself, and is not all.
    if not packed and len(file.lines) > 1 and first.startswith(b"{") and first.endswith(b"}"):
        columns, remarks = columns_of_lines(file, lines_of(file.content))
        yield {0: partial(_read_arrays, file, columns, remarks=remarks)}
        return
    log = load_arrays_only(file) if packed else parsed(file)
    logs = [log]
    if isinstance(log, dict):
        inner = [value for value in log.values() if isinstance(value, dict)]
        skills = [value[SKILL] for value in inner if isinstance(value.get(SKILL), dict)]
        logs = skills or (inner if len(inner) == len(log) == 1 else logs)
    elif packed:
        raise LogError(
            f"{file.path}: the pickle holds a {type(log).__name__}, no arrays by name{RESAVE}"
        )
    elif log and all(isinstance(row, dict) for row in log):
        logs = [columns_of(file, log)]
    yield {k: partial(_read_arrays, file, each) for k, each in enumerate(logs)}


def _read_arrays(file: LogFile, log: Data, request: ReadChoice, remarks: Notes = ()) -> RawLog:
    """The log of named arrays, by --columns or alias; or of rows."""
    named = isinstance(log, dict)
    arrays = _arrays_of(file, log if named else {"rows": log})
    if not named:
        rows = arrays["rows"]
        if rows.ndim != 2 or not rows.size:
            raise NoLogError(
                f"{file.path}: an array of shape {rows.shape}; a log is a matrix, a row a sample."
            )
        columns = {str(k): column for k, column in enumerate(rows.T)}
        return from_table(ArrayTable(path=file.path, columns=columns, headed=False), request)
    shaped = {
        n: a.reshape(len(a), -1) if a.ndim == 3 else a for n, a in arrays.items() if a.ndim < 4
    }
    table = ArrayTable(path=file.path, columns=shaped, remarks=remarks)
    if request.columns is not None and not request.spec.named:
        raise LogError(
            f"{file.path}: its arrays have names ({', '.join(list(arrays)[:20])}); --columns must "
            "name them, as in t[ms]=time,q=q,tau=tau_J."
        )
    panda = {"q", "time"} <= shaped.keys() and {"tau_J", "O_T_EE", "dq"} & shaped.keys()
    layout = FORMATS["npz" if panda and request.columns is None else "table"]
    return from_table(table, request, layout)


def _arrays_of(file: LogFile, log: Mapping[Any, Any]) -> Columns:
    arrays = {}
    for name, value in log.items():
        if not isinstance(value, np.ndarray | list):
            continue
        try:
            array = np.asarray(value)
        except ValueError:
            raise LogError(
                f"{file.path}: {name!s:.40} holds rows of different lengths."
            ) from None
        if array.dtype.kind in "fiub" and array.ndim and len(array):
            arrays[str(name)] = array
    if not arrays:
        raise NoLogError(f"{file.path}: holds no arrays of numbers, so no log.")
    return arrays


#: Type words of the second line of a binary file by UR's official client.
BINARY_TYPES = {
    b"DOUBLE": ">f8", b"UINT64": ">u8", b"INT32": ">i4",
    b"UINT32": ">u4", b"UINT8": "u1", b"BOOL": "u1",
}  # fmt: skip


def binary_table(file: LogFile) -> ArrayTable:
    """The table of a UR binary file: two lines, big-endian records."""
    first, second, *_ = [*bytes(file.content[: 1 << 20]).split(b"\n", 2), b"", b""]
    names, types = first.decode("ascii", errors="replace").split(), second.split()
    if len(names) != len(types) or not names:
        raise LogError(
            f"{file.path}: {len(names)} columns, {len(types)} types in the header; damaged or cut."
        )
    if unknown := [word for word in types if word not in BINARY_TYPES]:
        raise LogError(f"{file.path}: unknown column type {unknown[0]!r} in the second line.")
    fields = [(str(k), BINARY_TYPES[word]) for k, word in enumerate(types)]
    body, record, remarks = file.content[len(first) + len(second) + 2 :], np.dtype(fields), []
    # Some clients write the id of the recipe before every record.
    if len(body) % record.itemsize and len(body) % (record.itemsize + 1) == 0:
        record = np.dtype([("id", "u1"), *fields])
        remarks.append(fact("recipe-byte-skipped"))
    if left := len(body) % record.itemsize:
        remarks.append(fact("record-cut", rest_bytes=left))
    records = np.frombuffer(body[: len(body) - left], dtype=record)
    columns = {name: records[str(names.index(name))] for name in names}
    return ArrayTable(path=file.path, columns=columns, remarks=tuple(remarks))


V73 = b"MATLAB 7.3 MAT-file"  #: How a file of HDF5 begins.
HEADER, TAG = 128, 8  #: Bytes before the first variable, and of the tag before each.
COMPRESSED = 15  #: Type of a variable that is packed.
#: MATLAB's classes that may be signals, or hold them.
MATLAB_NUMBERS = {
    "double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64",
    "logical", "struct",
}  # fmt: skip


def _read_matlab(file: LogFile, request: ReadChoice) -> RawLog:
    """A .mat file's log; joints × samples are turned by the time's length, with a remark."""
    if not file.head.startswith(V73):
        variables = _matlab_5(file)
    else:
        with opened(file) as content:
            table = table_of(file.path, content, fewest_rows=1)
            there = {k: n for k, n in enumerate(table.names) if not n.startswith("#")}
            table.check_size(list(there))
            # MATLAB writes column by column, which HDF5 reads as rows.
            variables = {
                name.replace("/", "."): table.load([k], k if _is_clock(name) else None)[k].T
                for k, name in there.items()
            }
    if not variables:
        raise LogError(f"{file.path}: a MATLAB file without variables of numbers, so no log.")
    level = "" if request.spec.item("q") else level_of(file.path, list(variables), ".")
    columns = {
        name.removeprefix(level): array.ravel() if 1 in array.shape else array
        for name, array in variables.items()
        if name.startswith(level) or "." not in name
    }
    lengths = {len(a) for name, a in columns.items() if a.ndim == 1 and _is_clock(name)}
    turned = [  # a signal of another length is refused then
        name
        for name, array in columns.items()
        if array.ndim == 2 and len(array) not in lengths and len(array) < array.shape[1]
    ]
    columns |= {name: columns[name].T for name in turned}
    remarks = (fact("signals-turned", signals=listed(turned)),) if turned else ()
    return from_table(ArrayTable(path=file.path, columns=columns, remarks=remarks), request)


def _is_clock(name: str) -> bool:
    return re.split("[./]", name)[-1].lower() in CLOCKS


def _matlab_5(file: LogFile) -> Columns:
    """A version 5 file's variables of numbers; those of structs as struct.name."""
    from scipy.io import loadmat, whosmat

    # What the packed variables unpack to.
    content, place, total = file.content, HEADER, 0
    limit = unpacked_limit(len(content))
    order: Literal["little", "big"] = "little" if bytes(content[126:128]) == b"IM" else "big"
    while place + TAG <= len(content):
        kind = int.from_bytes(content[place : place + 4], order)
        size = int.from_bytes(content[place + 4 : place + TAG], order)
        packed = bytes(content[place + TAG : place + TAG + size])
        if len(packed) < size:
            raise LogError(f"{file.path}: the MATLAB file is cut within a variable.")
        place += TAG + size
        unpacker = zlib.decompressobj()
        total += 0 if kind == COMPRESSED else size
        with suppress(zlib.error):  # said when it is read
            while kind == COMPRESSED and packed and total <= limit and not unpacker.eof:
                total += len(unpacker.decompress(packed, 1 << 20))
                packed = unpacker.unconsumed_tail
        check_unpacked(file.path, total, len(content))

    stream: Any = BytesIO(file.content)
    with naming_damage(file.path, "a damaged MATLAB file", zlib.error), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what is left out
        there = [(name, shape) for name, shape, kind in whosmat(stream) if kind in MATLAB_NUMBERS]
        claimed = sum(8 * int(np.prod(shape, dtype=object)) for _, shape in there)
        check_unpacked(file.path, claimed, len(file.content))
        names = [name for name, _ in there]
        loaded = loadmat(stream, variable_names=names, simplify_cells=True)
    return {
        name: value
        for name, value in flat(loaded, 1)
        if isinstance(value, np.ndarray) and value.dtype.kind in "fiub"
        if value.ndim in {1, 2} and value.size
    }
