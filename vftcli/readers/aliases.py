"""Aliases: the names under which users' tables hold the signals."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

from vftcli.readers.columns import UNITS, Cell, Cells, Item, parse_columns, unit_factor
from vftcli.readers.reading import FORMATS, LogFormat
from vftcli.readers.table import (
    OWN_STAMPS,
    Names,
    NoColumnError,
    Picks,
    SameNameError,
    Signals,
    Table,
    cells_of,
    listed,
    named_cells,
    pick_of,
)
from vftcli.signals.errors import LogError
from vftcli.signals.parsing import tables_beside
from vftcli.signals.recording import EFFORTS
from vftcli.signals.remarks import fact

#: The layout of no program: its columns are known by their names.
TABLE = FORMATS["table"]
#: Names of the clock; a unit may follow, as in time_ms.
CLOCKS = (
    "t", "time", "timestamp", "time_s", "stamp", "sec", "__time", "%time", "seconds",
    "time_since_skill_started",
)  # fmt: skip
#: The nanoseconds beside a column of seconds: its name has the same stem.
NANOSECONDS = re.compile(r"(?P<stem>.*?)(nsecs?|nanosecs?|nanos|nanoseconds|ns)")
#: A message's own stamp, or a part of it.
HEADER_STAMP = re.compile(r"(?:.*[./])?header[./]stamp(?:[./]\w+)?")
#: Field of Recording → names its columns go by, in lower case and without their index.
ALIASES: dict[str, list[str]] = tables_beside(__file__, "aliases.toml")
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

# A number of any length would be tried from each of its digits on
INDEXED = re.compile(
    r"(?i)(?P<stem>.*?)[_./ ]?(?:(?:joint|j)_?|(?P<open>\[))?(?P<index>\d{1,9})(?(open)\])"
)
#: What ROS tools put before the fields of a JointState.
FIELD = re.compile(r"field\.|/?joint_states?[./]")
#: A joint's name before the signal's, as PlotJuggler exports JointState topics.
JOINT_FIRST = re.compile(
    r"(?:.*/)?(?P<joint>[A-Za-z][\w ]*)[/.](?P<stem>position|velocity|effort)(?:\[\])?"
)

SIGNAL_WORDS = "pos|position|vel|velocity|eff|effort|tau|torque|current|cur"
#: A signal's name before or behind a joint's, as in pos_elbow and elbow_joint_vel.
SIGNAL_OF_JOINT = (
    JOINT_FIRST,
    re.compile(rf"(?i)(?P<stem>{SIGNAL_WORDS})[_./ ](?P<joint>[A-Za-z][\w ]*)"),
    re.compile(rf"(?i)(?P<joint>[A-Za-z][\w ]*?)[_./ ](?P<stem>{SIGNAL_WORDS})"),
)

#: A unit behind a column's name, as in "q1 [deg]".
UNIT = re.compile(r"(.*?)[ _]?[\[(]([^\[\]()]+)[\])]")

NUMBERED_JOINT = re.compile(r"(?i)(joint|j)?_?\d+")
#: What a pose has in place of joints.
AXES = re.compile(r"(?i)r?[xyz]|q[wxyz]|roll|pitch|yaw")

FEWEST_JOINTS = 3

RESIDUAL_TURNED = fact("residual-turned")  #: Of libfranka's residual.
EFFORT_IS_CURRENT = fact("effort-is-current")


class NamedColumns:
    """The columns of a headed table, by their names or by a layout.

    Attributes:
        usual: Signal → the item that says its columns where it has any.
        groups: Name without index, in lower case → index → column.
        twice: Name of a group → a column that has the index of another.
        joints: Name of a group → the joints' names, if it has any.
    """

    def __init__(self, table: Table, layout: LogFormat = TABLE) -> None:
        self.table, self.remedy = table, layout.remedy
        usual = parse_columns(layout.columns).items if layout.columns else ()
        self.usual = {item.field: item for item in usual}
        self.twice: dict[str, str] = {}
        self.joints: dict[str, Names] = {}
        found: dict[str, dict[int, Cell]] = {}
        names = [without_unit(name)[0] for name in table.names]
        by_joint = _joint_columns(table, names)
        in_joints = {cell.column for cells in by_joint.values() for cell in cells.values()}
        for column, name in enumerate(names):
            if column in table.lists:
                found.setdefault(name.lower(), {}).update(enumerate(cells_of(table, column)))
            elif column not in in_joints and (match := INDEXED.fullmatch(name)):
                index, stem = int(match["index"]), FIELD.sub("", match["stem"].lower(), count=1)
                if found.setdefault(stem, {}).setdefault(index, Cell(column)) != Cell(column):
                    self.twice[stem] = name
        for stem, of_joint in by_joint.items():
            each = tuple(of_joint)
            self.joints[stem] = tuple(each[k] for k in kinematic_order(each))
            found[stem] = {k: of_joint[name] for k, name in enumerate(self.joints[stem])}
            self.twice.pop(stem, None)
        # Not by place: a table may hold q_10 before q_2.
        self.groups = {stem: dict(sorted(cells.items())) for stem, cells in found.items()}

    def cells(self, name: str) -> Cells:
        """The cells of a group."""
        group, path = self.groups[name.lower()], self.table.path
        if twice := self.twice.get(name.lower()):
            raise LogError(
                f"{path}: two columns could be {name} of one index: {twice!r} and another. "
                "Name the columns with --columns."
            )
        if not group:
            raise LogError(
                f"{path}: {name} holds no number in its first row, so its width is unknown. "
                "Cut the rows with empty lists out, or leave the column out with --columns."
            )
        return tuple(group.values())

    def find(self, signal: str) -> Item | None:
        """The columns of the clock or a signal, or None."""
        if self.usual:
            return self._usual(signal)
        if signal in {"t", "wrench"}:
            return clock_pick(self.table) if signal == "t" else wrench_pick(self.table)
        found = [name for name in ALIASES[signal] if name in self.groups]
        if len(found) > 1:
            raise LogError(
                f"{self.table.path}: {' and '.join(found)} could both be {signal}. Say which with "
                f"--columns, as in q=…,{signal if signal != 'torque' else 'tau'}={found[0]}_{{i}}."
            )
        for name in found:
            cells, indices = self.cells(name), list(self.groups[name])
            if indices[-1] - indices[0] >= len(indices):
                raise LogError(
                    f"{self.table.path}: the columns of {name} are numbered "
                    f"{', '.join(map(str, indices[:12]))}, with holes. Name them with --columns."
                )
            unit, remark = self.unit(cells), None if name not in TURNED else RESIDUAL_TURNED
            factor = unit_factor(signal, unit) * (-1.0 if remark else 1.0)
            return Item(signal, factor, unit, cells=cells, remark=remark)
        return None

    def unit(self, cells: Cells) -> str | None:
        """The unit in the names of columns, if any."""
        unit, *others = {without_unit(self.table.names[cell.column])[1] for cell in cells}
        if others:
            first = self.table.names[cells[0].column]
            raise LogError(
                f"{self.table.path}: columns like {first!r} have several units. "
                "Name them with --columns."
            )
        return unit

    def _usual(self, signal: str) -> Item | None:
        if (item := self.usual.get(signal)) is None:
            return None
        try:
            pick = pick_of(item, named_cells(self.table, item))
        except LogError as error:
            if signal in {"t", "q"} and not isinstance(error, SameNameError):
                raise LogError(f"{error} {self.remedy}".strip()) from None
            if isinstance(error, NoColumnError):
                return None
            raise
        # Of the vendors' signals libfranka's residual alone is turned.
        return pick._replace(remark=pick.remark and RESIDUAL_TURNED)

    def stated(self, item: Item) -> Item:
        """The columns that an item of --columns means."""
        pattern = item.pattern or ""
        if pattern not in self.table.names and pattern.lower() in self.groups:
            cells = self.cells(pattern)
            unit = item.unit or self.unit(cells)
            factor = unit_factor(item.signal, unit) * math.copysign(1.0, item.factor)
            return pick_of(item._replace(unit=unit, factor=factor), cells)
        if pattern or item.rate is not None:
            return pick_of(item, named_cells(self.table, item))
        found = self.find(item.field)
        if found is None and item.signal == "wrench" and "actual_tcp_force" in self.groups:
            found = Item("wrench", cells=self.cells("actual_tcp_force"))  # UR's
        if found is None:
            raise NoColumnError(self.table, item.signal, item.signal)
        pick = pick_of(item, found.cells)
        # A stated unit is in place of the usual one; a sign is turned again.
        scale = found.factor if item.unit is None else math.copysign(1.0, found.factor)
        return pick._replace(factor=pick.factor * scale, unit=pick.unit or found.unit)

    def others(self, stated: Mapping[str, Item]) -> Iterator[Item]:
        """The signals beside those that a text names.

        If it names the positions, only the velocities and an effort, of one group each.
        """
        if "t" not in stated and (clock := self.find("t")):
            yield clock
        known, used = stated.keys(), {cell for pick in stated.values() for cell in pick.cells}
        if "q" not in stated:
            for signal in (*ALIASES, "wrench"):
                pick = self.find(signal) if signal not in known else None
                if pick is not None and (signal == "wrench" or used.isdisjoint(pick.cells)):
                    yield pick
            return
        joints = len(stated["q"].cells)
        for wanted in (("dq",), EFFORTS):
            fitting = []
            for signal in wanted if known.isdisjoint(wanted) else ():
                with suppress(LogError):
                    pick = self.find(signal)
                    if pick and len(pick.cells) == joints and used.isdisjoint(pick.cells):
                        fitting.append(pick)
            if len(fitting) == 1:
                column = self.table.names[fitting[0].cells[0].column]
                remark = fact("signal-by-name", signal=fitting[0].field, column=column)
                yield fitting[0]._replace(remark=remark)


def picks_by_alias(
    table: Table, stated: Sequence[Item], layout: LogFormat, names: Names
) -> tuple[Picks, Names]:
    """The picks of a headed table by its names, and the joints' names."""
    columns = NamedColumns(table, layout)
    own = {pick.field: pick for pick in map(columns.stated, stated)}
    picks = own | {pick.field: pick for pick in columns.others(own)}
    q = picks["q"].cells if "q" in picks else ()
    # A group of another width is about something else: a gripper, a base.
    kept = {"t", "q", "wrench", *own, *columns.usual}
    picks = {s: p for s, p in picks.items() if not q or len(p.cells) == len(q) or s in kept}
    if len(names) != len(q):
        names = next((j for stem, j in columns.joints.items() if columns.cells(stem) == q), ())
    if effort_of(names) == "current" and own.keys().isdisjoint(EFFORTS) and "torque" in picks:
        efforts = [tuple(columns.groups.get(name, {}).values()) for name in ("effort", "eff")]
        if picks["torque"].cells in efforts:
            current = picks.pop("torque")._replace(signal="current", remark=EFFORT_IS_CURRENT)
            picks = {"current": current} | picks
    if table.names.count(OWN_STAMPS) == 1:
        column = table.names.index(OWN_STAMPS)
        if column not in table.lists:
            picks[OWN_STAMPS] = Item(OWN_STAMPS, cells=(Cell(column),))
    return picks, names


