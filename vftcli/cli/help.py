"""`vftcli help` and `--help`: commands by aim, options in groups, topics, lists.

Nothing here loads more than the command line, so that help comes at once.
"""

import re
import shlex
import shutil
import textwrap
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import chain
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

from vftcli.cli import options as opt
from vftcli.cli.commands import COMMANDS, JOURNEYS, former, renewed, with_command
from vftcli.cli.config import (
    NONE,
    READ,
    WORDS,
    Click,
    choices_of,
    every_command,
    is_configured,
    kept_words,
)
from vftcli.cli.progress import echo
from vftcli.robots import RobotChoice
from vftcli.signals.errors import ParameterError, UnknownFormatError
from vftcli.signals.option import GROUPS, LOG, NUMBERS, OUTPUT, Option, settings_by_name
from vftcli.signals.parsing import did_you_mean, nearest, printable, tables_beside

OWN = "This command"  #: Heading of one command's own options.
NARROWEST, WIDEST = 72, 80  #: Columns of a help text.


class GroupedCommand(TyperCommand):
    """A command with its options in groups for `--help`."""

    def __init__(self, *words: Any, **more: Any) -> None:  # noqa: ANN401 - typer's own
        super().__init__(*words, **more)
        if is_configured(self):
            how: dict[str, Any] = {"metavar": "FILE", "type": str, "expose_value": False}
            how["help"] = "Read options from FILE; none: from no file."
            self.params.append(TyperOption(param_decls=["--config"], **how))

    def parse_args(self, ctx: Click, args: list[str]) -> Click:
        """Parse the words; an unknown option's error names the nearest."""
        try:
            kept = kept_words(ctx, args) if is_configured(self) else None
            READ.set(kept[0] if kept else None)
            if kept:
                # What follows -- are logs.
                end = args.index("--") if "--" in args else len(args)
                args = [*args[:end], *kept[1], "--config", NONE, *args[end:]]
                WORDS.set([*WORDS.get()[:1], *args])
            rest = super().parse_args(ctx, args)
        except Exception as error:
            if found := getattr(error, "possibilities", None):
                near = nearest(getattr(error, "option_name", ""), found)
                vars(error)["possibilities"] = [near] if near else None
            elif (missing := getattr(error, "param", None)) and not vars(error)["message"]:
                vars(error)["message"] = f"\n  {missing.help}"
            raise
        if kept:
            said = shlex.join(kept[1]) or "nothing that this command takes and is not typed"
            words = f"note: {kept[0]} gives {said} (--config none: without it)"
            echo(printable(words), err=True)
        return rest

    def collect_usage_pieces(self, ctx: Click) -> list[str]:
        """Its usage without typer's braces."""
        return [piece.strip("{}") for piece in super().collect_usage_pieces(ctx)]

    def format_help(self, ctx: Click, formatter: Click) -> None:
        """Write its usage, its purpose, and its options by group."""
        width = columns()
        lines = [" ".join(["Usage:", ctx.command_path, *self.collect_usage_pieces(ctx)]), ""]
        for paragraph in (self.help or "").split("\n\n"):
            lines += textwrap.wrap(" ".join(paragraph.split()), width)
        found: dict[str, list[tuple[str, str]]] = {}
        for param in self.get_params(ctx):
            if (record := row_of(param, ctx)) is not None:
                # Those of every command have no `Option`.
                own = vars(self.callback).get("options", {}).get(param.name)
                group = own.group or OWN if own else OUTPUT
                is_log = param.param_type_name == "argument"
                found.setdefault(LOG if is_log else group, []).append(record)
        others = [group for group in found if group not in GROUPS]
        for group in (LOG, *others, *GROUPS[1:]):
            if group in found:
                lines += [f"{group}:", *two_columns(found[group])]
        formatter.write("\n".join(lines) + "\n")


class JourneyGroup(TyperGroup):
    """The program: its `--help` lists the commands by aim."""

    def format_help(self, ctx: Click, formatter: Click) -> None:
        """Write the commands by aim, then the program's options."""
        width, usage = columns(), "Usage: vftcli [COMMAND] LOG… [OPTIONS]"
        lines = [usage, "", *textwrap.wrap(self.help or "", width)]
        left = max(map(len, self.commands))
        for journey, names in JOURNEYS.items():
            lines += ["", journey]
            for name in names:
                text = f"  {name:<{left}}  {COMMANDS[name].summary}"
                lines += textwrap.wrap(text, width, subsequent_indent=" " * (left + 4))
        shown = (p for p in self.get_params(ctx) if p.name != "show_completion")
        rows = [row for p in shown if (row := row_of(p, ctx)) is not None]
        formatter.write("\n".join([*lines, "", *two_columns(rows)]) + "\n")

    def parse_args(self, ctx: Click, args: list[str]) -> Click:
        """Parse the words, with a command and today's for former ones."""
        words = with_command(args)
        if not ctx.resilient_parsing and words and (command := self.commands.get(words[0])):
            there = [name for param in command.params for name in param.opts]
            words[1:], notes = renewed(words[1:], there)
            if args[0] not in {words[0], *COMMANDS} and args[0] in former()["commands"]:
                notes.insert(0, f"{args[0]} is now {former()['commands'][args[0]]}")
            for note in notes:
                echo(printable(f"note: {note}"), err=True)
        WORDS.set(words)
        return super().parse_args(ctx, words)

    def resolve_command(self, ctx: Click, args: list[str]) -> Click:
        """The command asked for; an unknown one's error names the nearest."""
        if args[0] not in self.commands:
            if args[0] in former()["gone"]:
                raise ParameterError(f"{args[0]} is gone; {former()['gone'][args[0]]}")
            ctx.fail(f"No such command '{args[0]}'.{did_you_mean(args[0], self.commands)}")
        return super().resolve_command(ctx, args)


