"""libfranka's own logs: logToCSV before and after 0.9.1, and robot states printed as JSON lines."""

import json
import re
from typing import Any

import numpy as np

from vftcli.readers.aliases import RESIDUAL_TURNED
from vftcli.readers.delimited import TextTable
from vftcli.readers.reader import LogFile, RawLog, ReadChoice, Reader
from vftcli.readers.table import Cell, Pick, Picks, checked, picked
from vftcli.readers.tables import ArrayTable
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark, fact
from vftcli.signals.wrench import STIFFNESS_FRAME

JOINTS = 7
CLOCK = "robot clock (milliseconds since start)"

OLD_GROUPS = ("q", "q_d", "dq", "dq_d", "tau_J", "tau_ext_hat_filtered")
"""Groups of seven columns that follow `duration, success rate` in the old header, in this order.

The names q_d and dq_d come twice (the state's first, then the command's), so position decides.
"""

FIELDS = {
    "q": "q",
    "q_d": "target_q",
    "dq": "dq",
    "dq_d": "target_dq",
    "tau_J": "torque",
    "tau_ext_hat_filtered": "tau_ext",
}
"""libfranka's name → field of Recording."""


def _pick(name: str, cells: tuple[Cell, ...]) -> Pick:
    turned = name == "tau_ext_hat_filtered"
    return Pick(
        signal=FIELDS[name],
        cells=cells,
        factor=-1.0 if turned else 1.0,
        remark=RESIDUAL_TURNED if turned else None,
    )


def _read(table: TextTable, groups: dict[str, int], request: ReadChoice) -> RawLog:
    signals = tuple(
        _pick(name, tuple(Cell(start + j) for j in range(JOINTS))) for name, start in groups.items()
    )
    clock = Pick(signal="t", cells=(Cell(0),), factor=1e-3, unit="ms")
    picks = checked(table, Picks(signals=signals, clock=clock))
    return picked(table, picks, request, clock_name=CLOCK)


def read_old(file: LogFile, request: ReadChoice) -> RawLog:
    """Read a log of libfranka 0.2.0 to 0.9.0, by position."""
    table = TextTable(file)
    names = table.names or ()
    for k, name in enumerate(OLD_GROUPS):
        start = 2 + k * JOINTS
        if names[start : start + JOINTS] != tuple(f"{name}[{j}]" for j in range(JOINTS)):
            raise LogError(
                f"{file.path}: column {start + 1} should be {name}[0] in a libfranka log up to "
                "0.9.0. The header was edited: use --format table with --columns."
            )
    return _read(table, {n: 2 + k * JOINTS for k, n in enumerate(OLD_GROUPS)}, request)


def read_new(file: LogFile, request: ReadChoice) -> RawLog:
    """Read a log of libfranka 0.9.1 and later, by name."""
    table = TextTable(file)
    names = table.names or ()
    groups = {}
    for name in FIELDS:
        columns = [f"state.{name}[{j}]" for j in range(JOINTS)]
        if columns[0] in names:
            start = names.index(columns[0])
            if list(names[start : start + JOINTS]) == columns:
                groups[name] = start
    return _read(table, groups, request)


NOT_JSON = re.compile(rb"(?<=[\[,:\s])(-?)(nan|inf)(?=[\],}\s])")
"""Non-finite numbers as C++ streams print them."""

MAX_LINE = 64 * 1024
"""A robot state takes 1.7 kB; a line longer than this is no robot state."""


def read_states(file: LogFile, request: ReadChoice) -> RawLog:
    """Read robot states printed one a line.

    Raises:
        LogError: If a line is no robot state, or no line is.
    """
    states, skipped, cut = [], 0, False
    lines = bytes(file.content).replace(b"\r", b"\n").split(b"\n")
    numbered = [(k, line) for k, line in enumerate(lines, start=1) if line.strip()]
    for number, line in numbered:
        if not line.lstrip().startswith(b"{"):
            skipped += 1
            continue
        state = _state(line)
        if state is None and number == numbered[-1][0]:
            cut = True
            continue
        if state is None:
            raise LogError(f"{file.path}: line {number} is not a robot state in JSON.")
        states.append(state)
    if not states:
        raise LogError(f"{file.path}: no robot state in any line.")
    remarks = [fact("lines-skipped", lines=skipped)] if skipped else []
    remarks += [fact("line-cut")] if cut else []
    return _read_states(file, states, tuple(remarks), request)


def _state(line: bytes) -> dict[str, Any] | None:
    if len(line) > MAX_LINE:
        return None
    text = NOT_JSON.sub(lambda m: m[1] + {b"nan": b"NaN", b"inf": b"Infinity"}[m[2]], line)
    try:
        state = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return state if isinstance(state, dict) else None


def _read_states(
    file: LogFile, states: list[dict[str, Any]], remarks: tuple[Remark, ...], request: ReadChoice
) -> RawLog:
    columns = {name: _column(file, states, name, JOINTS) for name in FIELDS if name in states[0]}
    if "O_F_ext_hat_K" in states[0]:
        columns["O_F_ext_hat_K"] = _column(file, states, "O_F_ext_hat_K", 6)
    columns["time"] = _column(file, states, "time", None)
    table = ArrayTable(path=file.path, columns=columns, remarks=remarks)
    names = list(columns)
    signals = [
        _pick(name, tuple(Cell(names.index(name), j) for j in range(JOINTS)))
        for name in FIELDS
        if name in columns
    ]
    if "O_F_ext_hat_K" in columns:
        place = names.index("O_F_ext_hat_K")
        signals.append(Pick(signal="wrench", cells=tuple(Cell(place, j) for j in range(6))))
    clock = Pick(signal="t", cells=(Cell(names.index("time")),), factor=1e-3, unit="ms")
    picks = checked(table, Picks(signals=tuple(signals), clock=clock))
    mass = states[-1].get("m_load")
    return picked(
        table,
        picks,
        request,
        clock_name=CLOCK,
        wrench_frame=STIFFNESS_FRAME,
        payload_mass=float(mass) if isinstance(mass, int | float) else None,
    )


def _column(file: LogFile, states: list[dict[str, Any]], name: str, length: int | None) -> Any:  # noqa: ANN401
    """One field of all states as an array. (T,) or (T, length)"""
    shape = (len(states),) if length is None else (len(states), length)
    try:
        column = np.array([state[name] for state in states], dtype=np.float64)
    except (KeyError, ValueError, TypeError, OverflowError):
        column = np.empty(0)
    if column.shape != shape:
        wanted = "one number" if length is None else f"{length} numbers"
        raise LogError(f"{file.path}: {name} is not {wanted} in every state.")
    return column


OLD = Reader(
    name="libfranka-csv-old",
    recognises=lambda file: file.first_line.startswith(b"duration, success rate, q[0]"),
    read=read_old,
    columns=True,
)

NEW = Reader(
    name="libfranka-csv",
    recognises=lambda file: file.first_line.startswith(b"time,success_rate,state.q[0]"),
    read=read_new,
    columns=True,
)

STATES = Reader(
    name="libfranka-json",
    recognises=lambda file: file.first_line.lstrip().startswith(b'{"O_T_EE"'),
    read=read_states,
)
