"""UR's real-time data exchange: the official client's text and binary files, and ur_rtde's CSV."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vftcli.readers.delimited import TextTable
from vftcli.readers.formats import FORMATS, LogFormat
from vftcli.readers.reader import LogFile, RawLog, ReadChoice
from vftcli.readers.tables import ArrayTable, read_layout
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact
from vftcli.signals.wrench import WrenchFrame

#: Cycle of a CB3 controller, which its time stamps count; an e-Series has 2 ms. [s]
CB3_CYCLE = 8e-3
E_SERIES_FIELD = "ft_raw_wrench_0"  #: What only a controller with a sensor on the flange sends.
#: Type words of the second line of the official client's binary file.
BINARY_TYPES = {
    b"DOUBLE": ">f8",
    b"UINT64": ">u8",
    b"INT32": ">i4",
    b"UINT32": ">u4",
    b"UINT8": "u1",
    b"BOOL": "u1",
}


def read(file: LogFile, request: ReadChoice, layout: LogFormat) -> RawLog:
    """Read a table of RTDE names."""
    table = binary_table(file) if layout.name == "ur-binary" else TextTable(file)
    raw = read_layout(table, FORMATS["ur-csv"], request)
    return replace(raw, wrench_frame=force_frame(table.names, raw.stamps * raw.tick))


def force_frame(names: Sequence[str], stamps: Array) -> WrenchFrame:
    """Frame of actual_TCP_force: base axes, about the TCP on CB3; on e-Series by its sensor.

    The sensor in an e-Series' flange gives the moment about the flange: on three logs about the
    TCP it misses the joints' torque by four times as much. A sensor that a URCap brings gives it
    about the TCP. No field says which of the two is mounted. An e-Series log that has no
    `ft_raw_wrench`, with stamps that all happen to be multiples of 8 ms, reads as a CB3's.

    Args:
        names: Columns of the log.
        stamps: Controller clock. (T,) [s]
    """
    steps = stamps[np.isfinite(stamps)] / CB3_CYCLE
    # Half a millisecond: stamps may be written with three decimals.
    cb3 = bool(np.all(np.abs(steps - np.round(steps)) < 5e-4 / CB3_CYCLE))
    return WrenchFrame("base", "tool" if cb3 and E_SERIES_FIELD not in names else "controller")


def binary_table(file: LogFile) -> ArrayTable:
    """The official client's binary file: two lines of text, then big-endian records."""
    names, types, start = binary_header(file)
    fields = [(str(k), BINARY_TYPES[word]) for k, word in enumerate(types)]
    body, record, remarks = file.content[start:], np.dtype(fields), []
    # Some clients write the id of the recipe before every record.
    if len(body) % record.itemsize and len(body) % (record.itemsize + 1) == 0:
        record = np.dtype([("id", "u1"), *fields])
        remarks.append(fact("recipe-byte-skipped"))
    if rest := len(body) % record.itemsize:
        remarks.append(fact("record-cut", rest_bytes=rest))
    records = np.frombuffer(body, dtype=record, count=len(body) // record.itemsize)
    columns = {name: records[str(names.index(name))] for name in names}
    return ArrayTable(path=file.path, columns=columns, remarks=tuple(remarks))


def binary_header(file: LogFile) -> tuple[tuple[str, ...], list[bytes], int]:
    """Names and types of the columns, and where the records begin."""
    first, end, rest = bytes(file.content[: 1 << 20]).partition(b"\n")
    second, end_too, _ = rest.partition(b"\n")
    names = tuple(first.decode("ascii", errors="replace").split())
    types = second.split()
    if not end or not end_too or len(names) != len(types) or not names:
        raise LogError(
            f"{file.path}: the header names {len(names)} columns and {len(types)} types; a binary "
            "RTDE file has one type a column. It is damaged or cut."
        )
    if unknown := set(types) - set(BINARY_TYPES):
        raise LogError(f"{file.path}: unknown column type {unknown.pop()!r} in the second line.")
    return names, types, len(first) + len(second) + 2
