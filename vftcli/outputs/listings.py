"""Tables that a command prints and no file holds: robot profiles, gains that were found."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from vftcli.outputs.grid import Column, Grid, joint_columns, keyed_grid, terminal

if TYPE_CHECKING:
    from vftcli.observers.tuning import Tuned
    from vftcli.robots.robot import Robot


def robots_grid(robots: "Iterable[Robot]") -> Grid:
    """The robot profiles, one row each, without a heading."""
    return Grid(
        # The widths keep the columns of one release where they were in the one before.
        columns=tuple(Column("", words=True, width=width) for width in (6, 27, 9, 12, 0)),
        rows=tuple(
            (
                robot.name,
                robot.title,
                f"{robot.joints} joints",
                robot.torque_source,
                ", ".join(sorted({f.model for f in robot.friction}) or ["no friction model"]),
            )
            for robot in robots
        ),
    )


def joints_grid(robot: "Robot") -> Grid:
    """One robot joint by joint: masses, drives, limits, friction; units in the first row."""
    chain = robot.chain
    rows: list[tuple[str | float, ...]] = [("", "kg", "kg·m²", "N·m/A", "N·m", "")]
    for j, joint in enumerate(chain.names):
        constant = float(robot.torque_constant[j]) if robot.torque_constant is not None else "-"
        inertias = float(chain.mass[j]), float(chain.rotor_inertia[j])
        limit = float(robot.limits.tau_max[j])
        rows.append((joint, *inertias, constant, limit, friction_words(robot, j)))
    return Grid(
        columns=(
            Column("joint", words=True, width=16),
            Column("mass", form=".3f", width=7),
            Column("rotor", form=".3f", width=7),
            Column("K", form=".4f", width=8),
            Column("tau_max", form=".1f", width=7),
            Column("friction", words=True),
        ),
        rows=tuple(rows),
    )


def friction_words(robot: "Robot", j: int) -> str:
    """One joint's friction model with its numbers, and how far they are to be trusted."""
    table = robot.friction[j].table if robot.friction else {}
    if not table:
        return "none"
    model, confidence = table.pop("model"), table.pop("confidence", "no confidence stated")
    numbers = ", ".join(
        f"{key} {' '.join(f'{v:g}' for v in (value if isinstance(value, list) else [value]))}"
        for key, value in table.items()
    )
    return f"{model} ({numbers}); {confidence}"


def tuned_grid(tuned: "Sequence[Tuned]", with_alarms: bool) -> Grid:
    """Gains that were found for each observer and what to expect of them, joint by joint."""
    rows: list[tuple[str | float, ...]] = []
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
    joints = joint_columns(len(tuned[0].rate), form=".3g", width=7)
    words = (Column("observer", words=True), Column("", words=True, width=22))
    return Grid(columns=(*words, *joints), rows=tuple(rows))


def robot_text(robot: "Robot") -> str:
    """One robot in full: joints, drives, friction, gains, sources."""
    lines = [
        f"{robot.title} ({robot.name}): {robot.joints} joints, torque from {robot.torque_source}",
        "",
        *terminal(joints_grid(robot)).splitlines(),
    ]
    for observer, gains in robot.gains.items():
        lines.append("")
        lines.extend(f"{observer}.{key} = {value}" for key, value in gains.items())
    lines += ["", *(f"note: {note}" for note in robot.remarks)]
    lines += [
        f"source {source.get('id', '?')}: {source.get('what', '')}: {source.get('ref', '')}"
        for source in robot.sources
    ]
    if robot.payloads:
        lines.append(f"payloads: {', '.join(robot.payloads)} (--payload NAME)")
    return "\n".join(lines)


def bench_grid(result: Mapping[str, Any]) -> Grid:
    """Times of dynamics and observers, beside the paper's on its laptop."""
    dynamics = {"name": "dynamics", **result["dynamics"]}
    columns = {
        "name": Column("", words=True, width=15),
        "total_s": Column("total", "ms", lambda seconds: f"{1e3 * seconds:.2f}"),
        "per_sample_us": Column("per sample", "µs", ".3f"),
        "paper_s": Column("paper, its laptop", "s", ".3f"),
    }
    return keyed_grid(columns, [dynamics, *result["observers"], *result["complete_log"]])
