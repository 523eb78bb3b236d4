"""Aliases: the names under which users' tables hold the signals, found without being told."""

import re
import tomllib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from vftcli.readers.columns import SIGNALS, Item
from vftcli.readers.joints import effort_of, kinematic_order
from vftcli.readers.table import (
    Cell,
    Pick,
    Picks,
    Table,
    checked,
    listed,
    missing_column,
    named_cells,
    pick_of,
)
from vftcli.signals.errors import LogError
from vftcli.signals.recording import EFFORTS
from vftcli.signals.remarks import fact

#: Names of the clock; a unit may follow, as in time_ms.
CLOCKS = ("t", "time", "timestamp", "time_s", "stamp", "sec", "__time", "%time", "seconds")
#: The nanoseconds beside a column of seconds whose name has the same stem.
NANOSECONDS = re.compile(r"(?P<stem>.*?)(nsecs?|nanosecs?|nanos|nanoseconds|ns)")
#: A message's own stamp, or a part of it.
HEADER_STAMP = re.compile(r"(?:.*[./])?header[./]stamp(?:[./]\w+)?")
#: The log's own stamps [ns] beside a clock that starts at zero, as vftcli convert writes them.
OWN_STAMPS = "t_src_ns"
#: Field of Recording → names its columns go by, in lower case and without their index.
ALIASES: dict[str, tuple[str, ...]] = {
    field: tuple(names)
    for field, names in tomllib.loads(
        (Path(__file__).parent / "aliases.toml").read_text(encoding="utf-8")
    ).items()
}
#: Names of libfranka's residual, measured torque minus model: its sign has to be turned.
TURNED = {"tau_ext_hat_filtered", "state.tau_ext_hat_filtered", "motor_torques_external"}
#: Names of the six columns of a wrench.
WRENCHES = (
    "fx fy fz mx my mz",
    "fx fy fz tx ty tz",
    "wrench/fx wrench/fy wrench/fz wrench/mx wrench/my wrench/mz",
    "wrench/fx wrench/fy wrench/fz wrench/tx wrench/ty wrench/tz",
    " ".join(f"ft_wrench_{what}_{axis}" for what in ("force", "torque") for axis in "xyz"),
)

INDEXED = re.compile(
    r"(?P<stem>.*?)[_./ ]?(?:(?:joint|j)_?(?P<a>\d{1,9})|\[(?P<b>\d{1,9})\]|(?P<c>\d{1,9}))",
    re.IGNORECASE,
)  # a number of any length would be tried from each of its digits on
#: What ROS tools put before the fields of a JointState.
FIELD = re.compile(r"field\.|/?joint_states?[./]")
#: A joint's name before the signal's, as PlotJuggler exports JointState topics.
JOINT_FIRST = re.compile(
    r"(?:.*/)?(?P<joint>[A-Za-z][\w ]*)[/.](?P<stem>position|velocity|effort)(?:\[\])?"
)

SIGNAL_WORDS = "pos|position|vel|velocity|eff|effort|tau|torque|current"
#: A signal's name before or behind a joint's, as in pos_elbow and elbow_joint_vel.
SIGNAL_OF_JOINT = (
    re.compile(rf"(?P<stem>{SIGNAL_WORDS})[_./ ](?P<joint>[A-Za-z][\w ]*)", re.IGNORECASE),
    re.compile(rf"(?P<joint>[A-Za-z][\w ]*?)[_./ ](?P<stem>{SIGNAL_WORDS})", re.IGNORECASE),
)

NUMBERED_JOINT = re.compile(r"(joint|j)?_?\d+", re.IGNORECASE)
#: What a pose has in place of joints.
AXES = re.compile(r"r?[xyz]|q[wxyz]|roll|pitch|yaw", re.IGNORECASE)

FEWEST_JOINTS = 3

RESIDUAL_TURNED = fact("residual-turned")  #: Said wherever libfranka's residual is taken.


