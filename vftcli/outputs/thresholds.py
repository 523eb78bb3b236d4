"""Thresholds as tables, rows for machines, and calls of the robots' interfaces."""

from collections.abc import Callable, Sequence
from functools import partial
from math import ceil, isnan

from vftcli.contacts.threshold_check import ThresholdDetection
from vftcli.contacts.thresholds import SignalThreshold, Thresholds
from vftcli.outputs import Record
from vftcli.outputs.grid import (
    DASH,
    Column,
    Grid,
    Rows,
    keyed_grid,
    significant,
    terminal,
)
from vftcli.robots.robot_file import lines_of
from vftcli.signals.parsing import counted

#: Steps a unit: no robot resolves 0.01 N·m.
SHARES = 100
COLUMNS = "", Column("threshold"), "", Column("95 %"), Column("free motion", "h"), "set by"
#: Below the thresholds.
LEGEND = (
    "95 %: interval of the threshold; set by: the log that needs the highest one; "
    "free motion: its length. Below: thresholds, and upper ends of the intervals\n"
)
#: Key of a contact in a check → its column.
CONTACTS = {
    "number": Column("#"),
    "start_s": Column("from", "s", ".2f"),
    "stop_s": Column("to", "s", ".2f"),
    "peak_force_N": Column("|F|", "N"),
    "delay_s": Column("delay", "ms", lambda seconds: f"{1e3 * seconds:.0f}"),
    "by": "alarm by",
}


def thresholds_text(thresholds: Thresholds, checks: Sequence[ThresholdDetection]) -> str:
    """Tables of thresholds, calls of interfaces, for the terminal."""
    parts = [terminal(thresholds_grid(thresholds)) + LEGEND]
    for check in checks:
        contacts = [
            row | {"by": row["by"] or ("on already" if row["alarm_was_on"] else "missed")}
            for row in check_rows(check)
        ]
        grid = keyed_grid(CONTACTS, contacts, f"{check.log}: contacts at these thresholds")
        parts.append(f"{terminal(grid)}{check_line(check)}\n")
    return "\n".join([*parts, *(f"{name}:\n{text}" for name, text in calls(thresholds).items())])


def thresholds_grid(thresholds: Thresholds) -> Grid:
    """Every threshold with its interval and its log."""
    rows: Rows = []
    for name, unit, level, one in thresholds.named:
        span, t = DASH.join(map(significant, one.interval)), one.tail
        rows.append((name, level, unit, span, t and t.hours, one.log))
    title = f"Passed without contact {thresholds.rate:g} × an hour by any joint, or by any axis"
    return Grid(COLUMNS, rows, title)


def check_line(check: ThresholdDetection) -> str:
    """A check in a sentence."""
    count, detected = len(check.contacts), len(check.detected)
    median, longest, weakest, missed = check.figures.values()
    if check.reference is None:
        least = f", the weakest at {significant(weakest)} N" if count else ""
        return f"{check.log}: {counted(count, 'alarm')}{least}"
    words = [f"{check.log}: {detected} of {count} contacts detected"]
    if detected:
        words += [
            f"{1e3 * median:.0f} ms after they begin (median)",
            f"at most {1e3 * longest:.0f} ms",
        ]
    if not isnan(weakest):
        words.append(f"the weakest detected {significant(weakest)} N")
    if not isnan(missed):
        words.append(f"the hardest missed {significant(missed)} N")
    if on := sum(contact.already_above for contact in check.contacts):
        words.append(f"{on} while an alarm was on already")
    words.append(f"{check.false_alarms} false in {significant(check.untouched_h)} h untouched")
    return ", ".join(words)


def thresholds_record(thresholds: Thresholds, checks: Sequence[ThresholdDetection]) -> Record:
    """Thresholds for machines, units in the names."""
    rows = []
    for shown, of, level, one in thresholds.named:
        unit, tail, joint = of.replace("·", ""), one.tail, shown.startswith("J")
        row = {
            "joint" if joint else "axis": int(shown[1:]) if joint else shown,
            f"threshold_{unit}": None if isnan(level) else level,
            f"interval_{unit}": list(one.interval),
            "rate_per_h": one.rate,
            "log": one.log,
            f"tail_from_{unit}": tail and tail.start,
            f"tail_excess_{unit}": tail and tail.excess,
            "tail_rate_per_h": tail and tail.rate,
            "tail_maxima": tail and tail.size,
            "hours": tail and tail.hours,
        }
        rows.append(row)
    count, axes = len(thresholds.joints), len(thresholds.axes)
    return {
        "rate_per_h": thresholds.rate,
        "joints": rows[:count],
        "axes": rows[count : count + axes],
        "force": rows[-1] if thresholds.force else None,
        "calls": calls(thresholds),
        "checks": [
            {
                "log": check.log,
                "reference": check.reference,
                "detected": None if check.reference is None else len(check.detected),
                **check.figures,
                "false_alarms": check.false_alarms,
                "untouched_h": check.untouched_h,
                "contacts": check_rows(check),
                "remarks": check.remarks,
            }
            for check in checks
        ],
    }