def without_unit(name: str) -> tuple[str, str | None]:
    """A column's name, and the unit behind it or None."""
    match = UNIT.fullmatch(name)
    known = match and any(match[2] in units for units in UNITS.values())
    return (match[1], match[2]) if match and known else (name, None)


def _joint_columns(table: Table, names: Sequence[str]) -> dict[str, dict[str, Cell]]:
    """Columns that bear a signal's name beside a joint's: signal → joint → cell.

    PlotJuggler's names are split only where two signals have the same joints, no axes.
    """
    found: dict[str, dict[str, Cell]] = {}
    sure = set[str]()
    for column, name in enumerate(names):
        match = next((m for p in SIGNAL_OF_JOINT if (m := p.fullmatch(name))), None)
        if match is None or column in table.lists:
            continue
        sure |= {match["stem"].lower()} if match.re is JOINT_FIRST else set()
        # pos_joint1 is found by its number, as pos_1 is.
        if not (name.endswith(match["joint"]) and NUMBERED_JOINT.fullmatch(match["joint"])):
            found.setdefault(match["stem"].lower(), {})[match["joint"]] = Cell(column)
    joints = [cells.keys() for cells in found.values()]
    alike = {
        stem
        for stem, cells in found.items()
        if len(cells) >= FEWEST_JOINTS and joints.count(cells.keys()) > 1
        if not any(map(AXES.fullmatch, cells))
    }
    return {stem: cells for stem, cells in found.items() if stem in sure | alike}


