"""Tables of no page: robots, gains, times, drifts, contacts, pairs, prints."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from vftcli.outputs import Record
from vftcli.outputs.grid import (
    Column,
    Grid,
    Rows,
    joint_columns,
    keyed_grid,
    significant,
    terminal,
)
from vftcli.signals.wrench import AXES, unit_of

if TYPE_CHECKING:
    import polars as pl

    from vftcli.evaluation.published import Comparison
    from vftcli.observers.tuning import Tuned
    from vftcli.robots.robot import Robot
    from vftcli.wrench.sensor import Drift

FRICTION = "friction: SI units, models in docs/robots.md"  #: Below a robot's joints.
SURE = 0.05  #: A difference of two observers is sure below this p.
#: Column of the contact table → its heading.
CONTACTS = {
    "recording": "recording",
    "observer": "observer",
    "contacts": Column("contacts"),
    "listed_contacts": Column("rows"),
    "found_contacts": Column("found"),
    "missed_contacts": Column("missed"),
    "false_alarms": Column("false"),
    "false_alarms_per_h": Column("false/h"),
    "detection_delay_s": Column("delay", "s", ".3f"),
    "longest_delay_s": Column("longest", "s", ".3f", seldom=True),
}


def robots_grid(robots: "Iterable[Robot]") -> Grid:
    """The robot profiles, one row each."""
    rows: Rows = []
    for robot in robots:
        friction = sorted({f.model.removeprefix("coulomb-") for f in robot.friction})
        models = ", ".join(friction) or "no model"
        rows.append((robot.name, robot.title, str(robot.joints), robot.torque_source, models))
    return Grid(("name", "arm", Column("joints"), "effort", "friction"), rows)


def joints_grid(robot: "Robot") -> Grid:
    """One robot joint by joint: masses, drives, limits, friction."""
    chain, constants = robot.chain, robot.torque_constant
    rows: Rows = []
    for j, joint in enumerate(chain.names):
        friction = "none"
        if table := robot.friction[j].table if robot.friction else {}:
            model, trust = table.pop("model"), table.pop("confidence", "no confidence stated")
            numbers = ", ".join(
                f"{key} {' '.join(f'{v:g}' for v in (x if isinstance(x, list) else [x]))}"
                for key, x in table.items()
            )
            friction = f"{model} ({numbers}); {trust}"
        each = (chain.mass, chain.rotor_inertia, constants, robot.limits.tau_max)
        known = (None if values is None else float(values[j]) for values in each)
        rows.append((joint, *known, friction))
    columns = (
        "joint",
        Column("mass", "kg", ".3f"),
        Column("rotor", "kg·m²", ".3f"),
        Column("K", "N·m/A", ".4f"),
        Column("tau_max", "N·m", ".1f"),
        "friction",
    )
    return Grid(columns, rows)


def tuned_grid(tuned: "Sequence[Tuned]", with_alarms: bool) -> Grid:
    """Gains of each observer, and their effects, by joint."""
    rows: Rows = []
    for line in tuned:
        values = {
            "ω [rad/s]": line.rate,
            "delay [ms]": 1e3 * line.delay,
            "expected rmse [N·m]": line.rmse,
        }
        # Without a threshold there is no alarm to count.
        if with_alarms and line.alarms is not None:
            values["false alarms [1/h]"] = line.alarms.round(3)
        for k, (what, numbers) in enumerate(values.items()):
            rows.append(("" if k else line.observer, what, *map(float, numbers)))
    return Grid(("observer", "", *joint_columns(len(tuned[0].rate), form=".3g")), rows)


def robot_text(robot: "Robot") -> str:
    """One robot in full."""
    lines = [
        f"{robot.title} ({robot.name}): {robot.joints} joints, torque from {robot.torque_source}",
        *("", *terminal(joints_grid(robot)).splitlines(), FRICTION),
    ]
    for observer, gains in robot.gains.items():
        lines += ["", f"gains of {observer} (vftcli help gains):"]
        lines += [f"  {observer}.{key} = {value}" for key, value in gains.items()]
    lines += ["", *(f"note: {note}" for note in robot.remarks)]
    lines += [
        f"source {source.get('id', '?')}: {source.get('what', '')}: {source.get('ref', '')}"
        for source in robot.sources
    ]
    if robot.payloads:
        lines.append(f"payloads: {', '.join(robot.payloads)} (--payload NAME)")
    return "\n".join(lines)


def bench_grid(result: Record) -> Grid:
    """Times of dynamics and observers, beside the paper's."""
    dynamics = {"name": "dynamics", **result["dynamics"]}
    columns = {
        "name": "",
        "total_s": Column("total", "ms", lambda seconds: f"{1e3 * seconds:.2f}"),
        "per_sample_us": Column("per sample", "µs", ".3f"),
        "paper_s": Column("paper, its laptop", "s", ".3f"),
    }
    return keyed_grid(columns, [dynamics, *result["observers"]])


def contact_grids(errors: "pl.DataFrame | None") -> Iterator[Grid]:
    """Contact detection by recording, if any."""
    if errors is None or "contacts" not in errors.columns:
        return
    if len(rows := errors.drop_nulls("contacts")):
        title = "Contacts against the reference; delay: from their true start"
        yield keyed_grid(CONTACTS, rows.iter_rows(named=True), title)


def drift_grid(drifts: "Iterable[Drift]") -> Grid:
    """Zero drift by observer and axis, in the paper's decimals."""
    axes = (Column(axis, unit_of(axis), ".5f") for axis in AXES)
    rows: Rows = [(d.name, f"{d.span[0]:g}–{d.span[1]:g}", *map(float, d.mean)) for d in drifts]
    title = "Zero drift; the first span's is removed"
    return Grid(("observer", Column("span [s]"), *axes), rows, title, swatches=True)


def pairs_text(table: "pl.DataFrame") -> str:
    """The paired differences of all logs, as a terminal table."""
    rows: Rows = []
    for row in table.iter_rows(named=True):
        names, low, high = (row["observer"], row["other"]), row["low_Nm"], row["high_Nm"]
        # First RMSE less second: above zero the second observer is better.
        if row["difference_Nm"] > 0:
            names = names[::-1]
        else:
            low, high = -high, -low
        interval = f"{significant(low)} to {significant(high)}"
        by = abs(row["difference_Nm"])
        # A blank aligns digits without a star.
        sure = f"{row['p']:.3f}{'*' if row['p'] < SURE else ' '}"
        rows.append((row["recording"], f"J{row['joint']}", *names, by, interval, sure))
    heads = ("joint", "better", "than", "by [N·m]", "95 % interval", "p")
    grid = Grid(("recording", *map(Column, heads)), rows)
    return f"{terminal(grid)}*: p below {SURE:g}\n"


def print_grid(found: "Comparison") -> Grid:
    """A printed table beside one's own: two lines an observer."""
    rows: Rows = []
    for name in found.names:
        rows.append((f"{name}, printed", *(f"{v:.4f}" for v in found.printed(name))))
        rows.append((f"{name}, here", *map(float, found.ours[name])))
    rows.append(("floor, here", *map(float, found.floor)))
    columns = "observer", *joint_columns(len(found.floor))
    return Grid(columns, rows, f"{found.recording} beside {found.published.title}, N·m")
