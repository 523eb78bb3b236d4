"""`vftcli contacts`: what touched the arm, when, how hard, where."""

from typing import TYPE_CHECKING, Annotated

from vftcli.cli import options as opt
from vftcli.cli.console import LeftOut, canvas, echo, echo_data, say_analysis
from vftcli.evaluation import ReferenceChoice
from vftcli.free_motion import FreeChoice
from vftcli.signals.option import OUTPUT, Anyway, Asked, Choice, Option

if TYPE_CHECKING:
    from collections.abc import Mapping

    from vftcli.analysis import Analysis


class ListForm(Choice):
    """The form of the list."""

    GROUP = OUTPUT

    json: opt.Json
    csv: Annotated[bool, Option("--csv", "", "Print one row per contact.")]
    all: Annotated[bool, Option("--all", "", "Every row, not only the 20 hardest.")]


@opt.command(ReferenceChoice, *opt.OF_LOG, FreeChoice, ListForm, Anyway, opt.Talk)
def list_contacts(logs: opt.Logs, asked: Asked) -> None:
    """List what touched the arm. The default command.

    Name contact-free motion (--free LOG or A:B) to find weaker contacts.

    Example: vftcli contacts fixtures/ur5_circle.csv --robot ur5 --free 0.3:4
    """
    from vftcli.pipeline import analyse, analyse_logs, list_touches
    from vftcli.readers.reading import Library

    library = Library(logs)
    choice = opt.choice_for(asked, library, on_screen=opt.form_of(asked) == "terminal")
    left_out, found = LeftOut(library, logs), []
    work = analyse if choice.reference else list_touches
    for made in analyse_logs(logs, choice, left_out.add, work):
        say_analysis(made)
        found.append(made)
    if found:
        print_lists(found, asked, left_out.reasons)
    left_out.end(len(found))


def print_lists(found: "list[Analysis]", asked: Asked, failed: "Mapping[str, str]") -> None:
    """Print the lists in the form asked for."""
    from vftcli.outputs.contacts import contacts_csv
    from vftcli.outputs.screen import log_screen, logs_screen

    if asked.words["json"]:
        from vftcli.outputs.report import contacts_envelope
        from vftcli.outputs.run_record import to_json

        echo_data(to_json(contacts_envelope(found, asked.line, failed)))
    elif asked.words["csv"]:
        echo_data(contacts_csv([made.contacts for made in found if made.contacts is not None]))
    else:
        screen, every = canvas(), asked.words["all"] or asked.words["details"]
        several, texts = len(found) + len(failed) > 1, list[str]()
        if several:
            texts.append(logs_screen(found, screen, failed, every=every))
        if not several or asked.words["all"]:
            texts += [log_screen(made, screen, every=every) for made in found]
        echo("\n".join(texts), nl=False, colour=screen.colour)