def check_rows(check: ThresholdDetection) -> list[Record]:
    """The contacts of a check, a row each."""
    return [
        dict(zip(CONTACTS, (number, *c[:4], c.by or None), strict=True))
        | {"alarm_was_on": c.already_above}
        for number, c in enumerate(check.contacts, start=1)
    ]


def calls(thresholds: Thresholds) -> dict[str, str]:
    """Name of every interface for so many joints → its text."""
    # An interface that needs an unknown number gets no text.
    return {
        name: write(thresholds)
        for name, (joints, needed, write) in INTERFACES.items()
        if joints in (None, len(thresholds.joints))
        and (not needed or are_known(getattr(thresholds, needed)))
    }


def are_known(thresholds: Sequence[SignalThreshold]) -> bool:
    """Whether thresholds are there, and none is wide."""
    return bool(thresholds) and not any(one.is_wide for one in thresholds)


def lower(thresholds: Sequence[SignalThreshold]) -> list[float]:
    """The thresholds themselves; a contact is beyond. [N·m, N]"""
    # Rounding down would raise more alarms.
    return [ceil(one.value * SHARES) / SHARES for one in thresholds]


def upper(thresholds: Sequence[SignalThreshold]) -> list[float]:
    """Upper ends of their intervals, if known. [N·m, N]"""
    ends = ((one, one.interval[1]) for one in thresholds)
    return lower([one if isnan(end) else one._replace(value=end) for one, end in ends])


def franka_text(
    thresholds: Thresholds, frame: str, line: str, phases: Sequence[str] = ("",)
) -> str:
    """A text of Franka's interfaces: a frame about a line a list."""
    own = thresholds.of_vendor
    head = "" if own else "# learned from gmo, not from the robot's own tau_ext: record that\n"
    lists = "".join(
        line.format(f"{side}_{quantity}_thresholds{phase}", rounded(ones))
        for quantity, ones in (("torque", thresholds.joints), ("force", thresholds.axes))
        for phase in phases
        for side, rounded in (("lower", lower), ("upper", upper))
    )
    return head + frame.format(lists)


def ur_script(thresholds: Thresholds) -> str:
    """A thread in URScript that halts beyond the limit."""
    own = thresholds.logged_wrench
    head = "" if own else "# learned from gmo, not from actual_TCP_force: record that\n"
    return f"""{head}thread watch_force():
  while True:
    if force() > {lower(thresholds.force)[0]}:  # N
      halt
    end
    sync()
  end
end
run watch_force()
"""


def toml_text(thresholds: Thresholds) -> str:
    """The thresholds as TOML, units in the names."""
    table: Record = {
        "rate_per_h": thresholds.rate,
        "joint_torque_Nm": lower(thresholds.joints),
        "joint_torque_upper_Nm": upper(thresholds.joints),
    }
    parts = {"force_{}N": thresholds.axes[:3], "moment_{}Nm": thresholds.axes[3:]}
    for name, some in parts.items():
        if are_known(some):
            table[name.format("")], table[name.format("upper_")] = lower(some), upper(some)
    if are_known(thresholds.force):
        table["force_size_N"] = lower(thresholds.force)[0]
        table["force_size_upper_N"] = upper(thresholds.force)[0]
    return "".join(lines_of({"thresholds": table})).lstrip()


#: Interface of a robot → its number of joints, None for any; thresholds that must be
#: known, "" for none; and its text.
INTERFACES: dict[str, tuple[int | None, str, Callable[[Thresholds], str]]] = {
    # `set_collision_behavior` of pylibfranka; the C++ call has these four lists too.
    "libfranka": (7, "axes", partial(
        franka_text, frame="robot.set_collision_behavior(\n{})\n", line="    {1},  # {0}\n"
    )),
    # `collision_config` of franka_control_node.yaml.
    "franka_ros": (7, "axes", partial(
        franka_text, frame="collision_config:\n{}", line="  {}: {}\n",
        phases=("_acceleration", "_nominal"),
    )),
    "ur_script": (6, "force", ur_script),
    "toml": (None, "", toml_text),
}  # fmt: skip
