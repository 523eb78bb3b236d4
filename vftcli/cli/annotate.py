"""`vftcli annotate`: a dataset becomes a copy with forces in it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from vftcli.batch import WorkersChoice
from vftcli.cli import options as opt
from vftcli.cli.console import detail, echo_data, say
from vftcli.observers import ObserverChoice
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice
from vftcli.signals.option import WRITE, Anyway, Asked, Option
from vftcli.signals.parsing import check_known, counted
from vftcli.wrench import WrenchChoice

ADDED = ("wrench", "sd", "contact")  #: Values of ``--add``.


@opt.command(*opt.OF_LOG, ObserverChoice, WrenchChoice, WorkersChoice, Anyway, opt.Talk)
def annotate_dataset(
    dataset: Annotated[
        Path, Option("", "DATASET", "A LeRobot folder, a DROID folder, or HDF5 episodes.")
    ],
    output: opt.Folder,
    asked: Asked,
    add: Annotated[
        list[str] | None,
        Option(
            "--add",
            "NAMES",
            "Add wrench, sd or contact columns as well.",
            group=WRITE,
            completes=lambda: ADDED,
        ),
    ],
    json: opt.Json,
    force: opt.Force,
) -> None:
    """Add forces to every frame of a dataset's copy.

    Adds observation.external_torque, with --add wrench observation.wrench, and their statistics;
    COPY/meta/vftcli.json says what was done. A run that was cut off goes on where it stopped.
    With --anyway frames without an answer are 0, and columns ..._valid say so.

    Example: vftcli annotate fixtures/panda_episodes -o forces
    """
    from vftcli.batch.annotation import USUAL, ForceChoice, annotate
    from vftcli.outputs.run_record import to_json

    added = [name.strip() for word in add or () for name in word.split(",")]
    for name in added:
        check_known(name, ADDED, f"--add {name}")
    anyway, wanted = asked.anyway, "wrench" in added or asked.states(WrenchChoice)
    choice = ForceChoice(
        read=asked.of(ReadChoice),
        robot=asked.of(RobotChoice),
        observers=asked.but(observer=asked.words["observer"] or [USUAL]).of(ObserverChoice),
        wrench=asked.of(WrenchChoice) if wanted else None,
        sd="sd" in added,
        contacts="contact" in added,
        anyway=anyway,
    )
    engine = asked.of(WorkersChoice)
    engine.check_closed(anyway=anyway)
    record = annotate(dataset, output, choice, engine, asked.line, detail, force=force)
    if json:
        echo_data(to_json(record))
        return
    for line in copy_lines(record, choice.observer):
        say(line)
    say(f"wrote {output}")


def copy_lines(record: Mapping[str, Any], observer: str) -> list[str]:
    """Lines on the written copy, and on its limits."""
    from vftcli.doctor.examination import doubt

    done, frames = record["status"], sum(one.get("frames", 0) for one in record["episodes"])
    count = ", ".join(f"{n} {status}" for status, n in done.items())
    kind = "causal" if record["causal"] else "NOT causal: it looks ahead, no policy can run on it"
    lines = [
        f"{counted(sum(done.values()), 'episode')} ({count}), {frames} frames, "
        f"{record['robot']['name']}, {observer}, {kind}"
    ]
    for name, column in record["columns"].items():
        # Unit and axes of a force, else the meaning of 1 and 0.
        force = f"{column['units']}, {column['frame']}"
        lines.append(f"  {name}: {column['sign'] if column['units'] == '1' else force}")
    if delay := record["transient_frames"]:
        lines.append(f"  the observer settles in the first {delay} frames of each episode")
    clocks = dict.fromkeys(one["clock"] for one in record["episodes"] if "clock" in one)
    lines += [f"  clock: {clock}" for clock in clocks]
    overridden = sorted(
        {code for one in record["episodes"] for code in one.get("overridden", ())}
    )
    if overridden:
        lines.append(doubt(", ".join(overridden)))
    return lines
