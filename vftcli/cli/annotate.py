"""`vftcli annotate`: a dataset becomes a copy with forces in it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from vftcli.batch.choice import WorkersChoice
from vftcli.cli import options as opt
from vftcli.cli.analysis import LogOptions
from vftcli.observers.choice import ObserverChoice
from vftcli.signals.option import WRITE, Option
from vftcli.virtual_sensor.choice import WrenchChoice

if TYPE_CHECKING:
    from collections.abc import Mapping

    from vftcli.batch.annotation import ForceChoice


class ColumnOptions(opt.Bundle):
    """Which columns are added."""

    GROUP = WRITE

    sd: Annotated[
        bool,
        Option("--sd", "", "Also the observer's own standard deviation of each torque."),
    ]
    contact: Annotated[
        bool,
        Option(
            "--contact",
            "",
            "Also 1 in a listed contact, else 0. The list sees the complete episode: a label, no "
            "causal input.",
        ),
    ]
    allow_missing: Annotated[
        bool,
        Option(
            "--allow-missing",
            "",
            "Write 0 where nothing can be told. Columns …_valid say where; without it, such a "
            "frame stops the run.",
        ),
    ]


@opt.command
def annotate_dataset(
    dataset: Annotated[
        Path, Option("", "DATASET", "A LeRobot folder, a DROID folder, or HDF5 episodes.")
    ],
    output: Annotated[Path, Option("-o/--output", "COPY", "Folder of the copy.", group=WRITE)],
    logged: LogOptions,
    observers: opt.Typed[ObserverChoice],
    also_wrench: opt.Wrench,
    wrench: opt.Typed[WrenchChoice],
    columns: ColumnOptions,
    workers: opt.Typed[WorkersChoice],
    anyway: opt.Anyway,
    _talk: opt.TalkOptions,
    json: opt.Json,
    force: opt.Force,
) -> None:
    """Write the forces of every frame into a copy of a dataset.

    Adds observation.external_torque, with --wrench observation.wrench, and their statistics; what
    was done stands in COPY/meta/vftcli.json. A run that was cut off goes on where it stopped.

    Example: vftcli annotate fixtures/panda_episodes -o forces
    """
    from vftcli.batch.annotated_copy import annotate
    from vftcli.batch.annotation import USUAL, ForceChoice
    from vftcli.cli.console import command_line, detail, say, say_json, stages

    asked = ForceChoice(
        read=logged.reading.choice(),
        robot=logged.robot.choice(),
        observers=observers.choice(observer=observers.words["observer"] or [USUAL]),
        wrench=wrench.choice() if also_wrench or wrench.is_asked else None,
        sd=columns.sd,
        contact=columns.contact,
        anyway=anyway,
    )
    engine = workers.choice()
    engine.check_closed(anyway=anyway)
    record = annotate(
        dataset,
        output,
        asked,
        engine,
        command=command_line(),
        tell=detail,
        progress=stages(),
        allow_missing=columns.allow_missing,
        force=force,
    )
    if json:
        say_json(record)
        return
    for line in told_lines(record, asked):
        say(line)
    say(f"wrote {output}")


def meaning(column: "Mapping[str, str]") -> str:
    """What a column's numbers are: unit and axes of a force, else what 1 and 0 say."""
    if column["units"] == "1":
        return column["sign"]
    return f"{column['units']}, {column['frame']}"


def told_lines(record: "Mapping[str, Any]", asked: "ForceChoice") -> list[str]:
    """What was written, and what a user of it should know."""
    done, frames = record["status"], sum(one.get("frames", 0) for one in record["episodes"])
    count = ", ".join(f"{n} {status}" for status, n in done.items())
    kind = "causal" if record["causal"] else "NOT causal: it looks ahead, no policy can run on it"
    delay, episodes = record["transient_frames"], sum(done.values())
    lines = [
        f"{episodes} episode{'s' * (episodes != 1)} ({count}), {frames} frames, "
        f"{record['robot']['name']}, "
        f"{asked.observer}, {kind}",
        *(f"  {name}: {meaning(column)}" for name, column in record["columns"].items()),
        f"  the first {delay} frames of an episode still show where the observer started",
    ]
    clocks = dict.fromkeys(one["clock"] for one in record["episodes"] if "clock" in one)
    lines += [f"  clock: {clock}" for clock in clocks]
    overridden = sorted({code for one in record["episodes"] for code in one.get("overridden", ())})
    if overridden:
        lines.append(f"MEANINGLESS unless this is wrong (--anyway): {', '.join(overridden)}")
    return lines