class Group(NamedTuple):
    """Columns of one name but for their index; `twice` is one that has the index of another."""

    cells: tuple[Cell, ...]
    indices: tuple[int, ...]
    joints: tuple[str, ...] = ()
    twice: str = ""


def picks_by_alias(table: Table, stated: Sequence[Item]) -> tuple[Picks, tuple[str, ...]]:
    """Find the signals of a headed table by the names of its columns, and the joints' names."""
    groups = grouped(table)
    rate = next((item.rate for item in stated if item.rate is not None), None)
    named = [item for item in stated if item.rate is None and item.signal != "_"]
    told = {item.signal: stated_pick(table, item, groups) for item in named}
    clock = told.pop("t", None) or (None if rate is not None else _clock(table))
    signals = list(told.values())
    find = missing_picks if any(pick.signal == "q" for pick in signals) else found_picks
    signals += find(table, groups, signals)
    joints = next((len(p.cells) for p in signals if p.signal == "q"), 0)
    # A group of another width is about something else: a gripper, a base.
    also = {"q", "wrench", *(pick.signal for pick in told.values())}
    signals = [p for p in signals if len(p.cells) == (joints or len(p.cells)) or p.signal in also]
    origin = table.names.index(OWN_STAMPS) if table.names.count(OWN_STAMPS) == 1 else None
    origin = None if origin in table.lists else origin
    picks = checked(table, Picks(signals=tuple(signals), clock=clock, rate=rate, origin=origin))
    q = next(pick.cells for pick in signals if pick.signal == "q")
    names = next((g.joints for g in groups.values() if g.joints and g.cells == q), ())
    if effort_of(names) == "current" and not {pick.signal for pick in told.values()} & set(EFFORTS):
        picks = replace(picks, signals=tuple(_as_driven(pick, groups) for pick in picks.signals))
    return picks, names


def found_picks(table: Table, groups: dict[str, Group], stated: Sequence[Pick]) -> list[Pick]:
    """All signals that are found by their names beside those that are stated."""
    known, taken = {pick.signal for pick in stated}, {c for pick in stated for c in pick.cells}
    found = []
    for signal in ALIASES:
        if signal not in known and (pick := _pick_of(table, signal, groups)) is not None:
            found += [pick] if taken.isdisjoint(pick.cells) else []
    if "wrench" not in known and (wrench := _wrench(table)) is not None:
        found.append(wrench)
    return found


def missing_picks(table: Table, groups: dict[str, Group], stated: Sequence[Pick]) -> list[Pick]:
    """What a text that names the positions leaves out and no estimate can do without.

    Velocities, and an effort where it names none; what two groups could be is left out.
    """
    known, taken = {pick.signal for pick in stated}, {c for pick in stated for c in pick.cells}
    joints = next(len(pick.cells) for pick in stated if pick.signal == "q")
    found = []
    for wanted in (("dq",), EFFORTS):
        picks = []
        for signal in wanted if known.isdisjoint(wanted) else ():
            with suppress(LogError):
                picks.append(_pick_of(table, signal, groups))
        fitting = [p for p in picks if p is not None and len(p.cells) == joints]
        fitting = [pick for pick in fitting if taken.isdisjoint(pick.cells)]
        if len(fitting) == 1:
            columns = table.names[fitting[0].cells[0].column]
            told = fact("signal-by-name", signal=fitting[0].signal, column=columns)
            found.append(replace(fitting[0], remark=told))
    return found


def _as_driven(pick: Pick, groups: dict[str, Group]) -> Pick:
    """The effort of UR's drivers as the current that it is, other picks as they are."""
    efforts = [groups[name].cells for name in ("effort", "eff") if name in groups]
    if pick.signal != "torque" or pick.cells not in efforts:
        return pick
    return replace(pick, signal="current", remark=fact("effort-is-current"))


