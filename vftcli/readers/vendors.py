"""UR's real-time data exchange: the official client's text and binary files, and ur_rtde's CSV."""

import ast
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property

import numpy as np

from vftcli.readers.aliases import laid_along
from vftcli.readers.delimited import TextTable, is_number, split_cells
from vftcli.readers.opening import LogFile
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.readers.reading import FORMATS, LogFormat
from vftcli.readers.tables import ArrayTable, from_table, read_layout
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact
from vftcli.signals.wrench import WrenchFrame

#: Cycle of a CB3 controller, which its time stamps count; an e-Series has 2 ms. [s]
CB3_CYCLE = 8e-3
E_SERIES_FIELD = "ft_raw_wrench_0"  #: What only a controller with a sensor on the flange sends.
#: Type words of the second line of the official client's binary file.
BINARY_TYPES = {
    b"DOUBLE": ">f8", b"UINT64": ">u8", b"INT32": ">i4",
    b"UINT32": ">u4", b"UINT8": "u1", b"BOOL": "u1",
}  # fmt: skip


def read(file: LogFile, request: ReadChoice, layout: LogFormat) -> RawLog:
    """Read a table of RTDE names, or a printed JointState topic."""
    if layout.name in {"bagpy", "rostopic", "ros2-echo"}:
        printed = EchoTable(file) if layout.name == "ros2-echo" else TextTable(file)
        return laid_along(from_table(printed, request), joint_names(printed), request)
    table = binary_table(file) if layout.name == "ur-binary" else TextTable(file)
    raw = read_layout(table, FORMATS["ur-csv"], request)
    return replace(raw, wrench_frame=force_frame(table.names, raw.stamps * raw.tick))


def force_frame(names: Sequence[str], stamps: Array) -> WrenchFrame:
    """Frame of actual_TCP_force: base axes, about the TCP on CB3; on e-Series by its sensor.

    The sensor in an e-Series' flange gives the moment about the flange: on three logs about the
    TCP it misses the joints' torque by four times as much. A sensor that a URCap brings gives it
    about the TCP. No field says which of the two is mounted. An e-Series log that has no
    `ft_raw_wrench`, with stamps (T,) [s] that all are multiples of 8 ms, reads as a CB3's.
    """
    steps = stamps[np.isfinite(stamps)] / CB3_CYCLE
    # Half a millisecond: stamps may be written with three decimals.
    cb3 = bool(np.all(np.abs(steps - np.round(steps)) < 5e-4 / CB3_CYCLE))
    return WrenchFrame("base", "tool" if cb3 and E_SERIES_FIELD not in names else "controller")


def binary_table(file: LogFile) -> ArrayTable:
    """The official client's binary file: two lines of text, then big-endian records."""
    first, end, rest = bytes(file.content[: 1 << 20]).partition(b"\n")
    second, end_too, _ = rest.partition(b"\n")
    names, types = first.decode("ascii", errors="replace").split(), second.split()
    if not end or not end_too or len(names) != len(types) or not names:
        raise LogError(
            f"{file.path}: the header names {len(names)} columns and {len(types)} types; a binary "
            "RTDE file has one type a column. It is damaged or cut."
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
    records = np.frombuffer(body, dtype=record, count=len(body) // record.itemsize)
    columns = {name: records[str(names.index(name))] for name in names}
    return ArrayTable(path=file.path, columns=columns, remarks=tuple(remarks))


STAMP = 3  #: Columns before the names that ros2 topic echo --csv prints: sec, nanosec, frame_id.


class EchoTable(TextTable):
    """A table by ``ros2 topic echo --csv``: a message's fields in their order, without a header.

    Names, positions, velocities and efforts, as many of each or none, follow the header's stamp and
    frame.
    """

    is_headed = False

    def __init__(self, file: LogFile) -> None:
        super().__init__(file)
        fields = ("name", "position", "velocity", "effort")
        count, more = self.joints, range(self.width - STAMP)
        each = (
            f"{fields[k // count]}{k % count}" if k < 4 * count else f"_{k - 4 * count}"
            for k in more
        )
        self.names = ("sec", "nanosec", "frame_id", *each)

    @cached_property
    def joints(self) -> int:
        """Number of names in the first row; 0 where it is no such row."""
        cells = split_cells(self.sample[0], ",")
        words = [k for k, cell in enumerate(cells) if k >= STAMP and not is_number(cell)]
        count = len(words)
        values = len(cells) - STAMP - count
        stamped = len(cells) > STAMP and all(cell.isdigit() for cell in cells[:2])
        if not stamped or is_number(cells[2]) or words != list(range(STAMP, STAMP + count)):
            return 0
        return count if count and values >= count and values % count == 0 else 0


def joint_names(table: TextTable) -> tuple[str, ...]:
    """The joints' names that the rows hold, in the order of the columns."""
    each = enumerate(table.names)
    columns = [k for k, name in each if name.removeprefix("field.")[:4] == "name"]
    found = [table.words(column) for column in columns]
    for words in found:
        if len(words) > 1:
            raise LogError(
                f"{table.path}: the rows name different joints ({words[0][:60]} and "
                f"{words[1][:60]}), as where two controllers publish on one topic. Keep the rows "
                "of the arm."
            )
    names = tuple(words[0] for words in found)
    if len(names) != 1 or not names[0].startswith(("[", "(")):
        return names
    listed: object = None
    with suppress(ValueError, SyntaxError, RecursionError, MemoryError):
        listed = ast.literal_eval(names[0])  # a list as Python prints it
    if not isinstance(listed, list | tuple) or not all(isinstance(name, str) for name in listed):
        raise LogError(f"{table.path}: the column name holds no list of joints: {names[0][:60]!r}")
    return tuple(listed)


def recognises(file: LogFile, _: LogFormat) -> bool:
    """Whether a file was printed by ``ros2 topic echo --csv`` of a JointState topic."""
    cells = split_cells(file.first_line.decode("utf-8", "replace"), ",")
    return len(cells) > STAMP and EchoTable(file).joints > 0
