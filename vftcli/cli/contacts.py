"""`vftcli contacts`: what touched the arm, when, how hard, where."""

from typing import TYPE_CHECKING

import typer

from vftcli.cli import options as opt
from vftcli.cli.bundles import Bundle, flag, taken_apart

if TYPE_CHECKING:
    from vftcli.contacts.contact_list import ContactList


class ListOptions(Bundle):
    """The form of the list."""

    json: opt.Json = False
    csv: bool = flag("--csv", "Print one row per contact.")
    all: bool = flag("--all", "Every row, not only the 20 hardest.")


@taken_apart
def list_contacts(
    logs: opt.Logs,
    reading: opt.ReadOptions,
    robot: opt.RobotOptions,
    free: opt.FreeOptions,
    form: ListOptions,
    anyway: opt.Anyway = False,
) -> None:
    """List what touched the arm: when, how hard, in which direction, where, how sure.

    Needs no output folder and no reference; with --free LOG or --free A:B it tells more.

    Example: vftcli contacts fixtures/ur5_circle.csv --robot ur5 --free 0.3:4
    """
    if form.json and form.csv:
        raise typer.BadParameter("choose one of --json, --csv")

    from vftcli.cli.console import health_of, say_robots
    from vftcli.contacts.asking import ContactChoice, contact_lists
    from vftcli.readers.library import Library

    library = Library(logs)
    choice = ContactChoice(
        read=reading.choice(),
        robot=robot.choice(),
        free=free.choice(),
        library=library,
        examiner=health_of(library, anyway=anyway),
    )
    found = list(contact_lists(logs, choice))
    say_robots(choice.examiner.robots)
    show(found, form)


def show(found: "list[ContactList]", form: ListOptions) -> None:
    """Print the lists in the form that is asked for."""
    from vftcli.cli.console import say_json
    from vftcli.outputs import contacts as output

    if form.json:
        records = [output.contacts_record(each) for each in found]
        say_json(records[0] if len(records) == 1 else records)
    elif form.csv:
        typer.echo(output.contacts_csv(found), nl=False)
    elif len(found) == 1 or form.all:
        typer.echo(
            "\n".join(output.contacts_text(each, every=form.all) for each in found), nl=False
        )
    else:
        typer.echo(output.overview(found), nl=False)