def wrench_pick(table: Table) -> Item | None:
    """The six columns of a wrench or its column of lists, or None."""
    names = ["" if c in table.lists else name.lower() for c, name in enumerate(table.names)]
    for text in WRENCHES:
        wanted = text.split()
        if all(names.count(name) == 1 for name in wanted):
            return Item("wrench", cells=tuple(Cell(names.index(n)) for n in wanted))
    rows = [c for c, n in enumerate(table.names) if n.lower() == "wrench"]
    if len(rows) == 1 and table.lists.get(rows[0]) == 6:
        return Item("wrench", cells=cells_of(table, rows[0]))
    return None


def clock_pick(table: Table) -> Item | None:
    """The clock's columns, a message's own stamp before a recorder's, or None."""
    names = [name.lower() for name in table.names]
    found: list[tuple[int, ...]] = []  # seconds and nanoseconds, as ROS has them
    for column, name in enumerate(names):
        if match := NANOSECONDS.fullmatch(name):
            wanted = {match["stem"] + word for word in ("sec", "secs", "second", "seconds", "s")}
            there = [k for k, other in enumerate(names) if other in wanted]
            found += [(there[0], column)] if len(there) == 1 else []
    in_pair = {column for pair in found for column in pair}
    for column, name in enumerate(names):
        bare = re.sub(r"[_ ]?[\[(]?(?<=[_\[( ])(s|ms|us|ns)[\])]?$", "", name)
        called = name in CLOCKS or bare in CLOCKS[:4] or HEADER_STAMP.fullmatch(name)
        found += [(column,)] if called and column not in in_pair else []
    found = [columns for columns in found if HEADER_STAMP.match(names[columns[0]])] or found
    if len(found) > 1:
        clocks = listed(["|".join(table.names[c] for c in columns) for columns in found])
        raise LogError(
            f"{table.path}: {clocks} could each be the clock. Say which with --columns, as in "
            f"t={'|'.join(table.names[c] for c in found[0])},q=…"
        )
    return (
        Item("t", cells=tuple(cell for c in found[0] for cell in cells_of(table, c)))
        if found
        else None
    )


