"""libfranka's robot states, printed as JSON lines."""

import json
import re
from typing import Any

import numpy as np

from vftcli.readers.columns import parse_columns
from vftcli.readers.formats import LogFormat
from vftcli.readers.reader import LogFile, RawLog, ReadChoice
from vftcli.readers.table import Column
from vftcli.readers.tables import ArrayTable, read_layout
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact

#: Non-finite numbers as C++ streams print them.
NOT_JSON = re.compile(rb"(?<=[\[,:\s])(-?)(nan|inf)(?=[\],}\s])")
MAX_LINE = 64 * 1024  #: A robot state takes 1.7 kB; a line longer than this is no robot state.


def read(file: LogFile, request: ReadChoice, layout: LogFormat) -> RawLog:
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
    columns = {"time": field_of(file, states, "time", ())}
    for item in parse_columns(layout.columns).items:
        if (name := str(item.pattern)) in states[0] and item.signal != "t":
            width = 6 if item.signal == "wrench" else layout.joints
            columns[name] = field_of(file, states, name, (width,))
    table = ArrayTable(path=file.path, columns=columns, remarks=tuple(remarks))
    mass = states[-1].get("m_load")
    told = float(mass) if isinstance(mass, int | float) else None
    return read_layout(table, layout, request, payload_mass=told)


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