def stated_pick(table: Table, item: Item, groups: dict[str, Group]) -> Pick:
    """The columns of an item: by pattern, by a name without index, or those found without it."""
    if item.pattern is None:
        signal = SIGNALS.get(item.signal, item.signal)
        found = _clock(table) if signal == "t" else None
        found = _pick_of(table, signal, groups) if signal in ALIASES else found
        if signal == "wrench":
            controllers = groups.get("actual_tcp_force")  # UR's
            own = None if controllers is None else vendor_pick(signal, signal, controllers.cells)
            found = _wrench(table) or own
        if found is None:
            raise missing_column(table, item.signal, item.signal)
        pick = pick_of(item, found.cells)
        return replace(pick, factor=pick.factor * found.factor)
    group = groups.get(item.pattern.lower())
    if group is not None and item.pattern not in table.names:
        return pick_of(item, filled_cells(table, item.pattern, group))
    return pick_of(item, named_cells(table, item))


def grouped(table: Table) -> dict[str, Group]:
    """The columns of a table by name without index, in lower case."""
    found: dict[str, dict[int, Cell]] = {}
    twice: dict[str, str] = {}
    by_joint = joint_columns(table)
    in_joints = {cell.column for cells in by_joint.values() for cell in cells.values()}
    for column, name in enumerate(table.names):
        if column in in_joints:
            continue
        if column in table.lists:
            cells = {k: Cell(column, k) for k in range(table.lists[column])}
            found.setdefault(name.lower(), {}).update(cells)
        elif match := JOINT_FIRST.fullmatch(name):
            by_joint.setdefault(match["stem"], {})[match["joint"]] = Cell(column)
        elif match := INDEXED.fullmatch(name):
            index = int(match["a"] or match["b"] or match["c"])
            stem = FIELD.sub("", match["stem"].lower(), count=1)
            if found.setdefault(stem, {}).setdefault(index, Cell(column)) != Cell(column):
                twice[stem] = name
    # By index, not by place: a table may hold q_10 before q_2.
    groups = {
        stem: Group(
            tuple(cells[i] for i in sorted(cells)), tuple(sorted(cells)), twice=twice.get(stem, "")
        )
        for stem, cells in found.items()
    }
    for stem, cells_of in by_joint.items():
        order = kinematic_order(tuple(cells_of))
        names = tuple(tuple(cells_of)[k] for k in order)
        cells_in_order = tuple(cells_of[name] for name in names)
        groups[stem] = Group(cells_in_order, tuple(range(len(names))), names)
    return groups


def joint_columns(table: Table) -> dict[str, dict[str, Cell]]:
    """Columns that bear a signal's name beside a joint's: signal → joint → cell.

    Names are only taken apart so where two signals have the same joints, and are no axes.
    """
    found: dict[str, dict[str, Cell]] = {}
    for column, name in enumerate(table.names):
        match = next((m for p in SIGNAL_OF_JOINT if (m := p.fullmatch(name))), None)
        if match is None or column in table.lists:
            continue
        # pos_joint1 is found by its number, as pos_1 is.
        if not (name.endswith(match["joint"]) and NUMBERED_JOINT.fullmatch(match["joint"])):
            found.setdefault(match["stem"].lower(), {})[match["joint"]] = Cell(column)
    joints = {stem: frozenset(cells) for stem, cells in found.items()}
    return {
        stem: cells
        for stem, cells in found.items()
        if len(cells) >= FEWEST_JOINTS
        and list(joints.values()).count(joints[stem]) > 1
        and not any(AXES.fullmatch(joint) for joint in cells)
    }


def _pick_of(table: Table, signal: str, groups: dict[str, Group]) -> Pick | None:
    """The columns of a signal, None where none bears a name of it."""
    found = [name for name in ALIASES[signal] if name in groups]
    if not found:
        return None
    if len(found) > 1:
        raise LogError(
            f"{table.path}: {' and '.join(found)} could both be {signal}. Say which with "
            f"--columns, as in q=…,{signal if signal != 'torque' else 'tau'}={found[0]}_{{i}}."
        )
    name = found[0]
    group, cells = groups[name], filled_cells(table, name, groups[name])
    first = group.indices[0]
    if group.indices != tuple(range(first, first + len(group.indices))):
        raise LogError(
            f"{table.path}: the columns of {name} are numbered "
            f"{', '.join(map(str, group.indices[:12]))}, with holes. Name them with --columns."
        )
    return vendor_pick(signal, name, cells)