#: The UR drivers' joint names, base to tip; ROS 1 sorts its arrays.
UR_NAMES = (
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
    "wrist_1_joint", "wrist_2_joint", "wrist_3_joint",
)  # fmt: skip
#: The names on UR's teach pendant, base to tip.
UR_WORDS = ("base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3")

FRANKA = re.compile(r"(?:.*_)?(panda|fr3|fer|fp3)_joint([1-7])")
NUMBERED = re.compile(r"(?i).*?joint[_ ]?(\d{1,9})")

#: Stem of Franka's joint names → profile.
HINTS = {"panda": "panda", "fer": "panda", "fr3": "fr3"}


def kinematic_order(names: Sequence[str]) -> tuple[int, ...]:
    """Positions of the arm's joints among `names`, base to tip.

    Franka's and UR's joints are found by name, without prefixes and further joints (a
    gripper's fingers); UR's words and joint1, joint_2, … only alone. Unknown names keep
    the file's order.
    """
    words = [re.sub(r"[_ ]+", " ", name.lower()).strip() for name in names]
    numbers = (NUMBERED.fullmatch(name) for name in names)
    every: tuple[tuple[int, list[int | None]], ...] = (
        (7, [int(m[2]) if (m := FRANKA.fullmatch(name)) else None for name in names]),
        (6, [next((j for j, u in enumerate(UR_NAMES) if n.endswith(u)), None) for n in names]),
        (6, [UR_WORDS.index(w) if len(words) == 6 and w in UR_WORDS else None for w in words]),
        (len(names), [int(m[1]) if m else None for m in numbers]),
    )
    for count, places in every:
        found = {place: k for k, place in enumerate(places) if place is not None}
        if len(found) == count == len(places) - places.count(None):
            return tuple(found[place] for place in sorted(found))
    return tuple(range(len(names)))


def along_arm(names: Names, signals: Signals) -> tuple[Names, Signals]:
    """The arm's joint names, base to tip, and its signals with a column for each.

    The wrench of a six-joint arm has as many columns, but they are no joints.
    """
    order = list(kinematic_order(names))
    if order == list(range(len(names))):
        return names, signals
    of_joints = {
        signal: value[:, order]
        for signal, value in signals.items()
        if signal != "wrench" and value.ndim == 2 and value.shape[1] == len(names)
    }
    return tuple(names[k] for k in order), signals | of_joints


def effort_of(names: Sequence[str]) -> str:
    """The signal of a JointState's effort: UR's drivers publish currents."""
    of_ur = [name.endswith(UR_NAMES) for name in names].count(True)
    return "current" if of_ur == len(UR_NAMES) else "torque"


def robot_of(names: Sequence[str]) -> str | None:
    """The profile by joint names, or None: UR's fit all its models."""
    stems = {m[1] for name in names if (m := FRANKA.fullmatch(name))}
    return HINTS.get(stems.pop()) if len(stems) == 1 else None