def columns() -> int:
    """Width of a help text."""
    return min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST)


def row_of(param: Click, ctx: typer.Context) -> tuple[str, str] | None:
    """A parameter as typed, and its meaning; None if hidden."""
    if param.param_type_name == "argument":
        return (param.metavar or param.name.upper(), param.help) if param.help else None
    typed, meaning = param.get_help_record(ctx) or ("", "")
    # Typer adds "[required]" and ranges.
    plain = re.sub(r"(?<=required\.)  \[required\]|  \[[\dx<>=]+\]", "", meaning)
    return (typed, plain) if typed else None


def two_columns(rows: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Typed words to the left, meanings to the right, wrapped."""
    left = max(len(typed) for typed, _ in rows)
    for typed, meaning in rows:
        first, *more = textwrap.wrap(meaning, columns() - left - 4) or [""]
        yield f"  {typed:<{left}}  {first}".rstrip()
        yield from (f"{'':{left + 4}}{line}" for line in more)


topics = partial(tables_beside, __file__, "topics.toml")  #: Topic → its summary and its text.


#: List → its content.
LISTS = {
    "robots": "the built-in arms; robots NAME or FILE: one arm in full",
    "observers": "the observers, their equations and parameters",
    "formats": "the log formats; formats NAME: how to record one",
    "settings": "every setting of --set NAME=VALUE and vftcli.toml",
}


#: Below the list of robots.
ROBOTS = """
effort: what its logs hold: motor current, drive torque, torque behind the gear.
vftcli help robots NAME: one arm in full. Another arm: --robot FILE"""


@opt.command()
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
    topic, lists = topic or "", {"": contents, "observers": observers, "settings": settings}
    if topic in lists:
        echo("\n".join(lists[topic]()))
    elif topic == "robots":
        echo(robots(name, tip))
    elif topic == "formats":
        echo("\n".join(formats(name)))
    elif topic in topics():
        echo(topics()[topic]["text"].rstrip())
    elif topic in COMMANDS:
        asked = root.command.commands[topic]
        echo(asked.get_help(asked.make_context(topic, [], parent=root, resilient_parsing=True)))
    else:
        there = [*topics(), *LISTS]
        near = did_you_mean(topic, [*there, *COMMANDS])
        raise ParameterError(f"no topic {topic!r}; there is {', '.join(there)}.{near}")


def contents() -> Iterator[str]:
    """Topics, lists and commands of help."""
    explained = {name: entry["summary"] for name, entry in topics().items()}
    yield "vftcli help TOPIC explains one of these:"
    yield from two_columns([*explained.items(), *LISTS.items()])
    yield "vftcli help COMMAND shows the options of one of these:"
    yield from two_columns([(name, each.summary) for name, each in COMMANDS.items()])


def robots(name: str | None, tip: str | None) -> str:
    """The robot profiles, or one robot and its sources."""
    from vftcli.outputs.grid import terminal
    from vftcli.outputs.grids import robot_text, robots_grid
    from vftcli.robots import PROFILES, load_robot

    if name is not None:
        return robot_text(load_robot(name, tip=tip or ""))
    return terminal(robots_grid(map(load_robot, PROFILES))) + ROBOTS


def observers() -> Iterator[str]:
    """The observers, their equations and their parameters."""
    from vftcli.observers.table import OBSERVERS, PARAMETERS

    rows = []
    for name, entry in OBSERVERS.items():
        numbers = ", ".join(f"{entry.section}.{each}" for each in PARAMETERS[entry.section])
        rows += [(name, f"{entry.title}, {entry.equations}"), ("", entry.summary)]
        rows.append(("", f"--set {numbers}"))
    yield from two_columns(rows)


def formats(name: str | None) -> Iterator[str]:
    """The log formats, or how to record one."""
    from vftcli.readers.reading import FORMATS

    if name is None:
        yield from two_columns([(form.name, form.title) for form in FORMATS.values()])
        yield "\nvftcli help formats NAME: how to record one. Any may be packed as .gz or .zst."
    elif name in FORMATS:
        form = FORMATS[name]
        yield f"{form.name}: {form.title}"
        rows = {"record:": form.recording, "read:": form.takes, "pitfalls:": form.pitfalls}
        yield from two_columns([*rows.items()])
    else:
        near = did_you_mean(name, FORMATS)
        raise UnknownFormatError(f"no format {name!r}; there is {', '.join(FORMATS)}.{near}")


def settings() -> Iterator[str]:
    """Every setting: name, unit, meaning and default."""
    choices = choices_of(*every_command().values())
    rows, each = [], (settings_by_name([kind]).items() for kind in choices)
    for name, (option, default) in chain(*each):
        shown = {True: "yes", False: "no"}[default] if isinstance(default, bool) else default
        kept = f"; default {shown}" if isinstance(shown, str | int | float) else ""
        meaning = name, f"{option.help} ({option.metavar}{kept})"
        rows.append((option.metavar, option.help) if name == NUMBERS else meaning)
    yield "SETTINGS: --set GROUP.NAME=VALUE; in vftcli.toml [GROUP] with NAME = VALUE"
    yield from two_columns(sorted(rows))
    yield "simulate also takes its scenario's keys: --set servo.stiffness=soft"
