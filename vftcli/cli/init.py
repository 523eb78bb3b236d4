"""`vftcli init`: the options that a log calls for, written down once."""

import os
from pathlib import Path
from typing import Annotated

from vftcli.cli import options as opt
from vftcli.cli.analysis import LogOptions
from vftcli.cli.config import NAME
from vftcli.signals.option import WRITE, Option


@opt.command
def write_config(
    *,
    logs: opt.Logs,
    logged: LogOptions,
    _talk: opt.TalkOptions,
    output: Annotated[
        Path, Option("-o/--output", "FILE", "The file of options.", group=WRITE)
    ] = Path(NAME),
    json: opt.Json,
    force: opt.Force,
) -> None:
    """Write vftcli.toml: the options that a log calls for.

    Robot, columns, effort, reference, each with its reason; further LOGs are taken as free motion
    where nothing touches the arm. Commands in that folder then need none of these options.

    Example: vftcli init fixtures/ur5_circle.csv -o vftcli.toml
    """
    from vftcli.cli.console import say, say_json
    from vftcli.outputs.files import check_file, write_text
    from vftcli.proposal import config_text, propose
    from vftcli.readers.library import Library

    check_file(output, force)
    words = {**logged.reading.words, **logged.robot.words}
    given = {name.replace("_", "-"): value for name, value in words.items() if value is not None}
    choice = logged.asked(Library(logs))
    proposed = [
        option._replace(value=from_folder(output.parent, option.key, option.value))
        for option in propose(logs, choice, given)
    ]
    write_text(output, config_text(proposed), force)
    taken = {option.key: option.value for option in proposed if option.key and option.taken}
    for option in proposed:
        if not option.key:
            say(f"note: {option.why}")
    if json:
        say_json({"output": str(output), "options": taken, "notes": [o.why for o in proposed]})
    how = "unasked by commands run beside it" if output.name == NAME else f"with --config {output}"
    say(f"wrote {output}: {', '.join(taken) or 'nothing that is settled'}; read {how}")
    if "robot" not in taken:
        say("which arm it is stands open: name it with --robot, or in the file")


def from_folder(folder: Path, key: str, value: str | list[str]) -> str | list[str]:
    """A value with files named from a folder on."""
    if isinstance(value, list):
        return [str(from_folder(folder, key, word)) for word in value]
    if key not in {"robot", "free"} or not Path(value).exists():
        return value
    return Path(os.path.relpath(value, folder)).as_posix()