def filled_cells(table: Table, name: str, group: Group) -> tuple[Cell, ...]:
    """The cells of a group."""
    if group.twice:
        raise LogError(
            f"{table.path}: two columns could be {name} of one index: {group.twice!r} and another. "
            "Name the columns with --columns."
        )
    if not group.cells:
        raise LogError(
            f"{table.path}: {name} holds no number in its first row, so its width cannot be told. "
            "Cut the rows with empty lists out, or leave the column out with --columns."
        )
    return group.cells


def vendor_pick(signal: str, name: str, cells: tuple[Cell, ...]) -> Pick:
    """The cells of a vendor's field as a signal; libfranka's residual with its sign turned."""
    turned = name in TURNED
    return Pick(
        signal=signal,
        cells=cells,
        factor=-1.0 if turned else 1.0,
        remark=RESIDUAL_TURNED if turned else None,
    )


def _wrench(table: Table) -> Pick | None:
    """The six columns of a wrench, or its column of lists; None where one of them is missing."""
    there = enumerate(table.names)
    names = ["" if column in table.lists else name.lower() for column, name in there]
    for text in WRENCHES:
        wanted = text.split()
        if all(names.count(name) == 1 for name in wanted):
            return Pick(signal="wrench", cells=tuple(Cell(names.index(n)) for n in wanted))
    rows = [c for c, n in enumerate(table.names) if n.lower() == "wrench"]
    if len(rows) == 1 and table.lists.get(rows[0]) == 6:
        return Pick(signal="wrench", cells=tuple(Cell(rows[0], k) for k in range(6)))
    return None


def _clock(table: Table) -> Pick | None:
    """The columns of time, None where none bears a name of it: one, or seconds and nanoseconds.

    A message's own stamp goes before the time at which a recorder took it.
    """
    names = [name.lower() for name in table.names]
    pairs: list[tuple[int, ...]] = []  # whole seconds and nanoseconds, as ROS writes its stamps
    for column, name in enumerate(names):
        if match := NANOSECONDS.fullmatch(name):
            wanted = {match["stem"] + word for word in ("sec", "secs", "second", "seconds", "s")}
            there = [k for k, other in enumerate(names) if other in wanted]
            pairs += [(there[0], column)] if len(there) == 1 else []
    in_pair = {column for pair in pairs for column in pair}
    bare = [re.sub(r"[_ ]?[\[(]?(?<=[_\[( ])(s|ms|us|ns)[\])]?$", "", name) for name in names]
    single: list[tuple[int, ...]] = [
        (column,)
        for column, name in enumerate(names)
        if column not in in_pair
        and (name in CLOCKS or bare[column] in CLOCKS[:4] or HEADER_STAMP.fullmatch(name))
    ]
    found = [*pairs, *single]
    own = [columns for columns in found if HEADER_STAMP.match(names[columns[0]])]
    found = own or found
    if len(found) > 1:
        clocks = listed(["|".join(table.names[c] for c in columns) for columns in found])
        raise LogError(
            f"{table.path}: {clocks} could each be the clock. Say which with --columns, as in "
            f"t={'|'.join(table.names[c] for c in found[0])},q=…"
        )
    return Pick(signal="t", cells=tuple(table_clock(table, c) for c in found[0])) if found else None


def table_clock(table: Table, column: int) -> Cell:
    """The cell of a clock's column, which may hold lists of one number."""
    length = table.lists.get(column, 1)
    if length != 1:
        raise LogError(
            f"{table.path}: the clock {table.names[column]!r} holds {length} numbers a "
            "row, but a sample has one time. Name another column with --columns, as in t=…,q=…"
        )
    return Cell(column, 0 if column in table.lists else None)
