"""`vftcli help`: topics and commands, and what there is, with its sources."""

from collections.abc import Iterator
from typing import Annotated, Any

import typer

from vftcli.cli import options as opt
from vftcli.cli.commands import COMMANDS
from vftcli.cli.help import columns, topics, two_columns
from vftcli.robots.choice import RobotChoice
from vftcli.signals.errors import ParameterError, UnknownFormatError
from vftcli.signals.option import NUMBERS, Choice, Option
from vftcli.signals.parsing import did_you_mean

#: What is listed → what its list shows.
LISTS = {
    "robots": "the robot profiles; NAME or FILE: one robot in full",
    "observers": "the observers, their equations and their numbers",
    "formats": "the log formats; NAME: how to record it",
    "settings": "every setting of --set NAME=VALUE and vftcli.toml",
}


@opt.command
def show_help(
    ctx: typer.Context,
    topic: Annotated[
        str | None,
        Option(
            "",
            "[TOPIC]",
            "A topic or a command; none: the list.",
            completes=lambda: (*topics(), *LISTS, *COMMANDS),
        ),
    ],
    name: Annotated[str | None, Option("", "[NAME]", "One robot, robot file or format.")],
    tip: Annotated[str | None, RobotChoice.option("tip")],
) -> None:
    """Explain a topic, or list robots, observers, formats.

    Example: vftcli help columns
    """
    if name is not None and topic not in {"robots", "formats"}:
        raise ParameterError(f"help {topic} {name}: a name follows robots or formats only")
    root: Any = ctx.find_root()
    if topic is None:
        typer.echo("\n".join(contents()))
    elif topic == "robots":
        typer.echo(robots(name, tip))
    elif topic == "formats":
        typer.echo("\n".join(formats(name)))
    elif topic == "observers":
        typer.echo("\n".join(observers()))
    elif topic == "settings":
        typer.echo("\n".join(settings()))
    elif topic in topics():
        typer.echo(topics()[topic]["text"].rstrip())
    elif topic in COMMANDS:
        asked = root.command.commands[topic]
        of_command = asked.make_context(topic, [], parent=root, resilient_parsing=True)
        typer.echo(asked.get_help(of_command))
    else:
        there = [*topics(), *LISTS]
        near = did_you_mean(topic, [*there, *COMMANDS])
        raise ParameterError(f"no topic {topic!r}; there is {', '.join(there)}.{near}")


def contents() -> Iterator[str]:
    """What can be asked for: topics, lists and commands."""
    explained = {name: entry["summary"] for name, entry in topics().items()}
    yield "vftcli help TOPIC, of"
    yield from two_columns([*explained.items(), *LISTS.items()], columns())
    yield "or of a command:"
    yield from two_columns([(name, each.summary) for name, each in COMMANDS.items()], columns())


def robots(name: str | None, tip: str | None) -> str:
    """The robot profiles by maker, or one robot and its sources."""
    from vftcli.outputs.grid import terminal
    from vftcli.outputs.listings import robot_row, robot_text, robots_grid
    from vftcli.robots import MAKERS, load_robot

    if name is not None:
        return robot_text(RobotChoice.parsed(robot=name, tip=tip).named())
    rows = {maker: [robot_row(load_robot(p)) for p in names] for maker, names in MAKERS.items()}
    return "".join(f"{m}\n{terminal(robots_grid(each))}" for m, each in rows.items()).rstrip("\n")


def observers() -> Iterator[str]:
    """The observers, their equations and their parameters."""
    from vftcli.observers.table import OBSERVERS, PARAMETERS

    rows = []
    for name, entry in OBSERVERS.items():
        numbers = ", ".join(f"{entry.section}.{each}" for each in PARAMETERS[entry.section])
        rows += [(name, f"{entry.title} {entry.equations}"), ("", entry.summary)]
        rows.append(("", f"--set {numbers}"))
    yield from two_columns(rows, columns())


def formats(name: str | None) -> Iterator[str]:
    """The log formats, or how to record one."""
    from vftcli.readers import FORMATS

    if name is None:
        yield from two_columns([(form.name, form.title) for form in FORMATS.values()], columns())
        yield "\nvftcli help formats NAME: how to record one; gzip and zstd are taken off."
    elif name in FORMATS:
        form = FORMATS[name]
        yield f"{form.name}: {form.title}"
        rows = {"record:": form.recording, "read:": form.takes, "pitfalls:": form.pitfalls}
        yield from two_columns([*rows.items()], columns())
    else:
        near = did_you_mean(name, FORMATS)
        raise UnknownFormatError(f"no format {name!r}; there is {', '.join(FORMATS)}.{near}")


def settings() -> Iterator[str]:
    """Every setting of all commands: name, unit, meaning and default."""
    from vftcli.cli import app

    commands: dict[str, Any] = vars(typer.main.get_command(app))["commands"]
    every = {kind: None for c in commands.values() for kind in vars(c.callback)["choices"]}
    rows = sorted(row for kind in every for row in settings_of(kind))
    yield "SETTINGS: --set NAME=VALUE, or in vftcli.toml a table [GROUP], NAME = VALUE."
    yield from two_columns(rows, columns())
    yield "simulate has a scenario's keys: --set servo.stiffness=soft, --set duration=8."


def settings_of(kind: type[Choice]) -> Iterator[tuple[str, str]]:
    """How each setting of a choice is given, and what it means."""
    for name, (option, default) in opt.settings_by_name([kind]).items():
        shown = {True: "yes", False: "no"}[default] if isinstance(default, bool) else default
        kept = f"; default {shown}" if isinstance(shown, str | int | float) else ""
        if name == NUMBERS:
            yield option.metavar, option.help
        else:
            yield name, f"{option.help} ({option.metavar}{kept})"
