"""`vftcli contacts`: what touched the arm, when, how hard, where."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.analysis import LogOptions
from vftcli.cli.console import (
    LeftOut,
    canvas,
    command_line,
    echo,
    echo_data,
    say_analysis,
    say_json,
    stages,
)
from vftcli.free_motion.choice import FreeChoice
from vftcli.signals.option import OUTPUT, Option

if TYPE_CHECKING:
    from collections.abc import Mapping

    from vftcli.analysis import Analysis


class ListOptions(opt.Bundle):
    """The form of the list."""

    GROUP = OUTPUT

    json: opt.Json
    csv: Annotated[bool, Option("--csv", "", "Print one row per contact.")]
    all: Annotated[bool, Option("--all", "", "Every row, not only the 20 hardest.")]


@opt.command
def list_contacts(
    logs: opt.Logs,
    logged: LogOptions,
    free: opt.Typed[FreeChoice],
    form: ListOptions,
    anyway: opt.Anyway,
    talk: opt.TalkOptions,
) -> None:
    """List what touched the arm. The default command.

    Needs no output folder and no reference; with --free LOG or --free A:B it tells more.

    Example: vftcli contacts fixtures/ur5_circle.csv --robot ur5 --free 0.3:4
    """
    if form.json and form.csv:
        raise typer.BadParameter("choose one of --json, --csv")

    from vftcli.pipeline import analyse_logs, list_touches
    from vftcli.readers.library import Library
    from vftcli.readers.references import stored_observers

    if len(logs) == 1 and logged.reading.words["columns"] is None and stored_observers(logs[0]):
        print_stored(logs[0], form)
        return
    library = Library(logs)
    choice = logged.asked(
        library,
        anyway=anyway,
        on_screen=not (form.json or form.csv),
        free=free.choice(),
        progress=stages(),
    )
    left_out = LeftOut(library, logs)
    found = []
    for made in analyse_logs(logs, choice, left_out.add, list_touches):
        say_analysis(made)
        found.append(made)
    if found:
        print_lists(found, form, left_out.reasons, every=form.all or talk.details)
    left_out.end(len(found))


def print_stored(estimates: Path, form: ListOptions) -> None:
    """Print the list that the folder of an ``estimates.parquet`` holds."""
    from vftcli.outputs.contacts import contacts_csv, stored_list, stored_record
    from vftcli.outputs.screen import list_screen

    record = stored_record(estimates)
    if form.json:
        say_json([record])
    elif form.csv:
        echo_data(contacts_csv([stored_list(record)]))
    else:
        echo(list_screen(stored_list(record), canvas(), every=form.all), nl=False)


def print_lists(
    found: "list[Analysis]", form: ListOptions, failed: "Mapping[str, str]", *, every: bool
) -> None:
    """Print the lists in the form that is asked for."""
    from vftcli.outputs.contacts import contacts_csv
    from vftcli.outputs.report import contacts_envelope
    from vftcli.outputs.run_record import to_json
    from vftcli.outputs.screen import log_screen, logs_screen

    lists = [made.contacts for made in found if made.contacts is not None]
    if form.json:
        echo_data(to_json(contacts_envelope(found, command_line(), failed)))
    elif form.csv:
        echo_data(contacts_csv(lists))
    else:
        screen = canvas()
        texts = (
            []
            if len(found) + len(failed) == 1
            else [logs_screen(found, screen, failed, every=every)]
        )
        if not texts or form.all:
            texts += [log_screen(made, screen, every=every) for made in found]
        echo("\n".join(texts), nl=False, colour=screen.colour)
