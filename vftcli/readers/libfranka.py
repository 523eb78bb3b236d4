"""libfranka's own logs: logToCSV before and after 0.9.1, and robot states printed as JSON lines."""

import json
import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from vftcli.readers.aliases import table_clock, vendor_pick
from vftcli.readers.delimited import TextTable
from vftcli.readers.picking import picked
from vftcli.readers.reader import LogFile, RawLog, ReadChoice, Reader
from vftcli.readers.table import Cell, Column, Pick, Picks, Table, checked
from vftcli.readers.tables import ArrayTable
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact
from vftcli.signals.wrench import FRANKA_FRAME

JOINTS = 7
CLOCK = "robot clock (milliseconds since start)"

#: Groups of seven columns that follow `duration, success rate` in the old header, in this order.
#:
#: The names q_d and dq_d come twice (the state's first, then the command's), so position decides.
OLD_GROUPS = ("q", "q_d", "dq", "dq_d", "tau_J", "tau_ext_hat_filtered")

WRENCH = "O_F_ext_hat_K"

#: libfranka's name → field of Recording.
FIELDS = {
    "q": "q",
    "q_d": "target_q",
    "dq": "dq",
    "dq_d": "target_dq",
    "tau_J": "torque",
    "tau_ext_hat_filtered": "tau_ext",
    WRENCH: "wrench",
}

Cells = tuple[Cell, ...]


def read_fields(
    table: Table,
    fields: Mapping[str, Cells],
    time: Cell,
    request: ReadChoice,
    **more: Any,  # noqa: ANN401
) -> RawLog:
    """Read a table that holds robot states, whatever kind of file it is.

    Args:
        table: The table.
        fields: libfranka's name of a field → its cells.
        time: The cell of the robot's clock. [ms]
        request: What is wanted.
        more: Further fields of the RawLog.
    """
    signals = tuple(vendor_pick(FIELDS[name], name, cells) for name, cells in fields.items())
    clock = Pick(signal="t", cells=(time,), factor=1e-3, unit="ms")
    picks = checked(table, Picks(signals=signals, clock=clock))
    frame = FRANKA_FRAME if WRENCH in fields else None
    return picked(table, picks, request, clock_name=CLOCK, wrench_frame=frame, **more)


def read_old(file: LogFile, request: ReadChoice) -> RawLog:
    """Read a log of libfranka 0.2.0 to 0.9.0, by position."""
    table = TextTable(file)
    names = table.names or ()
    fields = {}
    for k, name in enumerate(OLD_GROUPS):
        start = 2 + k * JOINTS
        if names[start : start + JOINTS] != tuple(f"{name}[{j}]" for j in range(JOINTS)):
            raise LogError(
                f"{file.path}: column {start + 1} should be {name}[0] in a libfranka log up to "
                "0.9.0. The header was edited: use --format table with --columns."
            )
        fields[name] = cells_from(start)
    return read_fields(table, fields, Cell(0), request)


def read_new(file: LogFile, request: ReadChoice) -> RawLog:
    """Read a log of libfranka 0.9.1 and later, by name."""
    table = TextTable(file)
    names = table.names or ()
    fields = {}
    for name in FIELDS:
        columns = tuple(f"state.{name}[{j}]" for j in range(JOINTS))
        if columns[0] in names:
            start = names.index(columns[0])
            if names[start : start + JOINTS] == columns:
                fields[name] = cells_from(start)
    return read_fields(table, fields, Cell(0), request)


def cells_from(start: int) -> Cells:
    """Seven columns in a row."""
    return tuple(Cell(start + j) for j in range(JOINTS))


def read_array_fields(
    table: ArrayTable,
    wanted: Iterable[str],
    request: ReadChoice,
    **more: Any,  # noqa: ANN401
) -> RawLog:
    """Read those of the wanted fields that a table has as a column of lists each, and `time`."""
    names = list(table.columns)
    fields = {
        name: tuple(Cell(names.index(name), j) for j in range(width))
        for name in wanted
        if name in names and (width := table.lists.get(names.index(name)))
    }
    time = table_clock(table, names.index("time"))
    return read_fields(table, fields, time, request, **more)


#: Non-finite numbers as C++ streams print them.
NOT_JSON = re.compile(rb"(?<=[\[,:\s])(-?)(nan|inf)(?=[\],}\s])")
MAX_LINE = 64 * 1024  #: A robot state takes 1.7 kB; a line longer than this is no robot state.


def read_states(file: LogFile, request: ReadChoice) -> RawLog:
    """Read robot states printed one a line."""
    states, skipped, cut = [], 0, False
    lines = bytes(file.content).replace(b"\r", b"\n").split(b"\n")
    numbered = [(k, line) for k, line in enumerate(lines, start=1) if line.strip()]
    for number, line in numbered:
        if not line.lstrip().startswith(b"{"):
            skipped += 1
        elif (state := state_in(line)) is not None:
            states.append(state)
        elif number == numbered[-1][0]:
            cut = True
        else:
            raise LogError(f"{file.path}: line {number} is not a robot state in JSON.")
    if not states:
        raise LogError(f"{file.path}: no robot state in any line.")
    remarks = [fact("lines-skipped", lines=skipped)] if skipped else []
    remarks += [fact("line-cut")] if cut else []
    widths = {name: 6 if name == WRENCH else JOINTS for name in FIELDS if name in states[0]}
    columns = {name: field_of(file, states, name, (width,)) for name, width in widths.items()}
    columns["time"] = field_of(file, states, "time", ())
    table = ArrayTable(path=file.path, columns=columns, remarks=tuple(remarks))
    mass = states[-1].get("m_load")
    told = float(mass) if isinstance(mass, int | float) else None
    return read_array_fields(table, FIELDS, request, payload_mass=told)


def state_in(line: bytes) -> dict[str, Any] | None:
    """The robot state that a line holds, or None."""
    if len(line) > MAX_LINE:
        return None
    text = NOT_JSON.sub(lambda m: m[1] + {b"nan": b"NaN", b"inf": b"Infinity"}[m[2]], line)
    try:
        state = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return state if isinstance(state, dict) else None


def field_of(
    file: LogFile, states: list[dict[str, Any]], name: str, shape: tuple[int, ...]
) -> Column:
    """One field of all states. (T, *shape)"""
    try:
        column = np.array([state[name] for state in states], dtype=np.float64)
    except (KeyError, ValueError, TypeError, OverflowError):
        column = np.empty(0)
    if column.shape != (len(states), *shape):
        wanted = f"{shape[0]} numbers" if shape else "one number"
        raise LogError(f"{file.path}: {name} is not {wanted} in every state.")
    return column


OLD = Reader(
    name="libfranka-csv-old",
    recognises=lambda file: file.first_line.startswith(b"duration, success rate, q[0]"),
    read=read_old,
)

NEW = Reader(
    name="libfranka-csv",
    recognises=lambda file: file.first_line.startswith(b"time,success_rate,state.q[0]"),
    read=read_new,
)

STATES = Reader(
    name="libfranka-json",
    recognises=lambda file: file.first_line.lstrip().startswith(b'{"O_T_EE"'),
    read=read_states,
    columns=False,
)
