"""MATLAB files: version 5 by SciPy, 7.3 (HDF5) by h5py; variables, or one level of structs."""

import warnings
import zlib
from collections.abc import Mapping
from io import BytesIO
from typing import Any, Literal

import numpy as np

from vftcli.readers.aliases import CLOCKS
from vftcli.readers.formats import LogFormat
from vftcli.readers.hdf5 import level_of, opened, table_of
from vftcli.readers.opening import check_unpacked, unpacked_limit
from vftcli.readers.reader import LogFile, RawLog, ReadChoice
from vftcli.readers.table import Column, listed
from vftcli.readers.tables import ArrayTable, from_table
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact

V73 = b"MATLAB 7.3 MAT-file"  #: How a file of HDF5 begins.

HEADER, TAG = 128, 8  #: Bytes before the first variable, and of the tag before each.
COMPRESSED = 15  #: Type of a variable that is packed.
#: MATLAB's classes that may be signals, or hold them.
NUMBERS = {
    "double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64",
    "logical", "struct",
}  # fmt: skip


def read(file: LogFile, request: ReadChoice, _: LogFormat) -> RawLog:
    """Read a .mat file; signals of joints × samples are turned, and said."""
    variables = variables_of_v73(file) if file.head.startswith(V73) else variables_of_v5(file)
    if not variables:
        raise LogError(f"{file.path}: a MATLAB file without variables of numbers, so no log.")
    level = "" if request.spec.item("q") else level_of(file.path, list(variables), ".")
    columns = {
        name.removeprefix(level): array
        for name, array in variables.items()
        if name.startswith(level) or "." not in name
    }
    columns, turned = upright(columns)
    remarks = (fact("signals-turned", signals=listed(turned)),) if turned else ()
    return from_table(ArrayTable(path=file.path, columns=columns, remarks=remarks), request)


def upright(variables: Mapping[str, Column]) -> tuple[dict[str, Column], list[str]]:
    """Variables with a row a sample, and the names of those that had a column a sample.

    The length of the time says which is which.
    """
    columns = {
        name: array.ravel() if 1 in array.shape else array for name, array in variables.items()
    }
    clocks = {
        len(array)
        for name, array in columns.items()
        if array.ndim == 1 and name.rpartition(".")[2].lower() in CLOCKS
    }
    turned = [
        name
        for name, array in columns.items()
        if array.ndim == 2 and len(array) not in clocks and array.shape[1] in clocks
    ]
    return {n: a.T if n in turned else a for n, a in columns.items()}, turned


def variables_of_v73(file: LogFile) -> dict[str, Column]:
    """The variables of numbers of a file of version 7.3, as MATLAB shows them."""
    with opened(file) as content:
        table = table_of(file.path, content, fewest_rows=1)
        kept = [k for k, name in enumerate(table.names) if not name.startswith("#")]
        table.check_size(kept)
        names = [table.names[k].replace("/", ".") for k in kept]
        # MATLAB writes column by column, which HDF5 reads as rows.
        return {
            name: table.load([k], k if name.rpartition(".")[2].lower() in CLOCKS else None)[k].T
            for name, k in zip(names, kept, strict=True)
        }


def variables_of_v5(file: LogFile) -> dict[str, Column]:
    """The variables of numbers of a file of version 5, and those of its structs as struct.name."""
    check_size(file)
    from scipy.io import loadmat, whosmat

    stream: Any = BytesIO(file.content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what is left out
            there = whosmat(stream)
            wanted = [name for name, _, kind in there if kind in NUMBERS]
            claimed = sum(
                8 * int(np.prod(shape, dtype=object)) for _, shape, k in there if k in NUMBERS
            )
            check_unpacked(file.path, claimed, len(file.content))
            loaded = loadmat(stream, variable_names=wanted, simplify_cells=True)
    except (
        ValueError, TypeError, KeyError, IndexError, AttributeError, EOFError, OSError, zlib.error,
        MemoryError, OverflowError, RecursionError, NotImplementedError, UnicodeError, SystemError,
    ) as error:  # fmt: skip
        reason = str(error).split("\n")[0][:120]
        raise LogError(f"{file.path}: a damaged MATLAB file ({reason})") from None
    return dict(flat(loaded))


def flat(variables: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Column]]:
    """Variables that are one or two dimensions of numbers, those of structs one level down."""
    found: list[tuple[str, Column]] = []
    for name, value in variables.items():
        if isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim in {1, 2}:
            found += [(prefix + name, value)] if value.size else []
        elif isinstance(value, dict) and not prefix:
            found += flat(value, f"{name}.")
    return found


def check_size(file: LogFile) -> None:
    """Check what the packed variables of a file unpack to, before any is kept."""
    content, place, total = file.content, HEADER, 0
    order: Literal["little", "big"] = "little" if bytes(content[126:128]) == b"IM" else "big"
    limit = unpacked_limit(len(content))
    while place + TAG <= len(content):
        kind = int.from_bytes(content[place : place + 4], order)
        size = int.from_bytes(content[place + 4 : place + TAG], order)
        packed = content[place + TAG : place + TAG + size]
        if len(packed) < size:
            raise LogError(f"{file.path}: the MATLAB file is cut within a variable.")
        total += unpacked_size(packed, limit) if kind == COMPRESSED else size
        check_unpacked(file.path, total, len(content))
        place += TAG + size


def unpacked_size(packed: memoryview, limit: int) -> int:
    """How many bytes packed data unpacks to, counted up to a limit."""
    unpacker, total, rest = zlib.decompressobj(), 0, bytes(packed)
    while rest and total <= limit and not unpacker.eof:
        try:
            total += len(unpacker.decompress(rest, 1 << 20))
        except zlib.error:
            break  # told when it is read
        rest = unpacker.unconsumed_tail
    return total
